"""Equations without the coordinates that are not measured.

Three classes are tried in this order: substitution (one jet of the coordinate, linear), operator null vector (constant
coefficients), integrator chain (a combination holds the coordinate only as alpha(p) x^(n)).
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import sympy as sp

from pvid.base.wording import listed
from pvid.model.lower import lower
from pvid.model.readable import readable
from pvid.model.refusal import ModelError, Place
from pvid.model.signals import TIME, Integral, Jet, jets, total_derivative
from pvid.model.terms import ONE, ZERO, added, by_unknowns, merged, terms_of, times, varies

_D = sp.Symbol("D")  # d/dt in the matrix of operators


class ChainError(ModelError):
    """A term prevents the integrator chain."""

    def __init__(self, cause: str, term: sp.Expr) -> None:
        super().__init__(cause)
        self.term = term


@dataclass(frozen=True)
class Equation:
    """expression = 0, expanded."""

    name: str
    expression: sp.Expr
    place: Place = Place()
    made_of: tuple[str, ...] = ()

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the equations that it was made of."""
        return self.made_of or (self.name,)


@dataclass(frozen=True)
class Reduced:
    """An equation in measured signals.

    Attributes
    ----------
    name : of the equations that it comes from
    expression : = 0 in jets of measured signals; None where the chain gave parts at once
    parts : sum of D^m[psi_m] = 0, psi with unknowns
    nuisances : columns with a free factor in every window
    how : the class, "" where nothing was eliminated
    strong : the same as one expression in jets
    """

    name: str
    expression: sp.Expr | None
    parts: dict[int, sp.Expr] = field(default_factory=dict)
    nuisances: tuple[dict[int, sp.Expr], ...] = ()
    how: str = ""
    strong: sp.Expr | None = None
    place: Place = Place()


def eliminate(equations: Sequence[Equation], hidden: Sequence[str], p: Collection[sp.Symbol]) -> list[Reduced]:
    """All equations in measured signals that follow.

    Raises ModelError where a coordinate remains; the sentence names it, the term and what would help.
    """
    out = [Reduced(one.name, one.expression, place=one.place) for one in equations if not _has(one, hidden)]
    left = [one for one in equations if _has(one, hidden)]
    for name in hidden:
        if not any(_has(one, [name]) for one in left):
            raise ModelError(f"{name} is declared as unmeasured, but no equation contains it")
    while left:
        group, names = _connected(left, hidden)
        left = [one for one in left if one not in group]
        out += _without(group, names, p)
    return out


def _has(equation: Equation, names: Collection[str]) -> bool:
    return any(jet.of in names for jet in jets(equation.expression))


def _orders(equation: Equation, name: str) -> list[int]:
    return sorted({jet.order for jet in jets(equation.expression) if jet.of == name})


def _connected(equations: Sequence[Equation], hidden: Sequence[str]) -> tuple[list[Equation], list[str]]:
    names = {name for name in hidden if _has(equations[0], [name])}
    while True:
        group = [one for one in equations if _has(one, names)]
        wider = {name for name in hidden if any(_has(one, [name]) for one in group)}
        if wider == names:
            return group, [name for name in hidden if name in names]
        names = wider


def _without(group: Sequence[Equation], names: Sequence[str], p: Collection[sp.Symbol]) -> list[Reduced]:
    any_of = listed(names, "or")
    if len(group) <= len(names):
        raise ModelError(
            f"{listed(names)} cannot be eliminated: {len(group)} equation{'s' * (len(group) > 1)} for "
            f"{len(names)} unmeasured coordinate{'s' * (len(names) > 1)} leave nothing to identify from; "
            f"a sensor for {any_of}, or one more equation, would help",
            group[-1].place,
        )
    causes, aside = [], ""
    for name in names:
        shorter = substituted(group, name)
        if shorter is not None:
            how = f"{name} substituted"
            return [_with_how(one, how) for one in eliminate(shorter, [n for n in names if n != name], p)]
    try:
        return by_null_vector(group, names)
    except ModelError as error:
        causes.append(error.cause)
    if len(names) == 1:
        try:
            return [by_chain(group, names[0], p)]
        except ModelError as error:
            causes.append(error.cause)
            if isinstance(error, ChainError):
                aside = f", or leaving {readable(error.term)} out where it is small"
    raise ModelError(
        f"{listed(names)} cannot be eliminated: {'; '.join(causes)}; a sensor for {any_of} would help{aside}",
        group[-1].place,
    )


def _with_how(one: Reduced, how: str) -> Reduced:
    both = f"{how}, {one.how}" if one.how else how
    return Reduced(one.name, one.expression, one.parts, one.nuisances, both, one.strong, one.place)


def _joined(equations: Sequence[Equation]) -> str:
    names = list(dict.fromkeys(part for one in equations for part in one.sources))
    numbers = [name.removeprefix("equation ") for name in names]
    if len(names) > 1 and all(number.isdecimal() for number in numbers):
        return f"equations {listed(numbers)}"
    return listed(names)


# ---- substitution


def substituted(group: Sequence[Equation], name: str) -> list[Equation] | None:
    """The other equations, where the coordinate occurs as one jet only, linearly; None where it does not.

    Multiplied by the jet's factor, so that nothing is divided by.
    """
    used = sorted({order for one in group for order in _orders(one, name)})
    if len(used) != 1:
        return None
    jet = Jet(name, used[0])
    factors = [sp.expand(sp.diff(one.expression, jet)) for one in group]
    if any(factor.has(jet) for factor in factors):
        return None
    solvable = [k for k, factor in enumerate(factors) if factor != 0 and not varies(factor)]
    if not solvable:
        holding = [k for k, factor in enumerate(factors) if factor != 0]
        if len(holding) < 2:
            return None
        solvable = sorted(holding, key=lambda k: sp.count_ops(factors[k]))
    k = min(solvable, key=lambda k: (factors[k] not in (1, -1), sp.count_ops(group[k].expression)))
    factor, rest = factors[k], sp.expand(group[k].expression - factors[k] * jet)
    out = []
    for j, one in enumerate(group):
        if j == k:
            continue
        if factors[j] == 0:
            out.append(one)
            continue
        bare = sp.expand(one.expression - factors[j] * jet)
        expression = bare - factors[j] * rest / factor if factor.is_Number else bare * factor - factors[j] * rest
        both = [group[k], one]
        sources = tuple(name for each in both for name in each.sources)
        out.append(Equation(_joined(both), sp.expand(expression), one.place, sources))
    return out


# ---- operator null vector


def by_null_vector(group: Sequence[Equation], names: Sequence[str]) -> list[Reduced]:
    """Of h + 1 equations at a time: the left null vector of the matrix of operators, by signed minors."""
    matrix, rest = _operators(group, names)
    h, out, used = len(names), [], []
    for extra in range(h, len(group)):
        for others in itertools.combinations(range(extra), h):
            chosen = [*others, extra]
            vector = _null_vector(matrix.extract(chosen, list(range(h))))
            if vector is None:
                continue
            whole = added(_operate(one, rest[k]) for one, k in zip(vector, chosen, strict=True))
            chosen = [k for one, k in zip(vector, chosen, strict=True) if one != 0]
            sources = [group[k] for k in chosen]
            used.append(chosen)
            how = f"{listed(names)} eliminated by operators"
            out.append(Reduced(_joined(sources), sp.expand(whole), how=how, place=group[extra].place))
            break
    if not out:
        raise ModelError(f"the equations determine no combination without {listed(names)}")
    return out


def _operators(group: Sequence[Equation], names: Sequence[str]) -> tuple[sp.Matrix, list[sp.Expr]]:
    rows, rest = [], []
    for one in group:
        row, bare = [], one.expression
        for name in names:
            operator = ZERO
            for order in _orders(one, name):
                jet = Jet(name, order)
                factor = sp.expand(sp.diff(one.expression, jet))
                if any(other.of in names for other in jets(factor)):
                    raise ModelError(f"{readable(_term(one.expression, jet))} is not linear in {name}")
                if varies(factor):
                    raise ModelError(f"{readable(_term(one.expression, jet))} multiplies {name} by a signal")
                operator += factor * _D**order
                bare -= factor * jet
            row.append(operator)
        bare = sp.expand(bare)
        clear = sp.fraction(sp.together(added(row)))[1]
        rows.append([sp.expand(sp.cancel(one * clear)) for one in row])
        rest.append(sp.expand(bare * clear))
    return sp.Matrix(rows), rest


def _term(expression: sp.Expr, jet: Jet) -> sp.Expr:
    """The term that contains the jet and the most else."""
    holding = [term for term in terms_of(expression) if term.has(jet)]
    return max(holding, key=lambda term: (len(jets(term)), sp.count_ops(term)))


def _null_vector(matrix: sp.Matrix) -> list[sp.Expr] | None:
    rows = matrix.rows
    vector = []
    for k in range(rows):
        minor = matrix.extract([j for j in range(rows) if j != k], list(range(rows - 1)))
        vector.append(sp.expand((-1) ** k * minor.det(method="berkowitz")))
    if all(one == 0 for one in vector) or vector[-1] == 0:
        return None
    common = sp.gcd_list(vector)
    return [sp.expand(sp.cancel(one / common)) for one in vector]


def _operate(operator: sp.Expr, expression: sp.Expr) -> sp.Expr:
    if operator == 0:
        return ZERO
    total, derivative = ZERO, expression
    for k, factor in enumerate(sp.Poly(operator, _D).all_coeffs()[::-1]):
        if k:
            derivative = total_derivative(derivative)
        total += factor * derivative
    return sp.expand(total)


# ---- integrator chain


def by_chain(group: Sequence[Equation], name: str, p: Collection[sp.Symbol]) -> Reduced:
    """x^(n) alone in a combination of the equations: x is an n-fold running integral and a polynomial of the time.

    It is put into an equation that holds x undifferentiated, which is tested with D^n: what an unknown multiplies
    of the polynomial vanishes, and what a signal multiplies is a nuisance column free of unknowns.
    """
    pure, factor, top = _pure(group, name)
    rest = sp.expand(sp.cancel(sp.together((pure - factor * Jet(name, top)) / factor)))
    value = ZERO
    for mono, varying in by_unknowns(rest, p).items():
        for m, psi in lower(varying).items():
            value -= mono * (total_derivative(psi, m - top) if m >= top else _running(psi, top - m))
    carrier = next((one for one in group if _orders(one, name) == [0]), None)
    if carrier is None:
        raise ModelError(f"no equation holds {name} without its derivatives")
    gain = sp.expand(sp.diff(carrier.expression, Jet(name)))
    if any(jet.of == name for jet in jets(gain)):
        raise ModelError(f"{readable(_term(carrier.expression, Jet(name)))} is not linear in {name}")
    inserted = sp.expand(carrier.expression.xreplace({Jet(name): value}))
    parts = merged(*(times(_tested(psi, top), mono) for mono, psi in by_unknowns(inserted, p).items()))
    columns = []
    for _, varying in by_unknowns(gain, p).items():
        moving = added(term for term in terms_of(varying) if varies(term))
        if moving != 0:
            columns += [{top: sp.expand(moving * TIME**k)} for k in range(top)]
    value_now = -(carrier.expression - gain * Jet(name)) / gain
    strong = factor * _rate_of_fraction(value_now, top) + factor * rest
    numerator = sp.fraction(sp.cancel(sp.together(strong)))[0]
    return Reduced(
        _joined(group),
        None,
        parts,
        tuple(columns),
        f"{name} integrated {top} times",
        sp.expand(numerator),
        carrier.place,
    )


def _rate_of_fraction(expression: sp.Expr, n: int) -> sp.Expr:
    """d^n/dt^n, not expanded."""
    whole = expression
    for _ in range(n):
        whole = added(sp.diff(whole, jet) * jet.d() for jet in jets(whole))
    return whole


def _running(psi: sp.Expr, fold: int) -> sp.Expr:
    """The n-fold running integral; of a constant a power of the time."""
    out = ZERO
    for term in terms_of(psi):
        constant, varying = term.as_independent(*jets(term), as_Add=False) if jets(term) else (term, ONE)
        out += constant * (TIME**fold / sp.factorial(fold) if varying == 1 else Integral(varying, fold))
    return out


def _tested(psi: sp.Expr, top: int) -> dict[int, sp.Expr]:
    """D^top[psi] by order; running integrals that stand alone lose their folds."""
    parts: list[dict[int, sp.Expr]] = []
    smooth = []
    for term in terms_of(psi):
        integrals = list(term.atoms(Integral))
        if not integrals and not term.has(TIME):
            smooth.append(term)
            continue
        if not integrals and not jets(term):
            parts.append({0: total_derivative(term, top)})
            continue
        factor = term / integrals[0] if len(integrals) == 1 else term
        if len(integrals) == 1 and not varies(factor) and integrals[0].args[1] <= top:
            inner, fold = integrals[0].args
            parts.append({top - int(fold): factor * inner})
        else:
            parts.append({top: term})
    parts.append({m + top: one for m, one in lower(added(smooth)).items()})
    return merged(*parts)


def _pure(group: Sequence[Equation], name: str) -> tuple[sp.Expr, sp.Expr, int]:
    """A combination with factors free of signals that holds the coordinate as factor * x^(top) only."""
    marks = sp.symbols(f"_w0:{len(group)}")
    top = max(order for one in group for order in _orders(one, name))
    conditions = []
    for order in range(top):
        jet = Jet(name, order)
        factors = [sp.expand(sp.diff(one.expression, jet)) for one in group]
        if any(other.of == name for factor in factors for other in jets(factor)):
            raise ModelError(f"it stands nonlinearly in {_joined([one for one in group if one.expression.has(jet)])}")
        whole = added(mark * factor for mark, factor in zip(marks, factors, strict=True))
        by_signals: dict[sp.Expr, sp.Expr] = {}
        for term in terms_of(whole):
            constant, varying = term.as_independent(*jets(term), as_Add=False) if jets(term) else (term, ONE)
            by_signals[varying] = by_signals.get(varying, ZERO) + constant
        conditions += [value for value in by_signals.values() if sp.expand(value) != 0]
    system = sp.Matrix([[sp.diff(sp.expand(one), mark) for mark in marks] for one in conditions])
    candidates = system.nullspace() if conditions else [sp.eye(len(group)).col(k) for k in range(len(group))]
    for vector in candidates:
        weights = [sp.cancel(one) for one in vector]
        whole = sp.expand(added(w * one.expression for w, one in zip(weights, group, strict=True)))
        factor = sp.cancel(sp.diff(whole, Jet(name, top)))
        if factor != 0 and not varies(factor):
            return whole, factor, top
    jet = Jet(name, max(order for one in group for order in _orders(one, name) if order < top or top == 0))
    culprit = next(_term(one.expression, jet) for one in group if one.expression.has(jet))
    raise ChainError(f"no combination of the equations is free of {readable(culprit)}", culprit)
