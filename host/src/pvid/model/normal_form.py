"""An equation as the compiler reads it: rational numbers, offsets outside sines, no denominator that contains a signal
and an unknown."""

from __future__ import annotations

from collections.abc import Collection

import sympy as sp

from pvid.model.readable import readable
from pvid.model.refusal import ModelError
from pvid.model.signals import Integral, jets, sgn
from pvid.model.terms import roots_of, varies

_FUNCTIONS = (sp.sin, sp.cos, sp.Abs, sgn, Integral)


_WITHOUT = {
    "Max": "max(a, b) is (a + b + abs(a - b))/2",
    "Min": "min(a, b) is (a + b - abs(a - b))/2",
    "Piecewise": "(1 + sgn(x))/2 is 1 where x is positive and 0 where it is negative",
    "Heaviside": "(1 + sgn(x))/2 is 1 where x is positive and 0 where it is negative",
}


def rational(expression: sp.Expr) -> sp.Expr:
    """Floats as the decimal fractions that they are written as.

    Raises ModelError where a number is infinite or undefined, or a function is one of SymPy's that abs and sgn do
    without.
    """
    whole = sp.sympify(expression)
    if whole.has(sp.zoo, sp.nan, sp.oo, -sp.oo):
        raise ModelError(f"{readable(sp.sympify(expression))} is not finite: is something divided by 0?")
    for one in whole.atoms(sp.Max, sp.Min, sp.Piecewise, sp.Heaviside):
        raise ModelError(f"{type(one).__name__} is not supported: {_WITHOUT[type(one).__name__]}")
    return whole.xreplace({one: sp.Rational(repr(float(one))) for one in whole.atoms(sp.Float)})


def normal_form(expression: sp.Expr, p: Collection[sp.Symbol]) -> sp.Expr:
    """Expanded; multiplied, where needed, by a common denominator.

    Raises ModelError where a function or a power is none that rows can be made of.
    """
    whole = rational(expression)
    whole = whole.replace(sp.sign, sgn).replace(sp.tan, lambda x: sp.sin(x) / sp.cos(x))
    _check_functions(whole, p)
    whole = whole.replace(lambda one: isinstance(one, sp.sin | sp.cos), lambda one: _without_offset(one, set(p)))
    whole = sp.expand(whole)
    if any(_mixed(one, p) for one in whole.atoms(sp.Pow)):
        numerator, _ = sp.fraction(sp.together(whole))
        whole = sp.expand(numerator)
    for one in whole.atoms(sp.Pow):
        if one.base.free_symbols & set(p) | jets(one.base) and not one.exp.is_Integer and one not in roots_of(whole):
            only = "only those of signals and unknowns are supported, and square roots of signals"
            raise ModelError(f"{readable(one)} is no whole power: {only}")
    return whole


def _mixed(power: sp.Pow, p: Collection[sp.Symbol]) -> bool:
    below = bool(power.exp.could_extract_minus_sign())
    return below and varies(power.base) and bool(power.base.free_symbols & set(p))


def _check_functions(whole: sp.Expr, p: Collection[sp.Symbol]) -> None:
    for one in whole.atoms(sp.Function):
        if isinstance(one, sp.core.function.AppliedUndef):
            raise ModelError(f"{one} is no signal of the model: use what model.sensor(..) returned and its .d()")
        if one.free_symbols & set(p) and not varies(one) and not isinstance(one, sp.sin | sp.cos):
            raise ModelError(f"{readable(one)} is not supported: make it the unknown itself, or declare it as known")
        if varies(one) and not isinstance(one, _FUNCTIONS):
            raise ModelError(
                f"{type(one).__name__}(..) of a signal is not supported: sin, cos, sgn, abs, sqrt and rational ones are"
            )
    if whole.has(sp.Derivative, sp.Integral, sp.Piecewise):
        raise ModelError("derivatives are written as signal.d(n), and no cases are possible")


def _without_offset(one: sp.Expr, p: set[sp.Symbol]) -> sp.Expr:
    """sin(a - c) with an unknown c as sin a cos c - cos a sin c."""
    argument = sp.expand(one.args[0])
    if not argument.free_symbols & p or not jets(argument):
        return one
    terms = sp.Add.make_args(argument)
    moving = sp.Add(*(term for term in terms if varies(term)))
    fixed = sp.Add(*(term for term in terms if not varies(term)))
    if isinstance(one, sp.sin):
        return sp.sin(moving) * sp.cos(fixed) + sp.cos(moving) * sp.sin(fixed)
    return sp.cos(moving) * sp.cos(fixed) - sp.sin(moving) * sp.sin(fixed)
