"""How the rows determine p along motions that obey them.

The rows are relations between the jets of the signals: one jet of each row follows from the others and is put into all
rows. d(residual)/dp_k, as functions of the jets that are left free, are the columns whose rank counts the identifiable
functions of p. So a relation between rows (a sensor that measures k times another one), a homogeneous row, and channels
that only look different are all counted as what they are.
"""

from __future__ import annotations

import random

import sympy as sp

from pvid.model.compiled import CompiledModel, Part, Row
from pvid.model.gradient import rank
from pvid.model.signals import MAX_ORDER, TIME, Integral, Jet, jets, order_of, sgn, total_derivative
from pvid.model.terms import roots_of
from pvid.model.zero import RationalPoint, Sampler

_ROUNDS = 8  # of insertion: a derivative of what is inserted may contain a jet that follows again
_MOST_DIGITS = 300  # of a number in it
_MOST_TERMS = 200  # of what is inserted: a relation between rows that takes more is left out


class _TooLongError(Exception):
    """A rule would not stay short, would divide by 0, or needs itself."""


class Solutions:
    """Rules that jets of a model's solutions obey, at one random p.

    Attributes
    ----------
    at : p, in the order of the model
    rules : signal -> (order, expression): the jet of that order and all above follow
    """

    def __init__(self, compiled: CompiledModel, seed: int) -> None:
        self.compiled = compiled
        self.point = RationalPoint(random.Random(seed))
        self.point.values.update({one.symbol: sp.Rational(repr(one.value)) for one in compiled.knowns})
        self.at = [self.point.of(one) for one in compiled.p]
        self.rules: dict[str, tuple[int, sp.Expr]] = {}
        for row in compiled.rows:
            self._add(row)

    def columns(self, seed: int) -> sp.Matrix:
        """d residual / d p and nuisances at random points of solutions, then those of the constraints
        [points * rows + constraints, n_p + nuisances]."""
        p, rows = self.compiled.p, self.compiled.rows
        owners = [k for k, row in enumerate(rows) for _ in row.nuisances]
        try:
            free = [self._inserted(_rate(one)) for row in rows for one in row.nuisances]
            slopes = [[self._slope(row, one) for one in p] for row in rows]
        except _TooLongError:
            self.rules = {}
            return self.columns(seed)
        flat = []
        for k, row in enumerate(slopes):
            own = [one if owner == k else sp.Integer(0) for one, owner in zip(free, owners, strict=True)]
            flat += [*row, *own]
        sampler, source, width = Sampler(flat), random.Random(seed), len(p) + len(free)
        out = []
        for _ in range(width + 2):
            values = [sp.Rational(one.numerator, one.denominator) for one in sampler.at_random(source)]
            out += [values[k : k + width] for k in range(0, len(values), width)]
        known = [*self.compiled.constraints, *self.compiled.anchors]
        slopes = [[self.point.of(sp.diff(one, symbol)) for symbol in p] for one in known]
        out += [[*one, *[sp.Integer(0)] * len(free)] for one in slopes]
        return sp.Matrix(out)

    def rank(self, seed: int) -> int:
        """How many functions of p the rows determine."""
        whole, n = self.columns(seed), len(self.compiled.p)
        return rank(whole) - rank(whole[:, n:])

    # ---- rules

    def _add(self, row: Row) -> None:
        residual = sp.Add(*(theta * _rate(part) for theta, part in zip(row.theta, row.regressors, strict=True)))
        try:
            whole = self._inserted(self._at_p(residual - _rate(row.known)))
        except _TooLongError:
            return
        if row.nuisances or whole.has(Integral, TIME):
            return
        leading = self._leading(whole)
        if leading is None:
            return
        factor = sp.diff(whole, leading)
        before = dict(self.rules)
        self.rules[leading.of] = leading.order, sp.expand(leading - whole / factor)
        others = {name: one for name, one in before.items() if name != leading.of}
        try:
            self.rules |= {name: (n, self._inserted(one)) for name, (n, one) in others.items()}
        except _TooLongError:
            self.rules = before

    def _leading(self, whole: sp.Expr) -> Jet | None:
        """A jet that the row can be solved for: of an input where possible, without derivative; else the highest."""
        found = []
        inputs = {one.name for one in self.compiled.signals if one.driven}
        own = jets(whole)
        for name in {jet.of for jet in own} - set(self.rules):
            jet = max((one for one in own if one.of == name), key=lambda one: one.order)
            if name.startswith("_") or name not in {one.name for one in self.compiled.signals}:
                continue
            factor = sp.diff(whole, jet)
            if factor.is_number and factor != 0:
                found.append((name not in inputs, jet.order if name in inputs else -jet.order, name, jet))
        return min(found)[-1] if found else None

    def _at_p(self, expression: sp.Expr) -> sp.Expr:
        """Numbers in place of p and the known constants, sines of p included."""
        own = set(self.compiled.p) | {one.symbol for one in self.compiled.knowns}
        whole = sp.expand(expression)
        values = {}
        for one in whole.atoms(sp.sin, sp.cos):
            if one.free_symbols and one.free_symbols <= own:
                values[one] = self.point.of(one)
        known = {one: self.point.of(one) for one in own}
        return sp.expand(whole.xreplace(values).xreplace(known))

    def _slope(self, row: Row, of: sp.Symbol) -> sp.Expr:
        slopes = [self.point.of(sp.diff(theta, of)) for theta in row.theta]
        total = sp.Add(*(slope * _rate(part) for slope, part in zip(slopes, row.regressors, strict=True) if slope != 0))
        return self._inserted(self._at_p(total))

    def _inserted(self, expression: sp.Expr) -> sp.Expr:
        whole = expression
        for _ in range(_ROUNDS):
            values = {}
            for jet in jets(whole):
                if jet.of in self.rules and jet.order >= self.rules[jet.of][0]:
                    order, rule = self.rules[jet.of]
                    if len(sp.Add.make_args(rule)) > _MOST_TERMS or order_of(rule) + jet.order - order > MAX_ORDER:
                        raise _TooLongError
                    values[jet] = total_derivative(rule, jet.order - order)
            if not values:
                return whole
            whole = sp.expand(whole.xreplace(values))
            terms = sp.Add.make_args(whole)
            if len(terms) > _MOST_TERMS or whole.has(sp.nan, sp.zoo) or any(map(_has_long_number, terms)):
                break
        raise _TooLongError


def _has_long_number(term: sp.Expr) -> bool:
    number = term.as_coeff_Mul()[0]
    return bool(number.is_Rational and max(abs(number.p), number.q) > 10**_MOST_DIGITS)


def _rate(part: Part) -> sp.Expr:
    """sum D^m[psi]; sgn(..), |..| and roots stand as signals of their own."""
    total = sp.Integer(0)
    for m, psi in part.items():
        atoms = {one: Jet(f"_{one}") for one in (*psi.atoms(sgn, sp.Abs), *roots_of(psi))}
        total += total_derivative(psi.xreplace(atoms), m)
    return total
