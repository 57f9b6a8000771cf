"""What the refinement needs of the pendulum: r = (w, d1, d2, k1, k2, tau, c), refine_shape.h."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.models.kapitza.model import MODEL
from pvid.models.kapitza.modes import modes_hz
from pvid.settings.refine import RefineRig, RefineSignal

PARAMETERS = ("w", "d1", "d2", "k1", "k2", "tau", "c")
"""Names of r: k1, k2 [1/s] viscous friction over l1^2, tau [s] skew of the sensors, c [rad]."""

_PRIOR_SD = (0.15, 0.15, 0.15, 0.1, 0.05, 0.005, 0.1)
_STATE_LIMIT = (3.5, 3.5, 60.0, 60.0)
_ANGLE_RANGE = 1.0
_INPUT_RANGE = 3.0  # over gravity's w
_RESTS = 255  # the weak form is busy at 29 % of the ticks
_GAIN_OF_Y = next(one for one in MODEL.scales if one.name == "y_gain")


def refine_rig(
    sample_rate: float,
    l1: float,
    guess: npt.ArrayLike,
    phi_sd: float,
    y_gain_sd: float = 0.003,
    angle_range: float = _ANGLE_RANGE,
    samples: tuple[str, str] = ("phi", "y"),
) -> RefineRig:
    """The pendulum's.

    Parameters
    ----------
    sample_rate : [Hz]
    l1 : [m]
    guess : w, d1, d2
    phi_sd : white noise of a sample of the angle [rad]
    y_gain_sd : relative standard deviation of the gain of y
    angle_range : largest |phi| [rad]
    samples : argument of step; that of the weak form is ("y", "phi")
    """
    p = np.asarray(guess, float)
    found = modes_hz(p)
    if not found:
        raise PvidError("the refinement needs a guess with two modes of motion")
    slow, fast = found
    w = float(p[0])
    return RefineRig(
        sample_rate=sample_rate,
        slow_hz=slow,
        fast_hz=fast,
        signal=(
            RefineSignal(samples.index("y"), 2, 1.0 / l1, max(_INPUT_RANGE * w, 1.0)),
            RefineSignal(samples.index("phi"), 0, 1.0, angle_range),
        ),
        sample_sd=(phi_sd,),
        prior_sd=_PRIOR_SD,
        gain_sd=tuple(y_gain_sd * power for power in (*_GAIN_OF_Y.p, 0.0, 0.0, 0.0, 0.0)),
        state_limit=_STATE_LIMIT,
        rests=_RESTS,
    )


def sample_sd(bits: int, noise_lsb: float = 0.5) -> float:
    """White noise of an encoder of so many bits a turn [rad]."""
    return 2.0 * math.pi / 2.0**bits * math.sqrt(1.0 / 12.0 + noise_lsb**2)
