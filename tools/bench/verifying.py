"""What `pvid verify` takes for a long log of every mechanism, of each form and arithmetic that a board streams."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from bench.liar_board import estimate_of, padded
from pvid.base.errors import PvidError
from pvid.board.mechanism_board import MechanismBoard
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.strong_board import StrongBoard
from pvid.link import frames as link
from pvid.log.file import LogWriter
from pvid.log.verify import ReplayableBoard
from pvid.log.witness import CoreWitness
from pvid.twin import fnv

HEADER = ("mechanism", "identifier", "ticks by the core", "by the twin", "CPU of `verify`, s", "the twin alone, s")
EVERY = 100  # ticks from an estimate and a hash to the next, as `pvid log` configures at 1 kHz
_A_FRAME = 16  # ticks
_FRAMES = 4096  # that are written at a time
_OF_TWIN = 20_000  # ticks of a measurement of the twin

_BOARDS: dict[str, Callable[[str], Any]] = {
    "weak, float32": MechanismBoard.of_shipped_rig,
    "weak, float32, second stage": lambda name: MechanismBoard.of_shipped_rig(name, refined=True),
    "weak, fixed point": MechanismBoardQ31.of_shipped_rig,
    "strong, float32": StrongBoard.of_shipped_rig,
}


def messages(board: Any, ticks: int) -> Iterator[tuple[int, link.Message]]:
    """(tick, message) of a board whose sensors read its recording over and over; the core computes it."""
    configure = board.configure(board.stream_image.number, EVERY, EVERY)
    core = CoreWitness(board.core_of(configure), board)
    samples = np.resize(board.recording, (ticks, board.recording.shape[1]))
    hashes = fnv.sample_hashes(samples)
    fixed = isinstance(board, MechanismBoardQ31)
    raw, estimate = (link.RawCount, link.EstimateQ31) if fixed else (link.Raw, link.Estimate)
    yield 0, link.Schema(link.SCHEMA_TEXT.encode())
    yield 0, link.Names(board.names.text.encode())
    yield 0, configure
    for first in range(0, ticks, EVERY):
        piece = samples[first : first + EVERY]
        for at in range(0, len(piece), _A_FRAME):
            yield first + at, replace(raw.of_values(*piece[at : at + _A_FRAME].T), session=configure.session)
        core.run(piece)
        if len(piece) < EVERY:
            return
        done, own = first + EVERY, core.estimate()
        yield done, estimate_of(own, estimate, session=configure.session, updates=core.updates, reason=core.verdict)
        if (refined := core.refined()) is not None:
            values: dict[str, Any] = {
                "p": padded(refined.best["p"]),
                "covariance": link.upper_triangle(refined.best["covariance"]),
            }
            values |= {name: padded(refined.latest[name]) for name in ("r", "se")}
            values |= {name: refined.latest[name] for name in ("number", "level", "clash")}
            values |= {"reason": refined.told, "stage": refined.stage, "tick_high": 0}
            yield done, link.RefinedEstimate(session=configure.session, **values)
        yield done, link.Hash(configure.session, hash=core.running_hash, sample_hash=int(hashes[done - 1]))


def write_log(board: Any, ticks: int, path: Path) -> None:
    """The log of such a board."""
    writer = LogWriter(path, rig=board.text())
    writer.begin("a port", None)
    frames = (link.encode(message, sequence, tick) for sequence, (tick, message) in enumerate(messages(board, ticks)))
    while piece := b"".join(islice(frames, _FRAMES)):
        writer.take(piece)
    writer.end("the end")
    writer.close()


def verified(path: Path, *options: str) -> tuple[float, str]:
    """Processor time of `pvid verify` [s], that of the compiler included, and what it printed."""
    command = [sys.executable, "-P", "-m", "pvid", "verify", str(path), *options]
    before = os.times()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    after = os.times()
    if done.returncode != 0:
        raise PvidError(f"verify ended with {done.returncode}: {(done.stdout + done.stderr).strip()[-300:]}")
    return after.children_user + after.children_system - before.children_user - before.children_system, done.stdout


def us_a_tick(board: ReplayableBoard, samples: Any) -> float:
    """Processor time of the printed twin for a tick [us]."""
    twin = board.twin_of(board.configure(1, EVERY, EVERY))  # type: ignore[attr-defined]
    with np.errstate(all="ignore"):
        twin.run(samples[:100])
        began = time.process_time()
        twin.run(samples)
        return 1e6 * (time.process_time() - began) / len(samples)


def rows(names: tuple[str, ...], ticks: int, advance: Callable[[], object]) -> Iterator[tuple[str, ...]]:
    """As in HEADER, of logs of so many ticks."""
    for name in names:
        for kind, made in _BOARDS.items():
            try:
                board = made(name)
            except PvidError:
                continue  # no such identifier of this mechanism
            with tempfile.TemporaryDirectory() as folder:
                write_log(board, ticks, Path(folder) / "a.pvlog")
                seconds, printed = verified(Path(folder) / "a.pvlog")
            by_core, by_twin = re.findall(r"(\d+) ticks by the", printed)
            samples = np.resize(board.recording, (_OF_TWIN, board.recording.shape[1]))
            alone = us_a_tick(board, samples) * ticks / 1e6
            yield name, kind, by_core, by_twin, f"{seconds:.0f}", f"{alone:.0f}"
            advance()
