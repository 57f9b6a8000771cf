"""A described mechanism in fixed point on a board: streamed, verified by the twin, exported in SI."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from program import pvid

from pvid.base.errors import PvidError
from pvid.board.field import collect
from pvid.board.mechanism_board import board_of
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.stream_image import settings_number
from pvid.board.target import HOST_TARGET, open_target
from pvid.codegen.weak_library import weak_native_q31
from pvid.link.frames import Code, Core, EstimateQ31, Form, Source
from pvid.log.export import export_log
from pvid.log.reader import LogReader
from pvid.log.recorder import EmulatorSource, Logger
from pvid.log.rig import engine_text_of_log, mechanism_of_log
from pvid.log.verify import Verdict, Verifier

TICKS = 3600  # of the pendulum: two windows more than the first estimate takes


@pytest.fixture(scope="module")
def pendulum() -> MechanismBoardQ31:
    board = MechanismBoardQ31.of_shipped_rig("kapitza")
    return replace(board, recording=board.recording[:TICKS])


@pytest.mark.parametrize("name", ["dc_motor", "battery_2rc", "kapitza"])
def test_text_in_a_log_gives_the_same_board_back(name: str) -> None:
    board = MechanismBoardQ31.of_shipped_rig(name)
    text = board.text()
    again = board_of(text)
    assert isinstance(again, MechanismBoardQ31) and again.text() == text and len(text) < 64_000
    assert settings_number(again) == settings_number(board) and again.names == board.names
    assert again.names.parse(board.names.text.encode()) == board.names


def test_text_that_is_damaged_is_refused(pendulum: MechanismBoardQ31) -> None:
    text = pendulum.text()
    for wrong, right in (("estimator_gain", "estimator_gait"), ("design_hop", "design_hip"), ("jet_reach", "jet")):
        with pytest.raises(PvidError):
            board_of(text.replace(wrong, right))


@pytest.mark.parametrize("target", [HOST_TARGET, "mps2-an386"])
def test_a_board_computes_the_bits_of_this_machine(pendulum: MechanismBoardQ31, target: str) -> None:
    with open_target(target, pendulum) as opened:
        record = collect(opened, TICKS, begin=pendulum, hash_every=600, estimate_every=1200)
    engine = pendulum.engine
    own = weak_native_q31(engine.made, engine.parameters, engine.config).identifier().run_samples(pendulum.recording)
    assert record.hello is not None and (record.hello.form, record.hello.core) == (Form.WEAK, Core.Q31)
    assert record.status is not None and record.status.code == Code.RUNNING and record.gaps == []
    sent = np.concatenate([record.raw[first] for first in sorted(record.raw)])
    assert np.array_equal(sent[:TICKS], pendulum.recording)
    assert len(record.hashes) >= 5
    for tick, found in record.hashes.items():
        assert found == own.hash[tick - 1], tick
    estimate = record.estimates[2400]
    assert isinstance(estimate, EstimateQ31) and estimate.p[:4] == tuple(own.published[2399].tolist())


def test_log_is_verified_and_exported_in_the_units_of_the_model(pendulum: MechanismBoardQ31, tmp_path: Path) -> None:
    out = tmp_path / "a.pvlog"
    settings = settings_number(pendulum)
    logger = Logger(
        source=EmulatorSource(HOST_TARGET, lambda: open_target(HOST_TARGET, pendulum)),
        out=out,
        rig=pendulum.text(),
        samples=TICKS,
        begin=lambda: pendulum.configure(settings, 100, 100, Source.SENSOR_PACED),
    )
    assert logger.run().samples == TICKS and logger.failures == []
    text = engine_text_of_log(out)
    assert text is not None
    (stretch,) = Verifier(board_of(text)).stretches(LogReader(out))
    verdict = Verdict()
    verdict.add(stretch)
    assert stretch.difference is None and verdict.verified == TICKS and verdict.checked == 2 * TICKS // 100
    paths = export_log(out, "csv", tmp_path / "a", mechanism_of_log(out))
    samples = list(csv.DictReader(paths[0].open()))
    found = np.array([[float(row[name]) for name in pendulum.engine.sample_names] for row in samples])
    assert np.allclose(found, pendulum.recording * np.array(pendulum.engine.lsb), rtol=1e-6, atol=1e-9)
    last = list(csv.DictReader(paths[1].open()))[-1]
    truth = dict(zip(pendulum.p_names, pendulum.engine.values(pendulum.config.estimator.start), strict=True))
    assert set(truth) <= set(last) and float(last["w_se"]) > 0
    # The rig in the log is enough, though the pendulum has a rig file of its own too.
    for named in ((), ("--model", "kapitza")):
        done = pvid(tmp_path, "identify", "a.pvlog", "--json", *named)
        answer = json.loads(done.stdout)
        assert done.returncode == 0 and answer["samples"] == TICKS, done.stderr
        assert answer["parameters"]["w"]["value"] == pytest.approx(truth["w"], rel=0.01)
    assert pvid(tmp_path, "plot", "a.pvlog").stdout == "a.png\n"
