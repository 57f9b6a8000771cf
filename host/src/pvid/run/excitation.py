"""How strongly a run's pivot is driven and its angle moves, against the sensors' noise and against gravity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.setup.f32 import NOISE_LSB, nominal_start

Float = npt.NDArray[np.float64]

# A drive below these is weak: 15 s with u at 5 % of w fix w to some 5 % with a 12-bit encoder.
_WEAK_PART = 0.05
_NOISY = 10.0  # least drive of a window in the core, times the noise
# Motion below this many steps of the encoder (rms) shows too little of how it swings.
_STILL_STEPS = 1.5
_BAND = 4.0  # fast modes
_SEGMENT_S = 20.0


@dataclass(frozen=True)
class Excitation:
    """u = y''/l1 within the band of the motion (rms), what the pivot sensor's noise makes of it behind the core's
    filters, and w, all [1/s^2]; the angle's rms about its mean and the encoder's step [rad]; `fading`: its rms in the
    first fifth of the run over that in the last."""

    u: float
    u_noise: float
    w: float
    angle: float
    angle_step: float
    fading: float

    @property
    def weak(self) -> str | None:
        """Why nothing can be seen in the run, as a sentence; None if drive and motion are large enough."""
        return self.weak_motion or self.weak_drive

    @property
    def weak_drive(self) -> str | None:
        """Why the drive is weak, as a sentence; None if it is not."""
        if self.u <= _NOISY * self.u_noise:
            if self.u == 0.0:
                return "the pivot does not move: is y recorded, and the column right?"
            return (
                f"the pivot's acceleration is barely above its sensor's noise (rms of y''/l1 {self.u:.2g} 1/s^2, "
                f"of the noise {self.u_noise:.2g} 1/s^2): drive it harder or faster, or use a finer sensor for y"
            )
        if self.u < _WEAK_PART * self.w:
            return (
                f"the drive is weak: the pivot's acceleration (rms) is {100 * self.u / self.w:.2g} % of gravity, and "
                f"w is seen only through it: drive it harder or faster, to 10 % and more"
            )
        return None

    @property
    def weak_motion(self) -> str | None:
        """Why the motion is too small, as a sentence; None if it is not."""
        if self.angle == 0.0:
            return "phi does not move: is the encoder connected, and the column right?"
        if self.angle < _STILL_STEPS * self.angle_step:
            return (
                f"phi hardly moves: {self.angle / self.angle_step:.1f} steps of the encoder (rms): release the "
                f"pendulum from a larger angle, or use a finer encoder"
            )
        return None


def excitation_of(run: Run, rig: RigFile) -> Excitation:
    """Of a run, with w and the band from the rig file's guess."""
    from scipy.signal import welch  # takes a quarter of a second that a good run need not wait for

    rate, p = run.sample_rate, nominal_start(rig)
    fast = (rig.mechanism.model.modes_hz(p) or (float(np.sqrt(p[0])) / (2 * np.pi),))[-1]
    length = min(len(run.t), max(16, round(_SEGMENT_S * rate)))
    finite = np.isfinite(run.y)
    height = np.where(finite, run.y, run.y[finite].mean() if finite.any() else 0.0)
    frequency, density = welch(height, rate, "hann", length, detrend="linear")
    weight = np.where(frequency <= min(_BAND * fast, 0.4 * rate), (2 * np.pi * frequency) ** 4, 0.0) / rig.l1**2
    power = float((weight * density).sum() * frequency[1])
    noise = (NOISE_LSB * rig.sensor.y_lsb) ** 2 * 2 / rate * float(weight.sum() * frequency[1])
    return Excitation(
        u=float(np.sqrt(max(power - noise, 0.0))),
        u_noise=float(np.sqrt(noise)),
        w=float(p[0]),
        angle=float(run.phi[np.isfinite(run.phi)].std()) if np.isfinite(run.phi).any() else 0.0,
        angle_step=rig.sensor.phi_lsb,
        fading=_fading(run.phi),
    )


def _fading(phi: Float) -> float:
    parts = np.array_split(phi[np.isfinite(phi)], 5)
    first, last = (float(part.std()) if len(part) else 0.0 for part in (parts[0], parts[-1]))
    return first / last if last > 0.0 else 1.0
