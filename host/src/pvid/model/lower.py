"""Derivatives moved to the test function: an expression in jets as a sum of D^m[psi_m] with psi of low order."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import sympy as sp

from pvid.model.refusal import ModelError
from pvid.model.signals import Jet, jets, order_of, total_derivative
from pvid.model.terms import ZERO, added, merged, terms_of
from pvid.model.zero import is_zero

OPAQUE = "_"  # names of auxiliary signals start with it; they replace sgn(..) and |..|, which have no derivative

_PRINTABLE = (sp.sin, sp.cos)  # functions a psi may contain


def lower(expression: sp.Expr, by_parts: str = "") -> dict[int, sp.Expr]:
    """{m: psi_m} with expression = sum of D^m[psi_m] identically (asserted).

    With n the highest order of derivative, terms affine in the nth jets that are an exact derivative, together or one
    by one, become D[F]; F and the remainder are treated likewise. What is neither stays: a channel of order 0 with a
    smoothed derivative.

    Raises ModelError where the derivative of sgn(..) or |..| would be needed in a product.

    Parameters
    ----------
    expression : without unknowns
    by_parts : a signal; its derivative is moved even where a derivative of another signal takes its place
    """
    direct: dict[int, sp.Expr] = {}
    smooth = []
    for term in terms_of(expression):
        opaque = [jet for jet in jets(term) if jet.of.startswith(OPAQUE)]
        if not opaque:
            smooth.append(term)
        elif len(opaque) == 1 and not jets(term / opaque[0]):
            jet = opaque[0]
            direct[jet.order] = direct.get(jet.order, ZERO) + term / jet * Jet(jet.of)
        elif all(jet.order == 0 for jet in opaque):
            direct[0] = direct.get(0, ZERO) + term
        else:
            raise ModelError("the elimination needs the derivative of a product with sgn(..) or |..|")
    lowered = merged(direct, _lowered(added(smooth), by_parts))
    total = added(total_derivative(psi, m) for m, psi in lowered.items())
    if not is_zero(total - expression):
        raise AssertionError(f"lowering is not an identity: {expression}")
    return lowered


def _lowered(expression: sp.Expr, by_parts: str) -> dict[int, sp.Expr]:
    whole = sp.expand(expression)
    if whole == 0:
        return {}
    n = order_of(whole)
    if n == 0:
        return {0: whole}
    factors, stay, rest = _affine(whole, n)
    moved = ZERO
    for group in _linked(factors):
        part = _joint(group)
        if part is None:
            part, left = _one_by_one(group, by_parts)
            stay += left
        moved += part
    moved = sp.expand(moved)
    remainder = sp.expand(whole - stay - total_derivative(moved)) if moved != 0 else rest
    inner = _lowered(moved, by_parts)
    return merged({m + 1: psi for m, psi in inner.items()}, {0: stay}, _lowered(remainder, by_parts))


def _affine(whole: sp.Expr, n: int) -> tuple[dict[Jet, sp.Expr], sp.Expr, sp.Expr]:
    """Factors of the nth jets; terms that are not affine in these; terms without any."""
    factors: dict[Jet, sp.Expr] = {}
    stay, rest = [], []
    for term in terms_of(whole):
        top = [jet for jet in jets(term) if jet.order == n]
        if not top:
            rest.append(term)
            continue
        factor, of_jet = term.as_independent(top[0], as_Add=False)
        if len(top) == 1 and of_jet == top[0]:
            factors[top[0]] = factors.get(top[0], ZERO) + factor
        else:
            stay.append(term)
    return {jet: factor for jet, factor in factors.items() if factor != 0}, added(stay), added(rest)


def _below(jet: Jet) -> Jet:
    return Jet(jet.of, jet.order - 1)


def _linked(factors: Mapping[Jet, sp.Expr]) -> list[dict[Jet, sp.Expr]]:
    """The jets in groups: together where a factor of one contains the other one's jet below."""
    groups: list[set[Jet]] = []
    for jet, factor in factors.items():
        linked = {jet} | {other for other in factors if factor.has(_below(other))}
        for group in [group for group in groups if group & linked]:
            groups.remove(group)
            linked |= group
        groups.append(linked)
    key = list(factors).index
    return [{jet: factors[jet] for jet in sorted(group, key=key)} for group in groups]


def _joint(group: Mapping[Jet, sp.Expr]) -> sp.Expr | None:
    """F with dF = sum of factor d(jet below), None where there is none."""
    below = {jet: _below(jet) for jet in group}
    n = next(iter(group)).order
    inside = set(below.values())
    for jet, factor in group.items():
        if any(other.order == n - 1 and other not in inside for other in jets(factor)):
            return None
        for other, second in group.items():
            if other.name < jet.name and not is_zero(sp.diff(factor, below[other]) - sp.diff(second, below[jet])):
                return None
    found = ZERO
    for jet, factor in group.items():
        part = antiderivative(sp.expand(factor - sp.diff(found, below[jet])), below[jet])
        if part is None:
            return None
        found = sp.expand(found + part)
    return found


def _one_by_one(group: Mapping[Jet, sp.Expr], by_parts: str) -> tuple[sp.Expr, sp.Expr]:
    """F of the terms whose factor contains no other jet of the order below; the terms that stay."""
    moved, stay = ZERO, ZERO
    for jet, factor in group.items():
        for term in terms_of(factor):
            free = all(other == _below(jet) or other.order != jet.order - 1 for other in jets(term))
            part = antiderivative(term, _below(jet)) if free or jet.of == by_parts else None
            if part is None:
                stay += term * jet
            else:
                moved += part
    return moved, stay


def antiderivative(expression: sp.Expr, of: Jet) -> sp.Expr | None:
    """With respect to a jet; None where there is none in sums of products of jets, sines and cosines."""
    found = []
    for term in terms_of(expression):
        factor, inner = term.as_independent(of, as_Add=False)
        if inner.is_Pow and inner.base == of and inner.exp.is_Integer and inner.exp != -1:
            integral = of ** (inner.exp + 1) / (inner.exp + 1)
        elif inner == 1:
            integral = of
        elif inner == of:
            integral = of**2 / 2
        else:
            integral = _integral(inner, of)
            if integral is None:
                return None
        found.append(factor * integral)
    return sp.expand(added(found))


def _integral(inner: sp.Expr, of: Jet) -> sp.Expr | None:
    if not inner.is_polynomial(*_atoms(inner, of)):
        return None
    integral = sp.integrate(inner, of)
    functions = {type(one) for one in integral.atoms(sp.Function)} - set(_PRINTABLE)
    if functions or integral.has(sp.Integral, sp.Piecewise):
        return None
    return sp.expand(integral)


def _atoms(inner: sp.Expr, of: Jet) -> Iterable[sp.Expr]:
    return [of, *(one for one in inner.atoms(sp.sin, sp.cos) if one.has(of))]
