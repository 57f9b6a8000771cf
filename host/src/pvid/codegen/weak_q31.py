"""The generated functions of the fixed-point weak engine: formats from the reach of each jet, C, and their twins."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pvid.base.errors import PvidError
from pvid.codegen import c_q31, numpy_q31
from pvid.codegen.formats import FixedProgram, bits_of, fixed
from pvid.codegen.intervals import Interval
from pvid.codegen.reaches import symmetric
from pvid.codegen.twin_file import namespace
from pvid.codegen.weak import WeakFunctions
from pvid.design.weak_q31 import Formats
from pvid.settings.weak_q31 import WeakModelQ31, WeakTermQ31

_PARTS = """\
import numpy as np
import numpy.typing as npt

from pvid.twin.q31 import elementary as elementary_q31
from pvid.twin.q31.integer import Int
"""


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
    """Fixed-point functions of the weak engine.

    Attributes
    ----------
    functions : what is generated
    reaches : largest value of each jet
    run_s : longest run [s]
    prepare : None where there are neither runs nor signs
    values : of jets, runs and signs
    prepare_limits, values_limits : largest integer of each input
    model : tables and twins
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

    Raises
    ------
    PvidError
        Where fixed point cannot compute a function, with the quantity.
    """
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
    limits = _limits(inputs)
    return FixedWeak(
        functions=made,
        reaches=tuple(reaches),
        run_s=chosen.run_s,
        prepare=prepared,
        values=values,
        prepare_limits=limits[: len(bounds)],
        values_limits=limits,
        model=_model(made, prepared, values, limits),
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


def _limits(bounds: Sequence[Interval]) -> tuple[int, ...]:
    return tuple(math.floor(max(map(abs, one)) * 2.0 ** bits_of(one)) for one in bounds)


def _model(
    made: WeakFunctions, prepared: FixedProgram | None, values: FixedProgram, limits: tuple[int, ...]
) -> WeakModelQ31:
    jets = len(made.jet)
    parts = [_PARTS, numpy_q31.fixed_function("values", values, limits, "Gains, then integrands.")]
    if prepared:
        parts.append(numpy_q31.fixed_function("prepare", prepared, limits[:jets], "Rates, then arguments of sgn."))
    space = namespace("\n\n".join(parts), made.name)
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
        prepare=space.get("prepare"),
        values=space["values"],
    )


def c_functions(made: FixedWeak, prefix: str) -> str:
    """PREFIX_prepare_q31 and PREFIX_values_q31."""
    parts = []
    for name, one, limits in (
        ("prepare", made.prepare, made.prepare_limits),
        ("values", made.values, made.values_limits),
    ):
        if one is not None:
            signature = f"static bool {prefix}_{name}_q31(const int32_t in[], int32_t out[])"
            parts.append(c_q31.fixed_function(signature, one, limits))
    return "\n\n".join(parts) + "\n"
