"""What the compiler makes of a mechanism; all that oracle, simulator and printers read."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.chain import Chain
from pvid.model.drifted import Drifted
from pvid.model.signals import Jet
from pvid.settings.forms import FORMS

# order -> psi: the sum of D^order[psi] over the entries; psi holds jets of order 0 (of order 1 or more: a smoothed
# derivative is needed), sgn, Integral and TIME, and no unknown.
Part = Mapping[int, sp.Expr]

_PATIENT_WINDOWS = 100


Edge = Literal["between", "before", "after"]


@dataclass(frozen=True)
class Signal:
    """A recorded quantity.

    Attributes
    ----------
    jet : its symbol; jet.of is its name
    unit : as in "rad/s"; "" for a pure number
    kind : "sensor" has noise; "input" is known exactly
    resolution : of the sensor, in its unit; 0: no rounding
    noise : standard deviation of its white noise, in resolutions (in its unit where resolution is 0)
    reach : largest absolute value
    hold : "zoh": the value set at t_k holds until t_(k+1); "sampled": the value at t_k
    edge : of a sensor that jumps with a held input: its sample is that "before" the jump at its instant or "after" it;
        "between": halfway, or not known
    smooth : what a held input is set to never jumps: the refinement in C may take steps of several samples
    driven : the run sets it (every input; a sensor that measures what a drive imposes, such as a load's current)
    gain_sd : relative standard deviation of its gain; part of the standard errors, because a run seldom shows it
    delay_sd, offset_sd : standard deviations of its delay [s] and offset [unit] in a design that no recording is for;
        None: a tenth of the time between samples; half a sensor's resolution, a thousandth of an input's reach
    neglected : the equations are linearised: their relative error is up to this many times the square of the signal,
        from its mean; part of the standard errors [1/unit^2]
    delay : its samples are taken so much later than those of the others [s]
    given : the rig file states the resolution; else it may be taken from a recording
    """

    jet: Jet
    unit: str
    kind: Literal["sensor", "input"]
    resolution: float = 0.0
    noise: float = 0.5
    reach: float = 1.0
    hold: Literal["zoh", "sampled"] = "sampled"
    driven: bool = False
    gain_sd: float = 0.0
    delay_sd: float | None = None
    offset_sd: float | None = None
    neglected: float = 0.0
    smooth: bool = False
    edge: Edge = "between"
    delay: float = 0.0
    given: bool = False

    @property
    def name(self) -> str:
        """As in files."""
        return str(self.jet.of)

    @property
    def sd(self) -> float:
        """Standard deviation of one sample [unit]: white noise and rounding."""
        if self.kind == "input":
            return 0.0
        return self.resolution * float((1 / 12 + self.noise**2) ** 0.5) if self.resolution else self.noise


@dataclass(frozen=True)
class Unknown:
    """An entry of p.

    Attributes
    ----------
    symbol : in the equations; its name is that of the parameter
    unit : as in "kg*m^2"
    guess : rough value; the start where no other is given
    positive : identified in its logarithm, never crosses 0
    low, high : range of the plausible
    sd : how far off the guess can be [unit]; of positive ones 2 |guess| unless given
    bounds : low and high where the author gave them: the search stays between them
    guess_of : what the guess follows from, in known constants; None: it is a number
    """

    symbol: sp.Symbol
    unit: str
    guess: float
    positive: bool
    low: float
    high: float
    sd: float
    bounds: tuple[float, float] = (-math.inf, math.inf)
    guess_of: sp.Expr | None = None

    @property
    def name(self) -> str:
        """As in files."""
        return str(self.symbol)


@dataclass(frozen=True)
class Known:
    """A constant with a value, and the standard deviation of it [unit], that the rig file may set.

    required : it differs from rig to rig: a recording is identified with the value of its rig file alone
    """

    symbol: sp.Symbol
    unit: str
    value: float
    sd: float = 0.0
    required: bool = False

    @property
    def name(self) -> str:
        """As in files."""
        return str(self.symbol)


@dataclass(frozen=True)
class Output:
    """A physical parameter that follows from p."""

    name: str
    unit: str
    value: sp.Expr


@dataclass(frozen=True)
class Row:
    """One kind of row: sum_j theta_j(p) N_j = Y, each N_j and Y a Part.

    Attributes
    ----------
    name : of the equation
    theta : expressions in p (and knowns)
    regressors : N_j, one for each theta
    known : Y
    nuisances : columns with a free factor in every window
    """

    name: str
    theta: tuple[sp.Expr, ...]
    regressors: tuple[Part, ...]
    known: Part
    nuisances: tuple[Part, ...] = ()

    def with_empty(self, other: Row) -> Row:
        """With the theta of another row that multiply nothing."""
        empty = [one for one, part in zip(other.theta, other.regressors, strict=True) if not part]
        regressors = (*self.regressors, *({} for _ in empty))
        return replace(self, theta=(*self.theta, *empty), regressors=regressors) if empty else self

    @property
    def top(self) -> int:
        """Highest order of derivative that a test function takes."""
        return max(order for part in (*self.regressors, self.known, *self.nuisances) for order in part)


@dataclass(frozen=True)
class Extra:
    """An unknown that the refinement has and the rows have not; it is additive and starts at 0.

    Attributes
    ----------
    symbol : in the equations of the refinement
    unit : as in "1/s"
    sd : how far from 0 it can be [unit]
    optional : the option of the rig file that it belongs to: it is 0 but where that is chosen, or where the refinement
        in float64 asks for it; empty: it is always there
    """

    symbol: sp.Symbol
    unit: str
    sd: float
    optional: str = ""

    @property
    def name(self) -> str:
        """As in files."""
        return str(self.symbol)


@dataclass(frozen=True)
class Refinement:
    """What the refinement has instead of the equations of the rows.

    Attributes
    ----------
    equations : expressions = 0 in jets of coordinates and inputs, p, extras, shapes, knowns; (): those of the rows
    outputs : name of a sensor -> what it measures, in coordinates and parameters; others measure a coordinate
    extras : further unknowns
    shapes : symbols of the equations -> what they are in p; there are as many as unknowns that occur in nothing else
    region : expressions in p that are positive wherever the mechanism is possible
    """

    equations: tuple[sp.Expr, ...] = ()
    outputs: Mapping[str, sp.Expr] = field(default_factory=dict)
    extras: tuple[Extra, ...] = ()
    shapes: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict)
    region: tuple[sp.Expr, ...] = ()


@dataclass(frozen=True)
class Following:
    """How an estimate in C follows a mechanism that changes.

    Attributes
    ----------
    forgetting_s : time constant of forgetting [s]; 0: none
    outlier_gate : windows whose residuals exceed this multiple of the usual are rejected, and before the refinement
        single samples that do; 0: none is
    outlier_patience_s : the gate accepts a changed mechanism after this time [s], 0: never; None: as `patience_s`
    dead_zone : p stays while it is within this many standard errors of the solution of all data; 0: no dead zone
    """

    forgetting_s: float = 0.0
    outlier_gate: float = 4.0
    outlier_patience_s: float | None = None
    dead_zone: float = 0.0

    @property
    def is_usual(self) -> bool:
        """Whether it says nothing of its own."""
        return self == Following()

    def patience_s(self, window_s: float) -> float:
        """Patience of the gate for windows that end every window_s: outlier_patience_s if it is given; otherwise half
        the time constant of forgetting, or without forgetting the time of 100 windows."""
        if self.outlier_patience_s is not None:
            return self.outlier_patience_s
        return FORMS["weak"].patience * self.forgetting_s or _PATIENT_WINDOWS * window_s


@dataclass(frozen=True)
class Together:
    """What a model of several recordings has of its own.

    Attributes
    ----------
    unknowns, outputs : of one recording
    own : of each recording, symbol of an unknown in the rows and equations -> its symbol in p
    constraints : of one recording
    """

    unknowns: tuple[Unknown, ...]
    outputs: tuple[Output, ...]
    own: tuple[Mapping[sp.Symbol, sp.Symbol], ...]
    constraints: tuple[sp.Expr, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Of the own parameters, as of one recording."""
        return tuple(str(one) for one in self.own[0])


@dataclass(frozen=True)
class CompiledModel:
    """A mechanism ready to identify.

    Attributes
    ----------
    name, title : as in commands; in a few words
    signals, unknowns, knowns, outputs : as described
    rows : their kinds, in the order of the equations
    opaque : jet of an auxiliary signal -> the expression that it is computed from: a definition of the description
        (y''/l1, or Integral(i, 1), since the start of the run); in a strong form also sgn(th'), which is differentiated
        there. The rows contain its jets like those of a signal.
    equations : expressions = 0 as the user wrote them (in jets of signals and hidden), for the simulator
    hidden : unmeasured coordinates, and defined integrals, whose rates are among the equations
    refinement : of the second stage
    following : of the rig: how its estimate follows a change
    clock_sd : relative standard deviation of the sample rate; part of the standard errors, as no run shows it
    together : of several recordings with own parameters (pvid.model.together): p has one for each recording, which the
        rows and equations contain as one symbol; None: p is what they contain
    constraints : expressions = 0 in p and known constants
    drifts : directions in which alone p changes in time, each [n_p], in p and known constants
    drift_s : time constant of what the rows tell along them [s]
    drifted : how p drifted in a recording, which its rows are without: p is that of its end; None: not known
    anchors : unknowns of drifts that are in no equation -> standard deviation of their start, all that is known of them
    chain : of a robot, which has no rows and equations: p are its base parameters
    meanings : of parameters, in a few words, for those who read a report
    """

    name: str
    title: str
    signals: tuple[Signal, ...]
    unknowns: tuple[Unknown, ...]
    knowns: tuple[Known, ...]
    outputs: tuple[Output, ...]
    rows: tuple[Row, ...]
    opaque: Mapping[Jet, sp.Expr] = field(default_factory=dict)
    equations: tuple[sp.Expr, ...] = ()
    hidden: tuple[Jet, ...] = ()
    refinement: Refinement = field(default_factory=Refinement)
    following: Following = Following()
    clock_sd: float = 5e-5  # of a quartz, its temperature and ageing included
    together: Together | None = None
    constraints: tuple[sp.Expr, ...] = ()
    drifts: tuple[tuple[sp.Expr, ...], ...] = ()
    drift_s: float = 0.0
    drifted: Drifted | None = None
    anchors: Mapping[sp.Symbol, float] = field(default_factory=dict)
    chain: Chain | None = None
    meanings: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def alone(self) -> CompiledModel:
        """Of one recording."""
        if self.together is None:
            return self
        own = self.together
        return replace(self, unknowns=own.unknowns, outputs=own.outputs, constraints=own.constraints, together=None)

    @cached_property
    def places(self) -> tuple[tuple[int, ...], ...]:
        """Of each recording the entries of p that are its own and the shared ones, in the order of `alone`."""
        of_recordings: tuple[Mapping[sp.Symbol, sp.Symbol], ...] = ({},)
        if self.together is not None:
            of_recordings = self.together.own
        return tuple(
            tuple(self.p.index(own.get(one.symbol, one.symbol)) for one in self.alone.unknowns) for own in of_recordings
        )

    @property
    def drifting(self) -> list[int]:
        """Places in p of what drifts."""
        return [k for k in range(len(self.p)) if any(way[k] != 0 for way in self.drifts)]

    def refuse_drifts(self, what: str) -> None:
        """PvidError where there are any, by what follows none."""
        if self.drifts:
            raise PvidError(
                f"{self.name} has a drift of its unknowns, which {what} does not keep: the weak form in float64 and "
                "float32 does"
            )

    def refuse_constraints(self, what: str) -> None:
        """PvidError where there are any, or drifts, by what keeps neither."""
        self.refuse_drifts(what)
        if self.constraints:
            raise PvidError(
                f"{self.name} has constraints between its unknowns, which {what} does not keep: the weak form in "
                "float64 and float32 does, and `--form strong`"
            )

    def refuse_robot(self, what: str = "this command") -> None:
        """PvidError by what takes no robot."""
        if self.chain is not None:
            in_c = "" if self.chain.free else ", and --core f32 by the C that `pvid model build` prints"
            raise PvidError(
                f"{self.name} is a robot, which {what} does not take: `pvid identify` in float64 does{in_c}"
            )

    @property
    def p(self) -> tuple[sp.Symbol, ...]:
        """Symbols of p."""
        return tuple(one.symbol for one in self.unknowns)

    @property
    def p_names(self) -> tuple[str, ...]:
        """Names of p."""
        return tuple(one.name for one in self.unknowns)

    @property
    def options(self) -> tuple[str, ...]:
        """Of the refinement, that a rig file may choose."""
        return tuple(dict.fromkeys(one.optional for one in self.refinement.extras if one.optional))

    def with_options(self, chosen: Collection[str]) -> CompiledModel:
        """With these options of the refinement."""
        extras = self.refinement.extras
        own = tuple(replace(one, optional="") if one.optional in chosen else one for one in extras)
        return replace(self, refinement=replace(self.refinement, extras=own)) if own != extras else self

    def signal(self, name: str) -> Signal:
        """The one with this name."""
        return next(one for one in self.signals if one.name == name)

    def with_knowns(self, expression: sp.Expr) -> sp.Expr:
        """Values in place of the known constants."""
        return expression.xreplace({one.symbol: sp.Float(one.value) for one in self.knowns})
