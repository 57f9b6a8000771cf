"""The fixed-point weak form of a model: formats from the reach of each jet and the bounds of p, and their twins."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen import c_functions
from pvid.codegen.fixed_model import symmetric
from pvid.codegen.formats import FixedProgram, Interval, bits_of, bounds_of, fixed
from pvid.codegen.functions import Function, ModelFunctions
from pvid.codegen.weak import WeakFunctions, theta_model
from pvid.design.weak_q31 import Formats
from pvid.model.compiled import CompiledModel
from pvid.settings.weak import ThetaModel
from pvid.settings.weak_q31 import WeakConfigQ31, WeakModelQ31, WeakTermQ31

_BITS = 58  # of theta and of C: they fit 2^60
_FORMAT_MAX = 200


@dataclass(frozen=True)
class JetReaches:
    """What the description does not tell.

    Attributes
    ----------
    bandwidth_hz : of the signals: the nth derivative reaches (2 pi bandwidth)^n times the signal [Hz]
    run_s : longest run, for integrals since its start [s]
    of : a jet's name, as in phi_1 -> its largest absolute value, in place of the rule
    """

    bandwidth_hz: float = 10.0
    run_s: float = 3600.0
    of: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class FixedWeak:
    """Fixed-point functions of the weak identifier.

    Attributes
    ----------
    functions : what is generated
    reaches : largest value of each jet
    run_s : longest run [s]
    prepare : None where there are neither runs nor signs
    values : of jets, runs and signs
    prepare_limits, values_limits : largest integer of each input
    model : tables
    formats : for the design
    """

    functions: WeakFunctions
    reaches: tuple[float, ...]
    run_s: float
    prepare: FixedProgram | None
    values: FixedProgram
    prepare_limits: tuple[int, ...]
    values_limits: tuple[int, ...]
    model: WeakModelQ31
    formats: Formats


def fixed_weak(made: WeakFunctions, given: JetReaches | None = None) -> FixedWeak:
    """Formats of the functions of a model.

    Raises PvidError where fixed point cannot compute a function, with the quantity.
    """
    made.model.refuse_constraints("fixed point")
    chosen = given or JetReaches()
    name = made.name
    reaches = _reaches(made, chosen)
    bounds = [symmetric(one) for one in reaches]
    runs, signs = len(made.run_names), len(made.sign_names)
    prepared = fixed(made.prepare.program, bounds, f"{name}, prepare") if runs + signs else None
    rates = [prepared.bounds[place] for place in prepared.program.results[:runs]] if prepared else []
    run_reach = [max(map(abs, one)) * chosen.run_s for one in rates]
    if prepared:
        _require(prepared, [*made.run_names, *made.sign_names], name)
    inputs = [*bounds, *(symmetric(one) for one in run_reach), *[(-1.0, 1.0)] * signs]
    values = fixed(made.values.program, inputs, f"{name}, values")
    _require(values, [*made.gain_names, *made.integrand_names], name)
    prepare_bits = prepared.result_bits if prepared else ()
    gains = len(made.gain_names)
    formats = Formats(
        jets=tuple(map(bits_of, bounds)),
        runs=tuple(bits_of(symmetric(one)) for one in run_reach),
        run_reach=tuple(run_reach),
        rates=prepare_bits[:runs],
        arguments=prepare_bits[runs:],
        gains=values.result_bits[:gains],
        integrands=values.result_bits[gains:],
        gain_most=_most(values)[:gains],
        integrand_most=_most(values)[gains:],
    )
    limits = limits_of(inputs)
    return FixedWeak(
        functions=made,
        reaches=tuple(reaches),
        run_s=chosen.run_s,
        prepare=prepared,
        values=values,
        prepare_limits=limits[: len(bounds)],
        values_limits=limits,
        model=_model(made),
        formats=formats,
    )


def _reaches(made: WeakFunctions, given: JetReaches) -> list[float]:
    known = {one.name: one for one in made.model.signals}
    for name, reach in given.of.items():
        if name not in made.jet_names:
            raise PvidError(f"{made.name} has no jet {name}: its jets are {', '.join(made.jet_names)}")
        if not 0 < reach < math.inf:
            raise PvidError(f"the reach of {name} must be positive, not {reach}")
    found = []
    for name, jet in zip(made.jet_names, made.jet, strict=True):
        signal = known[made.signal_names[jet.signal]]
        found.append(given.of.get(name, signal.reach * (2 * math.pi * given.bandwidth_hz) ** jet.order))
    return found


def _require(made: FixedProgram, names: Sequence[str], model: str) -> None:
    """Every result has a bit after the point that counts."""
    for place, name in zip(made.program.results, names, strict=True):
        if max(map(abs, made.bounds[place])) * 2.0 ** made.bits[place] < 2**8:
            raise PvidError(f"{model}: {name} loses its digits in fixed point, beside a larger value it is added to")


def _most(made: FixedProgram) -> tuple[int, ...]:
    """Largest integer of each result, with room for its rounding: an operation is off by half a unit or so."""
    room = len(made.program.values) + 1
    return tuple(
        math.ceil(max(map(abs, made.bounds[place])) * 2.0 ** made.bits[place]) + room for place in made.program.results
    )


def limits_of(bounds: Sequence[Interval]) -> tuple[int, ...]:
    """Largest integer of each input within these bounds, in its format."""
    return tuple(math.floor(max(map(abs, one)) * 2.0 ** bits_of(one)) for one in bounds)


def _model(made: WeakFunctions) -> WeakModelQ31:
    return WeakModelQ31(
        samples=len(made.samples),
        runs=len(made.run_names),
        signs=len(made.sign_names),
        gains=len(made.gain_names),
        integrands=len(made.integrand_names),
        signal=made.signal,
        jet=made.jet,
        channel=made.channel,
        term=tuple(WeakTermQ31(one.channel, one.order, one.column) for one in made.term),
        kind=made.kind,
    )


@dataclass(frozen=True)
class ParametersQ31:
    """Formats and functions of p.

    Attributes
    ----------
    p_bits, theta_bits, c_bits : formats
    model : theta and the pattern of C
    functions : what is generated
    """

    p_bits: tuple[int, ...]
    theta_bits: tuple[int, ...]
    c_bits: tuple[int, ...]
    model: ThetaModel
    functions: ModelFunctions


def fixed_parameters(functions: ModelFunctions, bounds: Sequence[Interval]) -> ParametersQ31:
    """Formats from the bounds of p.

    Raises PvidError where theta or C may be infinite within the bounds, with its name.
    """
    p_bits = tuple(bits_of(one) for one in bounds)
    theta_bits = _bits_of_p(functions, functions.theta, bounds)
    c_bits = _bits_of_p(functions, functions.jacobian, bounds)
    return ParametersQ31(p_bits, theta_bits, c_bits, theta_model(functions), functions)


def _bits_of_p(functions: ModelFunctions, function: Function, bounds: Sequence[Interval]) -> tuple[int, ...]:
    c_functions.require_scaled(function.program, f"{functions.name}, {function.name}")
    found = bounds_of(function.program, bounds, f"{functions.name}, {function.name}")
    out = []
    for place, label in zip(function.program.results, function.labels, strict=True):
        size = max(map(abs, found[place]))
        if not size < math.inf:
            raise PvidError(f"{functions.name}: {label} may be infinite within the bounds of its parameters")
        out.append(_FORMAT_MAX if size == 0 else min(_BITS - math.frexp(size)[1], _FORMAT_MAX))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class WeakQ31:
    """A mechanism's fixed-point identifier for a rig.

    Attributes
    ----------
    compiled : the mechanism
    made : functions of the rows, with their formats
    parameters : functions of p
    config : settings and tables
    sample_rate : [Hz]
    lsb : value of a count of each sample [samples]
    """

    compiled: CompiledModel
    made: FixedWeak
    parameters: ParametersQ31
    config: WeakConfigQ31
    sample_rate: float
    lsb: tuple[float, ...]

    @property
    def name(self) -> str:
        """Of the mechanism, in C."""
        return self.made.functions.name

    @property
    def sample_names(self) -> tuple[str, ...]:
        """In the argument of step."""
        return self.made.functions.samples

    @property
    def hop_s(self) -> float:
        """Half a window."""
        return self.config.design.hop * self.config.design.decimation / self.sample_rate

    @property
    def ticks_needed(self) -> int:
        """Samples up to the first estimate, at most: as in float32."""
        return self.config.design.ticks_needed

    def counts_of(self, run: Mapping[str, npt.ArrayLike]) -> npt.NDArray[np.int32]:
        """The argument of step at every tick [ticks, samples]."""
        columns = [np.rint(np.asarray(run[name]) / lsb) for name, lsb in zip(self.sample_names, self.lsb, strict=True)]
        most = float(np.iinfo(np.int32).max)
        columns = [np.where(np.isnan(one), most, one) for one in columns]  # beyond every range: a gap
        return np.asarray(np.clip(np.stack(columns, axis=1), -most, most), np.int32)

    def values(self, p: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Parameters, or standard errors, from their integers [..., n_p]."""
        return np.asarray(p, np.float64) * 2.0 ** -np.array(self.parameters.p_bits, np.float64)

    def integers(self, p: npt.ArrayLike) -> npt.NDArray[np.int32]:
        """The nearest integers of parameters [n_p]."""
        return np.rint(np.asarray(p, np.float64) * 2.0 ** np.array(self.parameters.p_bits, np.float64)).astype(np.int32)
