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


def refine_config(rig: RefineRig, forgetting_s: float = 0.0) -> RefineConfig:
    """The settings that evidence recommends.

    Raises
    ------
    PvidError
        When the samples are too slow for the motion, or a block does not fit into the ring.
    """
    ratio = math.floor(rig.sample_rate / (_STEPS_OF_FAST * rig.fast_hz))
    if ratio < 1:
        raise PvidError(
            f"the refinement needs {_STEPS_OF_FAST:g} samples of the fastest period: a sample rate of "
            f"{_STEPS_OF_FAST * rig.fast_hz:.4g} Hz, not {rig.sample_rate:g}"
        )
    ratio = min(ratio, 255)
    h = ratio / rig.sample_rate
    most = RING // 6
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
    )


def _as_float32(values: npt.ArrayLike) -> npt.NDArray[np.float32]:
    return np.asarray(values, np.float32)
