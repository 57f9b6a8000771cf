"""Settings of a robot's identifier in C (pvid/robot.h)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RobotCoreDesign:
    """Fields of pvid_robot_design_f32 and pvid_robot_config_f32, with the rate of the samples [Hz]."""

    sample_rate: float
    decimation: int
    interval: int
    position: Float
    rate: Float
    spline: Float
    slope: Float
    torque: Float
    noise: Float
    noise_sd: Float
    white: Float
    start: Float
    start_sd: Float
    group: int
    memory: int = 2**16

    @property
    def taps(self) -> int:
        """Of the polynomials; position and rate are their weights outwards from the centre."""
        return 2 * len(self.position) + 1

    @property
    def knots_s(self) -> float:
        """Time between two rows of a joint [s]."""
        return self.interval * self.decimation / self.sample_rate
