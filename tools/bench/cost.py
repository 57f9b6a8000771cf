"""What one tick costs: instructions by callgrind on the host, split by stage, beside recursive least squares.

Instructions, not time: identical on repeat, whatever else the machine does. Each stage runs in tests/cost/tick_cost.c;
its cost is the difference between two numbers of ticks, so that start-up falls out.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from pvid.base.errors import PvidError
from pvid.core.sources import INCLUDES, ROOT, sources_of

STAGES = {
    "row": "Y and N[11] from the derivatives",
    "estimator": "strong form from derivatives: row, gate, verdict, sums, a solve, exact at every eighth row",
    "tick": "the same from samples, five points",
    "exact": "samples in, five points, a solve from all sums at every row: the paper's law literally",
    "staged": "samples in, five points, a solve at every eighth row in stages",
    "smoothing": "as tick, behind a Savitzky-Golay bank of 315 samples in blocks of nine",
    "assess": "standard errors and kappa (only when published)",
    "weak": "weak form, samples in, parameters out: mean over its windows (the pendulum's shipped rig)",
    "rls": "plain packed RLS of the same 11 parameters",
    "ud": "recursive least squares of the same 11 parameters in U-D form",
    "kalman": "extended Kalman filter of 7 states, u by 71 taps, samples in, parameters out",
}

PENDULUM = ROOT / "tests" / "unit" / "pendulum"  # tables of the weak form's rig
_PERIOD = 768  # ticks from window to window of that rig
_TICKS = 2496  # a multiple of the fold's block of 64 ticks
_WEAK_TICKS = 3 * _PERIOD


RLS_STATE_BYTES = 4 * (66 + 11 + 2)  # P packed, theta, lambda and its inverse: sizeof(rls_f32); U-D has as many


def require_valgrind() -> None:
    """Raises a PvidError where valgrind is missing."""
    if shutil.which("valgrind") is None:
        raise PvidError("valgrind is not installed: run ./tools/test once, or install the package valgrind")


def build(folder: Path, compiler: str = "gcc", level: str = "-O2") -> Path:
    """Compiles tests/cost with the float32 core as a device does, into `folder`; returns the binary.

    Raises
    ------
    PvidError
        When the compiler is missing or refuses.
    """
    sources = sorted([*sources_of("f32"), *(ROOT / "tests" / "cost").glob("*.c"), PENDULUM / "kapitza_weak_f32.c"])
    binary = folder / "tick_cost"
    command = [compiler, "-std=c99", level, "-ffp-contract=off", *INCLUDES, f"-I{PENDULUM.parent}"]
    try:
        done = subprocess.run(
            [*command, *map(str, sources), "-o", str(binary), "-lm"], capture_output=True, text=True, check=False
        )
    except OSError as error:
        raise PvidError(f"cannot run {compiler}: {error.strerror}") from error
    if done.returncode != 0:
        raise PvidError(f"{compiler} refused the cost harness: {done.stderr.strip()[:200]}")
    return binary


_SIZES = """#include <stdio.h>
#include "pvid/pvid.h"
int main(void) {
    printf("%zu %zu ", sizeof(pvid_estimator_f32), sizeof(pvid_strong_estimator_f32));
    printf("%zu %zu", sizeof(pvid_strong_f32), sizeof(pvid_weak_f32));
    return 0;
}
"""


def state_bytes(folder: Path) -> dict[str, int]:
    """Bytes of state with the bounds of pvid/config.h as they are, and the baseline's; works in `folder`."""
    source, binary = folder / "sizes.c", folder / "sizes"
    source.write_text(_SIZES, encoding="utf-8")
    subprocess.run(["gcc", "-std=c99", *INCLUDES, str(source), "-o", str(binary)], check=True)
    printed = subprocess.run([str(binary)], capture_output=True, text=True, check=True).stdout
    estimator, own, strong, weak = map(int, printed.split())
    return {
        "estimator (two-level sums, counters, settings)": estimator,
        "strong-estimator, of the strong form": own,
        "strong form, windows of 321 samples": strong,
        "weak form": weak,
        "plain packed RLS of 11 parameters": RLS_STATE_BYTES,
    }


@dataclass(frozen=True)
class StageCost:
    """Instructions of one stage per tick, the harness's own subtracted."""

    stage: str
    instructions: int


def _instructions(binary: Path, stage: str, ticks: int) -> int:
    command = [
        "valgrind",
        "--tool=callgrind",
        "--callgrind-out-file=/dev/null",
        str(binary),
        stage,
        str(ticks),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    counted = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode != 0 or counted is None:
        raise PvidError(
            f"counting {stage} failed: {done.stderr.strip().splitlines()[-1] if done.stderr else 'no output'}"
        )
    return int(counted.group(1))


def stage_costs(binary: Path) -> list[StageCost]:
    """Costs of every stage of the given tick_cost binary.

    Raises
    ------
    PvidError
        When valgrind is missing or the binary fails.
    """
    require_valgrind()

    def per_tick(stage: str) -> int:
        ticks = _WEAK_TICKS if stage == "weak" else _TICKS
        return round((_instructions(binary, stage, 2 * ticks) - _instructions(binary, stage, ticks)) / ticks)

    harness = per_tick("nothing")
    return [StageCost(stage, per_tick(stage) - harness) for stage in STAGES]


def as_markdown(by_level: dict[str, list[StageCost]], state: dict[str, int]) -> str:
    """The table in host/docs/benchmarks/cost.md from the costs at each level of optimisation."""
    levels = list(by_level)
    lines = ["| stage | " + " | ".join(f"gcc {level}" for level in levels) + " | what it does |"]
    lines.append("|---|" + "---:|" * len(levels) + "---|")
    for costs in zip(*by_level.values(), strict=True):
        figures = " | ".join(str(cost.instructions) for cost in costs)
        lines.append(f"| {costs[0].stage} | {figures} | {STAGES[costs[0].stage]} |")
    lines.append("")
    lines += ["| state | bytes |", "|---|---:|"]
    lines += [f"| {name} | {size} |" for name, size in state.items()]
    return "\n".join(lines)
