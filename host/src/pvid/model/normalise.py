"""Homogeneous rows: every term has an unknown, so that a row fixes theta up to a factor only.

Such a row is kept where another row fixes one of its theta (Kt = Ke of a motor's torque balance); else it is divided by
one of them.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

import sympy as sp

from pvid.model.compiled import CompiledModel, Part, Row, Unknown
from pvid.model.factor import divided
from pvid.model.gradient import rank
from pvid.model.readable import readable
from pvid.model.refusal import ModelError
from pvid.model.signals import order_of
from pvid.model.zero import RationalPoint


def with_scales(rows: Sequence[Row], unknowns: Sequence[Unknown]) -> list[Row]:
    """Rows of which each has a scale, in the same order."""
    p = [one.symbol for one in unknowns]
    point = RationalPoint(random.Random(1))

    def gradients(row: Row) -> sp.Matrix:
        """d theta / d p [theta, p] at the one point."""
        return sp.Matrix(len(row.theta), len(p), lambda i, j: point.of(sp.diff(row.theta[i], p[j])))

    out: dict[int, Row] = {k: row for k, row in enumerate(rows) if row.known}
    at = {k: gradients(row) for k, row in enumerate(rows)}
    waiting = [k for k, row in enumerate(rows) if not row.known]
    while waiting:
        fixed = sp.Matrix.vstack(sp.zeros(0, len(p)), *(at[k] for k in out))
        known = rank(fixed)
        kept = next((k for k in waiting if known and _follows(at[k], fixed, known)), None)
        k = waiting[0] if kept is None else kept
        if kept is None:
            out[k] = divided(rows[k], _normaliser(rows[k], unknowns), p)
            at[k] = gradients(out[k])
        else:
            out[k] = rows[k]
        waiting.remove(k)
    return [out[k] for k in range(len(rows))]


def with_own_scales(model: CompiledModel) -> CompiledModel | None:
    """The model with every homogeneous row divided by one of its theta, where that is possible; None: there is none.

    Least squares shrink a homogeneous row's theta where something in it is not explained: none is left of them where
    the other rows hardly see them.
    """
    rows = list(model.rows)
    for k, row in enumerate(rows):
        if not row.known:
            try:
                rows[k] = divided(row, _normaliser(row, model.unknowns), model.p)
            except ModelError:
                continue
    return replace(model, rows=tuple(rows)) if rows != list(model.rows) else None


def _follows(gradients: sp.Matrix, fixed: sp.Matrix, known: int) -> bool:
    """Whether one of these theta is, near any point, a function of the fixed ones, whose rank is `known`."""
    return any(rank(fixed.col_join(one)) == known for one in map(gradients.row, range(gradients.rows)))


def _derivatives(part: Part) -> int:
    """Most derivatives of a signal, those of the test function included."""
    return max(m + order_of(psi) for m, psi in part.items())


def _normaliser(row: Row, unknowns: Sequence[Unknown]) -> sp.Expr:
    """A theta that cannot be 0: a product of positive unknowns, of the regressor that takes the most derivatives, whose
    noise is largest and does no harm in Y."""
    positive = {one.symbol for one in unknowns if one.positive}
    own = {one.symbol for one in unknowns}
    candidates = [
        (theta, part)
        for theta, part in zip(row.theta, row.regressors, strict=True)
        if not theta.is_Add and theta.free_symbols & own <= positive and not theta.atoms(sp.sin, sp.cos)
    ]
    if not candidates:
        raise ModelError(
            f"{row.name} fixes its coefficients up to a common factor only: declare one of "
            f"{', '.join(map(readable, row.theta))} as known"
        )
    highest = max(_derivatives(part) for _, part in candidates)
    among = [theta for theta, part in candidates if _derivatives(part) == highest]
    return min(among, key=lambda theta: (sp.count_ops(theta), str(theta)))
