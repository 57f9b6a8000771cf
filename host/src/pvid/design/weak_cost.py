"""Cost of a weak-form design on a device: RAM, delay, and instructions per sample by a fitted formula.

The instructions are those of x86-64 at -O2, counted by callgrind: a measure to compare designs by, of the size that
cores with an FPU need too. Their number depends on the design's sizes alone (pvid/weak.h: the work of a tick does not
depend on the data), through the counts of `Schedule`; the coefficients are in weak_cost.toml, which
`pvid bench design-cost --update` measures anew and tests/design/test_weak_cost.py holds against the core.
"""

from __future__ import annotations

import platform
import re
import shutil
import subprocess
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.core.sources import PUBLIC_INCLUDES
from pvid.design.weak import WeakDesign
from pvid.design.weak_sizing import bounds_of, raised_bounds

COEFFICIENTS_FILE = Path(__file__).with_name("weak_cost.toml")

# Names of the coefficients of the mean [instructions]: what is done per tick, per decimated sample, per window.
MEAN_TERMS = (
    "tick",
    "decimated_sample",
    "front_slice",
    "tap_pair",
    "window_slice",
    "function",
    "window",
    "window_function",
    "window_function_cubed",
    "window_zero",
)
# And of the longest tick: a slice of taps beside the longest stage, or a slice of functions.
# What a function costs there is what it costs in the mean.
LONGEST_TERMS = ("tick", "front_pair", "stage", "factor", "factor_function_squared", "window_slice")


def stages_of(functions: int, zero_unknown: bool = True, iterations: int = 3) -> int:
    """Stages of a complete window (pvid_weak_finish_stages_f32): rows, Gauss-Newton steps, assessment."""
    rows = 8 * functions + 2 + 5 * -(-functions // 6)
    projection, parameters = (11, 4) if zero_unknown else (7, 3)
    step = projection + 6
    return rows + 1 + iterations * step + projection + 4 + parameters


@dataclass(frozen=True)
class Schedule:
    """How the work of `taps`, `decimation` D, `window` W and `functions` K is spread over ticks (weak_f32.c).

    Attributes
    ----------
    pairs : of taps, per decimated sample
    front_slice : pairs a tick, at most
    front_slices : ticks of D that smooth
    window_slice : functions a tick, at most
    window_slices : ticks of D in which one of the two windows takes the decimated sample in
    period : ticks from window to window
    free : ticks of D that are left for a complete window's stages
    together : stages that each of them takes
    """

    decimation: int
    functions: int
    pairs: int
    front_slice: int
    front_slices: int
    window_slice: int
    window_slices: int
    period: int
    free: int
    stages_per_tick: int

    @classmethod
    def of(cls, taps: int, decimation: int, window: int, functions: int) -> Schedule:
        """From a design's sizes."""
        pairs = (taps - 1) // 2
        front_slice = -(-pairs // max(decimation // 2, 1))
        window_slice = -(-functions // max((decimation - decimation // 2) // 2, 1))
        window_slices = -(-functions // window_slice)
        free = 1 if decimation <= 2 else decimation - 2 * window_slices
        return cls(
            decimation=decimation,
            functions=functions,
            pairs=pairs,
            front_slice=front_slice,
            front_slices=-(-pairs // front_slice),
            window_slice=window_slice,
            window_slices=window_slices,
            period=decimation * ((window - 1) // 2),
            free=free,
            stages_per_tick=-(-stages_of(functions) // (free * ((window - 1) // 2))),
        )

    def mean_counts(self, zero_unknown: bool) -> npt.NDArray[np.float64]:
        """How often each of MEAN_TERMS is done per tick."""
        per_sample = np.array([1.0, self.front_slices, self.pairs, 2 * self.window_slices, 2 * self.functions])
        per_window = np.array([1.0, self.functions, self.functions**3, float(zero_unknown)])
        return np.concatenate([[1.0], per_sample / self.decimation, per_window / self.period])

    def longest(self, coefficients: npt.NDArray[np.float64], mean: npt.NDArray[np.float64]) -> float:
        """The longest tick by coefficients in the order of LONGEST_TERMS, and those of MEAN_TERMS."""
        tick, front_pair, stage, factor, factor_squared, window_slice = coefficients
        function = float(mean[MEAN_TERMS.index("function")])
        work = self.stages_per_tick * max(stage, factor + factor_squared * self.functions**2)
        front = tick + front_pair * self.front_slice + work
        window = window_slice + function * self.window_slice
        if self.decimation == 1:
            return float(front + 2 * window)
        return float(max(front, tick + (2 if self.decimation == 2 else 1) * window))


@dataclass(frozen=True)
class WeakCost:
    """What a design costs.

    Attributes
    ----------
    delay_s : from a sample to the estimate of the last window that it is part of, at most [s]
    update_s : from estimate to estimate [s]
    flash_bytes : the tables
    ram_bytes : state of the identifier with the default bounds of pvid/config.h, for a 32-bit device; with that of the
        correction of large angles where it is wanted
    raised : the macros of those bounds that are too small for the design, with what it needs; part of ram_bytes
    ram_bytes_fitted : with bounds that just hold the design; None, both, if this machine's compiler cannot determine it
    definitions : the macros of these bounds
    instructions : mean per sample (x86-64, gcc -O2, by the formula), without the correction
    longest_tick : instructions of the longest tick (same)
    """

    delay_s: float
    update_s: float
    flash_bytes: int
    ram_bytes: int | None
    raised: tuple[str, ...]
    ram_bytes_fitted: int | None
    definitions: tuple[str, ...]
    instructions: float
    longest_tick: float


def cost_of(design: WeakDesign, zero_unknown: bool = True, iterations: int = 3, corrected: bool = False) -> WeakCost:
    """Cost of a design, by itself or corrected for large angles."""
    schedule = Schedule.of(design.taps, design.decimation, design.window, design.functions)
    mean, longest = instructions(schedule, zero_unknown)
    stages = stages_of(design.functions, zero_unknown, iterations)
    worked_off_s = -(-stages // (schedule.free * schedule.stages_per_tick)) * design.dt
    definitions = fitted_definitions(design)
    raised = tuple(f"{macro}={value}" for macro, value in raised_bounds(design).items())
    return WeakCost(
        delay_s=design.delay / design.sample_rate + design.window_s + min(worked_off_s, design.hop_s),
        update_s=design.hop_s,
        flash_bytes=design.flash_bytes,
        ram_bytes=state_bytes_32(raised, corrected),
        raised=raised,
        ram_bytes_fitted=state_bytes_32(definitions, corrected),
        definitions=definitions,
        instructions=mean,
        longest_tick=longest,
    )


def instructions(schedule: Schedule, zero_unknown: bool) -> tuple[float, float]:
    """Mean instructions a sample and those of the longest tick, by the fitted formula."""
    mean, longest = coefficients()
    return float(schedule.mean_counts(zero_unknown) @ mean), schedule.longest(longest, mean)


@cache
def coefficients() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Coefficients of MEAN_TERMS and LONGEST_TERMS."""
    document: dict[str, Any] = tomllib.loads(COEFFICIENTS_FILE.read_text(encoding="utf-8"))
    mean = np.array([document["mean"][name] for name in MEAN_TERMS], np.float64)
    return mean, np.array([document["longest"][name] for name in LONGEST_TERMS], np.float64)


def fitted_definitions(design: WeakDesign) -> tuple[str, ...]:
    """Macros of pvid/config.h that just hold the design."""
    return tuple(f"{macro}={value}" for macro, value in bounds_of(design).items())


@cache
def state_bytes_32(definitions: tuple[str, ...] = (), corrected: bool = False) -> int | None:
    """sizeof(pvid_weak_f32) where pointers have 32 bits, with pvid_weak_angle_f32 where rows are corrected: gcc is
    used, nothing is linked or run.

    None without gcc, or on a machine whose gcc has no 32-bit mode.
    """
    if shutil.which("gcc") is None or platform.machine() not in ("x86_64", "i686"):
        return None
    command = ["gcc", "-m32", "-msse2", "-mfpmath=sse", "-std=c99", "-ffreestanding", "-fno-common", *PUBLIC_INCLUDES]
    room = "sizeof(pvid_weak_f32)" + (" + sizeof(pvid_weak_angle_f32)" if corrected else "")
    source = f'#include "pvid/weak.h"\nchar state[{room}];\n'
    command += [*(f"-D{definition}" for definition in definitions), "-S", "-x", "c", "-", "-o", "-"]
    done = subprocess.run(command, input=source, capture_output=True, text=True, check=False)
    size = re.search(r"\.size\s+state, (\d+)", done.stdout)
    if done.returncode != 0 or size is None:
        raise PvidError(f"gcc cannot determine the size of the state: {done.stderr.strip()[:200]}")
    return int(size.group(1))
