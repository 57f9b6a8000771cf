"""Simulated rigs: the two-link pendulum on a driven pivot (theory.md 1 and 6) and its sensors.

The truth is integrated once (DOP853) and cached: many seeds of the sensors' noise cost one integration.
Angles in the state are absolute (from the vertical): ``a1 = phi1``, ``a2 = phi1 + phi``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.models.kapitza import MODEL
from pvid.models.kapitza.physical import linear
from pvid.rig.file import RigFile
from pvid.rig.run import MIN_ROWS, Run

FloatArray = npt.NDArray[np.float64]
Truth = Literal["linear", "full"]

# Local error per step. The error of phi after 40 s of the standard rig stays below 1e-11 rad (see the tests):
# 1e-7 of a 14-bit encoder's LSB.
_RTOL = 1e-12
_ATOL = 1e-14
# The standard rig takes 2300 evaluations of its equations a second, 560 a period of its fastest tone. A motion
# that takes ever more is running away, and would keep the user waiting for ever.
_MAX_EVALUATIONS_PER_S = 50_000
_MAX_EVALUATIONS_PER_PERIOD = 2_000
_RUNAWAY = "The simulated motion grows without bound or turns too fast: choose a weaker drive or other tones."
# Those of a rig file. The mass matrix loses its digits with the square of rho2/l2.
_LEAST_M, _MOST_M = 1e-6, 1e6
_MOST_GRAVITY = 1e3
_LEAST_RATIO = 1e-5

# Dry friction has its full size from some of this rate on [rad/s]: a thousandth of the fastest of the standard rig.
SLIP = 1e-3
_MAX_SAMPLES = 10_000_000  # 10 hours at 278 Hz; beyond, the request is a slip of units


@dataclass(frozen=True)
class Pendulum:
    """Physical parameters of the two-link pendulum (theory.md 1).

    Parameters
    ----------
    l1 : float
        Length of the massless rod 1 [m], > 0.
    l2 : float
        Distance from the joint to body 2's centre of mass [m], > 0.
    rho2 : float
        Radius of gyration of body 2 about its centre of mass [m], > 0.
    g : float
        Part of gravity that lies in the plane of motion, g* [m/s^2], > 0.
    damping1, damping2 : float
        Viscous torque at the pivot and at the joint, per unit of angular rate and of body 2's mass [m^2/s],
        >= 0. The linear parameters do not contain it.
    dry1, dry2 : float
        Dry friction at the pivot and at the joint, per unit of body 2's mass [m^2/s^2], >= 0: the torque turns with the
        sign of the rate, softly within some SLIP. Full equations only.
    slant : float
        Of the pivot's slide against the vertical [rad], within +-pi/2. Full equations only.
    """

    l1: float
    l2: float
    rho2: float
    g: float
    damping1: float = 0.0
    damping2: float = 0.0
    dry1: float = 0.0
    dry2: float = 0.0
    slant: float = 0.0

    def __post_init__(self) -> None:
        for name in ("l1", "l2", "rho2", "g"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise PvidError(f"The pendulum's {name} must be a positive number, not {value:g}.")
        for name in ("damping1", "damping2", "dry1", "dry2"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise PvidError(f"The pendulum's {name} must be zero or a positive number, not {value:g}.")
        if not abs(self.slant) < math.pi / 2:
            raise PvidError(f"The slide's slant must be within +-pi/2 rad, not {self.slant:g}.")

    @property
    def linear(self) -> FloatArray:
        """Parameters p = (w, d1, d2) of the linear model, shape (3,), w in 1/s^2."""
        return linear(self.g, self.l2, self.rho2, self.l1)

    @property
    def truths(self) -> dict[str, float]:
        """Every number that an identification gives, by its name; an encoder without an offset."""
        physical = {name: float(getattr(self, name)) for name in MODEL.physical_names}
        return {**dict(zip(MODEL.mapped_names, self.linear, strict=True)), **physical, MODEL.offset_name: 0.0}

    @classmethod
    def from_linear(cls, p: Sequence[float] | FloatArray, l1: float) -> Pendulum:
        """Pendulum whose linear parameters are ``p`` = (w, d1, d2) for a first rod of length ``l1`` [m].

        Raises
        ------
        PvidError
            When p lies outside the physical region w > 0, d2 > 0, d1 - d2 - 1 > 0.
        """
        w, d1, d2 = (float(value) for value in p)
        if not is_physical((w, d1, d2)):
            raise PvidError(f"No pendulum has w = {w:g}, d1 = {d1:g}, d2 = {d2:g}: w, d2 and d1 - d2 - 1 must be > 0.")
        ratio2 = d1 - d2 - 1.0
        l2 = l1 * ratio2 / d2
        return cls(l1=l1, l2=l2, rho2=l2 / math.sqrt(ratio2), g=w * l1)

    @classmethod
    def nominal(cls, rig: RigFile) -> Pendulum:
        """The one of a rig file's rough guess."""
        return cls(**asdict(rig.nominal), **(rig.mechanism.constants or {}))

    def tilted(self, tilt_rad: float) -> Pendulum:
        """The same pendulum with its plane tilted by ``tilt_rad`` from the vertical: g* = g cos(tilt)."""
        if not abs(tilt_rad) < math.pi / 2:
            raise PvidError(f"The plane's tilt must be within +-pi/2 rad, not {tilt_rad:g}.")
        return replace(self, g=self.g * math.cos(tilt_rad))


def is_physical(p: Sequence[float] | FloatArray) -> bool:
    """Whether ``p`` = (w, d1, d2) lies in the physical region of theory.md 1 (NaN does not)."""
    w, d1, d2 = (float(value) for value in p)
    return math.isfinite(w + d1 + d2) and w > 0 and d2 > 0 and d1 - d2 - 1 > 0


@dataclass(frozen=True)
class Tone:
    """One sine of the pivot's motion: amplitude_m sin(2 pi frequency_hz t + phase_rad)."""

    amplitude_m: float
    frequency_hz: float
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.amplitude_m + self.frequency_hz + self.phase_rad) or self.frequency_hz < 0:
            raise PvidError(
                f"A tone needs finite numbers and a frequency >= 0, not "
                f"{self.amplitude_m:g} m at {self.frequency_hz:g} Hz, {self.phase_rad:g} rad."
            )


# Smoothstep of degree 9, highest power first, and its derivatives 1..4. It runs from 0 to 1 over 0..1; its
# first four derivatives vanish at both ends: exactly, since the coefficients are integers.
_SMOOTHSTEP: tuple[FloatArray, ...] = tuple(
    np.polyder(np.array([70.0, -315.0, 540.0, -420.0, 126.0, 0.0, 0.0, 0.0, 0.0, 0.0]), order) for order in range(5)
)
_ALWAYS = ((-math.inf, math.inf),)


@dataclass(frozen=True)
class Drive:
    """Vertical motion of the pivot y(t): tones, and the intervals during which they are on.

    Outside the intervals the pivot stands at y = 0. At each finite end of an interval the tones' common
    amplitude is ramped, inside the interval, by a smoothstep of degree 9, so that y and its derivatives up to
    the fourth are continuous and `Simulation.exact` holds through the ramps. The tones' phases run on while
    the drive is off.

    Parameters
    ----------
    tones : tuple of Tone
        May be empty: a pivot at rest.
    on : tuple of (start, end) [s]
        In increasing order, apart, each at least two ramps long. Infinite ends have no ramp.
    ramp_s : float
        Duration of a ramp [s], > 0.
    """

    tones: tuple[Tone, ...]
    on: tuple[tuple[float, float], ...] = _ALWAYS
    ramp_s: float = 0.5

    def __post_init__(self) -> None:
        if not (math.isfinite(self.ramp_s) and self.ramp_s > 0):
            raise PvidError(f"The drive's ramp must last a positive time, not {self.ramp_s:g} s.")
        previous = -math.inf
        for start, end in self.on:
            if not (start >= previous and end - start >= 2 * self.ramp_s):
                raise PvidError(
                    f"The drive's interval {start:g} to {end:g} s must follow the one before it "
                    f"and last at least two ramps ({2 * self.ramp_s:g} s)."
                )
            previous = end

    def derivatives(self, t: FloatArray) -> FloatArray:
        """Pivot position and its derivatives of order 0..4 at ``t`` [s]: shape (n, 5), [m/s^order]."""
        tones = np.zeros((t.size, 5))
        for tone in self.tones:
            rate = 2 * math.pi * tone.frequency_hz
            angle = rate * t + tone.phase_rad
            sine, cosine = tone.amplitude_m * np.sin(angle), tone.amplitude_m * np.cos(angle)
            for order, wave in enumerate((sine, cosine, -sine, -cosine, sine)):
                tones[:, order] += rate**order * wave
        if self.on == _ALWAYS:
            return tones
        envelope = np.zeros((t.size, 5))
        for start, end in self.on:
            rise = np.clip((t - start) / self.ramp_s, 0.0, 1.0)
            fall = np.clip((t - (end - self.ramp_s)) / self.ramp_s, 0.0, 1.0)
            for order, step in enumerate(_SMOOTHSTEP):
                envelope[:, order] += (np.polyval(step, rise) - np.polyval(step, fall)) / self.ramp_s**order
        product = np.zeros((t.size, 5))
        for order in range(5):
            for part in range(order + 1):
                product[:, order] += math.comb(order, part) * envelope[:, part] * tones[:, order - part]
        return product


@dataclass(frozen=True)
class Sensors:
    """What the encoder and the pivot sensor do to the truth. The default is exact.

    Parameters
    ----------
    phi_lsb : float
        Encoder resolution [rad]; 0 means an exact encoder (its noise, given in LSB, is then 0 too).
    phi_noise_lsb : float
        Standard deviation of white noise before rounding [LSB].
    phi_zero : float
        The encoder's reading at the equilibrium [rad], added to the measured angle.
    random_offset : bool
        Place the encoder's grid at random, within half an LSB, against the equilibrium (drawn from the seed).
    y_lsb, y_noise_lsb : float
        The same for the pivot sensor [m], [LSB].
    skew_s : float
        The pivot is sampled this much later than the angle [s].
    outlier_fraction, outlier_rad : float
        Share of the angle samples, chosen at random, that are off by +-outlier_rad.
    """

    phi_lsb: float = 0.0
    phi_noise_lsb: float = 0.0
    phi_zero: float = 0.0
    random_offset: bool = False
    y_lsb: float = 0.0
    y_noise_lsb: float = 0.0
    skew_s: float = 0.0
    outlier_fraction: float = 0.0
    outlier_rad: float = 0.0

    def __post_init__(self) -> None:
        for name in ("phi_lsb", "phi_noise_lsb", "y_lsb", "y_noise_lsb"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise PvidError(f"The sensors' {name} must be zero or a positive number, not {value:g}.")
        if not math.isfinite(self.phi_zero + self.skew_s + self.outlier_rad):
            raise PvidError("The sensors' phi_zero, skew_s and outlier_rad must be finite.")
        if not 0 <= self.outlier_fraction <= 1:
            raise PvidError(f"The sensors' outlier_fraction must be in 0..1, not {self.outlier_fraction:g}.")

    @property
    def phi_sd(self) -> float:
        """Standard deviation of an angle's rounding and noise [rad]."""
        return self.phi_lsb * math.sqrt(1 / 12 + self.phi_noise_lsb**2)

    def measure(self, phi: FloatArray, y: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
        """Measured angle [rad] and pivot position [m] from the true ones, both of shape (n,).

        Every random number is drawn whatever the settings, so that one seed gives one noise for all of them.
        """
        random = np.random.default_rng(seed)
        offset = random.uniform(-0.5, 0.5) * self.random_offset
        phi_noise = self.phi_noise_lsb * random.standard_normal(phi.size)
        y_noise = self.y_noise_lsb * random.standard_normal(y.size)
        if self.phi_lsb > 0:
            phi = self.phi_lsb * (np.round(phi / self.phi_lsb + phi_noise + offset) - offset)
        if self.y_lsb > 0:
            y = self.y_lsb * np.round(y / self.y_lsb + y_noise)
        hit = random.random(phi.size) < self.outlier_fraction
        sign = random.choice([-1.0, 1.0], phi.size)
        return phi + self.phi_zero + self.outlier_rad * sign * hit, y.copy()


@dataclass(frozen=True, eq=False)
class Exact:
    """Exact derivatives of a linear truth at the sample times.

    Attributes
    ----------
    phi : ndarray, shape (n, 5)
        Relative angle, derivatives of order 0..4 [rad/s^order].
    u : ndarray, shape (n, 3)
        u = y''/l1 and its derivatives of order 1 and 2 [1/s^(2 + order)].
    """

    phi: FloatArray
    u: FloatArray


@dataclass(frozen=True, eq=False)
class Simulation:
    """A simulated run with its truth.

    Attributes
    ----------
    run : Run
        What the sensors saw.
    pendulum : Pendulum
        The truth.
    p : ndarray, shape (3,)
        The truth's (w, d1, d2).
    state : ndarray, shape (n, 4)
        True phi1, phi1 + phi [rad] and their rates [rad/s]; read-only.
    exact : Exact or None
        Exact derivatives; None for the full truth, which does not obey the linear model.
    """

    run: Run
    pendulum: Pendulum
    p: FloatArray
    state: FloatArray
    exact: Exact | None


STANDARD_PENDULUM = Pendulum(l1=0.3, l2=0.12, rho2=0.08, g=9.5)
STANDARD_DRIVE = (Tone(6e-3, 1.1, 0.3), Tone(5e-3, 2.3, 1.7), Tone(4e-3, 4.1, 4.0))
STANDARD_RELEASE = (0.06, 0.14)


def standard_sensors(bits: int = 14) -> Sensors:
    """Sensors of the standard rig (theory.md 6) with an encoder of ``bits`` bits a turn."""
    return Sensors(phi_lsb=2 * math.pi / 2**bits, phi_noise_lsb=0.5, random_offset=True, y_lsb=5e-6, y_noise_lsb=0.4)


def standard_start(seed: int) -> FloatArray:
    """Start of the estimate: the standard truth times uniform(0.5, 1.5), each of (w, d1, d2); shape (3,).

    Redrawn until physical. Its random stream is not the one of `simulate`, so that one seed can serve both.
    """
    random = np.random.default_rng([seed, 1])
    truth = STANDARD_PENDULUM.linear
    while True:
        start = np.asarray(truth * random.uniform(0.5, 1.5, 3))
        if is_physical(start):
            return start


def simulate(
    pendulum: Pendulum = STANDARD_PENDULUM,
    drive: Drive | Sequence[Tone] = STANDARD_DRIVE,
    sensors: Sensors | None = None,
    sample_rate: float = 1000.0,
    duration: float = 40.0,
    release: tuple[float, float] = STANDARD_RELEASE,
    truth: Truth = "linear",
    seed: int = 0,
) -> Simulation:
    """Simulate a rig; without arguments, the standard rig of theory.md 6.

    Parameters
    ----------
    pendulum : Pendulum
    drive : Drive or sequence of Tone
        Motion of the pivot.
    sensors : Sensors, optional
        Default: `standard_sensors` of 14 bits. ``Sensors()`` is exact.
    sample_rate : float
        [Hz], > 0 and at least twice the highest tone.
    duration : float
        [s]; the run has round(duration sample_rate) samples, the first at t = 0.
    release : (float, float)
        Absolute angles phi1 and phi1 + phi at t = 0 [rad], released at rest.
    truth : {"linear", "full"}
        The linear model (1) of theory.md, or the sin/cos equations of motion.
    seed : int
        Of the sensors' noise, >= 0.

    Raises
    ------
    PvidError
        For a setting that makes no sense, or a motion that grows beyond what can be integrated.
    """
    if not isinstance(drive, Drive):
        drive = Drive(tuple(drive))
    if sensors is None:
        sensors = standard_sensors()
    check_lengths(pendulum)
    if truth == "linear" and (pendulum.dry1 or pendulum.dry2 or pendulum.slant):
        raise PvidError("Dry friction and a slanted slide are in the full equations: choose the truth 'full'.")
    _check_request(drive, sample_rate, duration, release, truth, seed)
    state, exact = _truth(
        pendulum, drive, float(sample_rate), float(duration), (float(release[0]), float(release[1])), truth
    )
    t = _sample_times(sample_rate, duration)
    y = drive.derivatives(t + sensors.skew_s)[:, 0]
    phi_measured, y_measured = sensors.measure(state[:, 1] - state[:, 0], y, seed)
    run = Run(t=t, phi=phi_measured, y=y_measured, sample_rate=float(sample_rate))
    return Simulation(run=run, pendulum=pendulum, p=pendulum.linear, state=state, exact=exact)


def check_lengths(pendulum: Pendulum) -> None:
    """Refuses a pendulum whose equations of motion float64 cannot solve.

    Raises
    ------
    PvidError
        Naming the length.
    """
    for name in ("l1", "l2", "rho2"):
        length = getattr(pendulum, name)
        if not _LEAST_M <= length <= _MOST_M:
            raise PvidError(f"The pendulum's {name} must be from {_LEAST_M:g} to {_MOST_M:g} m, not {length:g}.")
    if pendulum.g > _MOST_GRAVITY:
        raise PvidError(f"The pendulum's g must be up to {_MOST_GRAVITY:g} m/s^2, not {pendulum.g:g}.")
    if pendulum.rho2 < _LEAST_RATIO * pendulum.l2:
        raise PvidError(
            f"The pendulum's rho2 of {pendulum.rho2:g} m is less than {_LEAST_RATIO:g} of its l2 of {pendulum.l2:g} m: "
            f"body 2 would be a point, and its rotation cannot be computed."
        )


def _check_request(
    drive: Drive, sample_rate: float, duration: float, release: tuple[float, float], truth: str, seed: int
) -> None:
    if truth not in ("linear", "full"):
        raise PvidError(f"The truth must be 'linear' or 'full', not {truth!r}.")
    if not (math.isfinite(sample_rate) and sample_rate > 0):
        raise PvidError(f"The sample rate must be a positive number of Hz, not {sample_rate:g}.")
    if not (math.isfinite(duration) and MIN_ROWS <= round(duration * sample_rate) <= _MAX_SAMPLES):
        raise PvidError(
            f"A run of {duration:g} s at {sample_rate:g} Hz must hold {MIN_ROWS} to {_MAX_SAMPLES} samples."
        )
    if not all(math.isfinite(angle) for angle in release):
        raise PvidError("The angles of release must be finite.")
    if seed < 0:
        raise PvidError(f"The seed must be zero or a positive integer, not {seed}.")
    for tone in drive.tones:
        if tone.frequency_hz > sample_rate / 2:
            raise PvidError(f"A tone of {tone.frequency_hz:g} Hz cannot be sampled at {sample_rate:g} Hz.")


def _sample_times(sample_rate: float, duration: float) -> FloatArray:
    # Divided, not multiplied by a rounded period: k/1000 is then the double nearest to the decimal in a file.
    return np.arange(round(duration * sample_rate)) / sample_rate


@lru_cache(maxsize=16)
def _truth(
    pendulum: Pendulum,
    drive: Drive,
    sample_rate: float,
    duration: float,
    release: tuple[float, float],
    truth: Truth,
) -> tuple[FloatArray, Exact | None]:
    """State (n, 4) at the sample times and, for the linear truth, its exact derivatives; all read-only."""
    from scipy.integrate import solve_ivp  # here: half of what any command takes to start

    t = _sample_times(sample_rate, duration)
    equations = _equations_of_motion(pendulum, drive, truth)
    fastest = max((tone.frequency_hz for tone in drive.tones), default=0.0)
    left = math.ceil((_MAX_EVALUATIONS_PER_S + _MAX_EVALUATIONS_PER_PERIOD * fastest) * (1.0 + duration))

    def counted(t: float, x: FloatArray) -> tuple[float, float, float, float]:
        nonlocal left
        left -= 1
        if left < 0 or not math.isfinite(x.sum()):
            raise PvidError(_RUNAWAY)
        return equations(t, x)

    with np.errstate(over="ignore", invalid="ignore"):
        solution = solve_ivp(
            counted,
            (0.0, t[-1]),
            [release[0], release[1], 0.0, 0.0],
            method="DOP853",
            t_eval=t,
            rtol=_RTOL,
            atol=_ATOL,
            # No step may leap over a ramp unseen.
            max_step=math.inf if drive.on == _ALWAYS else drive.ramp_s / 2,
        )
    if not solution.success:  # its y may be an empty list then
        raise PvidError(_RUNAWAY)
    state = np.ascontiguousarray(solution.y.T)
    if not np.isfinite(state).all():
        raise PvidError(_RUNAWAY)
    state.setflags(write=False)
    if truth == "full":
        return state, None
    exact = _exact_derivatives(pendulum, state, drive.derivatives(t))
    exact.phi.setflags(write=False)
    exact.u.setflags(write=False)
    return state, exact


def _pivot_acceleration(drive: Drive) -> Callable[[float], float]:
    """y''(t) [m/s^2] of ``drive.derivatives``, ten times as fast for one instant at a time."""
    tones = [(tone.amplitude_m, 2 * math.pi * tone.frequency_hz, tone.phase_rad) for tone in drive.tones]
    always = drive.on == _ALWAYS
    accelerations = [(amplitude * rate * rate, rate, phase) for amplitude, rate, phase in tones]
    steps = [step.tolist() for step in _SMOOTHSTEP[:3]]

    def steady(t: float) -> float:
        total = 0.0
        for amplitude, rate, phase in accelerations:
            total -= amplitude * math.sin(rate * t + phase)
        return total

    def switched(t: float) -> float:
        envelope = [0.0, 0.0, 0.0]
        for start, end in drive.on:
            rise = min(max((t - start) / drive.ramp_s, 0.0), 1.0)
            fall = min(max((t - (end - drive.ramp_s)) / drive.ramp_s, 0.0), 1.0)
            for order, step in enumerate(steps):
                envelope[order] += (_horner(step, rise) - _horner(step, fall)) / drive.ramp_s**order
        position = sum(amplitude * math.sin(rate * t + phase) for amplitude, rate, phase in tones)
        speed = sum(amplitude * rate * math.cos(rate * t + phase) for amplitude, rate, phase in tones)
        return envelope[0] * steady(t) + 2 * envelope[1] * speed + envelope[2] * position

    return steady if always else switched


def _horner(coefficients: list[float], x: float) -> float:
    value = 0.0
    for coefficient in coefficients:
        value = value * x + coefficient
    return value


def _equations_of_motion(
    pendulum: Pendulum, drive: Drive, truth: Truth
) -> Callable[[float, FloatArray], tuple[float, float, float, float]]:
    """Right-hand side for the state (a1, a2, a1', a2'), per unit of body 2's mass."""
    l1, l2 = pendulum.l1, pendulum.l2
    c1, c2 = pendulum.damping1, pendulum.damping2
    m11, m22 = l1 * l1, l2 * l2 + pendulum.rho2**2
    rough = pendulum.dry1 > 0 or pendulum.dry2 > 0 or pendulum.slant != 0
    up, across = math.cos(pendulum.slant), math.sin(pendulum.slant)
    acceleration = _pivot_acceleration(drive)

    def linear(t: float, x: FloatArray) -> tuple[float, float, float, float]:
        a1, a2, v1, v2 = x.tolist()
        gravity = pendulum.g + acceleration(t)
        torque1 = -gravity * l1 * a1 - c1 * v1 + c2 * (v2 - v1)
        torque2 = -gravity * l2 * a2 - c2 * (v2 - v1)
        m12 = l1 * l2
        det = m11 * m22 - m12 * m12
        return v1, v2, (m22 * torque1 - m12 * torque2) / det, (m11 * torque2 - m12 * torque1) / det

    def full(t: float, x: FloatArray) -> tuple[float, float, float, float]:
        a1, a2, v1, v2 = x.tolist()
        along = acceleration(t)
        gravity = pendulum.g + along * up
        centrifugal = l1 * l2 * math.sin(a1 - a2)
        torque1 = -centrifugal * v2 * v2 - gravity * l1 * math.sin(a1) - c1 * v1 + c2 * (v2 - v1)
        torque2 = centrifugal * v1 * v1 - gravity * l2 * math.sin(a2) - c2 * (v2 - v1)
        if rough:
            aside, joint = along * across, pendulum.dry2 * math.tanh((v2 - v1) / SLIP)
            torque1 -= aside * l1 * math.cos(a1) + pendulum.dry1 * math.tanh(v1 / SLIP) - joint
            torque2 -= aside * l2 * math.cos(a2) + joint
        m12 = l1 * l2 * math.cos(a1 - a2)
        det = m11 * m22 - m12 * m12
        return v1, v2, (m22 * torque1 - m12 * torque2) / det, (m11 * torque2 - m12 * torque1) / det

    return linear if truth == "linear" else full


def _exact_derivatives(pendulum: Pendulum, state: FloatArray, pivot: FloatArray) -> Exact:
    """Derivatives of order 0..4, from the state and y^(0..4).

    M a'' + D a' + (g + y'') K a = 0 is differentiated by Leibniz's rule.
    """
    l1, l2 = pendulum.l1, pendulum.l2
    c1, c2 = pendulum.damping1, pendulum.damping2
    inverse_mass = np.linalg.inv(np.array([[l1 * l1, l1 * l2], [l1 * l2, l2 * l2 + pendulum.rho2**2]]))
    damping = np.array([[c1 + c2, -c2], [-c2, c2]])
    gravity = pivot[:, 2:5].copy()
    gravity[:, 0] += pendulum.g
    angles = [state[:, 0:2], state[:, 2:4]]
    for order in range(3):
        torque = -angles[order + 1] @ damping
        for part in range(order + 1):
            factor = math.comb(order, part) * gravity[:, part, np.newaxis]
            torque -= factor * angles[order - part] * np.array([l1, l2])
        angles.append(torque @ inverse_mass)
    phi = np.stack([angle[:, 1] - angle[:, 0] for angle in angles], axis=1)
    return Exact(phi=phi, u=pivot[:, 2:5] / l1)
