"""A board with the second stage behind the link: its bits, its log, and what shows which estimate is published."""

import csv
import io
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import field_board
import numpy as np
import pytest
from mechanisms import path_of
from own_mechanisms import OWN, own_recording
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
from pvid.models.simulated_rig import simulated_rig
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.enums import Reason, Stage
from pvid.show.log_figure import write_log_figure
from pvid.show.page_state import LiveState
from pvid.show.view import LiveView

EVERY = 400  # ticks between estimates where all of them are compared


@dataclass(frozen=True)
class Case:
    """A run of `ticks`: refined estimates are published from before `before` on. `truth` of the motion, and a value
    whose standard error is at most so many times that of the first stage: both contain what all windows share."""

    ticks: int
    before: int
    truth: Mapping[str, float]
    tighter: tuple[str, float]


PENDULUM = {"g": 9.5, "l2": 0.12, "rho2": 0.08, "k1": 0.0, "k2": 0.0, "tau": 0.0}
CASES = {
    "kapitza": Case(4800, 4000, PENDULUM, ("g", 0.98)),
    "dc_motor": Case(2600, 2400, simulated_rig("dc_motor").truth, ("L", 0.3)),
    "heated_plate": Case(2600, 2400, {"C": 100.0, "h": 0.5}, ("h", 0.96)),
}


@pytest.fixture(scope="module", params=CASES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def board(name: str) -> MechanismBoard:
    """The board of a rig; its sensors read a simulation of the full equations."""
    ticks = CASES[name].ticks
    if name in OWN:
        made = MechanismBoard.of_recording(
            MechanismRig(OWN[name].path, OWN[name].rate), own_recording(name), refined=True
        )
    elif name == "kapitza":
        made = MechanismBoard.of_guess(field_board.rig(), refined=True)
        found = full_motion_of(compiled_of(name), ticks / 1000 + 1)
        made = replace(made, recording=made.readings(found["y"], found["phi"]))
    else:
        made = MechanismBoard.of_shipped_rig(name, refined=True)
    return replace(made, recording=made.recording[:ticks])


@pytest.fixture(scope="module")
def log(board: MechanismBoard, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a board on this machine."""
    out = tmp_path_factory.mktemp("refined") / "a.pvlog"
    settings = settings_number(board)
    logger = Logger(
        source=EmulatorSource(HOST_TARGET, lambda: open_target(HOST_TARGET, board)),
        out=out,
        rig=board.text(),
        samples=len(board.recording),
        begin=lambda: board.configure(settings, 100, 100, Source.SENSOR_PACED),
    )
    assert logger.run().samples == len(board.recording) and logger.failures == []
    return out


@pytest.fixture(scope="module")
def published(name: str, board: MechanismBoard) -> int:
    """Ticks until the first refined estimate is published."""
    stands = board.both_stages().run_both(board.recording).r[:, 0] > 0
    found = int(np.argmax(stands)) + 1
    assert 1000 < found < CASES[name].before and stands[found:].all()
    return found


def verified(name: str, log: Path, records: list[Record] | None = None) -> Stretch:
    """The only stretch of a log, or of what was made of it."""
    text = settings_text_of_log(log)
    assert text is not None
    (stretch,) = Verifier(board_of(text, path_of(name))).stretches(LogReader(log) if records is None else records)
    return stretch


def test_text_in_a_log_gives_the_same_board_back(name: str, board: MechanismBoard) -> None:
    text = board.text()
    again = board_of(text, path_of(name))
    assert isinstance(again, MechanismBoard) and again.refine is not None and again.text() == text
    assert settings_number(again) == settings_number(board)
    without = board_of("\n".join(line for line in text.split("\n") if not line.startswith("refine_")), path_of(name))
    assert without is not None and settings_number(without) != settings_number(board)
    for wrong, right in (("refine_ratio", "refine_ratios"), ("refine_block", "refine_black")):
        with pytest.raises(PvidError, match="damaged"):
            board_of(text.replace(f"{wrong} =", f"{right} ="), path_of(name))


@pytest.mark.parametrize(
    ("name", "target"), [*((name, HOST_TARGET) for name in CASES), ("dc_motor", "mps2-an386")], indirect=["name"]
)
def test_a_board_computes_the_bits_of_this_machine(board: MechanismBoard, published: int, target: str) -> None:
    ticks, n, sent = len(board.recording), len(board.compiled.p_names), list(board.shown)
    with open_target(target, board) as opened:
        record = collect(opened, ticks, begin=board, hash_every=EVERY, estimate_every=EVERY)
    own = board.both_stages()
    stages = {}
    for tick in range(EVERY, ticks, EVERY):  # those behind the last sample may be lost
        assert record.hashes[tick] == own.run_both(board.recording[tick - EVERY : tick]).hash[-1], tick
        found, (stage, best) = record.refined[tick], own.best
        assert found.stage == stage and found.reason == own.refinement.told
        assert np.array_equal(np.array(found.p[:n], np.float32), best["p"][:n])
        assert np.array_equal(np.array(found.of_p[1][:n, :n], np.float32), best["covariance"][:n, :n])
        for given, key in ((found.r, "r"), (found.se, "se")):
            wanted = np.zeros(len(sent)) if own.refined is None else own.refined[key][sent]
            assert np.array_equal(np.array(given[: len(sent)], np.float32), wanted)
        assert record.estimates[tick].p[:n] == tuple(own.estimate["p"][:n].tolist())
        stages[tick] = found.stage
    assert stages == {tick: Stage.REFINED if tick >= published else Stage.WEAK for tick in stages}
    assert set(stages.values()) == set(Stage)


def test_log_is_verified_in_both_stages(name: str, log: Path) -> None:
    verdict = Verdict()
    verdict.add(verified(name, log))
    assert verdict.different == 0 and verdict.verified == CASES[name].ticks
    assert verdict.checked == 3 * CASES[name].ticks // 100  # an estimate of each stage and a hash
    records = list(LogReader(log))
    refined = [one.item for one in records if isinstance(one.item, RefinedEstimate)]
    assert refined[-1].number == 1 and refined[-1].stage == Stage.REFINED and refined[-1].reason == Reason.UPDATED
    assert refined[0].reason == Reason.WARMING_UP and not any(refined[0].r)


@pytest.mark.parametrize(
    ("name", "key", "variable"),
    [
        ("kapitza", "p", "published w"),
        ("dc_motor", "r", "refined r[0]"),
        ("heated_plate", "se", "refined se[0]"),
        ("dc_motor", "stage", "stage"),
        ("heated_plate", "number", "number of"),
    ],
    indirect=["name"],
)
def test_a_changed_refined_estimate_is_found(name: str, log: Path, key: str, variable: str) -> None:
    records = list(LogReader(log))
    at = max(i for i, one in enumerate(records) if isinstance(one.item, RefinedEstimate))
    estimate = records[at].item
    value: Any = getattr(estimate, key)
    changed = value + 1 if isinstance(value, int) else (float(np.nextafter(np.float32(value[0]), 0)), *value[1:])
    records[at] = replace(records[at], item=replace(estimate, **{key: changed}))  # type: ignore[arg-type]
    stretch = verified(name, log, records)
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


def test_export_has_columns_of_both_stages(
    name: str, board: MechanismBoard, log: Path, published: int, tmp_path: Path
) -> None:
    mechanism, case, refined_names = mechanism_of_log(log), CASES[name], board.names.refined
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
        for one in (*case.truth, *board.compiled.p_names, *(one.name for one in refined_names)):
            assert math.isfinite(float(row[one])) == math.isfinite(float(row[f"{one}_se"])) == stands, (
                row["tick"],
                one,
            )
        assert math.isfinite(float(row["level"])) == stands
    last, (sharp, share) = refined[-1], case.tighter
    for one, value in case.truth.items():
        assert abs(float(last[one]) - value) < 4 * float(last[f"{one}_se"]), one
    assert float(last[f"{sharp}_se"]) < share * float(weak[-1][f"{sharp}_se"]) and last["reason"] == "updated"
    about = json.loads((tmp_path / "a-metadata.json").read_text())
    units = {one["name"]: one["unit"] for one in about["tables"][-1]["tableSchema"]["columns"]}
    for quantity in refined_names:
        assert units[quantity.name] == units[f"{quantity.name}_se"] == (quantity.unit or "1"), quantity
    for form in ("npz", "mcap", "parquet"):
        written = export_log(log, form, tmp_path / "b", mechanism)
        assert len(written) == (5 if form == "parquet" else 1)
    arrays = np.load(tmp_path / "b.npz")
    assert np.array_equal(arrays["refined.tick"], arrays["estimates.tick"])


def test_page_and_terminal_show_both_curves_and_which_is_published(
    name: str, board: MechanismBoard, log: Path, published: int
) -> None:
    state, stream, data = LiveState(log, "both"), LogStream(), log.read_bytes()
    view = LiveView(Console(width=110, file=io.StringIO()), "both")
    half, (sharp, share) = len(data) // 2, CASES[name].tighter
    of_model = [*(one.name for one in board.compiled.outputs), *board.compiled.p_names]
    extra = [one.name for one in board.names.refined if one.name not in of_model]
    for first in (0, half):
        part = data[first:] if first else data[:half]
        state.take(part)
        for record in stream.feed(part):
            view.take(record, stream.account)
        shown = json.loads(state.as_json())
        console = Console(width=110, file=io.StringIO())
        console.print(view.panel(stream.account, 1.0))
        text = console.file.getvalue()  # type: ignore[attr-defined]
        curve = next(one for one in shown["estimates"]["curves"] if one["label"].split()[0] == sharp)
        assert len(curve["refinedValue"]) == len(curve["value"]) == len(shown["estimates"]["t"])
        names_shown = [row["name"] for row in shown["parameters"]]
        if first == 0:
            assert shown["stage"].startswith("the first stage's; the second: ")
            assert not any(x is not None for x in curve["refinedValue"]) and names_shown == of_model
    assert shown["stage"] == "the second stage's" and re.search(r"published +the second stage's", text)
    assert names_shown == [*of_model, *extra]
    refined = [x for x in curve["refinedValue"] if x is not None]
    assert (
        len(refined) == (CASES[name].ticks - published) // 100 + 1
        and None not in curve["refinedValue"][-len(refined) :]
    )
    assert curve["refinedLow"][-1] < refined[-1] < curve["refinedHigh"][-1]
    assert refined[-1] - curve["refinedLow"][-1] < share * (curve["value"][-1] - curve["low"][-1])
    assert curve["limits"][0] < curve["refinedLow"][-1] and curve["limits"][1] > curve["refinedHigh"][-1]
    of_sharp = shown["parameters"][names_shown.index(sharp)]
    assert float(of_sharp["value"]) == pytest.approx(refined[-1], rel=1e-3)  # in one unit


def test_figure_shows_both_curves_and_which_is_published(
    name: str, board: MechanismBoard, log: Path, tmp_path: Path
) -> None:
    assert write_log_figure(log, mechanism_of_log(log), tmp_path / "b.svg")
    drawn = (tmp_path / "b.svg").read_text()
    for words in ("first stage", "refined, published where drawn", "published:", board.names.refined[-1].name):
        assert words in drawn, words


def test_status_line_has_the_published_estimate(name: str, board: MechanismBoard, log: Path) -> None:
    line, stream = StatusLine(io.StringIO()), LogStream()
    texts = []
    for record in stream.feed(log.read_bytes()):
        line.take(record, stream.account)
        if isinstance(record.item, RefinedEstimate):
            texts.append(line.line(stream.account, 1.0))
    assert "refined" not in texts[10] and ", refined; first stage: " in texts[-1]
    assert f"tick {CASES[name].ticks}: {board.compiled.p_names[0]} " in texts[-1]
