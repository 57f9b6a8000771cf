"""The longest tick of the weak form on a Cortex-M4F: a bound from its machine code, a search with spoilt samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.board.boards import Board
from pvid.board.mechanism_image import MISSING, MechanismRun, build_mechanism_image
from pvid.board.mechanism_image_q31 import FixedRun, build_fixed_image
from pvid.board.profile import counted
from pvid.board.stack_bound import stack_bound
from pvid.board.tick_bound import TickBound, tick_bound
from pvid.settings.cores import FIXED, FLOAT

Counts = npt.NDArray[np.int32]

CORE = "Cortex-M4F"  # whose code is read
SEARCHES = 3  # times that the run is spoilt, with the run as it is between
_PARTS = 0.1, 4.0  # lengths of what is spoilt alike [half windows]
_SPOILT = 0.6  # of the signals of a part


def longest_tick(board: Board, run: MechanismRun | FixedRun, seed: int = 0) -> TickBound:
    """Of the weak form with the settings of a run, by the run and what no sensor sends.

    Raises PvidError where the board is none with a CORE, a compiler or the emulator is missing, or the image fails.
    """
    if isinstance(run, MechanismRun):
        core, missing = FLOAT.name, MISSING
    else:  # a count beyond every full scale
        core, missing = FIXED.name, 2 ** (8 * run.count_bytes - 1) - 1
    design = run.config.design if isinstance(run, MechanismRun) else run.weak.config.design
    room = board.sample_bytes // (4 * run.counts.shape[1])  # ticks
    counts = run.counts[: room // 3]
    parts = [counts]
    for number in range(min(SEARCHES, room // len(counts) // 2)):
        spoilt = spoilt_counts(counts, design.hop * design.decimation, missing, SEARCHES * seed + number)
        parts += [spoilt, counts]
    long = np.concatenate(parts)[:room].astype(counts.dtype)
    if isinstance(run, MechanismRun):
        image, tree = build_mechanism_image(board, replace(run, counts=long))
    else:
        image, tree = build_fixed_image(board, replace(run, counts=long))
    entry = f"pvid_weak_step_{core}"
    columns = max(one.thetas + 1 + one.nuisances for one in design.model.kind)
    limits = {"columns_of": columns, "others": columns}  # of projected nuisances, which few mechanisms have
    found = tick_bound(board.tool_prefix, image, tree, entry, counted(board, image, entry), limits)
    return replace(found, stack=stack_bound(board.tool_prefix, image, tree, board.entry))


def spoilt_counts(counts: Counts, period: int, missing: int, seed: int) -> Counts:
    """Counts [ticks, signals] in parts, some signals of each of which are stuck, 0, scaled, noise, missing in part,
    squares, of single jolts, reversed or at the end of the scale; or all are as they were."""
    random = np.random.default_rng(seed)
    out = counts.copy()
    top = np.maximum(np.abs(np.where(counts == missing, 0, counts)).max(axis=0), 1)
    at = 0
    while at < len(out):
        part = out[at : at + 1 + int(period * np.exp(random.uniform(*np.log(_PARTS))))]
        at += len(part)
        kind, t = int(random.integers(10)), np.arange(len(part))
        for k in np.flatnonzero(random.random(counts.shape[1]) < _SPOILT):
            own, most = part[:, k], int(top[k])
            end = abs(missing) - 1 if random.random() < 0.5 else most
            own[:] = (
                own,
                np.full_like(own, own[0]),
                np.zeros_like(own),
                np.clip(np.rint(own * random.uniform(-3.0, 3.0)), -end, end),
                random.integers(-most, most + 1, len(part)),
                np.where(random.random(len(part)) < random.choice([0.001, 0.01, 0.5]), missing, own),
                np.where(t // int(random.integers(1, 200)) % 2, most, -most),
                np.where(random.random(len(part)) < 0.01, end, own),
                own[::-1].copy(),
                np.sign(own) * end,
            )[kind]
    return out
