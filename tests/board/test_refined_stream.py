"""A board with the second stage behind the link: its bits, its log, and what shows which estimate is published."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from program import pvid

from pvid.base.errors import PvidError
from pvid.board.field import collect
from pvid.board.mechanism_board import MechanismBoard, board_of
from pvid.board.stream_image import settings_number
from pvid.board.target import HOST_TARGET, open_target
from pvid.link.frames import RefinedEstimate, Source
from pvid.log.reader import LogReader, Record
from pvid.log.recorder import EmulatorSource, Logger
from pvid.log.rig import engine_text_of_log
from pvid.log.verify import Stretch, Verdict, Verifier
from pvid.rig.file import RigFile
from pvid.settings.enums import Reason, Stage

TICKS = 7200  # of the pendulum's full equations: the first refined estimate is published at 6568
PUBLISHED = 6568


@pytest.fixture(scope="module")
def pendulum() -> MechanismBoard:
    board = MechanismBoard.of_shipped_rig("kapitza", refined=True)
    return replace(board, recording=board.recording[:TICKS])


@pytest.fixture(scope="module")
def log(pendulum: MechanismBoard, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a board on this machine."""
    out = tmp_path_factory.mktemp("refined") / "a.pvlog"
    settings = settings_number(pendulum)
    logger = Logger(
        source=EmulatorSource(HOST_TARGET, lambda: open_target(HOST_TARGET, pendulum)),
        out=out,
        rig=pendulum.text(),
        samples=TICKS,
        begin=lambda: pendulum.configure(settings, 100, 100, Source.SENSOR_PACED),
    )
    assert logger.run().samples == TICKS and logger.failures == []
    return out


def verified(log: Path, records: list[Record] | None = None) -> Stretch:
    """The only stretch of a log, or of what was made of it."""
    text = engine_text_of_log(log)
    assert text is not None
    (stretch,) = Verifier(board_of(text)).stretches(LogReader(log) if records is None else records)
    return stretch


def test_text_in_a_log_gives_the_same_board_back(pendulum: MechanismBoard) -> None:
    text = pendulum.text()
    again = board_of(text)
    assert isinstance(again, MechanismBoard) and again.refine is not None and again.text() == text
    assert settings_number(again) == settings_number(pendulum)
    without = board_of("\n".join(line for line in text.split("\n") if not line.startswith("refine_")))
    assert without is not None and settings_number(without) != settings_number(pendulum)
    for wrong, right in (("refine_ratio", "refine_ratios"), ("refine_block", "refine_black")):
        with pytest.raises(PvidError, match="damaged"):
            board_of(text.replace(f"{wrong} =", f"{right} ="))


@pytest.mark.parametrize("target", [HOST_TARGET, "mps2-an386"])
def test_a_board_computes_the_bits_of_this_machine(pendulum: MechanismBoard, target: str) -> None:
    with open_target(target, pendulum) as opened:
        record = collect(opened, TICKS, begin=pendulum, hash_every=600, estimate_every=600)
    own = pendulum.both_stages()
    stages = {}
    for tick in range(600, TICKS, 600):
        assert record.hashes[tick] == own.run_both(pendulum.recording[tick - 600 : tick]).hash[-1], tick
        found, (stage, best) = record.refined[tick], own.best
        assert found.stage == stage and found.reason == own.refinement.told
        assert np.array_equal(np.array(found.p[:4], np.float32), best["p"][:4])
        covariance = found.of_p[1][:4, :4]
        assert np.array_equal(np.array(covariance, np.float32), best["covariance"][:4, :4])
        refined = own.refined
        r, se = (np.zeros(7), np.zeros(7)) if refined is None else (refined["r"], refined["se"])
        assert np.array_equal(np.array(found.r[:7], np.float32), r) and np.array_equal(
            np.array(found.se[:7], np.float32), se
        )
        assert record.estimates[tick].p[:4] == tuple(own.estimate["p"][:4].tolist())
        stages[tick] = found.stage
    assert stages == {tick: Stage.REFINED if tick > PUBLISHED else Stage.WEAK for tick in stages}


def test_log_is_verified_in_both_stages(log: Path) -> None:
    verdict = Verdict()
    verdict.add(verified(log))
    assert verdict.different == 0 and verdict.verified == TICKS
    assert verdict.checked == 3 * TICKS // 100  # an estimate of each stage and a hash
    records = list(LogReader(log))
    refined = [one.item for one in records if isinstance(one.item, RefinedEstimate)]
    assert refined[-1].number == 1 and refined[-1].stage == Stage.REFINED and refined[-1].reason == Reason.UPDATED
    assert refined[0].reason == Reason.WARMING_UP and not any(refined[0].r)


@pytest.mark.parametrize(
    ("name", "variable"),
    [("p", "published w"), ("r", "refined r[0]"), ("se", "refined se[0]"), ("stage", "stage"), ("number", "number of")],
)
def test_a_changed_refined_estimate_is_found(log: Path, name: str, variable: str) -> None:
    records = list(LogReader(log))
    at = max(i for i, one in enumerate(records) if isinstance(one.item, RefinedEstimate))
    estimate = records[at].item
    value: Any = getattr(estimate, name)
    changed = value + 1 if isinstance(value, int) else (float(np.nextafter(np.float32(value[0]), 0)), *value[1:])
    records[at] = replace(records[at], item=replace(estimate, **{name: changed}))  # type: ignore[arg-type]
    stretch = verified(log, records)
    assert stretch.difference is not None and stretch.difference.variable.startswith(variable)


def test_what_has_no_second_stage_is_refused(tmp_path: Path) -> None:
    def refusal(*arguments: str) -> str:
        done = pvid(tmp_path, "log", HOST_TARGET, "a.pvlog", "--refine", *arguments)
        assert done.returncode == 2, done.stderr
        return done.stderr

    assert "float32 alone" in refusal("--model", "kapitza", "--core", "q31")
    assert "sgn" in refusal("--model", "dc_motor")
    rig = tmp_path / "rig.toml"
    for changes, why in (({"core": "q31"}, "float32 alone"), ({"form": "strong"}, "behind the weak form")):
        own = RigFile.standard()
        replace(own, identifier=replace(own.identifier, **changes)).write(rig)  # type: ignore[arg-type]
        assert why in refusal("--rig", str(rig))


def test_a_rig_file_gives_both_stages(tmp_path: Path) -> None:
    rig = RigFile.standard()
    board = MechanismBoard.of_rig_file(rig, refined=True)
    assert board.refine is not None and board.refine.signal[0].range > 3 * board.refine.signal[1].range
    again = board_of(board.text())
    assert isinstance(again, MechanismBoard) and settings_number(again) == settings_number(board)
