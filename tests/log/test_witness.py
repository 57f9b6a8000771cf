"""Who verifies a log: the compiled core all of it, the twin samples of it and every difference; the twin alone else."""

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import field_board
import numpy as np
import pytest
from logs import log_of

from pvid.base.errors import PvidError
from pvid.board.mechanism_board import MechanismBoard, board_of
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.link import frames as link
from pvid.log.reader import LogReader
from pvid.log.verify import Stretch, Verdict, Verifier
from pvid.twin.printed import PrintedTwin

TICKS, PIECE, AGAIN = 9600, 400, 18
OWN = 14 * PIECE  # ticks that the twin computes from its own init on: of two windows
SAMPLED = OWN + PIECE  # and piece AGAIN
Sent = list[tuple[int, link.Message]]


@pytest.fixture(autouse=True)
def pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shorter ones than those of an hour's log."""
    for name, value in (("_PIECE", PIECE), ("_FIRST", 0), ("_EVERY", AGAIN)):
        monkeypatch.setattr(f"pvid.log.verify.{name}", value)


@pytest.fixture(scope="module")
def sent() -> Sent:
    """(tick, message) of a run of TICKS."""
    return list(field_board.messages(field_board.Field(TICKS)))


class Board:
    """The board of `sent`, with another twin or another core.

    faulty : tick from which the core's hash is wrong; None: never
    """

    def __init__(self, twin: Any = None, faulty: int | None = None) -> None:
        self._own, self._twin, self._faulty = field_board.board(), twin, faulty

    def __getattr__(self, name: str) -> Any:
        return getattr(self._own, name)

    def twin_of(self, frame: link.Configuration) -> PrintedTwin:
        return (self._twin or self._own).twin_of(frame)

    def core_of(self, frame: link.Configuration) -> Any:
        return _Core(self._own.core_of(frame), self._faulty)


class _Core:
    def __init__(self, own: Any, faulty: int | None) -> None:
        self._own, self._left = own, faulty

    def __getattr__(self, name: str) -> Any:
        return getattr(self._own, name)

    def run_samples(self, samples: Any, *, sums: bool) -> Any:
        record = self._own.run_samples(samples, sums=sums)
        if self._left is not None:
            self._left -= len(samples)
            self._own.running_hash ^= self._left <= 0
        return record


def verified(path: Path, sent: Sent, board: Any = None, **options: Any) -> Stretch:
    """The only stretch of the log."""
    log_of(path / "a.pvlog", b"".join(field_board.frames(sent)), rig=field_board.text())
    (stretch,) = Verifier(board or field_board.board(), **options).stretches(LogReader(path / "a.pvlog"))
    return stretch


def changed(
    sent: Sent, kind: type[link.Message], behind: int, change: Callable[[Any], link.Message]
) -> tuple[int, Sent]:
    """The first message of a kind behind a tick is another one; its tick."""
    place, (tick, message) = next(
        (i, one) for i, one in enumerate(sent) if isinstance(one[1], kind) and one[0] > behind
    )
    return tick, [*sent[:place], (tick, change(message)), *sent[place + 1 :]]


def test_the_core_computes_all_and_the_twin_a_sample_of_it(tmp_path: Path, sent: Sent) -> None:
    stretch = verified(tmp_path, sent)
    assert (stretch.verified, stretch.difference) == (TICKS, None)
    assert (stretch.by_core, stretch.by_twin, stretch.alone) == (TICKS, SAMPLED, None)
    verdict = Verdict()
    verdict.add(stretch)
    verdict.add(stretch)
    core, twin = f"{2 * TICKS} ticks by the core compiled here", f"{2 * SAMPLED} ticks by the printed twin"
    assert re.fullmatch(rf"computed again: {core} \(\S+ -O2\), {twin}", verdict.computed)


def _wrong_sample(message: link.Raw) -> link.Message:
    return replace(message, data=bytes([message.data[0] ^ 1]) + message.data[1:])


def _wrong_hash(message: link.Hash) -> link.Message:
    return replace(message, hash=message.hash ^ 0x100)


def _wrong_estimate(message: link.Estimate) -> link.Message:
    p = np.array(message.p, np.float32)
    p.view(np.uint32)[1] ^= 1
    return replace(message, p=tuple(map(float, p)))


@pytest.mark.parametrize(
    ("kind", "change", "variable"),
    [
        (link.Raw, _wrong_sample, "hash of the samples"),
        (link.Hash, _wrong_hash, "hash"),
        (link.Estimate, _wrong_estimate, "d1"),
    ],
)
@pytest.mark.parametrize("behind", [2500, 6000, 7300, 8800], ids=["begin", "no sample", "sample", "end"])
def test_one_wrong_bit_is_found_wherever_it_is(
    tmp_path: Path,
    sent: Sent,
    kind: type[link.Message],
    change: Callable[[Any], link.Message],
    variable: str,
    behind: int,
) -> None:
    """And by the twin as well."""
    tick, wrong = changed(sent, kind, behind, change)
    stretch = verified(tmp_path, wrong)
    found = stretch.difference
    assert found is not None and found.variable == variable and stretch.alone is None
    assert found.tick == (tick if kind is not link.Raw else tick // 160 * 160 + 160)
    assert found.core_word != found.twin_word
    first = (found.tick - 1) // PIECE * PIECE
    assert stretch.by_core == found.tick
    assert stretch.by_twin == min(first, OWN) + (PIECE if first > AGAIN * PIECE else 0) + found.tick - first


@pytest.mark.parametrize("core", ["none", "not asked"])
def test_the_twin_alone_verifies_and_finds_a_wrong_bit(
    tmp_path: Path, sent: Sent, core: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if core == "none":
        monkeypatch.setattr(shutil, "which", lambda *_: None)
    options = {"twin_alone": True} if core == "not asked" else {}
    part = [one for one in sent if one[0] <= 3200]
    stretch = verified(tmp_path, part, **options)
    assert stretch.verified == 3200 and (stretch.by_core, stretch.by_twin) == (0, 3200)
    assert (stretch.alone or "").endswith("and there is none" if core == "none" else "")
    tick, wrong = changed(part, link.Hash, 2500, _wrong_hash)
    (tmp_path / "a.pvlog").unlink()
    found = verified(tmp_path, wrong, **options).difference
    assert found is not None and (found.tick, found.variable) == (tick, "hash")


@pytest.mark.parametrize("faulty", [100, 6000, 7300])
def test_a_compiled_core_that_is_wrong_convicts_no_board(tmp_path: Path, sent: Sent, faulty: int) -> None:
    stretch = verified(tmp_path, sent, Board(faulty=faulty))
    assert (stretch.verified, stretch.difference, stretch.by_core, stretch.by_twin) == (TICKS, None, 0, TICKS)
    first = faulty // PIECE * PIECE
    assert stretch.alone == (
        f"the core compiled here computes other bits than it between ticks {first} and {first + PIECE}"
    )


def test_a_board_and_a_compiled_core_that_are_wrong_alike_are_found_by_the_twin(tmp_path: Path, sent: Sent) -> None:
    own = field_board.board()
    source = replace(own, config=replace(own.config, iterations=1))
    stretch = verified(tmp_path, sent, Board(twin=source))
    assert stretch.difference is not None and stretch.by_core == 0
    assert stretch.difference.tick == verified_first(own, source)


def verified_first(own: MechanismBoard, source: MechanismBoard) -> int:
    """The first check at which their hashes differ."""
    samples = own.readings(*(getattr(field_board.Field(TICKS).run, name)[:TICKS] for name in ("y", "phi")))
    one, other = (board.hashes(None, *samples.T) for board in (own, source))  # type: ignore[arg-type]
    every = field_board.Field.hash_every
    return next(tick for tick in range(every, TICKS + 1, every) if one[tick - 1] != other[tick - 1])


# ---- tables and numbers of a log from somebody else


def _without_last(board: MechanismBoard, name: str) -> MechanismBoard:
    design = board.config.design
    if name == "shared":
        n = len(board.compiled.unknowns)
        trust = replace(board.config.trust, shared=np.zeros(n * (n + 1) // 2 - 1, np.float32))
        return replace(board, config=replace(board.config, trust=trust))
    if hasattr(design, name):
        shorter: dict[str, Any] = {name: getattr(design, name)[:-1]}
        return replace(board, config=replace(board.config, design=replace(design, **shorter)))
    shorter = {name: np.full(design.model.samples - 1, 1e-3, np.float32)}
    return replace(board, config=replace(board.config, **shorter))


@pytest.mark.parametrize(
    "name", ["circle", "compensator", "error_order", "error_variance", "range", "drive_min", "shared"]
)
def test_a_table_that_is_too_short_never_reaches_the_compiled_core(
    tmp_path: Path, sent: Sent, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """C would read behind its end."""
    monkeypatch.setattr(MechanismBoard, "core_of", lambda *_: pytest.fail("the core was asked"))
    stretch = verified(tmp_path, sent[:200], _without_last(field_board.board(), name))
    assert stretch.why_not == "the settings of the identifier in the log are damaged: list index out of range"


@pytest.mark.parametrize("table", ["second", "signal"])
def test_a_table_of_the_second_stage_that_is_too_short_is_refused(table: str) -> None:
    board = MechanismBoard.of_guess(field_board.rig(), refined=True)
    assert board.refine is not None
    shorter: dict[str, Any] = {table: getattr(board.refine, table)[:-1]}
    with pytest.raises(IndexError):
        replace(board, refine=replace(board.refine, **shorter)).twin_of(board.configure(1, 100, 100))


@pytest.mark.parametrize("key", ["iterations", "estimator_gain", "trust_se_max", "design_sum_shift", "design_fine"])
def test_a_text_in_the_place_of_a_number_never_gets_into_c(key: str) -> None:
    lines = MechanismBoardQ31.of_guess(field_board.rig()).text().split("\n")
    (place,) = [i for i, line in enumerate(lines) if line.startswith(f"{key} =")]
    lines[place] = f'{key} = "1; int mark(void)"'
    with pytest.raises(
        PvidError, match=r"settings of the identifier in the log are damaged: '1; int mark.*' is no number"
    ):
        board_of("\n".join(lines))
