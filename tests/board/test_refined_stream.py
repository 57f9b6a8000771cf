"""A board with the second stage behind the link: its bits, its log, and what shows which estimate is published."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import field_board
import numpy as np
import pytest
from program import pvid
from rich.console import Console

from pvid.base.errors import PvidError
from pvid.board.field import collect
from pvid.board.mechanism_board import MechanismBoard, board_of
from pvid.board.stream_image import settings_number
from pvid.board.target import HOST_TARGET, open_target
from pvid.configuration.refine import full_motion_of
from pvid.link.frames import RefinedEstimate, Source
from pvid.log.export import export_log
from pvid.log.reader import LogReader, LogStream, Record
from pvid.log.recorder import EmulatorSource, Logger
from pvid.log.rig import mechanism_of_log, settings_text_of_log
from pvid.log.status import StatusLine
from pvid.log.verify import Stretch, Verdict, Verifier
from pvid.models.mechanisms import compiled_of
from pvid.settings.enums import Reason, Stage
from pvid.show.log_figure import write_log_figure
from pvid.show.page_state import LiveState
from pvid.show.view import LiveView

TICKS = 4400  # of the pendulum's full equations: refined estimates are published from about 3600 on
EVERY = 400  # ticks between estimates where all of them are compared


@pytest.fixture(scope="module")
def pendulum() -> MechanismBoard:
    """The board of a rig; its sensors read a simulation of the full equations."""
    board = MechanismBoard.of_guess(field_board.rig(), refined=True)
    found = full_motion_of(compiled_of("kapitza"), TICKS / 1000 + 1)
    return replace(board, recording=board.readings(found["y"], found["phi"])[:TICKS])


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


@pytest.fixture(scope="module")
def published(pendulum: MechanismBoard) -> int:
    """Ticks until the first refined estimate is published."""
    stands = pendulum.both_stages().run_both(pendulum.recording).r[:, 0] > 0
    found = int(np.argmax(stands)) + 1
    assert 3000 < found < 4000 and stands[found:].all()
    return found


def verified(log: Path, records: list[Record] | None = None) -> Stretch:
    """The only stretch of a log, or of what was made of it."""
    text = settings_text_of_log(log)
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
def test_a_board_computes_the_bits_of_this_machine(pendulum: MechanismBoard, published: int, target: str) -> None:
    with open_target(target, pendulum) as opened:
        record = collect(opened, TICKS, begin=pendulum, hash_every=EVERY, estimate_every=EVERY)
    own = pendulum.both_stages()
    stages = {}
    for tick in range(EVERY, TICKS, EVERY):  # those behind the last sample may be lost
        assert record.hashes[tick] == own.run_both(pendulum.recording[tick - EVERY : tick]).hash[-1], tick
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
    assert stages == {tick: Stage.REFINED if tick >= published else Stage.WEAK for tick in stages}
    assert set(stages.values()) == set(Stage)


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

    rig = tmp_path / "rig.toml"
    field_board.rig().write(rig)
    for given in (("--model", "kapitza"), ("--rig", str(rig))):
        assert "float32 alone" in refusal(*given, "--core", "q31")
    assert "without a second stage" in refusal("--model", "kapitza", "--form", "strong")


def test_a_shipped_rig_has_both_stages_of_its_full_equations() -> None:
    board = MechanismBoard.of_shipped_rig("kapitza", refined=True)
    again = board_of(board.text())
    assert isinstance(again, MechanismBoard) and again.text() == board.text()
    told = board.both_stages().run_both(board.recording[:12000]).told
    assert Reason.UPDATED in told and told[-1] == Reason.UPDATED


# ---- what shows both stages


def test_export_has_columns_of_both_stages(log: Path, published: int, tmp_path: Path) -> None:
    mechanism = mechanism_of_log(log)
    paths = export_log(log, "csv", tmp_path / "a", mechanism)
    assert [one.name for one in paths] == [
        *(f"a-{table}.csv" for table in ("samples", "estimates", "status", "events", "refined")),
        "a-metadata.json",
    ]
    weak, refined = (list(csv.DictReader((tmp_path / f"a-{table}.csv").open())) for table in ("estimates", "refined"))
    assert [row["tick"] for row in weak] == [row["tick"] for row in refined]
    for row in refined:
        stands = int(row["tick"]) >= published
        assert row["stage"] == ("refined" if stands else "weak") and int(row["number"]) == int(stands)
        for name in ("w", "g", "l2", "c", "k1", "tau", "w_se", "g_se", "k2_se", "level"):
            assert math.isfinite(float(row[name])) == stands, (row["tick"], name)
    last, truth = refined[-1], {"g": 9.5, "l2": 0.12, "rho2": 0.08, "k1": 0.0, "k2": 0.0, "tau": 0.0}
    for name, value in truth.items():
        assert abs(float(last[name]) - value) < 4 * float(last[f"{name}_se"]), name
    assert float(last["g_se"]) < 0.3 * float(weak[-1]["g_se"]) and last["reason"] == "updated"
    about = json.loads((tmp_path / "a-metadata.json").read_text())
    units = {one["name"]: one["unit"] for one in about["tables"][-1]["tableSchema"]["columns"]}
    assert (units["k1"], units["tau"], units["rho2_se"]) == ("1/s", "s", "m")
    for form in ("npz", "mcap", "parquet"):
        written = export_log(log, form, tmp_path / "b", mechanism)
        assert len(written) == (5 if form == "parquet" else 1)
    arrays = np.load(tmp_path / "b.npz")
    assert np.array_equal(arrays["refined.tick"], arrays["estimates.tick"])


def test_page_and_terminal_show_both_curves_and_which_is_published(log: Path, published: int) -> None:
    state, stream, data = LiveState(log, "both"), LogStream(), log.read_bytes()
    view = LiveView(Console(width=110, file=io.StringIO()), "both")
    half = len(data) // 2
    for first in (0, half):
        part = data[first:] if first else data[:half]
        state.take(part)
        for record in stream.feed(part):
            view.take(record, stream.account)
        shown = json.loads(state.as_json())
        console = Console(width=110, file=io.StringIO())
        console.print(view.panel(stream.account, 1.0))
        text = console.file.getvalue()  # type: ignore[attr-defined]
        curve = shown["estimates"]["curves"][0]
        assert len(curve["refinedValue"]) == len(curve["value"]) == len(shown["estimates"]["t"])
        names_shown = [row["name"] for row in shown["parameters"]]
        if first == 0:
            assert shown["stage"] == "the weak form's; the refinement: the first window of samples is not full yet"
            assert not any(x is not None for x in curve["refinedValue"]) and "k1" not in names_shown
    assert shown["stage"] == "the refined one" and re.search(r"published +the refined one", text)
    assert names_shown == ["g", "l2", "rho2", "w", "d1", "d2", "c", "k1", "k2", "tau"]
    refined = [x for x in curve["refinedValue"] if x is not None]
    assert len(refined) == (TICKS - published) // 100 + 1 and None not in curve["refinedValue"][-len(refined) :]
    assert curve["refinedLow"][-1] < refined[-1] < curve["refinedHigh"][-1]
    assert refined[-1] - curve["refinedLow"][-1] < 0.3 * (curve["value"][-1] - curve["low"][-1])
    assert curve["limits"][0] < curve["refinedLow"][-1] and curve["limits"][1] > curve["refinedHigh"][-1]
    assert float(shown["parameters"][0]["value"]) == pytest.approx(refined[-1], rel=1e-3)


def test_figure_shows_both_curves_and_which_is_published(log: Path, tmp_path: Path) -> None:
    assert write_log_figure(log, mechanism_of_log(log), tmp_path / "b.svg")
    drawn = (tmp_path / "b.svg").read_text()
    for words in ("weak form", "refined, published where drawn", "published: the refined one", "tau"):
        assert words in drawn, words


def test_status_line_has_the_published_estimate(log: Path) -> None:
    line, stream = StatusLine(io.StringIO()), LogStream()
    texts = []
    for record in stream.feed(log.read_bytes()):
        line.take(record, stream.account)
        if isinstance(record.item, RefinedEstimate):
            texts.append(line.line(stream.account, 1.0))
    assert texts[10].endswith("warming up") and texts[-1].endswith(", refined") and "tick 4400: w 31.6" in texts[-1]
