"""A log computed again by the twin: equal where the board was right, and the first wrong bit named."""

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import field_board
import numpy as np
import pytest
from logs import log_of
from program import pvid

from pvid.base.errors import PvidError
from pvid.base.toml_text import toml_document
from pvid.board.mechanism_board import MechanismBoard, board_of, board_of_guess
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.stream_image import settings_number
from pvid.board.target import HOST_TARGET, open_target
from pvid.cli.verify import command as verify
from pvid.link import frames as link
from pvid.link.frames import Source
from pvid.log.export import export_log
from pvid.log.file import LogWriter
from pvid.log.reader import LogReader
from pvid.log.recorder import EmulatorSource, Logger
from pvid.log.rig import mechanism_in, settings_text_of_log
from pvid.log.values import Values
from pvid.log.verify import ReplayableBoard, Stretch, Verdict, Verifier
from pvid.settings.cores import CORES
from pvid.settings.enums import Core
from pvid.show.log_figure import write_log_figure
from pvid.show.page_state import LiveState

TICKS = 6400
LONG = pytest.mark.long
Sent = list[tuple[int, link.Message]]


@pytest.fixture(scope="module")
def sent() -> Sent:
    """(tick, message) of a run of TICKS."""
    return list(field_board.messages(field_board.Field(TICKS)))


def verified(path: Path, *segments: Sequence[bytes], board: ReplayableBoard | None = None) -> list[Stretch]:
    """The stretches of a log of these segments."""
    board = board or field_board.board()
    log_of(path, *(b"".join(frames) for frames in segments), rig=field_board.text())
    return list(Verifier(board).stretches(LogReader(path)))


def checks(sent: Sent) -> int:
    return sum(isinstance(message, link.Estimate | link.Hash) for _, message in sent)


def test_a_right_board_is_equal_in_every_bit(tmp_path: Path, sent: Sent) -> None:
    (stretch,) = verified(tmp_path / "a.pvlog", list(field_board.frames(sent)))
    assert (stretch.first, stretch.ticks, stretch.checked) == (0, TICKS, checks(sent))
    assert stretch.verified == TICKS and stretch.difference is None
    assert stretch.checked > 40
    reasons = {message.reason for _, message in sent if isinstance(message, link.Estimate)}
    assert len(reasons) > 2  # warming up, held, updated: the test would see a verdict that is forgotten


def _flipped(value: float) -> float:
    return float((np.float32(value).view(np.uint32) ^ np.uint32(1)).view(np.float32))


def _wrong_in(name: str, place: int) -> Callable[[link.Estimate], link.Estimate]:
    def change(message: link.Estimate) -> link.Estimate:
        values = list(getattr(message, name))
        values[place] = _flipped(values[place])
        changed: dict[str, Any] = {name: tuple(values)}
        return replace(message, **changed)

    return change


@pytest.mark.parametrize(
    ("change", "variable"),
    [
        (_wrong_in("p", 1), "d1"),
        (_wrong_in("covariance", 1), "covariance of w and d1"),
        (_wrong_in("covariance", 16), "covariance of d2 and c"),
        (lambda message: replace(message, kappa=_flipped(message.kappa)), "kappa"),
        (lambda message: replace(message, residual_sd=_flipped(message.residual_sd)), "residual sd"),
        (lambda message: replace(message, weight=_flipped(message.weight)), "weight"),
        (lambda message: replace(message, updates=message.updates + 1), "updates"),
        (lambda message: replace(message, standing=message.standing ^ 1), "standing"),
        (lambda message: replace(message, reason=message.reason ^ 1), "status"),
    ],
)
def test_one_wrong_bit_is_named(
    tmp_path: Path, sent: Sent, change: Callable[[link.Estimate], link.Estimate], variable: str
) -> None:
    place, (tick, message) = next(
        (i, one) for i, one in enumerate(sent) if isinstance(one[1], link.Estimate) and one[0] > 3000
    )
    assert isinstance(message, link.Estimate)
    wrong = [*sent[:place], (tick, change(message)), *sent[place + 1 :]]
    (stretch,) = verified(tmp_path / "a.pvlog", list(field_board.frames(wrong)))
    found = stretch.difference
    assert found is not None
    assert (found.tick, found.variable) == (tick, variable)
    assert found.core_word != found.twin_word
    if variable not in ("updates", "status"):
        assert found.core_word ^ found.twin_word == 1
    assert f"DIFFERENT at tick {tick}, {variable}: log {found.core_word:08x}, twin" in stretch.text


def test_one_wrong_sample_is_found_by_the_hash(tmp_path: Path, sent: Sent) -> None:
    place, (tick, message) = next(
        (i, one) for i, one in enumerate(sent) if isinstance(one[1], link.Raw) and one[0] > 2000
    )
    assert isinstance(message, link.Raw)
    values = message.values.copy()
    values[3, 1] += np.float32(field_board.rig().sensor["phi"]["resolution"])  # one step of the encoder, once
    wrong = [*sent[:place], (tick, replace(message, data=values.tobytes())), *sent[place + 1 :]]
    (stretch,) = verified(tmp_path / "a.pvlog", list(field_board.frames(wrong)))
    found = stretch.difference
    assert found is not None and found.variable == "hash of the samples"
    assert tick < found.tick <= tick + field_board.Field.hash_every


def _summed(stretches: Sequence[Stretch]) -> Verdict:
    verdict = Verdict()
    for one in stretches:
        verdict.add(one)
    return verdict


def test_only_samples_before_an_equal_hash_are_verified(tmp_path: Path, sent: Sent) -> None:
    """A changed sample behind the last hash is not found, and is not among those that are verified."""
    every = field_board.Field.hash_every
    end = 3 * every + every // 2
    for kept, verified_ticks, is_open in ((end, 3 * every, True), (4 * every, 4 * every, False)):
        part = [one for one in sent if one[0] <= kept and not (isinstance(one[1], link.Raw) and one[0] >= kept)]
        place, (tick, message) = [(i, one) for i, one in enumerate(part) if isinstance(one[1], link.Raw)][-1]
        assert isinstance(message, link.Raw)
        data = bytes([message.data[0] ^ 1]) + message.data[1:]
        part[place] = tick, replace(message, data=data)
        (stretch,) = verified(tmp_path / str(kept), list(field_board.frames(part)))
        if is_open:
            assert (stretch.difference, stretch.verified, stretch.open) == (None, verified_ticks, True)
            assert stretch.text.endswith(
                f"; the last {end - 3 * every} samples are not verified, no check of them was due yet"
            )
            verdict = _summed([stretch])
            assert (verdict.verified, verdict.trailing, verdict.left) == (verified_ticks, end - 3 * every, 0)
            assert f"{3 * every} samples verified; {end - 3 * every} behind the last check" in verdict.text
        else:
            assert stretch.difference is not None and stretch.difference.variable == "hash of the samples"


def test_a_check_that_was_lost_leaves_samples_over(tmp_path: Path, sent: Sent) -> None:
    every = field_board.Field.hash_every
    end = 4 * every + 16
    part = [one for one in sent if one[0] < end or not isinstance(one[1], link.Raw) and one[0] <= end]
    frames = list(field_board.frames(part))
    lacking = [
        frame
        for frame, (tick, one) in zip(frames, part, strict=True)
        if not (tick == 4 * every and isinstance(one, link.Hash | link.Estimate))
    ]
    (whole,) = verified(tmp_path / "a", frames)
    (stretch,) = verified(tmp_path / "b", lacking)
    assert (whole.verified, whole.trailing, whole.open) == (4 * every, 16, True)
    assert (stretch.verified, stretch.trailing, stretch.open) == (3 * every, every + 16, False)
    assert stretch.text.endswith(f"the last {every + 16} samples are not verified, the check of them was lost")
    assert _summed([stretch]).left == every + 16


def test_samples_that_were_lost_at_the_very_end_are_not_taken_for_a_healthy_end(tmp_path: Path, sent: Sent) -> None:
    """The last frame of samples is damaged, and the hash behind it came: the samples before it cannot be checked."""
    every = field_board.Field.hash_every
    part = [one for one in sent if one[0] < 2 * every or not isinstance(one[1], link.Raw) and one[0] <= 2 * every]
    frames = list(field_board.frames(part))
    last = max(i for i, (_, one) in enumerate(part) if isinstance(one, link.Raw))
    (stretch,) = verified(tmp_path / "a", [*frames[:last], *frames[last + 1 :]])
    assert (stretch.verified, stretch.open) == (every, False)


def test_board_without_sample_hash_confirms_processed_samples(tmp_path: Path, sent: Sent) -> None:
    older = [(tick, replace(one, sample_hash=0) if isinstance(one, link.Hash) else one) for tick, one in sent]
    (stretch,) = verified(tmp_path / "a", list(field_board.frames(older)))
    assert stretch.difference is None and stretch.open and 1000 < stretch.trailing < 3000
    at = [i for i, (tick, one) in enumerate(older) if isinstance(one, link.Raw) and tick < stretch.verified][-1]
    tick, message = older[at]
    assert isinstance(message, link.Raw)
    values = message.values.copy()
    values[:, 1] += np.float32(0.01)
    wrong = [*older[:at], (tick, replace(message, data=values.tobytes())), *older[at + 1 :]]
    (changed,) = verified(tmp_path / "b", list(field_board.frames(wrong)))
    assert changed.difference is not None


@pytest.mark.parametrize("counted", [True, False], ids=["48 bits", "32 bits"])
def test_a_count_that_passes_2_to_the_32_is_no_restart(tmp_path: Path, counted: bool) -> None:
    """Also of a board that sends no more than the low 32 bits."""
    first = 7 * 2**32 + 2**32 - 1600 if counted else 2**32 - 1600
    run = list(field_board.messages(field_board.Field(3200, first_tick=first)))
    frames = list(field_board.frames(run))
    if not counted:
        frames = [
            link.encode(replace(one, tick_high=0), i, tick % 2**32) if hasattr(one, "tick_high") else frame  # type: ignore[call-arg]
            for i, (frame, (tick, one)) in enumerate(zip(frames, run, strict=True))
        ]
    (stretch,) = verified(tmp_path / "a.pvlog", frames)
    assert (stretch.first, stretch.ticks, stretch.verified) == (first, 3200, 3200), stretch.text
    reader = LogReader(tmp_path / "a.pvlog")
    ticks = [record.tick for record in reader if isinstance(record.item, link.Raw | link.Estimate)]
    assert ticks == sorted(ticks) and ticks[-1] == first + 3200
    assert (reader.account.restarts, reader.account.missing_samples) == (0, 0)


@pytest.mark.parametrize("core", CORES)
def test_the_firmware_and_all_that_reads_its_log_count_on_beyond_2_to_the_32(tmp_path: Path, core: Core) -> None:
    """Samples on both sides of a passage, of the first and of one 95 years later; exported and drawn."""
    board, log, every = board_of_guess(field_board.rig(), core), tmp_path / "a.pvlog", 100
    mechanism = mechanism_in(toml_document(board.text()))
    assert mechanism is not None
    passages = (1, 700)
    for number in passages:
        begin = partial(board.configure, settings_number(board), every, every, Source.SENSOR, number * 2**32 - 1250)
        source = EmulatorSource(HOST_TARGET, lambda: open_target(HOST_TARGET, board))
        Logger(source=source, out=log, rig=board.text(), append=True, samples=2500, begin=begin, restart=True).run()
    verdict, reader = Verdict(), LogReader(log)
    for stretch in Verifier(board).stretches(reader):
        verdict.add(stretch)
    assert not verdict.different and verdict.verified > 0.9 * 2500 * len(passages), verdict.text
    assert (reader.account.missing_samples, reader.account.restarts) == (0, 0)
    values, ticks = Values(mechanism), []
    for record in LogReader(log):
        assert getattr(record.item, "tick_high", record.tick // 2**32) == record.tick // 2**32
        for rows in values.rows(record):
            if rows.table == "samples":
                ticks.append(rows.columns["tick"])
                np.testing.assert_array_equal(rows.columns["t"], rows.columns["tick"] / 1000.0)
    expected = np.concatenate(ticks)
    assert {*passages} <= {*(expected // 2**32).tolist()} and (np.diff(expected) == 1).sum() == len(expected) - 2
    (exported,) = export_log(log, "npz", tmp_path / "a", mechanism)
    with np.load(exported) as arrays:
        np.testing.assert_array_equal(arrays["tick"], expected)
    state = LiveState(log, "a year")
    state.take(log.read_bytes())
    assert "cannot be shown" not in json.loads(state.as_json())["lost"]
    write_log_figure(log, mechanism, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 10_000


def test_restart_beyond_2_to_the_31_is_found_by_the_session(tmp_path: Path) -> None:
    """The ticks alone look like a counter that has wrapped and a gap of 2^30 samples."""
    first = 2**32 - 2**30
    before = list(field_board.messages(field_board.Field(800, first_tick=first)))
    after = list(field_board.messages(field_board.Field(800), session=8))
    joined = [*before, *after[4:]]  # without the words of the start, which were lost
    stretches = verified(tmp_path / "a.pvlog", list(field_board.frames([*before, *after])))
    assert [(one.first, one.ticks, one.verified) for one in stretches] == [(first, 800, 800), (0, 800, 800)]
    verified(tmp_path / "b.pvlog", list(field_board.frames(joined)))
    for name in ("a.pvlog", "b.pvlog"):
        reader = LogReader(tmp_path / name)
        list(reader)
        assert (reader.account.restarts, reader.account.missing_samples) == (1, 0)


def test_unconfigured_board_is_at_tick_0(tmp_path: Path) -> None:
    """Whatever was counted before it was switched off, and though the next session counts on from far beyond it."""
    first, second = 2**32 - 800, 2 * 2**32 - 800
    runs = [
        list(field_board.messages(field_board.Field(1600, first_tick=tick), session=session))
        for tick, session in ((first, 7), (second, 8))
    ]
    words = [(0, link.Status(0, link.Code.WAITING, *[0] * 9)), (0, link.Credit(0, 256, 1, 0))]
    stretches = verified(
        tmp_path / "a.pvlog", list(field_board.frames(runs[0])), list(field_board.frames([*words, *runs[1]]))
    )
    assert [(one.first, one.verified) for one in stretches] == [(first, 1600), (second, 1600)]
    reader, values = LogReader(tmp_path / "a.pvlog"), Values()
    times = {}
    for record in reader:
        if isinstance(record.item, link.Status) and record.item.session == 0:
            assert record.tick == 0
        for rows in values.rows(record):
            if rows.table == "samples":
                times[record.segment] = abs(int(rows.columns["log_time"][-1]) - record.unix_ns)
    assert times.keys() == {0, 1} and max(times.values()) < 10e9


def test_samples_after_a_loss_are_unverified_until_restart(tmp_path: Path, sent: Sent) -> None:
    frames = list(field_board.frames(sent))
    lost = next(i for i, (tick, message) in enumerate(sent) if isinstance(message, link.Raw) and tick > 2000)
    again = list(field_board.frames(sent[:300]))
    first, behind, anew = verified(tmp_path / "a.pvlog", [*frames[:lost], *frames[lost + 1 :], *again])
    n = field_board.SAMPLES_A_FRAME
    gap = sent[lost][0]
    last = gap // field_board.Field.hash_every * field_board.Field.hash_every
    assert (first.first, first.ticks, first.verified, first.open) == (0, gap, last, False)
    assert (behind.first, behind.ticks, behind.verified, behind.open) == (gap + n, TICKS - gap - n, 0, False)
    assert f"not verified, the samples of ticks {gap} to {gap + n - 1} were lost" in behind.text
    assert anew.first == 0 and anew.verified and anew.difference is None
    assert 0 < first.checked < checks(sent) and anew.checked > 0


def test_a_link_that_broke_without_costing_a_sample_breaks_nothing(tmp_path: Path, sent: Sent) -> None:
    frames = list(field_board.frames(sent))
    (stretch,) = verified(tmp_path / "a.pvlog", frames[:150], frames[150:])
    assert (stretch.ticks, stretch.checked, stretch.difference) == (TICKS, checks(sent), None)


def test_unverifiable_segment_has_its_reason(tmp_path: Path, sent: Sent) -> None:
    def reason(name: str, frames: list[tuple[int, link.Message]], board: ReplayableBoard | None = None) -> str | None:
        (stretch,) = verified(tmp_path / name, list(field_board.frames(frames)), board=board)
        assert not stretch.verified
        return stretch.why_not

    without = [one for one in sent if not isinstance(one[1], link.Configuration)]
    silent = [one for one in sent if not isinstance(one[1], link.Estimate | link.Hash)]
    assert reason("a", without) == "the board's configuration is missing"
    assert reason("b", silent) == "the log contains no estimate and no hash for them"
    assert reason("c", [one for one in sent if one[0] >= 160]) == (
        "its session began before this segment did, and the samples before tick 160 are not in it"
    )
    other = MechanismBoard.of_guess(field_board.rig(0.31))
    refused = "the board's image was made for other settings or another model than the log's, or by another version"
    assert reason("d", sent, other) == refused
    assert reason("e", sent, MechanismBoardQ31.of_guess(field_board.rig())) == (
        "the board's image contains another core than the log's settings"
    )
    (stretch,) = Verifier(None).stretches(LogReader(tmp_path / "d"))
    assert stretch.why_not == "the log holds no settings of an identifier: name its rig file with --rig"


def test_segment_of_an_old_session_is_never_verified(tmp_path: Path, sent: Sent) -> None:
    """As when a line is closed and opened while the board samples on, and it is pulled before the board starts over."""
    frames = list(field_board.frames(sent))
    late = [frame for frame, (tick, _) in zip(frames, sent, strict=True) if 1600 <= tick < 2400]
    stretches = verified(tmp_path / "a.pvlog", frames[:150], late, frames)
    assert [(one.segment, one.verified > 0) for one in stretches] == [(0, True), (1, False), (2, True)]
    assert stretches[1].text == (
        "segment 1, ticks 1600 to 2399: not verified, its session began before this segment did, and the samples "
        "before tick 1600 are not in it"
    )
    verdict = _summed(stretches)
    checked = stretches[0].checked + stretches[2].checked
    assert verdict.text == (
        f"in all: {checked} estimates and hashes equal in every bit, {stretches[0].verified + TICKS} samples verified; "
        f"{stretches[0].trailing} behind the last check; 800 samples not verified; nothing verified of segment 1"
    )


def test_losses_within_a_segment_are_named(tmp_path: Path, sent: Sent) -> None:
    frames = list(field_board.frames(sent))
    without = [frame for frame, (tick, _) in zip(frames, sent, strict=True) if not 1600 <= tick < 1632]
    begun, lost = verified(tmp_path / "a.pvlog", without)
    assert begun.verified and begun.ticks == 1600
    assert lost.text.endswith(
        "not verified, the samples of ticks 1600 to 1631 were lost, and every bit after them depends on them"
    )


def test_empty_log_is_reported(tmp_path: Path) -> None:
    writer = LogWriter(tmp_path / "a.pvlog")
    with pytest.raises(PvidError, match=r"a.pvlog is empty: the recording ended before the link was up"):
        list(LogReader(tmp_path / "a.pvlog"))
    writer.begin("a port", None)
    writer.close()
    nothing = pvid(tmp_path, "verify", "a.pvlog")
    assert nothing.returncode == 3 and nothing.stdout.startswith("nothing to verify: the log contains no samples\n")


# ---- the program


def altered(log: Path, out: Path, change: Callable[[link.Message], link.Message | None], behind: int) -> int:
    """Copies a log with the first message behind that tick changed for which `change` is not None; returns its tick.

    The frame is encoded again as a board would that had computed this: no checksum tells.
    """
    pieces = log.read_bytes().split(b"\0")
    for i, piece in enumerate(pieces):
        for item in link.Decoder().feed(piece + b"\0"):
            if isinstance(item, link.Frame) and item.tick > behind and (changed := change(item.message)) is not None:
                pieces[i] = link.encode(changed, item.sequence, item.tick)[:-1]
                out.write_bytes(b"\0".join(pieces))
                return item.tick
    raise AssertionError("there is no such message")


def _wrong_hash(message: link.Message) -> link.Message | None:
    return replace(message, hash=message.hash ^ 0x100) if isinstance(message, link.Hash) else None


def _wrong_second(message: link.Message) -> link.Message | None:
    if isinstance(message, link.Estimate):
        return _wrong_in("p", 1)(message)
    if isinstance(message, link.EstimateQ31):
        return replace(message, p=(message.p[0], message.p[1] ^ 1, *message.p[2:]))
    return None


def _wrong_sample(message: link.Message) -> link.Message | None:
    """The last bit of the first angle."""
    if not isinstance(message, link.Raw | link.RawCount):
        return None
    data = bytearray(message.data)
    data[0] ^= 1
    return replace(message, data=bytes(data))


@pytest.mark.parametrize(
    ("target", "identifier", "samples", "change"),
    [
        (HOST_TARGET, {"form": "weak", "core": "f32"}, 6000, _wrong_second),
        pytest.param(HOST_TARGET, {"form": "weak", "core": "f32", "forgetting_s": 10.0}, 3000, _wrong_hash, marks=LONG),
        (HOST_TARGET, {"form": "weak", "core": "q31"}, 3000, _wrong_sample),
        pytest.param(
            HOST_TARGET, {"form": "weak", "core": "q31", "forgetting_s": 10.0}, 6000, _wrong_second, marks=LONG
        ),
        (HOST_TARGET, {"form": "strong", "core": "f32"}, 1000, _wrong_second),
        pytest.param("mps2-an386", {"form": "weak", "core": "f32"}, 8000, _wrong_hash, marks=LONG),
        ("mps2-an386", {"form": "weak", "core": "q31"}, 4000, _wrong_hash),
    ],
    ids=lambda one: "-".join(map(str, one.values())) if isinstance(one, dict) else getattr(one, "__name__", None),
)
def test_a_field_log_of_the_firmware_verifies_and_an_altered_bit_is_named(
    tmp_path: Path,
    target: str,
    identifier: dict[str, Any],
    samples: int,
    change: Callable[[link.Message], link.Message | None],
) -> None:
    given = [] if target == HOST_TARGET else ["--paced"]
    following = {name: value for name, value in identifier.items() if name == "forgetting_s"}
    replace(field_board.rig(), identifier=following).write(tmp_path / "rig.toml")
    given += ["--core", identifier["core"], "--form", identifier["form"]]
    done = pvid(tmp_path, "log", target, "a.pvlog", "--rig", "rig.toml", "--samples", str(samples), *given)
    assert done.returncode == 0, done.stderr
    checked = pvid(tmp_path, "verify", "a.pvlog")
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert "estimates and hashes equal in every bit" in checked.stdout
    assert "lost 0 frames, 0 samples" in checked.stdout
    tick = altered(tmp_path / "a.pvlog", tmp_path / "b.pvlog", change, samples // 2)
    text = settings_text_of_log(tmp_path / "b.pvlog")
    assert text is not None
    board = board_of(text)
    (wrong,) = Verifier(board).stretches(LogReader(tmp_path / "b.pvlog"))
    found = wrong.difference
    assert found is not None and wrong.checked > 2, wrong.text
    if change is _wrong_sample:
        assert tick < found.tick <= tick + 100 and found.variable == "hash of the samples"
    else:
        assert (found.tick, found.variable) == (tick, "hash" if change is _wrong_hash else "d1")
        assert (found.core_word ^ found.twin_word) == (0x100 if change is _wrong_hash else 1)


@pytest.mark.parametrize("core", ["f32", pytest.param("q31", marks=LONG)])
def test_a_field_log_is_drawn_and_identified_with_its_own_settings(tmp_path: Path, core: str) -> None:
    """The settings that a log is drawn and identified with are those of the rig file in it."""
    replace(field_board.rig(), identifier={"forgetting_s": 20.0}).write(tmp_path / "rig.toml")
    given = ("--rig", "rig.toml", "--core", core, "--samples", "12000", "--paced")
    done = pvid(tmp_path, "log", HOST_TARGET, "a.pvlog", *given)
    assert done.returncode == 0, done.stderr
    drawn = pvid(tmp_path, "plot", "a.pvlog", "-o", "a.svg")
    assert drawn.returncode == 0, drawn.stderr
    assert ": kapitza, float32" in (tmp_path / "a.svg").read_text(encoding="utf-8")
    found = json.loads(pvid(tmp_path, "identify", "a.pvlog", "--json").stdout)
    stream = LogReader(tmp_path / "a.pvlog")
    ticks = sum(record.item.count for record in stream if isinstance(record.item, link.Raw | link.RawCount))
    assert found["samples"] == ticks
    assert found["parameters"]["w"]["value"] == pytest.approx(9.8 / 0.3, rel=0.01)
    assert found["parameters"]["d1"]["value"] == pytest.approx(5.0, rel=0.02)
    exported = pvid(tmp_path, "export", "a.pvlog", "--to", "csv", "--out", "a")
    assert exported.returncode == 0, exported.stderr
    samples = np.genfromtxt(tmp_path / "a-samples.csv", delimiter=",", names=True)
    assert np.abs(samples["phi"]).max() > 0.05 > 0.03 > np.abs(samples["y"]).max()


def test_verify_exit_codes(tmp_path: Path, sent: Sent, capfd: pytest.CaptureFixture[str]) -> None:
    def run(log: str, *options: str) -> tuple[int, str]:
        """In this process: the model is derived once."""
        code = verify.main([str(tmp_path / log), *options], standalone_mode=False)
        return code, capfd.readouterr().out

    frames = list(field_board.frames(sent[:200]))
    verified(tmp_path / "right.pvlog", frames)
    wrong = [
        (tick, replace(message, hash=message.hash ^ 1) if isinstance(message, link.Hash) else message)
        for tick, message in sent[:200]
    ]
    verified(tmp_path / "wrong.pvlog", list(field_board.frames(wrong)))
    verified(tmp_path / "none.pvlog", frames[30:])
    (tmp_path / "noise").write_bytes(b"noise")
    code, text = run("right.pvlog")
    assert code == 0 and re.search(
        r"computed again: \d+ ticks by the core compiled here \(.*\), \d+ ticks by the printed twin\n", text
    )
    code, text = run("right.pvlog", "--twin")
    assert code == 0 and re.search(r"computed again: \d+ ticks by the printed twin\n", text)
    verified(tmp_path / "part.pvlog", [*frames[:120], *frames[121:]])
    code, text = run("part.pvlog")
    assert code == 1 and "DIFFERENT" not in text and "samples not verified" in text
    assert run("part.pvlog", "--partial")[0] == 0
    code, text = run("wrong.pvlog")
    assert code == 1 and "DIFFERENT at tick 160, hash: log" in text
    assert "1 of 1 stretches DIFFERENT" in text
    assert run("none.pvlog")[0] == 3
    noise = pvid(tmp_path, "verify", "noise")
    assert (noise.returncode, noise.stderr) == (2, "pvid: noise is not a log of pvid: not one frame in 5 bytes\n")
