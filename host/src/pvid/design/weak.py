"""Design of the weak form's tables: front end, test functions, whitening (theory.md 5, pvid/weak.h).

The test functions are chi_k(x) = (1 - x^2)^exponent P_k(x), x from -1 to 1 over the window, recombined such
that the residual filters

    chi'''' + d1 w chi'' + d2 w^2 chi

are orthonormal (plain sums over the window's samples) at a nominal p. A row's noise then has the variance
of the decimated angle's noise, and rows of one window are independent. At another p the Gram tables restore
this.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
from numpy.polynomial import legendre

from pvid.base.errors import PvidError
from pvid.design.weak_sizing import HOST, Bounds, Sizes, sized, slow_and_fast_hz

Float = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]

# chi'''' must vanish at the window's ends, where the core reads no table: it has a factor
# (1 - x^2)^(exponent - 4).
_MIN_EXPONENT = 5
_MAX_EXPONENT = 12
# Below this the equilibrated Gram matrix's smallest eigenvalue leaves float64 no digits for the whitening.
_MIN_EIGENVALUE = 1e-11

# How the Gram tables combine into R0(p): orders of the derivatives in each of the six, in the core's order.
GRAM_PAIRS: tuple[tuple[tuple[int, int], ...], ...] = (
    ((4, 4),),
    ((4, 2), (2, 4)),
    ((4, 0), (0, 4)),
    ((2, 2),),
    ((2, 0), (0, 2)),
    ((0, 0),),
)


@dataclass(frozen=True, eq=False)
class WeakTables32:
    """The tables as the float32 core takes them: pvid_weak_design_f32, shapes as in `WeakDesign`."""

    taps: int
    decimation: int
    window: int
    functions: int
    smooth: Float32
    second: Float32
    chi: Float32
    gram: Float32
    overlap: float
    lag: int


@dataclass(frozen=True, eq=False)
class WeakDesign:
    """A design in float64; `f32` has its tables in float32.

    Attributes
    ----------
    l1 : length of rod 1 [m]
    sample_rate : [Hz]
    nominal : (w, d1, d2) of the whitening, shape [3]
    taps : length of the front end's filters [samples], odd
    decimation : D, samples per decimated sample
    window : W [decimated samples], odd
    functions : K
    exponent : of (1 - x^2) in the test functions
    smooth, second : folded FIR tables of order 0 and 2 (per sample^2), shape [(taps - 1) / 2]
    chi : chi, chi'' [1/s^2] and chi'''' [1/s^4] at the window's samples, shape [W, 3, K]
    gram : lower triangles, by rows, of the six Gram matrices of GRAM_PAIRS, shape [6, K (K + 1) / 2]; the first holds
        the disturbance's share, too
    overlap : inflation of variances because half-overlapping windows share noise
    """

    l1: float
    sample_rate: float
    nominal: Float
    taps: int
    decimation: int
    window: int
    functions: int
    exponent: int
    smooth: Float
    second: Float
    chi: Float
    gram: Float
    overlap: float

    @property
    def dt(self) -> float:
        """Time between decimated samples [s]."""
        return self.decimation / self.sample_rate

    @property
    def hop(self) -> int:
        """Decimated samples from the start of a window to the start of the next."""
        return (self.window - 1) // 2

    @property
    def window_s(self) -> float:
        """From the first sample of a window to the last [s]."""
        return (self.window - 1) * self.dt

    @property
    def hop_s(self) -> float:
        """From window to window, and from estimate to estimate [s]."""
        return self.hop * self.dt

    @property
    def delay(self) -> int:
        """Samples between a sample and the decimated value that refers to its instant."""
        return (self.taps - 1) // 2

    @property
    def smoothing_gain(self) -> float:
        """Standard deviation of a decimated sample for white noise of 1 on the samples."""
        centre = 1 - 2 * float(np.sum(self.smooth))
        return math.sqrt(2 * float(np.sum(self.smooth**2)) + centre**2)

    @property
    def fast_rad_s(self) -> float:
        """Angular frequency of the fast mode at the nominal p [rad/s]."""
        return 2 * math.pi * slow_and_fast_hz(self.nominal)[1]

    @property
    def lag(self) -> int:
        """Decimated samples in a sixth of the fast mode's period: a second difference that wide is phi'' to a tenth."""
        return min(max(round(2 * math.pi / (6 * self.fast_rad_s * self.dt)), 1), 255)

    def pivot_noise(self, y_sd: float) -> float:
        """Variance that white noise of y_sd [m] on the pivot's samples gives a row, for each (rad/s^2)^2 of phi''^2.

        An error du of u enters a row as sum chi'' q du with q = phi''/w, motion at the fast mode's frequency. What of
        du lies in the rows' band is dy''/l1, so that (chi'' q)'' meets dy; to it comes what decimation folds into
        the band.
        """
        w = self.nominal[0]
        g = self.chi[:, 1]
        slope = np.gradient(g, self.dt, axis=0)
        bend = np.gradient(slope, self.dt, axis=0)
        omega = self.fast_rad_s
        inner = np.sum((bend - omega**2 * g) ** 2 + (2 * omega * slope) ** 2) / self.decimation
        outer = float(np.sum(g**2)) * self._folded_gain(self.band_hz)
        return float((inner + outer) / self.functions * (y_sd / (self.l1 * w)) ** 2)

    @property
    def band_hz(self) -> float:
        """Edge of the band in which a row takes the pivot's noise in, beside motion at the fast mode [Hz]."""
        return self.fast_rad_s / (2 * math.pi) + self.functions / (2 * self.window_s)

    def drive_noise(self, y_sd: float) -> tuple[float, float]:
        """Rms of u [1/s^2] that white noise of y_sd [m] on the pivot's samples makes: in all, and in the rows' band."""
        f, response = self._second_response(4096)
        scale = y_sd / self.l1
        within = f < self.band_hz
        whole, band = float(np.mean(response**2)), float(np.mean(np.where(within, response**2, 0.0)))
        return scale * math.sqrt(whole), scale * math.sqrt(band)

    def _folded_gain(self, band_hz: float) -> float:
        """Variance of y'' [1/s^4] of unit noise of y after decimation, from its density below band_hz."""
        rate = self.sample_rate / self.decimation
        f, response = self._second_response(4096)
        folded = np.abs(f - rate * np.round(f / rate))
        beyond = (folded < band_hz) & (f > rate / 2)
        if not beyond.any():
            return 0.0
        return float(np.mean(response[beyond] ** 2) * (self.decimation - 1) / self.decimation)

    def _second_response(self, points: int) -> tuple[Float, Float]:
        """Frequencies up to half the sample rate [Hz] and the response of `second` there [1/s^2]."""
        return _response(self.second.tobytes(), self.sample_rate, points)

    @property
    def flash_bytes(self) -> int:
        """Size of the float32 tables."""
        return 4 * (self.smooth.size + self.second.size + self.chi.size + self.gram.size)

    @cached_property
    def f32(self) -> WeakTables32:
        """All float32 tables: what native.WeakConfig takes."""
        return WeakTables32(
            self.taps,
            self.decimation,
            self.window,
            self.functions,
            _as_float32(self.smooth),
            _as_float32(self.second),
            _as_float32(self.chi),
            _as_float32(self.gram),
            float(np.float32(self.overlap)),
            self.lag,
        )


@lru_cache(maxsize=64)
def _response(second: bytes, sample_rate: float, points: int) -> tuple[Float, Float]:
    """`WeakDesign._second_response` of a table in float64; kept, since designs with other p have the same table."""
    taps = np.frombuffer(second)
    f = (np.arange(points) + 0.5) * sample_rate / (2 * points)
    phase = 2 * math.pi * np.outer(f, np.arange(1, len(taps) + 1)) / sample_rate
    return _frozen(f), _frozen(np.asarray(2 * (np.cos(phase) - 1) @ taps * sample_rate**2))


def design(
    l1: float,
    sample_rate: float,
    nominal_p: Sequence[float] | Float,
    sizes: Sizes | None = None,
    disturbance: float = 0.0,
    exponent: int = 6,
    bounds: Bounds = HOST,
) -> WeakDesign:
    """Tables for a rig.

    Parameters
    ----------
    l1 : length of rod 1 [m]
    sample_rate : [Hz]
    nominal_p : rough (w [1/s^2], d1, d2); may be wrong by a factor of 2
    sizes : those that are fixed; the others follow from the modes of nominal_p (pvid.design.weak_sizing)
    disturbance : white disturbance of the joints' accelerations [rad/s^2 a decimated sample] over the noise of a
        decimated angle [rad]: rows are weighted by both (`disturbance_gram`)
    exponent : of (1 - x^2) in the test functions, 5..12
    bounds : of the core the tables are for

    Raises
    ------
    PvidError
        Naming the setting that makes no sense or exceeds the core's bounds.
    """
    nominal = _checked_rig(l1, sample_rate, nominal_p)
    sizes = sizes or Sizes()
    return _designed(l1, sample_rate, tuple(nominal.tolist()), sizes, disturbance, exponent, bounds)


@lru_cache(maxsize=16)
def _designed(
    l1: float,
    sample_rate: float,
    nominal_p: tuple[float, ...],
    sizes: Sizes,
    disturbance: float,
    exponent: int,
    bounds: Bounds,
) -> WeakDesign:
    """`design`; the last ones are kept: a run's rows are made, judged and shifted with one design."""
    nominal = np.array(nominal_p)
    if not _MIN_EXPONENT <= exponent <= _MAX_EXPONENT:
        raise PvidError(f"exponent must be {_MIN_EXPONENT} to {_MAX_EXPONENT}, not {exponent}")
    size = sized(nominal, sample_rate, sizes, bounds)
    window, functions, decimation = size.window, size.functions, size.decimation
    dt = decimation / sample_rate
    chi = _whitened(_test_functions(window, functions, exponent, dt), nominal)
    w, d1, d2 = nominal
    residual = chi[:, 2] + d1 * w * chi[:, 1] + d2 * w**2 * chi[:, 0]
    hop = (window - 1) // 2
    # The estimate sums g_m^T e_m over windows m, e_m the K residuals; neighbours share noise, E e_m e_(m+1)^T = R1,
    # the filters' Gram at a lag of one hop. Motion that repeats from window to window (g_m = g_(m+1)) makes the
    # variance grow by 2 g^T R1 g <= 2 lambda_max(R1 + R1^T)/2 |g|^2.
    shared = residual[hop:].T @ residual[: window - hop]
    return WeakDesign(
        l1=float(l1),
        sample_rate=float(sample_rate),
        nominal=_frozen(nominal),
        taps=size.front.taps,
        decimation=decimation,
        window=window,
        functions=functions,
        exponent=exponent,
        smooth=size.front.smooth.weights,
        second=size.front.second.weights,
        chi=_frozen(chi),
        gram=_frozen(_with_disturbance(_gram_tables(chi), nominal, disturbance)),
        overlap=float(1 + 2 * np.linalg.eigvalsh((shared + shared.T) / 2).max()),
    )


def _checked_rig(l1: float, sample_rate: float, nominal_p: Sequence[float] | Float) -> Float:
    """nominal_p as an array [3], once the rig makes sense."""
    for name, value in (("l1", l1), ("sample_rate", sample_rate)):
        if not (math.isfinite(value) and value > 0):
            raise PvidError(f"{name} must be a positive number, not {value:g}")
    nominal = np.array(nominal_p, np.float64)
    if nominal.shape != (3,) or not (np.isfinite(nominal).all() and (nominal > 0).all()):
        raise PvidError(f"nominal_p must be three positive numbers (w, d1, d2), not {nominal_p}")
    return nominal


@lru_cache(maxsize=256)
def _test_functions(window: int, functions: int, exponent: int, dt: float) -> Float:
    """chi, chi'' and chi'''' before whitening, shape [window, 3, functions]; kept, since every mechanism has the same.

    Each is evaluated on one half and mirrored, so that its parity (that of k) holds in every bit.
    """
    half = (window - 1) // 2
    x = np.arange(half + 1) / half
    bell = legendre.legpow(np.array([2 / 3, 0.0, -2 / 3]), exponent)  # 1 - x^2 = 2/3 (P_0 - P_2)
    chi = np.empty((window, 3, functions))
    for k in range(functions):
        polynomial = legendre.legmul(bell, np.eye(functions)[k])
        for place, order in enumerate((0, 2, 4)):
            right = legendre.legval(x, legendre.legder(polynomial, order)) / (half * dt) ** order
            right[-1] = 0.0
            if k % 2:
                right[0] = 0.0
            chi[half:, place, k] = right
            chi[half::-1, place, k] = -right if k % 2 else right
    _as_integral(chi[:, 2])
    return _frozen(chi)


# Gregory's end corrections of the trapezoid rule: what the differences of order 1, 2, .. at an end are multiplied by.
_GREGORY = (1 / 12, 1 / 24, 19 / 720, 3 / 160, 863 / 60480, 275 / 24192, 33953 / 3628800)


def _as_integral(chi4: Float) -> None:
    """Weights the ends of chi'''' [W, K] such that plain sums with it do what its integrals do.

    It vanishes there only as (1 - x^2)^(exponent - 4): unweighted sums err by some millionths, and with an encoder's
    zero of 0.1 rad that is as much as a row's noise. Seven differences leave a fiftieth of that, and nothing that
    depends on the zero.
    """
    weights = np.ones(len(chi4))
    for order, factor in enumerate(_GREGORY, 1):
        for j in range(order + 1):
            weights[[j, -1 - j]] -= factor * (-1) ** j * math.comb(order, j)
    chi4 *= weights[:, None]


def _whitened(chi: Float, p: Float) -> Float:
    """The functions recombined, within each parity, such that their residual filters at p are orthonormal.

    By the Cholesky factor of their Gram matrix (diagonally equilibrated): the result has no free signs, so
    that every machine makes the same tables.
    """
    w, d1, d2 = p
    residual = chi[:, 2] + d1 * w * chi[:, 1] + d2 * w**2 * chi[:, 0]
    out = np.empty_like(chi)
    for parity in (0, 1):
        mine = slice(parity, None, 2)
        gram = residual[:, mine].T @ residual[:, mine]
        scale = 1 / np.sqrt(np.diag(gram))
        gram *= np.outer(scale, scale)
        if not np.isfinite(gram).all() or np.linalg.eigvalsh(gram)[0] < _MIN_EIGENVALUE:
            raise PvidError(
                f"{chi.shape[2]} test functions are not independent on {chi.shape[0]} decimated samples: "
                f"choose fewer functions or a smaller decimation"
            )
        factor = np.linalg.cholesky(gram)
        mixing = np.linalg.solve(factor, np.diag(scale))
        out[:, :, mine] = chi[:, :, mine] @ mixing.T
    return out


def _gram_tables(chi: Float) -> Float:
    """The six packed lower triangles of GRAM_PAIRS; exactly zero between functions of opposite parity."""
    functions = chi.shape[2]
    lower = np.tril_indices(functions)
    opposite = (lower[0] + lower[1]) % 2 == 1
    tables = []
    for pairs in GRAM_PAIRS:
        packed = sum((chi[:, i // 2].T @ chi[:, j // 2] for i, j in pairs), np.zeros((functions, functions)))[lower]
        packed[opposite] = 0.0
        tables.append(packed)
    return np.stack(tables)


def disturbance_gram(gram: Float, p: Float) -> Float:
    """Covariance of a window's rows, packed, for white disturbances of 1 of both joints' angular accelerations.

    With e1 and e2 the disturbances, phi'' = G q + k e2 - (k + 1) e1, k = L2 (1 + L1) = d1 - 1, and
    q'' = -d1 phi'' - d2 G phi + d2 (e2 - e1): a row takes chi'' times the first and, but for u, w chi times the second.
    """
    w, d1, d2 = p[:3]
    k = d1 - 1
    of_22, of_20, of_00 = gram[3], gram[4], gram[5]
    return np.asarray((k**2 + (k + 1) ** 2) * of_22 + d2 * (2 * k + 1) * w * of_20 + 2 * (d2 * w) ** 2 * of_00)


def _with_disturbance(gram: Float, nominal: Float, disturbance: float) -> Float:
    """The tables with the disturbance's share in the first, whose coefficient is 1 at every p."""
    if disturbance > 0:
        gram[0] += disturbance**2 * disturbance_gram(gram, nominal)
    return gram


def _frozen(array: Float) -> Float:
    array.setflags(write=False)
    return array


def _as_float32(array: Float) -> Float32:
    out = np.ascontiguousarray(array, np.float32)
    out.setflags(write=False)
    return out
