"""Which unknowns the rows determine, whatever the drive: a rank over the rationals, along solutions of the rows.

Where it is deficient, the null vectors name the unknowns that shift together, and what of them is identifiable: sums
where the shift is a translation, products where it is a change of scale, else the theta that contain them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import sympy as sp
from sympy.polys.matrices import DomainMatrix

from pvid.base.wording import listed
from pvid.model.compiled import CompiledModel
from pvid.model.gradient import jacobian_at, null_space, rank
from pvid.model.solutions import Solutions
from pvid.model.symmetry import Symmetry, symmetries

_SEEDS = (1, 2, 3)  # random points at which ranks are taken: one alone could lie on a special surface


@dataclass(frozen=True)
class Shift:
    """Unknowns that can change together without a change of any row.

    Attributes
    ----------
    unknowns : their names
    combinations : functions of them that are identifiable
    kind : "sum" or "product" where nothing else of them is identifiable; "coefficients": the combinations are theta
    cure : what would help, as the end of a sentence
    """

    unknowns: tuple[str, ...]
    combinations: tuple[sp.Expr, ...]
    kind: str
    cure: str = ""


@dataclass(frozen=True)
class Identifiability:
    """What the rows determine.

    Attributes
    ----------
    rank : number of functions of the unknowns that the rows determine
    unknowns : how many
    shifts : groups of unknowns that are not identifiable; none: all are, near the truth
    symmetries : finite ones
    """

    rank: int
    unknowns: int
    shifts: tuple[Shift, ...]
    symmetries: tuple[Symmetry, ...]

    @property
    def identifiable(self) -> bool:
        """Whether every unknown is, near the truth."""
        return self.rank == self.unknowns

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Names of the unknowns that are not."""
        return tuple(name for one in self.shifts for name in one.unknowns)


def identifiable(compiled: CompiledModel) -> Identifiability:
    """Of a compiled model, for any drive; local, so that finite symmetries are listed apart."""
    theta = list(dict.fromkeys([theta for row in compiled.rows for theta in row.theta] + [*compiled.constraints]))
    p = list(compiled.p)
    along: list[Solutions] = []
    found = 0
    for seed in _SEEDS:
        along.append(Solutions(compiled, seed))
        found = max(found, along[-1].rank(seed))
        if found == len(p):
            break
    shifts: tuple[Shift, ...] = ()
    if found < len(p):
        by_theta = max(rank(jacobian_at(theta, p, seed)[0]) for seed in _SEEDS)
        spaces = _of_theta(theta, p) if by_theta == found else _of_solutions(along)
        shifts = tuple(replace(one, cure=_cure(compiled, one)) for one in _shifts(*spaces, theta, p))
    groups = [set(one.unknowns) for one in shifts]
    finite = [one for one in symmetries(theta, compiled.unknowns) if not any(one.names <= group for group in groups)]
    return Identifiability(found, len(p), shifts, tuple(finite))


def _cure(compiled: CompiledModel, shift: Shift) -> str:
    """A sensor for what is hidden, a known force where there is none, else a known value."""
    hidden = [jet.of for jet in compiled.hidden if jet not in compiled.opaque]
    if hidden:
        return f"declare one of them as known, or add a sensor for {listed(hidden, 'or')}"
    if shift.kind == "product" and not any(one.driven for one in compiled.signals):
        return "declare one of them as known, or apply a known force: nothing known fixes their scale"
    return "declare one of them as known"


# ---- shifts


_Space = list[list[sp.Expr]]


def _of_theta(theta: Sequence[sp.Expr], p: Sequence[sp.Symbol]) -> tuple[list[_Space], list[_Space]]:
    """Null spaces of d theta / d p and of d theta / d log p at two points; known constants stay symbols."""
    constants = sorted({one for value in theta for one in value.free_symbols} - set(p), key=str)
    found = [jacobian_at(theta, p, seed, constants) for seed in _SEEDS[:2]]
    return (
        [_canonical(null_space(matrix)) for matrix, _ in found],
        [_canonical(null_space(matrix * sp.diag(*at))) for matrix, at in found],
    )


def _of_solutions(along: Sequence[Solutions]) -> tuple[list[_Space], list[_Space]]:
    """The same of the columns along solutions, where a relation between rows makes the space larger."""
    spaces, scaled = [], []
    for one, seed in zip(along[:2], _SEEDS, strict=False):
        n = len(one.at)
        whole = [vector[:n] for vector in null_space(one.columns(seed)) if any(value != 0 for value in vector[:n])]
        spaces.append(_canonical(whole))
        scaled.append(_canonical([[value / at for value, at in zip(v, one.at, strict=True)] for v in whole]))
    return spaces, scaled


def _shifts(
    spaces: Sequence[_Space], scaled: Sequence[_Space], theta: Sequence[sp.Expr], p: Sequence[sp.Symbol]
) -> list[Shift]:
    out = []
    for block in _blocks(spaces[0]):
        names = [k for k in range(len(p)) if any(vector[k] != 0 for vector in block)]
        others = [_within(space, names) for space in spaces]
        scales = [_within(space, names) for space in scaled]
        if others[0] == others[1]:
            kind, combinations = "sum", [_sum(vector, p, names) for vector in _complement(others[0])]
        elif scales[0] == scales[1] and all(value.is_Rational for vector in scales[0] for value in vector):
            kind, combinations = "product", [_product(vector, p, names) for vector in _complement(scales[0])]
        else:
            own = {p[k] for k in names}
            shared = [value for value in theta if value.free_symbols & own and value not in own]
            kind, combinations = "coefficients", shared
        out.append(Shift(tuple(str(p[k]) for k in names), tuple(combinations), kind))
    return out


def _canonical(basis: list[list[sp.Expr]]) -> list[list[sp.Expr]]:
    """The reduced echelon form of a space's basis, which is the same for every basis."""
    if not basis:
        return []
    reduced, pivots = DomainMatrix.from_Matrix(sp.Matrix(basis)).to_field().rref()
    whole = reduced.to_Matrix()
    return [[sp.cancel(one) for one in whole.row(k)] for k in range(len(pivots))]


def _blocks(basis: Sequence[Sequence[sp.Expr]]) -> list[list[Sequence[sp.Expr]]]:
    """Vectors in groups that share no unknown."""
    blocks: list[tuple[set[int], list[Sequence[sp.Expr]]]] = []
    for vector in basis:
        support, members = {k for k, one in enumerate(vector) if one != 0}, [vector]
        for block in [block for block in blocks if block[0] & support]:
            blocks.remove(block)
            support, members = support | block[0], block[1] + members
        blocks.append((support, members))
    return [members for _, members in blocks]


def _within(space: Sequence[Sequence[sp.Expr]], names: Sequence[int]) -> list[list[sp.Expr]]:
    return [[vector[k] for k in names] for vector in space if any(vector[k] != 0 for k in names)]


def _complement(basis: Sequence[Sequence[sp.Expr]]) -> list[list[sp.Expr]]:
    """What is constant along the basis, in the simplest terms: each unknown in turn is the one that is shared."""
    columns = list(range(len(basis[0])))
    found = []
    for last in reversed(columns):
        order = [k for k in columns if k != last] + [last]
        vectors = _along([[one[k] for k in order] for one in basis])
        found.append([[one[order.index(k)] for k in columns] for one in vectors])
    return min(found, key=lambda vectors: sum(_size(value) for one in vectors for value in one))


def _size(value: sp.Expr) -> int:
    below = sp.fraction(value)[1]
    return int(sp.count_ops(value)) + (0 if value == 0 else 1) + (0 if below.is_Number else 5)


def _along(basis: Sequence[Sequence[sp.Expr]]) -> list[list[sp.Expr]]:
    """Null vectors, the last columns being those that others are expressed by; in whole numbers where possible."""
    columns = len(basis[0])
    reduced, pivots = DomainMatrix.from_Matrix(sp.Matrix([one[::-1] for one in basis])).to_field().rref()
    whole = reduced.to_Matrix()
    out = []
    for j in range(columns):
        if j in pivots:
            continue
        backwards = [sp.Integer(0)] * columns
        backwards[j] = sp.Integer(1)
        for i, pivot in enumerate(pivots):
            backwards[pivot] = -whole[i, j]
        vector = backwards[::-1]
        clear = sp.ilcm(1, *(one.q for one in vector if one.is_Rational))
        scaled = [sp.cancel(one * clear) for one in vector]
        if sum(1 for one in scaled if one.could_extract_minus_sign()) * 2 > sum(1 for one in scaled if one != 0):
            scaled = [-one for one in scaled]
        out.append(scaled)
    return out[::-1]


def _sum(vector: Sequence[sp.Expr], p: Sequence[sp.Symbol], names: Sequence[int]) -> sp.Expr:
    return sp.Add(*(value * p[k] for value, k in zip(vector, names, strict=True)))


def _product(vector: Sequence[sp.Expr], p: Sequence[sp.Symbol], names: Sequence[int]) -> sp.Expr:
    return sp.Mul(*(p[k] ** value for value, k in zip(vector, names, strict=True)))
