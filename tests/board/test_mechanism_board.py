"""A described mechanism on a board: recorded, verified by the twin, exported under its own names."""

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
from pvid.board.mechanism_board import MechanismBoard, board_of
from pvid.board.stream_image import settings_number
from pvid.board.target import HOST_TARGET, judge, open_target, verify
from pvid.codegen.weak_library import weak_native
from pvid.core.native import Native
from pvid.link.frames import Code, Estimate, Form, Raw, Source
from pvid.log.export import export_log
from pvid.log.reader import LogReader
from pvid.log.recorder import EmulatorSource, Logger
from pvid.log.rig import engine_text_of_log, mechanism_of_log, recording_of_log
from pvid.log.verify import Stretch, Verdict, Verifier
from pvid.models.mechanisms import names
from pvid.show.log_figure import write_log_figure
from pvid.show.page_state import LiveState

TICKS = 3000  # of the motor: some windows more than the first estimate takes


@pytest.fixture(scope="module")
def motor() -> MechanismBoard:
    board = MechanismBoard.of_shipped_rig("dc_motor")
    return replace(board, recording=board.recording[:TICKS])


@pytest.fixture(scope="module")
def log(motor: MechanismBoard, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a board on this machine."""
    out = tmp_path_factory.mktemp("motor") / "a.pvlog"
    settings = settings_number(motor)
    logger = Logger(
        source=EmulatorSource(HOST_TARGET, lambda: open_target(HOST_TARGET, motor)),
        out=out,
        rig=motor.text(),
        samples=TICKS,
        begin=lambda: motor.configure(settings, 100, 100, Source.SENSOR_PACED),
    )
    assert logger.run().samples == TICKS and logger.failures == []
    return out


def stretches_of(log: Path) -> list[Stretch]:
    text = engine_text_of_log(log)
    assert text is not None
    return list(Verifier(board_of(text)).stretches(LogReader(log)))


@pytest.mark.parametrize("name", names())
def test_text_in_a_log_gives_the_same_board_back(name: str) -> None:
    board = MechanismBoard.of_shipped_rig(name)
    text = board.text()
    again = board_of(text)
    assert again is not None and again.text() == text and len(text) < 64_000
    assert settings_number(again) == settings_number(board) and again.names == board.names
    assert again.names.parse(board.names.text.encode()) == board.names


def test_text_that_is_damaged_is_refused(motor: MechanismBoard) -> None:
    text = motor.text()
    assert board_of("l1 = 0.3\n") is None
    for wrong, right in (("estimator_law", "estimator_lore"), ("design_hop", "design_hip"), ("dc_motor", "nowhere")):
        with pytest.raises(PvidError):
            board_of(text.replace(wrong, right))


@pytest.mark.parametrize("target", [HOST_TARGET, "mps2-an386"])
def test_a_board_computes_the_bits_of_this_machine(motor: MechanismBoard, target: str) -> None:
    with open_target(target, motor) as opened:
        record = collect(opened, TICKS, begin=motor, hash_every=500, estimate_every=1000)
    identifier = weak_native(motor.compiled, motor.config.design).identifier_of(motor.config)
    own = identifier.run_samples(motor.recording)
    assert record.hello is not None and (record.hello.form, record.hello.samples) == (Form.WEAK, 3)
    assert record.status is not None and record.status.code == Code.RUNNING and record.gaps == []
    sent = np.concatenate([record.raw[first] for first in sorted(record.raw)])
    assert np.array_equal(sent[:TICKS], motor.recording)
    assert len(record.hashes) >= 5
    for tick, found in record.hashes.items():
        assert found == own.hash[tick - 1], tick
    estimate = record.estimates[2000]
    assert isinstance(estimate, Estimate) and estimate.p[:7] == tuple(own.published[1999].tolist())


def test_samples_that_the_pc_sends_have_the_bits_of_this_machine(motor: MechanismBoard, native: Native) -> None:
    board = motor.without_recording
    verdict = verify(HOST_TARGET, board, native, *motor.recording.T)
    assert verdict.text == "equal" and verdict.playback.done == TICKS and len(verdict.playback.hashes) == TICKS // 500
    other = motor.recording.copy()
    other[1200, 1] += np.float32(0.01)  # the block sums of a step round away a change of the last bit
    found = judge(verdict.playback, board.hashes(native, *other.T))
    assert found.first is not None and found.first[0] >= 1000 and "DIFFERENT" in found.text


def test_log_of_a_mechanism_is_verified(log: Path) -> None:
    (stretch,) = stretches_of(log)
    verdict = Verdict()
    verdict.add(stretch)
    assert stretch.difference is None and verdict.verified == TICKS and verdict.checked == 2 * TICKS // 100
    assert "no check of them" not in stretch.text


def test_a_changed_sample_and_a_changed_estimate_are_found(log: Path, tmp_path: Path) -> None:
    text = engine_text_of_log(log)
    assert text is not None
    board = board_of(text)
    records = list(LogReader(log))
    at = next(i for i, one in enumerate(records) if isinstance(one.item, Raw) and one.tick > 1000)
    raw = records[at].item
    assert isinstance(raw, Raw)
    changed = bytes([raw.data[0] ^ 1]) + raw.data[1:]
    wrong = [*records[:at], replace(records[at], item=replace(raw, data=changed)), *records[at + 1 :]]
    (stretch,) = Verifier(board).stretches(wrong)
    assert stretch.difference is not None and stretch.difference.variable == "hash of the samples"
    at = next(i for i, one in enumerate(records) if isinstance(one.item, Estimate) and one.tick == 2000)
    estimate = records[at].item
    assert isinstance(estimate, Estimate)
    p = (*estimate.p[:2], float(np.nextafter(np.float32(estimate.p[2]), np.float32(1))), *estimate.p[3:])
    wrong = [*records[:at], replace(records[at], item=replace(estimate, p=p)), *records[at + 1 :]]
    (stretch,) = Verifier(board).stretches(wrong)
    assert stretch.difference is not None and stretch.difference.variable == "k"


def test_samples_of_another_number_a_tick_are_not_verified(log: Path) -> None:
    text = engine_text_of_log(log)
    assert text is not None
    records = [
        replace(one, item=Raw(one.item.data[: 8 * one.item.count], session=one.item.session))
        if isinstance(one.item, Raw)
        else one
        for one in LogReader(log)
    ]
    verdict = Verdict()
    for stretch in Verifier(board_of(text)).stretches(records):
        verdict.add(stretch)
        assert stretch.why_not is not None and "2 a tick, and the identifier takes 3" in stretch.why_not
    assert verdict.verified == 0 and verdict.samples == TICKS


def test_log_of_a_mechanism_is_exported_under_its_names(log: Path, motor: MechanismBoard, tmp_path: Path) -> None:
    mechanism = mechanism_of_log(log)
    assert mechanism.model.p_names == motor.p_names
    paths = export_log(log, "csv", tmp_path / "a", mechanism)
    samples = list(csv.DictReader(paths[0].open()))
    assert len(samples) == TICKS
    found = np.array([[row[name] for name in ("V", "i", "phi")] for row in samples], np.float32)
    assert np.array_equal(found, motor.recording)
    last = list(csv.DictReader(paths[1].open()))[-1]
    truth = dict(zip(motor.p_names, motor.compiled.p_names, strict=True))
    assert set(truth) <= set(last) and float(last["R"]) == pytest.approx(1.2, rel=0.01) and float(last["R_se"]) > 0
    recording = recording_of_log(log, ["phi", "V"])
    assert np.array_equal(np.float32(recording.signals["V"]), motor.recording[:, 0])
    assert list(recording.signals) == ["phi", "V"] and recording.sample_rate == 1000.0
    with pytest.raises(PvidError, match="a log of dc_motor: it has V, i and phi, and not x"):
        recording_of_log(log, ["x"])


def test_page_shows_the_names_and_units_of_the_mechanism(log: Path) -> None:
    state = LiveState(log, "the motor")
    data = log.read_bytes()
    for first in range(0, len(data), 5000):
        state.take(data[first : first + 5000])
    shown = json.loads(state.as_json())
    assert "weak form of dc_motor" in shown["board"] and shown["lost"] == ""
    assert [row["symbol"] for row in shown["parameters"]] == ["R", "L", "k", "J", "b", "Tc", "i0"]
    assert [row["unit"] for row in shown["parameters"]][:4] == ["ohm", "H", "N*m/A", "kg*m²"]
    assert [curve["label"] for curve in shown["motion"]] == ["V V [V]", "i i [A]", "phi phi [rad]"]
    assert [len(curve["x"]) > 100 for curve in shown["motion"]] == [True] * 3
    assert len(shown["estimates"]["curves"]) == 7 and "noise of the sensors" in shown["residual"]


def test_log_of_a_mechanism_is_plotted(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "motor.svg"
    write_log_figure(log, mechanism_of_log(log), out)
    drawn = out.read_text()
    for words in ("Tc [N*m]", "phi [rad]", "kappa of R", "weak form of dc_motor", f"{TICKS} samples"):
        assert f"<!-- {words}" in drawn or words in drawn, words


def test_options_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    for given, why in ((["--paced"], "an emulated board needs a mechanism"), (["--refine"], "needs a mechanism")):
        done = pvid(tmp_path, "log", HOST_TARGET, "a.pvlog", *given)
        assert done.returncode == 2 and why in done.stderr
    (tmp_path / "rig.toml").write_text('[model]\nname = "dc_motor"\n')
    done = pvid(tmp_path, "log", HOST_TARGET, "a.pvlog", "--rig", "rig.toml")
    assert done.returncode == 2 and "sample_rate is required" in done.stderr
    assert not (tmp_path / "a.pvlog").exists()
