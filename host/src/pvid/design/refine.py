"""Rate, blocks and filter of the refinement for a rig."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design import refine_filter
from pvid.settings.refine import BIG_STEP, RefineConfig, RefineRig

HALF = 12  # PVID_REFINE_HALF

_STEPS_OF_FAST = 48.0  # steps of Adams in the fast period, at least
_STEPS_OF_RUNGE_KUTTA = 25.0
_STEPS_WITH_REVERSALS = 120.0  # likewise; with 80 one run in 40 stays at a wrong estimate
_MOST_PARTS = 8  # of a step of one tick
_MOST_FINE = 64
_MOST_TICKS = 4  # of a step in which a sign may change, or an input jump
_PART_OF_RING = 0.6  # that a block has
_BANDS = 4.0  # pass band of second derivatives over the fast frequency
_PERIODS = 2.0  # slow periods of a block
_LEAST_BLOCK = 16
_MOST_PASSES = 3  # of a block, that the ring has room for
# Likewise, while the next one comes in: nearly collinear parameters take many, and reversals are found in small
# steps.
_PASSES, _PASSES_WITH_SIGNS = 9, 8
_JOBS = 9  # of a pass for each big step
_JOBS_OF_A_PART, _OTHER_JOBS = 10, 15  # with Runge-Kutta
_LEAST_JOBS = 3  # in a tick
_MORE_TICKS = 50  # of a pass, beside these
_SPARE = 16  # entries of the ring


def refine_config(rig: RefineRig, forgetting_s: float = 0.0, outlier_gate: float = 4.0) -> RefineConfig:
    """The settings that evidence recommends. Raises PvidError when samples are too slow for the steps of the motion."""
    ratio, parts, fine = _steps_of(rig)
    of_big_step = _JOBS_OF_A_PART * parts + _OTHER_JOBS if rig.runge_kutta else _JOBS
    free = max(ratio - 1, 1)  # ticks of a step that have jobs
    passes = _PASSES_WITH_SIGNS if rig.jumps else _MOST_PASSES if rig.runge_kutta else _PASSES
    jobs = max(_LEAST_JOBS, math.ceil(of_big_step * passes / (BIG_STEP * free)))
    behind = (_MOST_PASSES - 1) / free  # steps that come in for each tick of a pass behind the first one
    ticks = math.ceil(of_big_step / jobs)
    most = min(rig.ring // 6, math.floor((rig.ring - _SPARE - behind * _MORE_TICKS) / (BIG_STEP + behind * ticks)))
    h = ratio / rig.sample_rate
    block = min(max(round(_PERIODS / rig.slow_hz / (BIG_STEP * h)), _LEAST_BLOCK), most)
    derived = any(one.order == 2 for one in rig.signal)
    second = refine_filter.second_derivative(HALF, min(_BANDS * rig.fast_hz * h, 0.4), ratio) / h**2
    share = math.sqrt(ratio * BIG_STEP)
    return RefineConfig(
        sample_rate=rig.sample_rate,
        ratio=ratio,
        second=refine_filter.as_float32(second) if derived else None,
        signal=rig.signal,
        block=block,
        first_block=max(round(0.26 * block), 8),
        sd=_as_float32(np.asarray(rig.sample_sd) / share),
        prior_sd=_as_float32(rig.prior_sd),
        state_limit=_as_float32(rig.state_limit),
        forgetting_s=forgetting_s,
        outlier_gate=outlier_gate,
        jobs=jobs,
        rests=rig.rests,
        parts=parts if rig.runge_kutta else None,
        fine_parts=fine if rig.runge_kutta else None,
        width=_as_float32(np.asarray(rig.jumps) * h / fine) if len(rig.jumps) else None,
        step_fine=rig.step_fine,
    )


def _steps_of(rig: RefineRig) -> tuple[int, int, int]:
    """Ticks of a step of the motion; steps of Runge-Kutta in it, and in one in which a sign may change."""
    longest = 1 / (rig.fast_hz * (_STEPS_OF_RUNGE_KUTTA if rig.runge_kutta else _STEPS_OF_FAST))
    if longest * (_MOST_PARTS if rig.runge_kutta else 1) * rig.sample_rate < 1:
        needed = math.ceil(1 / (longest * (_MOST_PARTS if rig.runge_kutta else 1)))
        raise PvidError(
            f"the refinement in C needs {needed} samples a second for the fastest motion or relaxation, "
            f"{rig.fast_hz:.3g} Hz, not {rig.sample_rate:g}"
        )
    ratio = math.floor(min(longest, _MOST_FINE * rig.fine_s) * rig.sample_rate)
    if rig.jumps and all(one.order == 2 for one in rig.inputs):  # which are smooth
        ratio = min(ratio, math.floor(rig.sample_rate / (_STEPS_WITH_REVERSALS * rig.fast_hz)))
    elif rig.runge_kutta:  # inputs may jump: no longer steps than the ring needs for a block, or than reversals bear
        for_ring = math.ceil(_PERIODS / rig.slow_hz * rig.sample_rate / (_PART_OF_RING * rig.ring))
        ratio = min(ratio, _MOST_TICKS if rig.jumps else for_ring)
    ratio = min(max(ratio, 1), 255)
    h = ratio / rig.sample_rate
    parts = math.ceil(h / longest - 1e-9)
    return ratio, parts, min(max(math.ceil(h / rig.fine_s), parts), _MOST_FINE)


def _as_float32(values: npt.ArrayLike) -> npt.NDArray[np.float32]:
    return np.asarray(values, np.float32)
