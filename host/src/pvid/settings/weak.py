"""Tables and settings of the weak form of any compiled mechanism, as in weak.h.

Counts of tables are properties: what C has beside a pointer is the length of the tuple here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Core
from pvid.settings.parts import EstimatorConfig, GateConfig, TrustConfig

Float32 = npt.NDArray[np.float32]
UInt8 = npt.NDArray[np.uint8]

NONE = 255  # PVID_WEAK_NONE: no gain or integrand, it is 1


class Source(IntEnum):
    """Where a signal comes from, PVID_SIGNAL_."""

    SAMPLED = 0  # the sample
    HELD = 1  # of an input that is held from tick to tick: its mean about the tick
    JUMP = 2  # dt/12 times the sample's difference to the one before
    LAST = 3  # the sample before


@dataclass(frozen=True)
class WeakSignal:
    """pvid_weak_signal: `sample` is a place in the argument of step."""

    sample: int
    source: Source


@dataclass(frozen=True)
class WeakJet:
    """pvid_weak_jet: a signal or one of its derivatives."""

    signal: int
    order: int


@dataclass(frozen=True)
class WeakChannel:
    """pvid_weak_channel: gain I^fold[integrand].

    Attributes
    ----------
    gain : place among the gains; NONE: 1 with fold 0, whose sums are known
    integrand : place among the integrands; NONE: 1
    fold : 0, 1, 2
    plain : of an integral: the channel with the same gain and fold 0; else NONE
    ramp : of fold 2: the channel with the same gain and fold 1 of integrand 1; else NONE
    """

    gain: int
    integrand: int = NONE
    fold: int = 0
    plain: int = NONE
    ramp: int = NONE


@dataclass(frozen=True)
class WeakTerm:
    """pvid_weak_term_f32: column += factor D^order[channel]; the column counts in its kind."""

    channel: int
    order: int
    column: int
    factor: np.float32


@dataclass(frozen=True)
class WeakKind:
    """pvid_weak_kind: columns are the regressors of thetas, Y, then nuisances; its terms are first..end - 1."""

    thetas: int
    nuisances: int
    first: int
    end: int

    @property
    def columns(self) -> int:
        """With Y and the nuisances."""
        return self.thetas + 1 + self.nuisances


@dataclass(frozen=True)
class ThetaModel:
    """pvid_model_f32, pvid_model_q31: theta and the pattern of C of all kinds.

    Attributes
    ----------
    n_theta : of all kinds
    positive : of each parameter [n_p]
    c_row, c_column : of each non-zero of C [n_c]
    kind_end : one past the last theta of each kind
    constraints, drifts : how many
    """

    n_theta: int
    positive: tuple[bool, ...]
    c_row: tuple[int, ...]
    c_column: tuple[int, ...]
    kind_end: tuple[int, ...]
    constraints: int = 0
    drifts: int = 0

    @property
    def n_p(self) -> int:
        """Parameters."""
        return len(self.positive)

    @property
    def n_c(self) -> int:
        """Non-zeros of C."""
        return len(self.c_row)

    @property
    def moments(self) -> int:
        """Entries of M on and above the diagonals of its blocks, one a kind."""
        sizes = (end - first for first, end in zip((0, *self.kind_end), self.kind_end, strict=False))
        return sum(n * (n + 1) // 2 for n in sizes)


@dataclass(frozen=True, eq=False)
class WeakModel:
    """pvid_weak_model_f32: the same for every rig.

    Attributes
    ----------
    name : of the mechanism, as in C
    sample_names, jet_names, run_names, sign_names, gain_names, integrand_names : what each place is, in words
    signal, jet, channel, term, kind : tables
    model : theta and C of all kinds
    """

    name: str
    sample_names: tuple[str, ...]
    jet_names: tuple[str, ...]
    run_names: tuple[str, ...]
    sign_names: tuple[str, ...]
    gain_names: tuple[str, ...]
    integrand_names: tuple[str, ...]
    signal: tuple[WeakSignal, ...]
    jet: tuple[WeakJet, ...]
    channel: tuple[WeakChannel, ...]
    term: tuple[WeakTerm, ...]
    kind: tuple[WeakKind, ...]
    model: ThetaModel

    @property
    def samples(self) -> int:
        """Entries of the argument of step."""
        return len(self.sample_names)

    @property
    def signals(self) -> int:
        """With those that are made of samples."""
        return len(self.signal)

    @property
    def plain(self) -> bool:
        """Whether the signals are the samples, in their order."""
        return self.signal == tuple(WeakSignal(place, Source.SAMPLED) for place in range(self.samples))

    @property
    def jets(self) -> int:
        """Inputs of `prepare`."""
        return len(self.jet)

    @property
    def runs(self) -> int:
        """Integrals since the start of the run."""
        return len(self.run_names)

    @property
    def signs(self) -> int:
        """Arguments of sgn."""
        return len(self.sign_names)

    @property
    def gains(self) -> int:
        """First results of `values`."""
        return len(self.gain_names)

    @property
    def integrands(self) -> int:
        """Further results of `values`."""
        return len(self.integrand_names)

    @property
    def channels(self) -> int:
        """What is summed, and the constant."""
        return len(self.channel)

    @property
    def kinds(self) -> int:
        """Of rows: one for each equation."""
        return len(self.kind)


@dataclass(frozen=True, eq=False)
class WeakFilter:
    """pvid_weak_filter_f32: weights float32 [half] from the centre outwards, per second^order."""

    weights: Float32

    @property
    def half(self) -> int:
        """0: the sample itself."""
        return int(self.weights.size)


@dataclass(frozen=True)
class WeakNoise:
    """pvid_weak_noise_f32: D_h of a kind += factor theta_a theta_b omega_h^(2 power), theta of Y is -1."""

    kind: int
    power: int
    a: int
    b: int
    factor: np.float32


@dataclass(frozen=True, eq=False)
class WeakDesign32:
    """pvid_weak_design_f32: tables for a rig.

    Attributes
    ----------
    model : of the mechanism
    functions : K
    power : n of sin^n
    decimation : D, ticks a step
    hop : steps of half a window, a multiple of 8
    filter : of each jet, at the samples: block sums and compensator in one
    compensator : of each jet, at the steps, behind the block sums; without a decimation the filter
    circle : sin(pi j / hop) [5 hop / 2], a turn and a quarter
    noise : sorted by kind, then by columns
    error_order : of each kind uint8 [kinds]: its own error is that derivative of white noise
    error_variance : least one of that noise at a step [kinds]; residuals raise it
    sign_width : of the soft sign [signs]; 0: the mean of sgn over a step
    overlap : variance inflation by the noise that overlapping windows share
    sign_doubt : a sign whose argument is not larger is in doubt [signs]; None: no check
    """

    model: WeakModel
    functions: int
    power: int
    decimation: int
    hop: int
    filter: tuple[WeakFilter, ...]
    compensator: tuple[WeakFilter, ...]
    circle: Float32
    noise: tuple[WeakNoise, ...]
    error_order: UInt8
    error_variance: Float32
    sign_width: Float32
    overlap: float
    sign_doubt: Float32 | None = None

    @property
    def n_noise(self) -> int:
        """Entries of `noise`."""
        return len(self.noise)

    @property
    def highest(self) -> int:
        """H, the highest harmonic."""
        return self.functions // 2 + self.power // 2

    @property
    def half(self) -> int:
        """The largest half of a filter at the samples [ticks]."""
        return max(one.half for one in self.filter)

    @property
    def half_steps(self) -> int:
        """The largest half of a compensator [steps]."""
        return max(one.half for one in self.compensator)

    def noise_of(self, kind: int) -> tuple[WeakNoise, ...]:
        """Entries of one kind."""
        return tuple(one for one in self.noise if one.kind == kind)

    def with_soft_widths(self, widths: Mapping[str, float]) -> WeakDesign32:
        """With soft signs v / (|v| + width) of some arguments, as in phi_1; the others keep theirs."""
        own = zip(self.model.sign_names, self.sign_width, strict=True)
        return replace(self, sign_width=np.array([widths.get(name, width) for name, width in own], np.float32))


@dataclass(frozen=True, eq=False)
class WeakConfig:
    """pvid_weak_config_f32: settings of the identifier.

    Attributes
    ----------
    sample_rate : ticks per second [Hz]
    design : tables
    estimator : its start, start_sd and bounds have n_p entries; row_sd is 1
    range : window dropped if a sample's absolute value is beyond [samples]; None: no check
    drive_min : window dropped if the standard deviation of a sample is below [samples]; None: no check
    compensation : B gets what the sensors' noise takes from it
    iterations : Gauss-Newton steps in each of the first eight windows; then one
    causes : what the shared errors of trust.h are made of, a line for each parameter; in no struct of C
    """

    sample_rate: float
    design: WeakDesign32
    estimator: EstimatorConfig
    range: Float32 | None = None
    drive_min: Float32 | None = None
    compensation: bool = True
    iterations: int = 2
    trust: TrustConfig = field(default_factory=TrustConfig)
    gate: GateConfig = field(default_factory=GateConfig)
    causes: tuple[str, ...] = ()

    form: ClassVar[str] = "weak"
    core: ClassVar[Core] = "f32"

    @property
    def dt(self) -> float:
        """Time between steps [s]."""
        return self.design.decimation / self.sample_rate

    @property
    def hop_s(self) -> float:
        """From window to window [s]."""
        return self.design.hop * self.dt

    @property
    def ticks_needed(self) -> int:
        """Samples up to the first estimate, at most: one window, the filters, and the half window of processing."""
        design = self.design
        return design.decimation * (2 * design.half_steps + 3 * design.hop + 9) + 3
