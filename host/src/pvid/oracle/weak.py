"""The weak form in float64, as in theory.md 5; read both together.

Neither fast nor bit-exact: the reference for twin and C core, and the place to try new terms.

    samples -> front_end -> frames -> columns -> rows (whitened at p, no a and b) -> WeakOracle -> p, s.e.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.weak import WeakDesign
from pvid.oracle.strong import Estimate, kappa_of
from pvid.sim.pendulum import Sensors

Float = npt.NDArray[np.float64]

# Columns of a window: Y, N1..N8, a, b.
Y, N, A, B = 0, slice(1, 9), 9, 10
_COLUMNS = 11

# The full-angle correction leaves out terms of the fourth order: measured bias in w at 0.13 rad 0.02 % and
# growing fast (0.3 % at 0.16 rad).
VALID_ANGLE = 0.2  # rad

# The correction begins after this many windows (at the first one it would diverge), with a step of p and standard
# errors below these, both relative. It ends at four times the latter.
_SETTLED_WINDOWS = 4
_SETTLED_MOVE = 0.02
_SETTLED_ERROR = 0.05
# Then the sums of the windows without correction fade, as those of rows at a poor start do: 0.3^4 = 0.8 % remains.
# Fading waits until the relative standard errors are at most _NEAR.
_FADE = 0.3
_AGEING_WINDOWS = 4
_NEAR = 0.1

_DAMPING_SD = 1e-3  # m^2/s, prior of the damping coefficients
_DAMPING_REACH = 1e-2  # m^2/s, reference of the step limit


# ---- from samples to rows


def front_end(phi: npt.ArrayLike, y: npt.ArrayLike, design: WeakDesign) -> tuple[Float, Float]:
    """Decimated angle [rad] and u = y''/l1 [1/s^2], both [decimated samples].

    Decimated sample m belongs to sample (taps - 1) / 2 + m D.
    """
    angle, height = np.asarray(phi, np.float64), np.asarray(y, np.float64)
    count = (angle.size - design.taps) // design.decimation + 1
    if count < 1:
        raise PvidError(f"{angle.size} samples do not fill the smoothing window of {design.taps}")
    centres = design.delay + design.decimation * np.arange(count)

    def folded(x: Float, weights: Float) -> Float:
        total = np.zeros(count)
        for i, weight in enumerate(weights, start=1):
            total += weight * ((x[centres + i] - x[centres]) + (x[centres - i] - x[centres]))
        return total

    smooth = angle[centres] + folded(angle, design.smooth)
    return smooth, folded(height, design.second) * design.sample_rate**2 / design.l1


def frames(x: Float, design: WeakDesign) -> Float:
    """Half-overlapping windows [windows, W] of decimated samples [n]."""
    if x.size < design.window:
        raise PvidError(
            f"{x.size} decimated samples do not fill one window of {design.window}: record longer or shorten window_s"
        )
    return np.lib.stride_tricks.sliding_window_view(x, design.window)[:: design.hop]


def end_times(windows: int, design: WeakDesign) -> Float:
    """Times [s] of the last sample that each window needs, from the first sample of the run."""
    last = design.taps - 1 + design.decimation * (design.window - 1 + design.hop * np.arange(windows))
    return np.asarray(last / design.sample_rate)


def integrated_once(f: Float, dt: float) -> Float:
    """Integral from the window's start, trapezoid; [..., W]."""
    out = np.empty_like(f)
    out[..., 0] = 0.0
    inner = np.add(f[..., 1:], f[..., :-1], out=out[..., 1:])
    inner /= 2
    np.add.accumulate(inner, axis=-1, out=inner)
    inner *= dt
    return out


def integrated_twice(f: Float, dt: float) -> Float:
    """I2: double integral from the window's start, [..., W].

    The trapezoid rule applied twice is wrong by dt^2/6 f and terms that are linear in time; the latter are of
    the form a + b t and are projected out.
    """
    return integrated_once(integrated_once(f, dt), dt) - dt**2 / 6 * f


def columns(phi: Float, u: Float, design: WeakDesign) -> Float:
    """Columns Y, N1..N8, a, b of windows phi, u [windows, W]: shape [windows, 11, K]."""
    dt, w = design.dt, design.window
    chi, chi2, chi4 = design.chi[:, 0], design.chi[:, 1], design.chi[:, 2]
    t = dt * (np.arange(w) - (w - 1) / 2)
    one = np.ones_like(phi)
    u_phi = u * phi
    return np.stack(
        [
            phi @ chi4,
            -u_phi @ chi2,
            -phi @ chi2,
            -(u * integrated_twice(u_phi, dt)) @ chi2,
            -(u * integrated_twice(phi, dt)) @ chi2 - u_phi @ chi,
            -phi @ chi,
            (u * integrated_twice(u, dt)) @ chi2,
            (u * integrated_twice(one, dt)) @ chi2 + u @ chi,
            one @ chi,
            u @ chi2,
            (u * t) @ chi2,
        ],
        axis=1,
    )


def residual_filters(design: WeakDesign, p: Float) -> Float:
    """chi'''' + d1 w chi'' + d2 w^2 chi [W, K]: filter from the angle's noise to a row's residual, without u."""
    w, d1, d2 = p[:3]
    return np.asarray(design.chi[:, 2] + d1 * w * design.chi[:, 1] + d2 * w**2 * design.chi[:, 0])


def noise_gram(design: WeakDesign, p: Float) -> Float:
    """R0(p) [K, K], from the design's Gram tables: covariance of a window's rows for noise of unit variance."""
    w, d1, d2 = p[:3]
    f2, f0 = d1 * w, d2 * w**2  # factors of chi'' and chi in the filter
    return packed_to_square(np.array([1.0, f2, f0, f2**2, f2 * f0, f0**2]) @ design.gram)


def packed_to_square(packed: Float) -> Float:
    """A symmetric matrix [n, n] from its lower triangle by rows [n (n + 1) / 2]."""
    functions = (math.isqrt(8 * len(packed) + 1) - 1) // 2
    return np.asarray(packed[_places_in_triangle(functions)])


@cache
def _places_in_triangle(n: int) -> npt.NDArray[np.int64]:
    """Place of each entry of a symmetric matrix [n, n] in its packed lower triangle."""
    places = np.zeros((n, n), np.int64)
    rows, columns = np.tril_indices(n)
    places[rows, columns] = places[columns, rows] = np.arange(len(rows))
    return places


def overlap_gram(design: WeakDesign, p: Float) -> Float:
    """R1(p) [K, K]: covariance of a window's rows with those of the next one."""
    filters = residual_filters(design, p)
    return np.asarray(filters[design.hop :].T @ filters[: design.window - design.hop])


def without_directions(x: Float, directions: Float) -> Float:
    """x [n, K] less its components along directions [m, K], by Gram-Schmidt; those of length 0 do nothing."""
    for k in range(len(directions)):
        length = float(np.linalg.norm(directions[k]))
        if length > 0:
            q = directions[k] / length
            directions = directions - np.outer(directions @ q, q)
            x = x - np.outer(x @ q, q)
    return x


# ---- parameters


def theta(p: Float) -> Float:
    """theta(p): 5 entries for p = (w, d1, d2), 8 for (w, d1, d2, c)."""
    w, d1, d2, *offset = p.tolist()  # numbers of Python: a search evaluates this a million times
    first = [d1, d1 * w, d2, d2 * w, d2 * w * w]
    return np.array([*first, *(c * x for c in offset for x in first[2:])])


def jacobian(p: Float) -> Float:
    """C = d theta / d p, [5, 3] or [8, 4]."""
    w, d1, d2, *offset = p.tolist()
    ww = w * w
    if not offset:
        return np.array([[0, 1, 0], [d1, w, 0], [0, 0, 1], [d2, 0, w], [2 * d2 * w, 0, ww]])
    c = offset[0]
    return np.array(
        [
            *([0.0, 1.0, 0.0, 0.0], [d1, w, 0.0, 0.0]),
            *([0.0, 0.0, 1.0, 0.0], [d2, 0.0, w, 0.0], [2 * d2 * w, 0.0, ww, 0.0]),
            *([0.0, 0.0, c, d2], [d2 * c, 0.0, c * w, d2 * w], [2 * d2 * c * w, 0.0, c * ww, d2 * ww]),
        ]
    )


# ---- full angles and damping


def boundary(p: Float, window_columns: Float, known: Float) -> Float:
    """a [rad] and b [rad/s] of one window at p, from its columns; `known` [K] is taken off Y."""
    th = theta(p)
    e = window_columns[Y] - th @ window_columns[1 : 1 + len(th)] - known
    return np.asarray(np.linalg.lstsq(window_columns[[A, B]].T, e, rcond=None)[0])


def _slope(x: Float, dt: float) -> Float:
    """Derivative of a window x [W] by central differences, as np.gradient, in a third of its time."""
    out = np.empty_like(x)
    out[1:-1] = (x[2:] - x[:-2]) / (2.0 * dt)
    out[0], out[-1] = (x[1] - x[0]) / dt, (x[-1] - x[-2]) / dt
    return out


def internal_motion(p: Float, ends: Float, phi: Float, u: Float, design: WeakDesign) -> tuple[Float, Float]:
    """q = phi''/G and q' of one window [W] at p, with `ends` its a and b.

    q = a + b t - d1 phi - d2 I2(G phi); phi as measured, since a has taken in what c does to d1 phi.
    """
    w, d1, d2 = p[:3]
    c = p[3] if len(p) > 3 else 0.0
    g, angle, dt = w + u, phi - c, design.dt
    a, b = ends
    t = dt * (np.arange(design.window) - (design.window - 1) / 2)
    rate = _slope(phi, dt)
    q = a + b * t - d1 * phi - d2 * integrated_twice(g * angle, dt)
    return q, b - d1 * rate - d2 * integrated_once(g * angle, dt)


@dataclass(frozen=True)
class Remainder:
    """Remainder of the linear rows of a window, y [K] and k [2, K]: Y = N^T theta + y + k^T damping."""

    y: Float
    k: Float


# Below this L2 a mechanism is implausible, and its rows are not corrected.
L2_MIN = 0.05


def remainder_of_motion(
    p: Float,
    motion: tuple[Float, Float],
    phi: Float,
    u: Float,
    design: WeakDesign,
    full_angle: bool,
    friction: bool = True,
) -> Remainder:
    """Remainder of the linear rows of one window, with q and q' of `internal_motion` (theory.md 5, (12)); without
    `friction` its columns k are 0.

    With q known, so is the motion: phi1 = q + k phi, k = L2 (1 + L1). The exact equations are

        phi'' = G q + k (e2 - e1) - e1,    q'' = -d1 phi'' - d2 G phi + d2 (e2 - e1)
        e1 = G (a1 - sin a1) + ((1 - cos phi) a2'' + sin phi a2'^2) / L1 - c1 a1' / l1^2 + c2 phi' / l1^2
        e2 = G (a2 - sin a2) + (1 - cos phi) a1'' - sin phi a1'^2 - c2 L1 phi' / l1^2

    with a1 = phi1, a2 = phi1 + phi absolute.
    """
    w, d1, d2 = p[:3]
    c = p[3] if len(p) > 3 else 0.0
    big_l2 = d1 - d2 - 1
    big_l1 = d2 / big_l2
    k, l1, dt = big_l2 * (1 + big_l1), design.l1, design.dt
    g, angle, rate = w + u, phi - c, _slope(phi, dt)
    sine, versine = np.sin(angle), 1 - np.cos(angle)
    chi2 = design.chi[:, 1]
    q, q_rate = motion

    def weakened(e1: Float, e2: Float) -> Float:
        m1, m2 = k * (e2 - e1) - e1, d2 * (e2 - e1)
        return np.asarray((m1 + g * integrated_twice(m2, dt)) @ chi2)

    a1, v1 = q + k * angle, q_rate + k * rate
    a2, v2 = a1 + angle, v1 + rate
    acceleration1 = -g * a1 + big_l2 * g * angle
    acceleration2 = -d2 * g * angle
    y = np.zeros(design.functions)
    if full_angle:
        y = weakened(
            g * (a1 - np.sin(a1)) + (versine * acceleration2 + sine * v2**2) / big_l1,
            g * (a2 - np.sin(a2)) + versine * acceleration1 - sine * v1**2,
        )
    if not friction:
        return Remainder(y, np.zeros((2, design.functions)))
    columns_of_damping = [
        weakened(-v1 / l1**2, np.zeros_like(v1)),
        weakened(rate / l1**2, -big_l1 * rate / l1**2),
    ]
    return Remainder(y, np.stack(columns_of_damping))


def remainder(
    p: Float,
    damping: Float,
    window_columns: Float,
    phi: Float,
    u: Float,
    design: WeakDesign,
    passes: int = 3,
    full_angle: bool = True,
) -> Remainder:
    """Rows of the full-angle remainder and of the two damping columns of one window, at p, by passes as the C core
    makes them.

    Each pass takes the last one's remainder off Y, so that a and b, and with them q, improve.
    """
    out = Remainder(np.zeros(design.functions), np.zeros((2, design.functions)))
    if p[1] - p[2] - 1 <= L2_MIN:
        return out
    for _ in range(passes):
        ends = boundary(p, window_columns, out.y + damping @ out.k)
        out = remainder_of_motion(p, internal_motion(p, ends, phi, u, design), phi, u, design, full_angle)
    return out


# ---- the identifier


@dataclass(frozen=True)
class WeakSettings:
    """Settings of the estimator, as in estimator.h and weak.h.

    Attributes
    ----------
    start : (w, d1, d2), or (w, d1, d2, c) when the encoder's zero is unknown
    row_sd : standard deviation of a row's residual [rad], see `row_sd`
    start_sd : of the start [units of p]; None: half of w, d1, d2, and 0.5 rad
    forgetting_s : time constant [s]; 0: none
    iterations : Gauss-Newton steps a window
    step_limit : largest |dp/p|, of c |dc| / start_sd; the whole step is shortened
    kappa_min : below it no step
    drive_min : rms of u [1/s^2] below which a window is dropped; 0: none is
    full_angle, damping : correct for sines and cosines; estimate the two damping coefficients
    passes : of the correction, per window
    pivot_noise : variance that the pivot sensor's noise gives a row for each (rad/s^2)^2 of mean square phi'' [s^4]
    misfit_max : residual variance of all rows over what the sensors explain beyond which they do not fit
    renewal : the past is aged once p has settled so far, relative, from where rows that do not fit came in; 0: never
    """

    start: Float
    row_sd: float
    start_sd: Float | None = None
    forgetting_s: float = 0.0
    iterations: int = 3
    step_limit: float = 0.3
    kappa_min: float = 5e-6
    drive_min: float = 0.0
    full_angle: bool = False
    damping: bool = False
    passes: int = 3
    pivot_noise: float = 0.0
    misfit_max: float = 4.0
    renewal: float = 0.0

    @property
    def sd(self) -> Float:
        """start_sd, or its default."""
        if self.start_sd is not None:
            return self.start_sd
        return np.array([*(0.5 * self.start[:3]), *([0.5] * (len(self.start) - 3))])


@dataclass(frozen=True)
class WeakIdentified:
    """Outcome of identify_weak, one entry a window.

    Attributes
    ----------
    t : end of each window [s]
    p, se : estimates and standard errors [windows, n_p]; damping coefficients [m^2/s] last, where estimated
    covariance : of the estimates [windows, n_p, n_p]
    kappa : [windows]
    updated : windows that moved p
    corrected : windows that were corrected for full angles or damping
    misfit : energy of a window's residuals against what the sensors' noise predicts; about 1 when the model holds
    chi2 : variance of the residuals of all rows remembered over what the sensors' noise explains; NaN: too few rows
    agrees : whether that is within what chance makes of the limit
    valid : largest angle stayed below VALID_ANGLE; looked at only with the full-angle correction
    last : the last estimate
    sandwich : its standard errors with the measured effect of the overlap in place of the design's bound
    """

    t: Float
    p: Float
    se: Float
    covariance: Float
    kappa: Float
    updated: npt.NDArray[np.bool_]
    corrected: npt.NDArray[np.bool_]
    misfit: Float
    chi2: Float
    agrees: npt.NDArray[np.bool_]
    valid: bool
    last: Estimate
    sandwich: Float


@dataclass
class WeakOracle:
    """The estimator; its input are windows. b = B - M theta and rr = sum (Y - N^T theta)^2 are kept relative to p.

    p contains w, d1, d2, then c if unknown, then the two damping coefficients if estimated.
    """

    design: WeakDesign
    settings: WeakSettings
    corrected: bool = False
    folded: int = 0
    updated: bool = False
    misfit: float = math.nan
    size: float = math.inf
    expected: float = 0.0
    _known: bool = False
    _ageing: int = 0
    _previous: tuple[Float, Float] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self.n_core = len(self.settings.start)
        extra = 2 if self.settings.damping else 0
        self.p = np.append(self.settings.start, [0.0] * extra)
        self.sd = np.append(self.settings.sd, [_DAMPING_SD] * extra)
        n = len(self.theta())
        self.m, self.q = np.zeros((n, n)), np.zeros((n, n))
        self.b, self.rr, self.weight = np.zeros(n), 0.0, 0.0
        self.anchor = self.p.copy()

    def theta(self) -> Float:
        """theta at the present p, damping coefficients last."""
        if len(self.p) == self.n_core:
            return theta(self.p)
        return np.append(theta(self.p[: self.n_core]), self.p[self.n_core :])

    def jacobian(self) -> Float:
        """d theta / d p at the present p."""
        c = jacobian(self.p[: self.n_core])
        extra = len(self.p) - self.n_core
        if not extra:
            return c
        out = np.zeros((c.shape[0] + extra, c.shape[1] + extra))
        out[: c.shape[0], : c.shape[1]] = c
        out[c.shape[0] :, c.shape[1] :] = np.eye(extra)
        return out

    def window(self, window_columns: Float, phi: Float, u: Float) -> None:
        """Processes one window: its columns [11, K] and its samples phi [rad], u [1/s^2], both [W]."""
        self.updated = False
        self.misfit = math.nan
        driven = u[:-1]  # as the core, without the window's last sample
        if self.settings.drive_min > 0 and float(np.var(driven)) < self.settings.drive_min**2:
            self._previous = None
            return
        if self.folded == 0 and self.n_core == 4:
            self.p[3] = float(np.mean(phi[:-1]))
        before = self.p.copy()
        x, inverse_factor = self.rows(window_columns, phi, u)
        self.add(x, inverse_factor)
        explained = self._explained(phi)
        self.expected += (explained - self.expected) * (self.design.functions - 2) / self.weight
        for _ in range(self.settings.iterations):
            self.updated |= self._step()
        e = x[0] - self.theta() @ x[1:]
        self.misfit = float(e @ e) / (self.design.functions - 2) / explained
        self.folded += 1
        self._settle()
        if self.settings.full_angle or self.settings.damping:
            self._switch(before)

    def _explained(self, phi: Float) -> float:
        """Variance of the rows of a window phi [W] by the sensors' noise."""
        lag = self.design.lag
        bend = phi[2 * lag :: lag] - 2 * phi[lag:-lag:lag] + phi[: -2 * lag : lag]
        curvature = float(np.mean(bend**2)) / (lag * self.design.dt) ** 4 if len(bend) else 0.0
        return self.settings.row_sd**2 + self.settings.pivot_noise * curvature

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the residuals."""
        return self.weight - len(self.p)

    @property
    def chi2(self) -> float:
        """Residual variance of all rows over its expectation from the sensors' noise; NaN with too few rows."""
        return max(self.rr, 0.0) / (self.freedom * self.expected) if self.freedom >= 1 else math.nan

    @property
    def agrees(self) -> bool:
        """Whether chi2 is within misfit_max, with three standard deviations of chance."""
        limit = self.settings.misfit_max * (1 + 3 * math.sqrt(2 / max(self.freedom, 1.0)))
        return not self.chi2 > limit

    def _settle(self) -> None:
        """Begins to fade the rows of a poor start if p has settled elsewhere and they do not fit there."""
        estimate = self.assess()
        self._known = bool((estimate.se[:3] <= _NEAR * self.p[:3]).all())
        settled = self.updated and self.size <= _SETTLED_MOVE and self._known and self._ageing == 0
        if not settled or self.settings.renewal == 0:
            return
        moved = np.abs(self.p[:3] / self.anchor[:3] - 1).max() > self.settings.renewal
        if moved and not self.agrees:
            self._ageing = _AGEING_WINDOWS
        if self.agrees or self._ageing > 0:
            self.anchor = self.p.copy()

    def rows(self, window_columns: Float, phi: Float, u: Float) -> tuple[Float, Float]:
        """Rows Y, N.. [1 + n_theta, K] whitened at p, without a and b; and L^-1."""
        core = self.p[: self.n_core]
        inverse_factor = np.linalg.inv(np.linalg.cholesky(noise_gram(self.design, core)))
        x = window_columns[: 1 + len(theta(core))]
        neglected = self._remainder(core, window_columns, phi, u)
        x = np.concatenate([x[:1] - neglected.y, x[1:], neglected.k])
        return without_directions(x @ inverse_factor.T, window_columns[[A, B]] @ inverse_factor.T), inverse_factor

    def _remainder(self, core: Float, window_columns: Float, phi: Float, u: Float) -> Remainder:
        """Remainder of the rows at p; 0 while the correction is off; k has no rows without damping."""
        functions, extra = self.design.functions, len(self.p) - self.n_core
        if not self.corrected:
            return Remainder(np.zeros(functions), np.zeros((extra, functions)))
        damping = self.p[self.n_core :] if extra else np.zeros(2)
        settings = self.settings
        neglected = remainder(core, damping, window_columns, phi, u, self.design, settings.passes, settings.full_angle)
        return Remainder(neglected.y, neglected.k[:extra])

    def add(self, x: Float, inverse_factor: Float) -> None:
        """Adds a window's rows to the sums, after forgetting and fading."""
        hop_s = self.design.hop_s
        keep = math.exp(-hop_s / self.settings.forgetting_s) if self.settings.forgetting_s > 0 else 1.0
        if self._ageing > 0 and self._known:
            keep *= _FADE
            self._ageing -= 1
        y, n = x[0], x[1:]
        e = y - self.theta() @ n
        k = self.design.functions
        self.m = keep * self.m + n @ n.T
        self.b = keep * self.b + n @ e
        self.rr = keep * self.rr + float(e @ e)
        self.weight = keep * self.weight + (k - 2)
        self.q = keep * self.q
        if self._previous is not None:
            last_n, last_factor = self._previous
            shared = last_factor @ overlap_gram(self.design, self.p) @ inverse_factor.T
            cross = last_n @ shared @ n.T
            self.q = self.q + cross + cross.T
        self._previous = n, inverse_factor

    def information(self) -> Float:
        """S = C^T M C."""
        c = self.jacobian()
        return np.asarray(c.T @ self.m @ c)

    def _step(self) -> bool:
        """One Gauss-Newton step; whether p moved."""
        prior = (self.settings.row_sd / self.sd) ** 2
        c = self.jacobian()
        s = c.T @ self.m @ c + np.diag(prior)
        kappa = kappa_of(s[: self.n_core, : self.n_core])
        if kappa < self.settings.kappa_min or (self.settings.kappa_min > 0 and kappa * s[0, 0] < 2 * prior[0]):
            return False
        d = 1 / np.sqrt(np.diag(s))
        dp = d * np.linalg.solve(s * np.outer(d, d), d * (c.T @ self.b))
        reach = self.p.copy()
        reach[3 : self.n_core] = self.sd[3 : self.n_core]
        reach[self.n_core :] = _DAMPING_REACH
        self.size = float(np.max(np.abs(dp) / reach))
        dp *= min(1.0, self.settings.step_limit / max(self.size, 1e-300))
        before = self.theta()
        self.p = self.p + dp
        change = self.theta() - before
        self.rr += float(-2 * change @ self.b + change @ self.m @ change)
        self.b = self.b - self.m @ change
        return True

    def _switch(self, before: Float) -> None:
        """Enables the correction if the estimate has settled; disables it if the standard errors become large."""
        worst = float(np.max(self.assess().se[:3] / self.p[:3])) if self.weight > len(self.p) else math.inf
        moved = float(np.max(np.abs(self.p[:3] / before[:3] - 1)))
        if self.corrected:
            self.corrected = worst <= 4 * _SETTLED_ERROR
        elif self.folded >= _SETTLED_WINDOWS and moved < _SETTLED_MOVE and worst < _SETTLED_ERROR:
            self.corrected = True
            self._ageing = _AGEING_WINDOWS

    def assess(self) -> Estimate:
        """Standard errors by (S / s^2 + 1 / start_sd^2)^-1, s^2 = overlap * rr / (weight - n_p), where rr is at
        least its expectation from the sensors' noise."""
        if self.weight <= len(self.p):
            return Estimate(self.p.copy(), self.sd.copy(), np.diag(self.sd**2), 0.0, 0.0)
        variance = max(self.rr / (self.weight - len(self.p)), self.expected)
        wide = variance * self.design.overlap
        s = self.information()
        covariance = _inverse(s + np.diag(wide / self.sd**2)) * wide
        kappa = kappa_of(s[: self.n_core, : self.n_core])
        return Estimate(self.p.copy(), np.sqrt(np.diag(covariance)), covariance, kappa, math.sqrt(variance))

    def sandwich(self) -> Float:
        """Standard errors [n_p] that count the noise windows share where it was: S^-1 (S + C^T Q C) S^-1."""
        if self.weight <= len(self.p):
            return self.sd.copy()
        variance = max(self.rr, 0.0) / (self.weight - len(self.p))
        c = self.jacobian()
        s = self.information()
        inverse = _inverse(s + np.diag(variance / self.sd**2))
        spread = np.diag(inverse @ (s + c.T @ self.q @ c) @ inverse)
        # Q is itself an estimate: limit the information of overlapping windows to twice as much.
        return np.sqrt(variance * np.maximum(spread, np.diag(inverse) / 4))


def _inverse(s: Float) -> Float:
    d = 1 / np.sqrt(np.diag(s))
    return np.asarray(np.linalg.inv(s * np.outer(d, d)) * np.outer(d, d))


def identify_weak(
    phi: npt.ArrayLike,
    y: npt.ArrayLike,
    design: WeakDesign,
    settings: WeakSettings,
    estimator: type[WeakOracle] | None = None,
) -> WeakIdentified:
    """Identifies a run phi [rad], y [m], both [samples], window by window.

    `estimator` is a subclass of WeakOracle that takes its place.

    Raises
    ------
    PvidError
        When the run does not fill a window, or a sample is not finite.
    """
    if not (np.isfinite(phi).all() and np.isfinite(y).all()):
        raise PvidError("the float64 weak form takes finite samples only")
    smooth, u = front_end(phi, y, design)
    phi_frames, u_frames = frames(smooth, design), frames(u, design)
    oracle = (estimator or WeakOracle)(design, settings)
    count = len(phi_frames)
    history = np.empty((count, len(oracle.p)))
    covariance = np.empty((count, len(oracle.p), len(oracle.p)))
    kappa, misfit, chi2 = np.empty(count), np.empty(count), np.empty(count)
    updated, corrected, agrees = (np.zeros(count, np.bool_) for _ in range(3))
    for k, window_columns in enumerate(columns(phi_frames, u_frames, design)):
        corrected[k] = oracle.corrected
        oracle.window(window_columns, phi_frames[k], u_frames[k])
        estimate = oracle.assess()
        history[k], covariance[k], kappa[k] = estimate.p, estimate.covariance, estimate.kappa
        updated[k], misfit[k], chi2[k], agrees[k] = oracle.updated, oracle.misfit, oracle.chi2, oracle.agrees
    zero = oracle.p[3] if oracle.n_core == 4 else 0.0
    return WeakIdentified(
        t=end_times(count, design),
        p=history,
        se=np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)),
        covariance=covariance,
        kappa=kappa,
        updated=updated,
        corrected=corrected,
        misfit=misfit,
        chi2=chi2,
        agrees=agrees,
        valid=not settings.full_angle or float(np.max(np.abs(smooth - zero))) <= VALID_ANGLE,
        last=oracle.assess(),
        sandwich=oracle.sandwich(),
    )


# ---- noise


def sample_sd(lsb: float, noise_lsb: float) -> float:
    """Standard deviation of a sensor's error: rounding, lsb^2/12, and noise of noise_lsb LSB before it."""
    return lsb * math.sqrt(1 / 12 + noise_lsb**2)


def row_sd(design: WeakDesign, sensors: Sensors) -> float:
    """Standard deviation of a row's residual [rad]: white noise of the angle sensor, through the front end.

    About the samples' own over sqrt(D): the rows look at frequencies that the smoother lets pass, so that
    `WeakDesign.smoothing_gain`, which averages over all frequencies, is too small.
    """
    energy = _energy(residual_filters(design, design.nominal), _taps(design.smooth, 1.0), design.decimation)
    return sample_sd(sensors.phi_lsb, sensors.phi_noise_lsb) * math.sqrt(energy / design.functions)


def _taps(folded: Float, unity: float) -> Float:
    """All taps of a folded symmetric filter whose taps sum to `unity`."""
    return np.concatenate([folded[::-1], [unity - 2 * float(np.sum(folded))], folded])


def _energy(filters: Float, taps: Float, decimation: int) -> float:
    """Sum over filters [W, K] of their squared impulse responses at the full rate, behind the FIR `taps`."""
    stretched = np.zeros(((len(filters) - 1) * decimation + 1, filters.shape[1]))
    stretched[::decimation] = filters
    return float(sum(np.sum(np.convolve(column, taps) ** 2) for column in stretched.T))
