"""Sums of products, split by what their factors contain."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import reduce
from operator import mul

import sympy as sp

from pvid.model.readable import readable
from pvid.model.refusal import ModelError
from pvid.model.signals import TIME, Integral, Jet, sgn

ZERO, ONE = sp.Integer(0), sp.Integer(1)


def added(terms: Iterable[sp.Expr]) -> sp.Expr:
    """Their sum, not expanded."""
    return sp.Add(*terms)


def product(factors: Iterable[sp.Expr]) -> sp.Expr:
    """Their product."""
    return reduce(mul, factors, ONE)


def terms_of(expression: sp.Expr) -> tuple[sp.Expr, ...]:
    """The terms of the expanded expression; none of 0."""
    whole = sp.expand(expression)
    return () if whole == 0 else sp.Add.make_args(whole)


def varies(expression: sp.Expr) -> bool:
    """Whether it contains a signal, the time or a running integral."""
    return bool(expression.atoms(Jet, Integral)) or expression.has(TIME)


def roots_of(expression: sp.Expr) -> set[sp.Pow]:
    """Square roots of signals, and other powers of a half."""
    return {one for one in expression.atoms(sp.Pow) if one.exp.is_Rational and one.exp.q == 2 and varies(one.base)}


def is_opaque(expression: sp.Expr) -> bool:
    """Whether it contains sgn(..), |..| or a root of a signal, of which rows take no derivative."""
    return bool(expression.has(sgn, sp.Abs) or roots_of(expression))


def split(term: sp.Expr, p: Iterable[sp.Symbol]) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """A term as (constant without unknowns, function of the unknowns, function of signals and time).

    Raises ModelError where a factor contains an unknown and a signal.
    """
    unknowns = set(p)
    constant: list[sp.Expr] = []
    mono: list[sp.Expr] = []
    base: list[sp.Expr] = []
    for factor in sp.Mul.make_args(term):
        among = factor.free_symbols & unknowns
        if varies(factor):
            if among:
                names = " and ".join(sorted(map(str, among)))
                raise ModelError(
                    f"the unknown {names} stands inside {readable(factor)} together with a signal, so that no row is "
                    f"linear in a function of the unknowns alone: declare {names} as known, or replace this term by a "
                    "sum of products of unknowns and signals"
                )
            base.append(factor)
        else:
            (mono if among else constant).append(factor)
    return product(constant), product(mono), product(base)


def by_unknowns(expression: sp.Expr, p: Iterable[sp.Symbol]) -> dict[sp.Expr, sp.Expr]:
    """Function of the unknowns -> what it is multiplied by: the sum of all products is the expression."""
    unknowns = tuple(p)
    out: dict[sp.Expr, sp.Expr] = {}
    for term in terms_of(expression):
        constant, mono, base = split(term, unknowns)
        out[mono] = out.get(mono, ZERO) + constant * base
    return {mono: value for mono, value in out.items() if value != 0}


def merged(*parts: Mapping[int, sp.Expr]) -> dict[int, sp.Expr]:
    """Parts {order: psi} added; what cancels is left out."""
    out: dict[int, sp.Expr] = {}
    for part in parts:
        for order, psi in part.items():
            out[order] = out.get(order, ZERO) + psi
    expanded = {order: sp.expand(psi) for order, psi in out.items()}
    return {order: psi for order, psi in sorted(expanded.items()) if psi != 0}


def times(part: Mapping[int, sp.Expr], factor: sp.Expr) -> dict[int, sp.Expr]:
    """Each psi multiplied."""
    return {order: psi * factor for order, psi in part.items()}


def matchings(pairs: list[tuple[int, int]]) -> Iterator[tuple[tuple[int, int], ...]]:
    """All non-empty sets of pairs without a common member, the small ones first."""
    level: list[tuple[tuple[int, int], ...]] = [()]
    while level:
        following = []
        for chosen in level:
            taken = {one for pair in chosen for one in pair}
            for pair in pairs:
                if (not chosen or pair > chosen[-1]) and not taken & set(pair):
                    following.append((*chosen, pair))
        yield from following
        level = following
