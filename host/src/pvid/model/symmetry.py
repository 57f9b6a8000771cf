"""Finite symmetries: other values of the unknowns with the same theta."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from pvid.model.compiled import Unknown
from pvid.model.terms import matchings
from pvid.model.units import dimension_of_unit
from pvid.model.zero import function_of_fractions

_MOST = 5000  # exchanges, or changes of sign, that are tried


@dataclass(frozen=True)
class Symmetry:
    """Another p with the same theta.

    Attributes
    ----------
    swapped : pairs of unknowns that exchange their values
    negated : unknowns that change their sign
    excluded : whether the ranges of the unknowns exclude one of the two
    """

    swapped: tuple[tuple[str, str], ...]
    negated: tuple[str, ...]
    excluded: bool

    @property
    def names(self) -> set[str]:
        """Unknowns that change."""
        return {name for pair in self.swapped for name in pair} | set(self.negated)


def symmetries(theta: Sequence[sp.Expr], unknowns: Sequence[Unknown]) -> list[Symmetry]:
    """Exchanges of unknowns of one unit, and changes of sign, that leave every theta as it is; the smallest of each."""
    unchanged = _at_a_point(theta, unknowns)
    if unchanged is None:
        return []
    out: list[Symmetry] = []
    for pairs in itertools.islice(matchings(_like(unknowns)), _MOST):
        named = tuple((unknowns[i].name, unknowns[j].name) for i, j in pairs)
        if any(set(one.swapped) <= set(named) for one in out):
            continue
        if unchanged({i: (j, 1) for pair in pairs for i, j in (pair, pair[::-1])}):
            out.append(Symmetry(named, (), any(_apart(unknowns[i], unknowns[j]) for i, j in pairs)))
    free = [k for k, one in enumerate(unknowns) if not one.positive]
    chosen_sets = (chosen for count in range(1, len(free) + 1) for chosen in itertools.combinations(free, count))
    for chosen in itertools.islice(chosen_sets, _MOST):
        names = tuple(unknowns[k].name for k in chosen)
        if any(one.negated and set(one.negated) <= set(names) for one in out):
            continue
        if unchanged({k: (k, -1) for k in chosen}):
            ranges = [unknowns[k] for k in chosen]
            out.append(Symmetry((), names, any(one.low >= 0 or one.high <= 0 for one in ranges)))
    return out


def _at_a_point(
    theta: Sequence[sp.Expr], unknowns: Sequence[Unknown]
) -> Callable[[Mapping[int, tuple[int, int]]], bool] | None:
    """Whether every theta keeps its value at a random rational point whose coordinates are moved: {index: (index of the
    one in its place, sign)}; None where theta has sines of more than one unknown, which are not judged."""
    p = [one.symbol for one in unknowns]
    sines = sorted({one for value in theta for one in value.atoms(sp.sin, sp.cos)}, key=str)
    if any(one.args[0] not in p for one in sines):
        return None
    marks = {one: sp.Dummy() for one in sines}
    bare = [value.xreplace(marks) for value in theta]
    constants = sorted({one for value in bare for one in value.free_symbols} - set(p) - set(marks.values()), key=str)
    source = random.Random(5)
    numbers, slopes, rest = ([_fraction(source) for _ in range(k)] for k in (len(p), len(p), len(constants)))

    def place(moved: Mapping[int, tuple[int, int]]) -> list[Fraction]:
        at = [moved.get(k, (k, 1)) for k in range(len(p))]
        of_sines = []
        for one in sines:
            k, sign = at[p.index(one.args[0])]
            r = sign * slopes[k]
            of_sines.append(2 * r / (1 + r**2) if isinstance(one, sp.sin) else (1 - r**2) / (1 + r**2))
        return [*(sign * numbers[k] for k, sign in at), *of_sines, *rest]

    arguments = [*p, *marks.values(), *constants]
    functions = [function_of_fractions(arguments, [value]) for value in bare]
    here = [function(*place({})) for function in functions]
    within = [{k for k, one in enumerate(p) if one in value.free_symbols} for value in theta]

    def unchanged(moved: Mapping[int, tuple[int, int]]) -> bool:
        values = place(moved)
        touched = (k for k, own in enumerate(within) if not own.isdisjoint(moved))
        return all(functions[k](*values) == here[k] for k in touched)

    return unchanged


def _fraction(source: random.Random) -> Fraction:
    return Fraction(source.randint(2, 997), source.randint(2, 97))


def _like(unknowns: Sequence[Unknown]) -> list[tuple[int, int]]:
    """Pairs of unknowns with one unit and, both or none, a sign."""
    units = [(dimension_of_unit(one.unit), one.positive) for one in unknowns]
    return [(i, j) for i, j in itertools.combinations(range(len(unknowns)), 2) if units[i] == units[j]]


def _apart(one: Unknown, other: Unknown) -> bool:
    return one.high <= other.low or other.high <= one.low
