"""Rate, blocks and filter of the refinement for a rig."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design import refine_filter
from pvid.settings.refine import BIG_STEP, RefineConfig, RefineRig

RING = 512  # PVID_REFINE_RING
HALF = 12  # PVID_REFINE_HALF

_STEPS_OF_FAST = 48.0  # steps of the fast period, at least
_BANDS = 4.0  # pass band of second derivatives over the fast frequency
_PERIODS = 2.0  # slow periods of a block
_LEAST_BLOCK = 16
_LEAST_RATIO = 4  # with fewer ticks in a step two passes of a block take longer than the block
_MOST_PASSES = 3  # of a block, that the ring has room for
_TICKS, _MORE_TICKS = 3, 50  # of a pass for each big step, three jobs a tick, and beside these
_SPARE = 16  # entries of the ring


def refine_config(rig: RefineRig, forgetting_s: float = 0.0, outlier_gate: float = 4.0) -> RefineConfig:
    """The settings that evidence recommends.

    Raises
    ------
    PvidError
        When there are too few ticks for the steps of the motion.
    """
    ratio = math.floor(rig.sample_rate / (_STEPS_OF_FAST * rig.fast_hz))
    if ratio < _LEAST_RATIO:
        needed = math.ceil(_LEAST_RATIO * _STEPS_OF_FAST * rig.fast_hz)
        raise PvidError(
            f"the refinement in C makes {_STEPS_OF_FAST:g} steps in a period of the fastest motion, "
            f"{1 / rig.fast_hz:.3g} s, and needs {_LEAST_RATIO} ticks for each: a sample rate of {needed} Hz, not "
            f"{rig.sample_rate:g}"
        )
    ratio = min(ratio, 255)
    h = ratio / rig.sample_rate
    behind = (_MOST_PASSES - 1) / (ratio - 1)  # steps that come in for each tick of a pass behind the first one
    most = min(RING // 6, math.floor((RING - _SPARE - behind * _MORE_TICKS) / (BIG_STEP + behind * _TICKS)))
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
        gain_sd=_as_float32(rig.gain_sd),
        state_limit=_as_float32(rig.state_limit),
        forgetting_s=forgetting_s,
        outlier_gate=outlier_gate,
        rests=rig.rests,
    )


def _as_float32(values: npt.ArrayLike) -> npt.NDArray[np.float32]:
    return np.asarray(values, np.float32)
