"""Tables of the fixed-point weak form of any compiled mechanism, as in weak_q31.h."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.q31 import EstimatorConfigQ31, GateConfigQ31, TrustConfigQ31
from pvid.settings.weak import WeakChannel, WeakJet, WeakKind, WeakSignal

Int32 = npt.NDArray[np.int32]


@dataclass(frozen=True)
class WeakTermQ31:
    """pvid_weak_term_q31: column += factor D^order[channel]; the column counts in its kind."""

    channel: int
    order: int
    column: int


@dataclass(frozen=True, eq=False)
class WeakModelQ31:
    """pvid_weak_model_q31: the same for every rig with these formats.

    Attributes
    ----------
    samples, gains, integrands, runs, signs : how many
    signal, jet, channel, term, kind : tables
    """

    samples: int
    runs: int
    signs: int
    gains: int
    integrands: int
    signal: tuple[WeakSignal, ...]
    jet: tuple[WeakJet, ...]
    channel: tuple[WeakChannel, ...]
    term: tuple[WeakTermQ31, ...]
    kind: tuple[WeakKind, ...]


@dataclass(frozen=True)
class Rescale:
    """pvid_rescale_q31: (x 2^-down) multiplier 2^-shift."""

    down: int
    shift: int
    multiplier: int


@dataclass(frozen=True, eq=False)
class WeakFilterQ31:
    """pvid_weak_filter_q31.

    Attributes
    ----------
    half : steps to either side; 0: the signal itself
    down : shift of the sum
    weights : int32 within 2^30: of order 0 that of the signal itself, else 0; then outwards [half + 1]
    """

    half: int
    down: int
    weights: Int32


@dataclass(frozen=True)
class WeakFormatQ31:
    """pvid_weak_format_q31: shifts of a channel."""

    value: int
    lift: int
    own: int
    plain: int = 0
    ramp: int = 0


@dataclass(frozen=True)
class WeakNoiseQ31:
    """pvid_weak_noise_q31: D_h of a kind += W_h factor theta_a theta_b h^(2 power), theta of Y is -1.

    factor : (m, e)
    """

    kind: int
    power: int
    a: int
    b: int
    factor: tuple[int, int]


@dataclass(frozen=True, eq=False)
class WeakDesignQ31:
    """pvid_weak_design_q31: tables and formats for a rig.

    Attributes
    ----------
    model : of the mechanism
    functions : K
    power : n of sin^n
    decimation : D, ticks a step
    hop : steps of half a window, a multiple of 4
    sum_shift : of four steps' products 2^-14 (fine: 2^-22) before they are added
    full_scale : of the counts about their offsets [samples]
    down : shift of the block sums of each signal to 28 bits
    filter : of each jet, at the steps: its compensator
    run : from twice the sum over the steps to the input of `values` [runs]
    sign_width : of the soft sign, in the format of its argument [signs]; 0: the mean of sgn over a step
    integral : shifts (down, twice) of each integrand
    format : of each channel
    fine : the cosine has 24 bits; else 16
    circle : int32 cos(pi j / hop) times its first entry [2 hop + 3 hop/2 + 3 H]
    factor : of each term (m, e), of h^order times a unit of S_h
    noise : sorted by kind, then power
    error_order : of each kind: its own error is that derivative of white noise
    error_variance : least one of that noise at a step, of h^(2 order) (m, e) [kinds]; residuals raise it
    units : value of one unit of S_h of each channel [channels]
    margins : for each quantity the bits that its largest value leaves free
    """

    model: WeakModelQ31
    functions: int
    power: int
    decimation: int
    hop: int
    sum_shift: int
    full_scale: tuple[int, ...]
    down: tuple[int, ...]
    filter: tuple[WeakFilterQ31, ...]
    run: tuple[Rescale, ...]
    sign_width: tuple[int, ...]
    integral: tuple[tuple[int, int], ...]
    format: tuple[WeakFormatQ31, ...]
    fine: bool
    circle: Int32
    factor: tuple[tuple[int, int], ...]
    noise: tuple[WeakNoiseQ31, ...]
    error_order: tuple[int, ...]
    error_variance: tuple[tuple[int, int], ...]
    units: tuple[float, ...]
    margins: Mapping[str, float]

    @property
    def highest(self) -> int:
        """H, the highest harmonic."""
        return self.functions // 2 + self.power // 2

    @property
    def half(self) -> int:
        """The largest half of a compensator [steps]."""
        return max(one.half for one in self.filter)

    @property
    def parts(self) -> int:
        """Of the sums of a window, K + n."""
        return self.functions + self.power

    @property
    def ticks_needed(self) -> int:
        """Samples up to the first estimate, at most: as in float32."""
        return self.decimation * (2 * self.half + 3 * self.hop + 9) + 3

    @property
    def powers(self) -> int:
        """Of h^2 in the noise."""
        return 1 + max((*(one.power for one in self.noise), *self.error_order), default=0)


@dataclass(frozen=True, eq=False)
class WeakConfigQ31:
    """pvid_weak_config_q31: settings of the identifier.

    Attributes
    ----------
    design : tables
    estimator : rows are in standard deviations, row_sd 2^(8 + y_bits)
    offset : reading of each sensor at 0 [counts]
    drive_min : window dropped if the standard deviation of a sample is below [counts]; None: no check
    compensation : b gets what the sensors' noise takes from it
    iterations : Gauss-Newton steps in each of the first eight windows; then one
    causes : as of WeakConfig
    """

    design: WeakDesignQ31
    estimator: EstimatorConfigQ31
    offset: tuple[int, ...]
    drive_min: tuple[int, ...] | None = None
    compensation: bool = True
    iterations: int = 2
    trust: TrustConfigQ31 = TrustConfigQ31()
    gate: GateConfigQ31 = GateConfigQ31()
    causes: tuple[str, ...] = ()
