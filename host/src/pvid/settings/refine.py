"""Settings of the refinement, as in refine.h."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.weak import Source

Float32 = npt.NDArray[np.float32]

BIG_STEP = 4  # steps of the motion in one of the columns and rows


@dataclass(frozen=True)
class RefineSignal:
    """pvid_refine_signal_f32: an input or an output of the model.

    Attributes
    ----------
    sample : place in the argument of step
    order : 0: the sample, 2: its second derivative, -1: its integral
    source : of an input HELD where it is held from tick to tick
    scale : factor to the model's unit
    range : largest absolute value [model's unit]
    """

    sample: int
    order: int
    scale: float
    range: float
    source: Source = Source.SAMPLED


@dataclass(frozen=True, eq=False)
class RefineConfig:
    """pvid_refine_config_f32.

    Attributes
    ----------
    sample_rate : ticks per second [Hz]
    ratio : ticks of a step of the motion
    second : weights of second derivatives, centre first [17], 1/s^2; None: no signal has order 2
    signal : inputs, then outputs
    block, first_block : big steps of a full block and of the first one of a search
    sd : of the noise of a row at low frequencies [outputs]
    prior_sd : of the weak form's estimate [parameters], relative if logarithmic
    state_limit : largest |start| of a block [states]
    passes, most_passes : of a block: at least (in the track one with a short step), and while the steps are not small
    jobs : of a pass in one tick: 1 without a floating point unit
    rests : ticks in a row, at most, without jobs because the weak form is busy
    forgetting_s : time constant; 0: none
    outlier_gate : means of samples that stand out by more than this multiple of the usual are left out; 0: no gate
    gate, chi_max, clash_max, step_max, step_limit, se_max, distance : limits
    step_fine : with signs step_max behind the second block; None: there are none
    parts, fine_parts : steps of Runge-Kutta in a step of the motion, in one in which a sign may change; None: steps are
        Adams's
    width : where the widths of the signs start [widths]; None: none is refined
    observer : correction of the states at the end of a big step by a row of each output, flat [outputs, states]; None:
        no input is measured, or steps are Adams's
    """

    sample_rate: float
    ratio: int
    second: Float32 | None
    signal: tuple[RefineSignal, ...]
    block: int
    first_block: int
    sd: Float32
    prior_sd: Float32
    state_limit: Float32
    passes: int = 2
    most_passes: int = 8
    jobs: int = 3
    rests: int = 1
    forgetting_s: float = 0.0
    outlier_gate: float = 4.0
    gate: float = 8.0
    chi_max: float = 3.0
    clash_max: float = 25.0
    step_max: float = 0.02
    step_limit: float = 2.0
    se_max: float = 0.01
    distance: float = 0.03
    parts: int | None = None
    fine_parts: int | None = None
    width: Float32 | None = None
    observer: Float32 | None = None
    step_fine: float | None = None


@dataclass(frozen=True)
class RefineRig:
    """What the refinement of a rig depends on.

    Attributes
    ----------
    sample_rate : [Hz]
    slow_hz, fast_hz : frequencies of the motion; with Runge-Kutta the largest rate over 2 pi
    signal : inputs, then outputs of the model
    sample_sd : white noise of a sample of each output [outputs]
    prior_sd : [parameters]
    state_limit : [states]
    rests : ticks in a row, at most, that the refinement leaves to the weak form
    runge_kutta : each step is Runge-Kutta's; else Adams's
    ring : entries
    fine_s : longest step of Runge-Kutta where a sign may change [s]
    jumps : of the rates of the signs' arguments at their reversals [widths]
    step_fine : as of the settings
    """

    sample_rate: float
    slow_hz: float
    fast_hz: float
    signal: tuple[RefineSignal, ...]
    sample_sd: Sequence[float]
    prior_sd: Sequence[float]
    state_limit: Sequence[float]
    rests: int = 1
    runge_kutta: bool = False
    ring: int = 512
    fine_s: float = math.inf
    jumps: Sequence[float] = ()
    step_fine: float | None = None

    @property
    def inputs(self) -> tuple[RefineSignal, ...]:
        """Those of the signals."""
        return self.signal[: len(self.signal) - len(self.sample_sd)]
