"""A row from parts {m: psi} with unknowns: channels and functions of the unknowns, separated by rank factorisation.

The row is sum A[channel, mono] D^m[base] mono(p) with A over the rationals (and the known constants). theta has as many
entries as A has rank: channels that share one coefficient become one regressor (base parameters).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import sympy as sp
from sympy.polys.matrices import DomainMatrix

from pvid.model.compiled import Part, Row
from pvid.model.refusal import ModelError
from pvid.model.signals import Jet, sgn, total_derivative
from pvid.model.terms import ONE, ZERO, merged, roots_of, split, terms_of, times
from pvid.model.zero import dependent


@dataclass(frozen=True)
class _Channel:
    order: int
    base: sp.Expr

    @property
    def rate(self) -> sp.Expr:
        """D^order[base] in jets; sgn(..), |..| and roots stand as signals of their own."""
        atoms = {one: Jet(f"_{one}") for one in (*self.base.atoms(sgn, sp.Abs), *roots_of(self.base))}
        return total_derivative(self.base.xreplace(atoms), self.order)


_Table = dict[_Channel, dict[sp.Expr, sp.Expr]]


def factor(name: str, parts: Part, p: Sequence[sp.Symbol], nuisances: Sequence[Part] = ()) -> Row:
    """sum_j theta_j N_j = Y of sum of D^m[psi_m] = 0; Y is empty where every term has an unknown.

    Raises ModelError where no term has an unknown.
    """
    table = _table(parts, p)
    table = _independent(table, [_Channel(m, base) for part in nuisances for m, base in part.items()])
    monos = _monos(table, p)
    if not monos:
        raise ModelError(f"{name} contains no unknown, so that nothing can be identified from it: leave it out")
    known = merged(*({one.order: -cells[ONE] * one.base} for one, cells in table.items() if ONE in cells))
    channels = [one for one, cells in table.items() if set(cells) - {ONE}]
    channels.sort(key=lambda one: (len(table[one]), one.order, sp.count_ops(one.base), str(one.base)))
    matrix = sp.Matrix(len(channels), len(monos), lambda i, j: table[channels[i]].get(monos[j], ZERO))
    theta, shares = _factored(matrix, monos, p)
    order = sorted(range(len(theta)), key=lambda j: _rank_of(theta[j], p))
    regressors = [merged(*({one.order: shares[i, j] * one.base} for i, one in enumerate(channels))) for j in order]
    row = Row(name, tuple(theta[j] for j in order), tuple(regressors), known, tuple(nuisances))
    return _positive(row)


def _rank_of(theta: sp.Expr, p: Sequence[sp.Symbol]) -> tuple[int, list[int], str]:
    return sp.count_ops(theta), [k for k, one in enumerate(p) if theta.has(one)], str(theta)


def _table(parts: Part, p: Collection[sp.Symbol]) -> _Table:
    table: _Table = {}
    for m, psi in parts.items():
        for term in terms_of(psi):
            constant, mono, base = split(term, p)
            if base == 1 and m > 0:
                continue  # a derivative of a constant
            cells = table.setdefault(_Channel(m, base), {})
            cells[mono] = sp.expand(cells.get(mono, ZERO) + constant)
    return _without_zeros(table)


def _without_zeros(table: _Table) -> _Table:
    clean = {one: {mono: value for mono, value in cells.items() if value != 0} for one, cells in table.items()}
    return {one: cells for one, cells in clean.items() if cells}


def _independent(table: _Table, nuisances: Sequence[_Channel]) -> _Table:
    """Channels that are combinations of others (sin^2 + cos^2 = 1), or of nuisance columns, put into those."""
    channels = sorted(table, key=lambda one: (len(one.base.atoms(sp.Function)), one.order, sp.count_ops(one.base)))
    found = dependent([one.rate for one in (*nuisances, *channels)])
    n = len(nuisances)
    for j, combination in found.items():
        if j < n:
            continue
        cells = table.pop(channels[j - n])
        for k, share in combination.items():
            if k < n:
                continue
            into = table[channels[k - n]]
            for mono, value in cells.items():
                into[mono] = sp.expand(into.get(mono, ZERO) + share * value)
    return _without_zeros(table)


def _monos(table: _Table, p: Sequence[sp.Symbol]) -> list[sp.Expr]:
    found = {mono for cells in table.values() for mono in cells} - {ONE}
    return sorted(found, key=lambda mono: _rank_of(mono, p))


def _factored(matrix: sp.Matrix, monos: Sequence[sp.Expr], p: Sequence[sp.Symbol]) -> tuple[list[sp.Expr], sp.Matrix]:
    """theta [rank] and shares [channels, rank] with shares * theta = matrix * monos."""
    field = DomainMatrix.from_Matrix(matrix).to_field()
    if field.rank() == len(monos):
        return list(monos), matrix
    reduced, pivots = field.transpose().rref()
    shares = reduced.to_Matrix()[: len(pivots), :].T
    chosen = matrix.extract(list(pivots), list(range(len(monos))))
    theta = [sp.factor(sum((chosen[r, j] * mono for j, mono in enumerate(monos)), ZERO)) for r in range(len(pivots))]
    for r, value in enumerate(theta):  # numbers belong to the regressor
        number, rest = value.as_independent(*p, as_Add=False)
        if rest.is_Add and rest.could_extract_minus_sign():
            number, rest = -number, -rest
        theta[r] = rest
        shares[:, r] = (shares[:, r] * number).applyfunc(sp.cancel)
    return theta, shares


def _positive(row: Row) -> Row:
    """With a positive factor of the simplest term of Y."""
    if not row.known:
        return row
    lowest = (term.as_coeff_Mul() for term in terms_of(row.known[min(row.known)]))
    if min(lowest, key=lambda one: (sp.count_ops(one[1]), str(one[1])))[0] > 0:
        return row
    return replace(row, known=times(row.known, -ONE), regressors=tuple(times(one, -ONE) for one in row.regressors))


def parts_of(row: Row) -> dict[int, sp.Expr]:
    """The row as sum of D^m[psi_m] = 0 again, psi with unknowns."""
    return merged(
        *(times(one, theta) for theta, one in zip(row.theta, row.regressors, strict=True)), times(row.known, -ONE)
    )


def divided(row: Row, by: sp.Expr, p: Sequence[sp.Symbol]) -> Row:
    """The row over a function of the unknowns."""
    parts: Mapping[int, sp.Expr] = {m: sp.expand(psi / by) for m, psi in parts_of(row).items()}
    return factor(row.name, parts, p, row.nuisances)
