"""The strong form of every mechanism on emulated boards: its bits, and what a tick costs, beside least squares.

Recursive least squares of all entries of theta, packed and as U D U^T (tests/cost), take the rows as they are: the
derivatives, the row, the step from theta to p, standard errors, gate and reasons are not in their figures.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np

from bench.case import DIFFERS, Advance
from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.board.mechanism_image import build_with
from pvid.board.replay_image import play
from pvid.board.strong_image import play_on_board
from pvid.compare.strong import StrongComparison
from pvid.core.sources import ROOT
from pvid.rig.run import Recording
from pvid.settings.enums import Core
from pvid.sim.simulated_run import simulation_of

ON = ("mps2-an386", "microbit", "virt-rv32imac")
TICKS = 1200
FIXED_HEADER = ("mechanism", "samples of a window", "state [B]", *(BOARDS[one].core for one in ON), "bits")
HEADER = (
    *FIXED_HEADER,
    *("entries of theta", "RLS of them, Cortex-M4F", "RLS as U D U^T"),
)
COST = ROOT / "tests" / "cost"
_ROWS = 400  # of a baseline: its path does not depend on them


def comparison_of(name: str, ticks: int = TICKS, core: Core = "f32") -> StrongComparison:
    """The first samples of a mechanism's shipped rig through the strong form in C on this machine and its twin."""
    simulation = simulation_of(name)
    run = simulation.run(seed=1)
    signals = {one.name: run[one.name][:ticks] for one in simulation.model.signals}
    recording = Recording(run["t"][:ticks], signals, simulation.rig.sample_rate)
    return StrongComparison.of(simulation.model, recording, core=core)


def row_of(name: str) -> tuple[str, ...]:
    """A row of the table in float32, with the costs of the baselines."""
    run = comparison_of(name)
    sizes = [len(one.theta) for one in run.design.strong.functions.kinds]
    peers = (str(sum(peer_cost(peer, n) for n in sizes)) for peer in ("rls", "ud"))
    return *_cells(name, run), " + ".join(map(str, sizes)), *peers


def fixed_row_of(name: str) -> tuple[str, ...]:
    """A row of the table in fixed point, as in FIXED_HEADER."""
    return _cells(name, comparison_of(name, core="q31"))


def _cells(name: str, run: StrongComparison) -> tuple[str, ...]:
    """Instructions of a tick, mean / longest, on each board; whether all bits are the twin's."""
    costs, equal, state = [], run.found.equal, "-"
    for target in ON:
        try:
            report = play_on_board(target, run)
        except PvidError:
            costs.append("does not fit")
            continue
        costs.append(f"{report.instructions_mean:.0f} / {report.instructions_longest:.0f}")
        equal = equal and report.differs_at(run.hashes) is None
        state = str(report.state_bytes) if state == "-" else state
    return name, str(run.design.config.window), state, *costs, "equal" if equal else DIFFERS


@cache
def peer_cost(peer: str, n: int) -> int:
    """Mean instructions of a step of a baseline of tests/cost, rls or ud, with n entries, on the first board."""
    header, source = ((COST / f"{peer}_f32.{end}").read_text(encoding="utf-8") for end in ("h", "c"))
    header = re.sub(rf"#define {peer.upper()}_N \d+", f"#define {peer.upper()}_N {n}", header)
    rows = np.random.default_rng(1).normal(size=(_ROWS, n + 1)).astype(np.float32).view(np.uint32)
    listed = "\n".join("    {" + ", ".join(f"{word}u" for word in row) + "}," for row in rows.tolist())
    own = _PEER.replace("NAME", peer).replace("ENTRIES", str(n))
    text = f"{own}static const float replay_lsb[{n + 1}] = {{{', '.join(['1.0f'] * (n + 1))}}};\n"
    text += f"static const uint32_t replay_samples[{_ROWS}][{n + 1}] = {{\n{listed}\n}};\n#endif\n"
    files = {f"{peer}_f32.h": header, f"{peer}_f32.c": source, "replay_run.h": text}
    image, _ = build_with(BOARDS[ON[0]], f"{peer}-{n}", files, {}, "f32", "strong")
    return round(play(BOARDS[ON[0]], image, 60.0).instructions_mean)


_PEER = f"""#ifndef REPLAY_RUN_H
#define REPLAY_RUN_H
#include <string.h>

#include "NAME_f32.h"
#include "pvid/fnv_word.h"
#include "pvid/status.h"

typedef struct {{
    NAME_f32 estimator;
}} baseline;

static pvid_status baseline_init(baseline *self, const int *config)
{{
    NAME_init_f32(&self->estimator, 0.9999f, (float)*config);
    return PVID_OK;
}}

static pvid_reason baseline_step(baseline *self, const float *row)
{{
    NAME_step_f32(&self->estimator, row, row[ENTRIES]);
    return PVID_UPDATED;
}}

static uint32_t baseline_hash(uint32_t hash, const NAME_f32 *estimator, pvid_reason reason)
{{
    uint32_t word;
    memcpy(&word, &estimator->theta[0], sizeof word);
    return pvid_fnv_word(hash + (uint32_t)reason, word);
}}

#define REPLAY_TYPE baseline
#define REPLAY_INIT baseline_init
#define REPLAY_STEP baseline_step
#define REPLAY_HASH baseline_hash
#define REPLAY_SAMPLE float
#define REPLAY_COUNT uint32_t
#define REPLAY_HAS_BITS
#define REPLAY_CHANNELS (ENTRIES + 1)
#define REPLAY_FAULTS 0u
#define REPLAY_IS_FLOAT 1
#define REPLAY_FORM "NAME"
#define REPLAY_TICKS {_ROWS}u
#define REPLAY_MEASURE_FROM {_ROWS // 2}u
#define REPLAY_REPORT_EVERY 500u
static const int replay_config = 1000000;
"""


def rows(names: Sequence[str], _: int, advance: Advance) -> Iterator[tuple[str, ...]]:
    """Of HEADER."""
    for name in names:
        yield row_of(name)
        advance()


def fixed_rows(names: Sequence[str], _: int, advance: Advance) -> Iterator[tuple[str, ...]]:
    """Of FIXED_HEADER."""
    for name in names:
        yield fixed_row_of(name)
        advance()
