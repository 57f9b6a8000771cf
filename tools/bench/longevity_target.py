"""The longevity bench on a board: the same signals in counts, played by the replay image, hash for hash with the host.

The counts stand in the image (4 bytes a tick: a million ticks need a board of 4 MB); both forms take an encoder, of 14
bits in the weak form and of 19 in the strong one, so that they fit 16 bits.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bench.longevity import OURS, STRIDE, build_library
from bench.longevity_signals import CHUNK, RATE_HZ, SCENARIOS, Sensing, Signals
from bench.longevity_tables import keep, load, measured_with
from pvid.base.errors import PvidError
from pvid.board.boards import Board
from pvid.board.replay_image import MISSING, REPORT_EVERY, ReplayRun, build_image, play
from pvid.cases import CASES
from pvid.core.native import Native
from pvid.rig.file import RigFile

BITS = {"weak": 14, "strong": 19}
PAIRS = [(form, core) for form in ("weak", "strong") for core in ("f32", "q31")]
WRAPS = "sensor wrap"  # a turn of 19 bits does not fit 16: the weak form's does
PATIENCE_S = 3600.0
SLOW = 10  # the strong form in fixed point, of 30 000 instructions a tick, plays the tenth part of the ticks
SETTLED = 10_000  # ticks from which on a tick's cost is taken


def combinations(scenarios: Sequence[str], columns: Sequence[str] = OURS) -> list[tuple[str, str, str]]:
    """Scenario, form and core of every run that can be played, of these columns."""
    pairs = [(form, core) for form, core in PAIRS if f"{form}{'-q31' * (core == 'q31')}" in columns]
    return [(name, *pair) for name in scenarios for pair in pairs if (name, pair[0]) != (WRAPS, "strong")]


def run_of(library: ctypes.CDLL, scenario: str, form: str, core: str, ticks: int) -> ReplayRun:
    """The scenario's samples in counts, and the settings that a rig file gives the form; no forgetting. To the
    fixed-point core a sample that is missing is one beyond full scale.

    Raises
    ------
    PvidError
        When a count does not fit 16 bits.
    """
    lsb = 2 * np.pi / 2 ** BITS[form]
    sensing = replace(Sensing(), phi_lsb=lsb)
    counts = np.empty((ticks, 2), np.int16)
    at = 0
    for phi, y in Signals(library, SCENARIOS[scenario], ticks, sensing).chunks():
        whole = np.rint(np.stack([phi / sensing.phi_lsb, y / sensing.y_lsb], axis=1))
        if np.nanmax(np.abs(whole)) > np.iinfo(np.int16).max:
            raise PvidError(f'"{scenario}" does not fit 16-bit counts')
        counts[at : at + len(whole)] = np.where(np.isnan(whole), MISSING, whole).astype(np.int16)
        at += len(whole)
    rig = RigFile.standard()
    settings = replace(rig.identifier, full_angle=False)  # the signals' equations are linear
    if form == "strong":
        settings = replace(settings, form="strong", stride=STRIDE)
    rig = replace(rig, identifier=settings, sensor=replace(rig.sensor, phi_lsb=lsb))
    return ReplayRun(
        config=CASES[form, core].settings(rig, RATE_HZ),
        counts=counts,
        phi_lsb=np.float32(lsb),
        y_lsb=np.float32(sensing.y_lsb),
        measure_from=min(SETTLED, ticks // 2),
    )


def host_hashes(run: ReplayRun, native: Native) -> npt.NDArray[np.uint32]:
    """Running hash on this machine after every REPORT_EVERY ticks; memory does not grow with the run."""
    identifier, samples = native.identifier(run.config), run.samples
    parts = []
    for at in range(0, run.ticks, CHUNK):
        phi, y = (x[at : at + CHUNK] for x in samples)
        parts.append(identifier.run(phi, y, sums=False).hash[REPORT_EVERY - 1 :: REPORT_EVERY])
    return np.concatenate(parts)


@dataclass(frozen=True)
class OnBoard:
    """What became of a run on a board: the ticks done, the last hash, and up to where all are the host's."""

    board: str
    scenario: str
    form: str
    core: str
    ticks: int
    hash: int
    compared: int
    differs_at: int | None

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of the table."""
        verdict = (
            "equal" if self.differs_at is None else f"DIFFERENT within the {REPORT_EVERY} before {self.differs_at}"
        )
        return (
            self.board,
            SCENARIOS[self.scenario].title,
            f"{self.form}, {self.core}",
            str(self.ticks),
            str(self.compared),
            f"{self.hash:08x}",
            verdict,
        )


HEADER = ("board", "disturbance", "form", "ticks", "hashes compared", "the last", "with the host")


def measure_on(
    board: Board, library: ctypes.CDLL, native: Native, scenario: str, form: str, core: str, ticks: int
) -> OnBoard:
    """Plays a scenario on a board and compares all running hashes.

    Raises
    ------
    PvidError
        When the image cannot be built or does not come to its end.
    """
    if ticks % CHUNK != 0:
        raise PvidError(f"a run on a board has a multiple of {CHUNK} ticks")
    run = run_of(library, scenario, form, core, ticks)
    image, _ = build_image(board, run)
    report = play(board, image, PATIENCE_S)
    here = host_hashes(run, native)
    at = REPORT_EVERY * (np.arange(len(here)) + 1)
    wrong = [int(tick) for tick, hashed in zip(at, here, strict=True) if report.hashes.get(int(tick)) != hashed]
    differs = wrong[0] if wrong else None
    return OnBoard(board.name, scenario, form, core, report.ticks, report.hash, len(at), differs)


def run_missing_on(
    board: Board,
    ticks: int,
    among: Sequence[tuple[str, str, str]],
    folder: Path,
    progress: Callable[[int], None],
) -> list[tuple[str, ...]]:
    """Plays those of `combinations` that are not there yet, keeps each as soon as it is done, and returns the table's
    rows.

    `progress` is told how many runs are there.
    """
    library, native = build_library(folder), Native()
    rows = []
    for number, (scenario, form, core) in enumerate(among, start=1):
        name, key = f"{form}, {core} on {board.name}", SCENARIOS[scenario].title
        made_with = measured_with(core, SCENARIOS[scenario])
        asked = ticks // SLOW if (form, core) == ("strong", "q31") else ticks
        stored = load(key, name, asked, made_with)
        if stored is None:
            cells = measure_on(board, library, native, scenario, form, core, asked).cells
            stored = keep(key, name, asked, made_with, {"cells": cells})
        rows.append(tuple(stored["cells"]))
        progress(number)
    return rows
