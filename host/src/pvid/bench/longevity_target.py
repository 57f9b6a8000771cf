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

from pvid.bench.longevity import STRIDE, Results, build_library, load, save
from pvid.bench.longevity_signals import CHUNK, RATE_HZ, SCENARIOS, Sensing, Signals
from pvid.boards import Board
from pvid.errors import PvidError
from pvid.native import Native, WeakConfig
from pvid.replay_image import MISSING, REPORT_EVERY, ReplayRun, build_image, play
from pvid.rigfile import RigFile
from pvid.setup import config_of

BITS = {"weak": 14, "strong": 19}
WRAPS = "sensor wrap"  # a turn of 19 bits does not fit 16: the weak form's does
PATIENCE_S = 3600.0
SETTLED = 10_000  # ticks from which on a tick's cost is taken


def combinations(scenarios: Sequence[str]) -> list[tuple[str, str]]:
    """Scenario and form of every run that can be played."""
    return [(name, form) for name in scenarios for form in BITS if (name, form) != (WRAPS, "strong")]


def run_of(library: ctypes.CDLL, scenario: str, form: str, ticks: int) -> ReplayRun:
    """The scenario's samples in counts, and the settings that a rig file gives the form; no forgetting.

    Raises
    ------
    PvidError
        When a count does not fit 16 bits.
    """
    lsb = 2 * np.pi / 2 ** BITS[form]
    sensing = replace(Sensing(), phi_lsb=lsb)
    counts = np.empty((ticks, 2), np.int16)
    at = 0
    for phi, y in Signals(library, scenario, ticks, sensing).chunks():
        whole = np.rint(np.stack([phi / sensing.phi_lsb, y / sensing.y_lsb], axis=1))
        if np.nanmax(np.abs(whole)) > np.iinfo(np.int16).max:
            raise PvidError(f'"{scenario}" does not fit 16-bit counts')
        counts[at : at + len(whole)] = np.where(np.isnan(whole), MISSING, whole).astype(np.int16)
        at += len(whole)
    rig = RigFile.standard()
    settings = rig.identifier if form == "weak" else replace(rig.identifier, form="strong", stride=STRIDE)
    rig = replace(rig, identifier=settings, sensor=replace(rig.sensor, phi_lsb=lsb))
    return ReplayRun(
        form=form,
        config=config_of(rig, RATE_HZ),
        counts=counts,
        phi_lsb=np.float32(lsb),
        y_lsb=np.float32(sensing.y_lsb),
        measure_from=min(SETTLED, ticks // 2),
    )


def host_hashes(run: ReplayRun, native: Native) -> npt.NDArray[np.uint32]:
    """Running hash on this machine after every REPORT_EVERY ticks; memory does not grow with the run."""
    identifier = native.weak(run.config) if isinstance(run.config, WeakConfig) else native.strong(run.config)
    phi, y = run.phi, run.y
    parts = [
        identifier.run(phi[at : at + CHUNK], y[at : at + CHUNK], sums=False).hash[REPORT_EVERY - 1 :: REPORT_EVERY]
        for at in range(0, run.ticks, CHUNK)
    ]
    return np.concatenate(parts)


@dataclass(frozen=True)
class OnBoard:
    """What became of a run on a board: the ticks done, the last hash, and up to where all are the host's."""

    board: str
    scenario: str
    form: str
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
            f"{self.scenario}: {SCENARIOS[self.scenario]}",
            self.form,
            str(self.ticks),
            str(self.compared),
            f"{self.hash:08x}",
            verdict,
        )


HEADER = ("board", "disturbance", "form", "ticks", "hashes compared", "the last", "with the host")


def measure_on(board: Board, library: ctypes.CDLL, native: Native, scenario: str, form: str, ticks: int) -> OnBoard:
    """Plays a scenario on a board and compares all running hashes.

    Raises
    ------
    PvidError
        When the image cannot be built or does not come to its end.
    """
    if ticks % CHUNK != 0:
        raise PvidError(f"a run on a board has a multiple of {CHUNK} ticks")
    run = run_of(library, scenario, form, ticks)
    image, _ = build_image(board, run)
    report = play(board, image, PATIENCE_S)
    here = host_hashes(run, native)
    at = REPORT_EVERY * (np.arange(len(here)) + 1)
    wrong = [int(tick) for tick, hashed in zip(at, here, strict=True) if report.hashes.get(int(tick)) != hashed]
    return OnBoard(board.name, scenario, form, report.ticks, report.hash, len(at), wrong[0] if wrong else None)


def _key(board: Board, scenario: str, form: str) -> str:
    return f"{scenario}, {form} form on {board.name}"


def run_missing_on(
    board: Board, ticks: int, scenarios: Sequence[str], folder: Path, progress: Callable[[int], None]
) -> list[tuple[str, ...]]:
    """Plays what is not there yet, keeps each run as soon as it is done, and returns the table's rows.

    `progress` is told how many runs are there.
    """
    library, native = build_library(folder), Native()
    results: Results = load()
    rows = []
    for number, (scenario, form) in enumerate(combinations(scenarios), start=1):
        stored = results.get(_key(board, scenario, form), {})
        if stored.get("ticks", 0) < ticks:
            cells = measure_on(board, library, native, scenario, form, ticks).cells
            stored = {"ticks": ticks, "cells": list(cells)}
            results = {**load(), _key(board, scenario, form): stored}
            save(results)
        rows.append(tuple(stored["cells"]))
        progress(number)
    return rows
