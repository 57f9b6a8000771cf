"""Full scales of the fixed-point core: from the rig file, else from what a run needs, else defaults."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.rig.file import RigFile, Sensor
from pvid.rig.run import Run

Float = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

DEFAULT_PHI_RANGE = 0.5  # rad
_Y_RANGE_OF_L1 = 0.1
_ACCELERATION_OF_G = 4.0

# Factor on the largest value in a run: the next run of the same rig may be a little larger.
_MARGIN = 1.25
# One sample in a thousand may have any value: beyond _FAULT times this quantile it is a fault of the sensor, which the
# core rejects; the range need not include it.
_ORDINARY = 0.999
_ORDINARY_ACCELERATION = 0.99  # a jump of y by one fault is spread by the smoother
_FAULT = 3.0
_SMOOTHING_S = 0.05  # smoothing window for the pivot's acceleration
_ACCELERATION_MARGIN = 2.0


def with_default_ranges(rig: RigFile) -> Sensor:
    """The sensors of a rig with all ranges; those missing in the file have their default."""
    sensor = rig.sensor
    return replace(
        sensor,
        phi_range=sensor.phi_range or DEFAULT_PHI_RANGE,
        y_range=sensor.y_range or _Y_RANGE_OF_L1 * rig.l1,
        acceleration_range=sensor.acceleration_range or _ACCELERATION_OF_G * rig.nominal.g,
    )


def with_ranges_of(rig: RigFile, run: Run) -> RigFile:
    """The rig with all ranges. A range missing in the file is what the run needs plus a margin; for phi and y at least
    the default."""
    default = with_default_ranges(rig)
    given = rig.sensor
    ranges = {
        "phi_range": given.phi_range or max(default.phi_range, _MARGIN * reach(run.phi, 0.0)),
        "y_range": given.y_range or max(default.y_range, _MARGIN * reach(run.y)),
        "acceleration_range": given.acceleration_range or _acceleration_range(run, default.acceleration_range),
    }
    return replace(rig, sensor=replace(default, **ranges))


def _acceleration_range(run: Run, default: float) -> float:
    """The range that the run needs [m/s^2], without faults of the sensor; at least the default."""
    return max(default, _ACCELERATION_MARGIN * reach(pivot_acceleration(run), 0.0, _ORDINARY_ACCELERATION))


def middle_of_travel(x: npt.ArrayLike) -> float:
    """Mean of the ends of x [n] without its faults; 0 if x is empty."""
    values = np.asarray(x, np.float64)
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0
    low, high = np.quantile(values, [1.0 - _ORDINARY, _ORDINARY])
    return float(low + high) / 2.0


def reach(x: Float, middle: float | None = None, ordinary: float = _ORDINARY) -> float:
    """Largest distance of x [n] from `middle` (None: the middle of its travel), without its faults."""
    values = x[np.isfinite(x)]
    if not len(values):
        return 0.0
    distance = np.abs(values - (middle_of_travel(values) if middle is None else middle))
    return min(float(distance.max()), _FAULT * float(np.quantile(distance, ordinary)))


def pivot_acceleration(run: Run) -> Float:
    """y'' [n, m/s^2] after a Savitzky-Golay smoother of 50 ms, degree 4."""
    from scipy.signal import savgol_filter  # a quarter of a second, which a float core does not need

    points = max(7, round(_SMOOTHING_S * run.sample_rate)) | 1
    height = _height(run)
    if len(height) < points:
        return np.zeros(0)
    return np.asarray(savgol_filter(height, points, 4, deriv=2, delta=1.0 / run.sample_rate))


def _height(run: Run) -> Float:
    """y from the middle of its travel [n, m], interpolated where samples are missing; empty if there are none."""
    finite, clock = np.isfinite(run.y), np.arange(len(run.y))
    if not finite.any():
        return np.zeros(0)
    return np.interp(clock, clock[finite], run.y[finite] - middle_of_travel(run.y))


@dataclass(frozen=True)
class Beyond:
    """Counts of the samples of a run that the core rejected: `phi` and `y` beyond their ranges. `samples`: all samples
    of the run."""

    phi: int
    y: int
    samples: int

    @property
    def share(self) -> float:
        """The larger count as a share of all samples, 0 to 1."""
        return max(self.phi, self.y) / max(self.samples, 1)

    def words(self, sensor: Sensor) -> str | None:
        """Share of samples beyond each range, one clause for each; None if there are none."""
        parts = [
            f"{_percent(count / max(self.samples, 1))} of the samples are beyond {name} = {value:.3g} {unit}"
            for count, name, value, unit in (
                (self.phi, "phi_range", sensor.phi_range, "rad"),
                (self.y, "y_range", sensor.y_range, "m"),
            )
            if count
        ]
        return " and ".join(parts) or None


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.01 else f"{100 * share:.2g} %"


def beyond_ranges(phi: Int64, y: Int64, phi_max: int, y_max: int) -> Beyond:
    """From sensor counts without offset [n] and full scales [counts]."""
    return Beyond(int((np.abs(phi) > phi_max).sum()), int((np.abs(y) > y_max).sum()), len(phi))
