"""The sums of a model's strong form, and S, F from them: equal products once, powers by chains, a shift by binomials.

A row is Y = N^T theta(p) + noise. Its entries are monomials in few factors of the instant, the atoms: inputs, sines,
signs, and sums of those. With P(p) = N^T theta and its gradient g_a = dP/dp_a (theory, equations (4), (5)),

    S_ab = sum g_a g_b,   F_a = sum g_a (Y - P),   P = sum over the linear parameters l of p_l g_l + Q

are polynomials in sums of products of atoms, with coefficients in p. `strong_sums_of` finds the sums that are needed,
each once over all kinds of rows, and the operations from the sums to S and F. Where the gradient has powers of G = u +
w, an atom and a parameter, the sums are those of powers of u, and the moments of G follow from them by one binomial row
for each family and Pascal's rule, which does not cancel.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count
from math import comb

import sympy as sp

from pvid.codegen.strong import StrongFunctions
from pvid.model.operations import Builder, Program

Monomial = tuple[tuple[int, int], ...]  # (atom, power), by ascending atoms; () is 1
Polynomial = dict[Monomial, sp.Expr]  # monomial -> coefficient in p

_SHIFT = sp.Symbol("shifted")  # G = u + w of the shift, in the place of its atom u


@dataclass
class Kind:
    """A kind of rows.

    Attributes
    ----------
    product : P = N^T theta, expanded, in the symbols of the atoms and p
    known : place of the atom Y; None where Y is 0
    unit : rows of the core are those of the model over this
    gradient : dP/dp_a for each parameter, in which the atom of the shift is written for G
    rest : Q, likewise
    """

    product: sp.Expr
    known: int | None
    unit: sp.Expr = sp.Integer(1)
    gradient: list[Polynomial] = field(default_factory=list)
    rest: Polynomial = field(default_factory=dict)

    @property
    def y(self) -> Monomial:
        """Y as a monomial; () where it is 0."""
        return () if self.known is None else ((self.known, 1),)

    @property
    def monomials(self) -> list[Monomial]:
        """Of the gradient, each once."""
        return list(dict.fromkeys(one for part in self.gradient for one in part))


@dataclass(frozen=True)
class Chain:
    """A product and the two factors it is one multiplication of."""

    made: Monomial
    left: Monomial
    right: Monomial


@dataclass(frozen=True)
class Noted:
    """A program with what its values are.

    Attributes
    ----------
    program : arguments -> results
    notes : of some places
    """

    program: Program
    notes: dict[int, str]

    @classmethod
    def of(
        cls, builder: Builder, names: Sequence[str], wanted: Sequence[sp.Expr], shown: Mapping[sp.Expr, str]
    ) -> Noted:
        """Of the results that are wanted; shown: symbols among the definitions, and what they are."""
        results = tuple(builder.place_of(sp.sympify(e)) for e in wanted)
        values, notes = tuple(builder.values), dict[int, str]()
        for symbol, text in shown.items():
            place = builder.place_of(symbol)
            notes[place] = f"{notes[place]} = {text}" if place in notes else text
        return cls(Program(tuple(names), values, results), {at: text for at, text in notes.items() if at < len(values)})


@dataclass(frozen=True)
class Innovation:
    """Residual and gradient of the rows of an instant.

    Attributes
    ----------
    noted : p, atoms -> of each kind e, then the entries of `entries`
    entries : parameters on which the rows of each kind depend
    """

    noted: Noted
    entries: list[list[int]]

    @property
    def program(self) -> Program:
        """Without notes."""
        return self.noted.program


def strong_sums_of(strong: StrongFunctions) -> StrongSums:
    """The sums of a strong form, named NAME_strong."""
    found = _Rows(strong)
    found.find_shift()
    found.choose_units()
    return StrongSums(strong, found)


def times(*monomials: Monomial) -> Monomial:
    """Their product."""
    powers: dict[int, int] = {}
    for atom, power in (one for monomial in monomials for one in monomial):
        powers[atom] = powers.get(atom, 0) + power
    return tuple(sorted(powers.items()))


def over(monomial: Monomial, by: Monomial) -> Monomial | None:
    """Their quotient; None where it is none."""
    left = dict(monomial)
    for atom, power in by:
        left[atom] = left.get(atom, 0) - power
    return None if any(k < 0 for k in left.values()) else tuple(sorted((a, k) for a, k in left.items() if k))


def chains_of(wanted: Iterable[Monomial], atoms: int) -> list[Chain]:
    """Products in an order in which each is one multiplication of what is known; a power is used while it is fresh."""
    known: dict[Monomial, None] = {(): None, **{((a, 1),): None for a in range(atoms)}}
    steps: list[Chain] = []

    def make(monomial: Monomial) -> None:
        if monomial in known:
            return
        pairs = [(one, rest) for one in known if one and (rest := over(monomial, one)) is not None]
        pairs.sort(key=lambda pair: -_degree(pair[0]))
        one, rest = next((pair for pair in pairs if pair[1] in known), pairs[0])
        make(rest)
        steps.append(Chain(monomial, one, rest))
        known[monomial] = None

    for one in sorted(set(wanted), key=lambda m: (_degree(m), m)):
        make(one)
    return _depth_first(steps, atoms)


def _depth_first(steps: Sequence[Chain], atoms: int) -> list[Chain]:
    left = {one.made: one for one in steps}
    known: set[Monomial] = {(), *(((a, 1),) for a in range(atoms))}
    order: list[Chain] = []

    def visit(monomial: Monomial) -> None:
        order.append(left.pop(monomial))
        known.add(monomial)
        for one in list(left.values()):
            if one.made in left and monomial in (one.left, one.right) and {one.left, one.right} <= known:
                visit(one.made)

    while left:
        visit(next(one.made for one in left.values() if {one.left, one.right} <= known))
    return order


def _degree(monomial: Monomial) -> int:
    return sum(power for _, power in monomial)


class _Rows:
    """Atoms and kinds as they are found."""

    def __init__(self, strong: StrongFunctions) -> None:
        functions = strong.functions
        self.p: tuple[sp.Symbol, ...] = tuple(functions.model.p)
        self.atoms: list[sp.Expr] = []
        self.symbols: list[sp.Symbol] = []
        self.shift: tuple[int, sp.Symbol] | None = None  # atom u and parameter w
        self.kinds: list[Kind] = []
        columns = strong.row.expressions
        for kind in functions.kinds:
            own = columns[kind.columns.start : kind.known]
            thetas = functions.theta.expressions[kind.theta.start : kind.theta.stop]
            terms = [self._monomial(n) * theta for n, theta in zip(own, thetas, strict=True) if n != 0]
            y = columns[kind.known]
            known = None if y == 0 else self._place(y)
            self.kinds.append(Kind(sp.expand(sp.Add(*terms)), known))

    def _place(self, atom: sp.Expr) -> int:
        if atom not in self.atoms:
            self.atoms.append(atom)
            self.symbols.append(sp.Symbol(f"a{len(self.symbols)}"))
        return self.atoms.index(atom)

    def _monomial(self, e: sp.Expr) -> sp.Expr:
        """As constant and product of atoms; what is a sum, and what has another power than 1, 2 .., is an atom."""
        whole = sp.expand(e)
        constant, rest = whole.primitive() if whole.is_Add else whole.as_coeff_Mul()
        if rest.is_Add and sp.default_sort_key(rest) > sp.default_sort_key(-rest):
            constant, rest = -constant, -rest
        product = constant
        for one in [rest] if rest.is_Add else sp.Mul.make_args(rest):
            base, power = (one, sp.Integer(1)) if one.is_Add else one.as_base_exp()
            if not (power.is_Integer and power > 0):
                base, power = one, sp.Integer(1)
            product *= sp.Integer(1) if base == 1 else self.symbols[self._place(base)] ** power
        return product

    def find_shift(self) -> None:
        """An atom that occurs as (k u + w)^n, n >= 2, in a derivative of P: it becomes k u, and G = k u + w."""
        for kind, a in ((kind, a) for kind in self.kinds for a in self.p):
            derivative = sp.diff(kind.product, a)
            if derivative == 0 or not derivative.is_polynomial():
                continue
            for factor, power in sp.factor_list(derivative)[1]:
                atoms = [one for one in factor.free_symbols if one in self.symbols]
                parameters = [one for one in factor.free_symbols if one in self.p]
                if power < 2 or len(atoms) != 1 or len(parameters) != 1:
                    continue
                u, w = atoms[0], parameters[0]
                polynomial = sp.Poly(factor, u, w)
                if polynomial.total_degree() == 1 and not polynomial.coeff_monomial(1):
                    self._shift(u, w, polynomial.coeff_monomial(u) / polynomial.coeff_monomial(w))
                    return

    def _shift(self, u: sp.Symbol, w: sp.Symbol, k: sp.Expr) -> None:
        at = self.symbols.index(u)
        if any(one.known == at for one in self.kinds):
            return
        self.atoms[at] = k * self.atoms[at]
        for one in self.kinds:
            one.product = sp.expand(one.product.xreplace({u: u / k}))
        self.shift = at, w

    def choose_units(self) -> None:
        """Rows in units in which most constants are 1; an atom that is a sum and occurs once takes its own constant."""
        for kind in self.kinds:
            seen = kind.product
            if self.shift is not None:
                u = self.symbols[self.shift[0]]
                seen = sp.expand(seen.xreplace({u: u - self.shift[1]}))
            constants = [abs(one.as_coeff_Mul()[0]) for one in sp.Add.make_args(seen)]
            unit = max(sorted(set(constants)), key=constants.count)
            kind.product, kind.unit = sp.expand(kind.product / unit), unit
            if kind.known is not None and unit != 1:
                kind.known = self._place(sp.expand(self.atoms[kind.known] / unit))
        for at, (atom, symbol) in enumerate(zip(self.atoms, self.symbols, strict=True)):
            users = [one for one in self.kinds if one.product.has(symbol)]
            if not atom.is_Add or len(users) != 1 or any(one.known == at for one in self.kinds):
                continue
            own = {one.as_coeff_Mul()[0] for one in sp.Add.make_args(users[0].product) if one.has(symbol)}
            if len(own) == 1 and own != {1} and sp.Poly(users[0].product, symbol).degree() == 1:
                (constant,) = own
                self.atoms[at] = atom * constant
                users[0].product = sp.expand(users[0].product.xreplace({symbol: symbol / constant}))
        self._drop_unused()

    def _drop_unused(self) -> None:
        used = [
            k
            for k, one in enumerate(self.symbols)
            if any(kind.product.has(one) or kind.known == k for kind in self.kinds)
        ]
        fresh = {self.symbols[k]: sp.Symbol(f"a{n}") for n, k in enumerate(used)}
        for kind in self.kinds:
            kind.product = kind.product.xreplace(fresh)  # at once: no name is replaced twice
            kind.known = None if kind.known is None else used.index(kind.known)
        self.atoms = [_short(self.atoms[k]) for k in used]
        self.symbols = list(fresh.values())
        if self.shift is not None:
            self.shift = used.index(self.shift[0]), self.shift[1]


def _short(e: sp.Expr) -> sp.Expr:
    """Of fewest operations: the constant outside, Horner in one of the inputs."""
    whole = sp.expand(e)
    if not whole.is_Add:
        return e
    constant, rest = whole.primitive()
    tried = [rest]
    for x in sorted(rest.free_symbols, key=str):
        if rest.is_polynomial(x):
            tried += [sp.Add(*[c * x**k for (k,), c in sp.Poly(rest, x).terms()]), sp.horner(rest, x)]
    best = min(tried, key=lambda one: (sp.count_ops(one), str(one)))
    return best if constant == 1 else sp.Mul(constant, best, evaluate=False)


class StrongSums:
    """The sums of a strong form and the programs around them.

    Attributes
    ----------
    strong : rows, theta and where the inputs come from
    p : symbols of the parameters
    atoms : factors of the rows, in the inputs
    kinds : of rows
    shift : atom u and parameter w of G = u + w; None where the gradient has no powers of such a sum
    linear : parameters l with P = sum p_l g_l + Q
    places : of each sum; the products are of atoms, with powers of u
    """

    def __init__(self, strong: StrongFunctions, found: _Rows) -> None:
        self.strong, self.p, self.atoms, self.kinds, self.shift = strong, found.p, found.atoms, found.kinds, found.shift
        self._symbols = found.symbols
        self._u: int | None = None if self.shift is None else self.shift[0]
        self._w = sp.Integer(0) if self.shift is None else self.shift[1]
        self._differentiate()
        self.linear = self._linear()
        self._families = self._families_of_moments()
        self.places = self._places()
        self._sums = [sp.Symbol(f"s{i}") for i in range(len(self.places))]
        self._weights = [sp.Symbol(f"w{k}") for k in range(len(self.kinds))]
        self._names = count()
        self._definitions: dict[sp.Expr, sp.Expr] = {}
        self._moments = self._shifted_moments()
        self._first = list(self._definitions)  # moments come before what uses them: fewer registers
        self._s, self._f, self._distance = self._projected()

    def _differentiate(self) -> None:
        for kind in self.kinds:
            product = kind.product
            if self._u is not None:
                product = sp.expand(product.xreplace({self._symbols[self._u]: self._symbols[self._u] - self._w}))
            for a in self.p:
                derivative = sp.diff(product, a)
                if self._u is not None and a == self._w:
                    derivative += sp.diff(product, self._symbols[self._u])
                kind.gradient.append(self._polynomial(derivative))
            kind.rest = self._polynomial(product)

    def _polynomial(self, e: sp.Expr) -> Polynomial:
        whole = sp.expand(e)
        if whole == 0:
            return {}
        terms = sp.Poly(whole, *self._symbols).terms() if self._symbols else [((), whole)]
        return {
            tuple((atom, power) for atom, power in enumerate(powers) if power): sp.factor_terms(c)
            if not c.has(sp.Pow) or c.is_polynomial()
            else sp.together(c)
            for powers, c in terms
        }

    @cached_property
    def _shown(self) -> list[sp.Symbol]:
        """Atoms as comments have them: signals, functions of them, x0, x1 ..; G in the place of the shift's."""
        named = [str(one) if one.is_Symbol or one.is_Function else f"x{a}" for a, one in enumerate(self.atoms)]
        taken = {*named, *map(str, self.p)}
        shifted = next(one for one in ("G", "G_", "G_shifted") if one not in taken)
        return [sp.Symbol(shifted if a == self._u else one) for a, one in enumerate(named)]

    def _text(self, monomial: Monomial, *, shifted: bool = True) -> str:
        own = {a: str(one) for a, one in enumerate(self._shown) if shifted or a != self._u}
        return text_of(monomial, own)

    def about(self, kind: int) -> list[str]:
        """What the rows of a kind are: Y, P and its gradient."""
        one = self.kinds[kind]
        values = dict(zip(self._symbols, self._shown, strict=True))
        linear = " + ".join(f"{self.p[a]} g[{kind}][{a}]" for a in self.linear if one.gradient[a])
        rest = self._expression(one.rest).xreplace(values)
        y = "0" if one.known is None else f"x{one.known}"
        return [
            f"Y[{kind}] = {y}",
            f"P[{kind}] = {' + '.join([*([linear] if linear else []), *([] if rest == 0 else [str(rest)])]) or '0'}",
            *(
                f"g[{kind}][{a}] = dP/d{p} = {self._expression(g).xreplace(values)}"
                for a, (p, g) in enumerate(zip(self.p, one.gradient, strict=True))
                if g
            ),
        ]

    @property
    def shift_text(self) -> str:
        """As in G = x1 + w; nothing without a shift."""
        return "" if self._u is None else f"{self._shown[self._u]} = x{self._u} + {self._w}"

    def _expression(self, polynomial: Polynomial) -> sp.Expr:
        terms = [c * sp.Mul(*[self._symbols[a] ** k for a, k in m]) for m, c in polynomial.items()]
        return sp.expand(sp.Add(*terms))

    def _linear(self) -> list[int]:
        """One after the other, that which leaves fewest terms of Q; writes Q into the kinds."""
        rest = [self._expression(one.rest) for one in self.kinds]
        parts = [
            [sp.expand(a * self._expression(g)) for a, g in zip(self.p, one.gradient, strict=True)]
            for one in self.kinds
        ]
        chosen: list[int] = []

        def terms(expressions: Sequence[sp.Expr]) -> int:
            return sum(len(sp.Add.make_args(one)) for one in expressions if one != 0)

        while True:
            left = {
                j: [sp.expand(q - own[j]) for q, own in zip(rest, parts, strict=True)]
                for j in range(len(self.p))
                if j not in chosen
            }
            best = min(left, key=lambda j: terms(left[j]), default=None)
            if best is None or terms(left[best]) >= terms(rest):
                break
            rest = left[best]
            chosen.append(best)
        for kind, q in zip(self.kinds, rest, strict=True):
            kind.rest = self._polynomial(q)
        return sorted(chosen)

    def _families_of_moments(self) -> dict[Monomial, list[int]]:
        """Products without the shift's atom -> powers of G with which they occur in S, F and the residuals."""
        found: dict[Monomial, None] = {}
        for kind in self.kinds:
            own = kind.monomials
            for i, m in enumerate(own):
                partners = [
                    n
                    for n in own[i:]
                    if any((m in a and n in b) or (n in a and m in b) for a in kind.gradient for b in kind.gradient)
                ]
                found |= dict.fromkeys(times(m, n) for n in (*partners, *kind.rest))
                if kind.y:
                    found[times(m, kind.y)] = None
            for n in kind.rest:
                found |= dict.fromkeys(
                    [*(times(n, other) for other in kind.rest), *([times(n, kind.y)] * bool(kind.y))]
                )
        families: dict[Monomial, list[int]] = {}
        for one in found:
            rest, power = self._split(one)
            families.setdefault(rest, []).append(power)
        return families

    def _split(self, monomial: Monomial) -> tuple[Monomial, int]:
        powers = dict(monomial)
        power = powers.pop(self._u, 0) if self._u is not None else 0
        return tuple(sorted(powers.items())), power

    def _joined(self, rest: Monomial, power: int) -> Monomial:
        return times(rest, ((self._u, power),)) if power and self._u is not None else rest

    def _places(self) -> dict[Monomial, int]:
        """All powers of u of each family, the highest first; Y^2 of each kind; the weight."""
        places: dict[Monomial, int] = {}
        for rest, powers in self._families.items():
            for power in range(max(powers), -1, -1):
                places.setdefault(self._joined(rest, power), len(places))
        for kind in self.kinds:
            if kind.y:
                places.setdefault(times(kind.y, kind.y), len(places))
        places.setdefault((), len(places))
        return places

    def _let(self, e: sp.Expr, stem: str) -> sp.Expr:
        """A symbol that is defined as the expression."""
        if e.is_Symbol or e.is_number:
            return e
        name = sp.Symbol(f"{stem}{next(self._names)}")
        self._definitions[name] = e
        return name

    def _shifted_moments(self) -> dict[Monomial, sp.Expr]:
        """Products with powers of G -> their sums: one binomial row of each family, then X_i <- X_(i+1) + w X_i."""
        w, values = self._w, {}
        for rest, powers in self._families.items():
            least, levels = min(powers), max(powers) - min(powers)

            def power(k: int, rest: Monomial = rest) -> sp.Symbol:
                return self._sums[self.places[self._joined(rest, k)]]

            if least == 0 and levels == 0:
                values[rest] = power(0)
                continue
            row = [sp.Integer(1), *(self._let(comb(least, i) * w**i, "c") for i in range(1, least + 1))]
            level = [
                self._let(sp.Add(*[row[i] * power(least + up - i) for i in range(least + 1)]), "t")
                for up in range(levels + 1)
            ]
            values[self._joined(rest, least)] = level[0]
            for up in range(1, levels + 1):
                level = [self._let(level[i + 1] + w * level[i], "t") for i in range(len(level) - 1)]
                values[self._joined(rest, least + up)] = level[0]
        for kind in self.kinds:
            if kind.y:
                values.setdefault(times(kind.y, kind.y), self._sums[self.places[times(kind.y, kind.y)]])
        return values

    def _projected(self) -> tuple[list[list[sp.Expr]], list[sp.Expr], sp.Expr]:
        """S, F, and sum (Y - Q)^2."""
        n_p, moments = len(self.p), self._moments
        coefficients: dict[sp.Expr, sp.Expr] = {}

        def named(c: sp.Expr) -> sp.Expr:
            if c not in coefficients:
                coefficients[c] = c if c.is_number else self._let(c, "k")
            return coefficients[c]

        def weighted(k: int, e: sp.Expr) -> sp.Expr:
            return self._weights[k] * self._let(e, "v") if k else e

        s = [[sp.Integer(0)] * n_p for _ in range(n_p)]
        f, distance = [sp.Integer(0)] * n_p, sp.Integer(0)
        for k, kind in enumerate(self.kinds):
            shared: dict[tuple[Monomial, int], sp.Expr] = {}
            for j in range(n_p):
                for i in range(j + 1):
                    few, many = (i, j) if len(kind.gradient[i]) <= len(kind.gradient[j]) else (j, i)
                    terms = []
                    for m, c in kind.gradient[few].items():
                        if (m, many) not in shared:
                            inner = [named(d) * moments[times(m, n)] for n, d in kind.gradient[many].items()]
                            shared[m, many] = self._let(sp.Add(*inner), "v")
                        terms.append(named(c) * shared[m, many])
                    if terms:
                        s[i][j] += weighted(k, sp.Add(*terms))
                own = []
                for m, c in kind.gradient[j].items():
                    inner = [moments[times(m, kind.y)]] if kind.y else []
                    inner += [-named(d) * moments[times(m, n)] for n, d in kind.rest.items()]
                    if inner:
                        own.append(named(c) * self._let(sp.Add(*inner), "v"))
                if own:
                    f[j] += weighted(k, sp.Add(*own))
            rest = [-2 * c * moments[times(m, kind.y)] for m, c in kind.rest.items() if kind.y]
            rest += [c * d * moments[times(m, n)] for m, c in kind.rest.items() for n, d in kind.rest.items()]
            square = [moments[times(kind.y, kind.y)]] if kind.y else []
            distance += weighted(k, sp.Add(*square, *rest))
        whole = [[self._let(s[min(i, j)][max(i, j)], "S") for j in range(n_p)] for i in range(n_p)]
        return whole, [f[j] - sp.Add(*[self.p[i] * whole[j][i] for i in self.linear]) for j in range(n_p)], distance

    def _arguments(self) -> tuple[list[sp.Symbol], list[str]]:
        names = [f"p{a}" for a in range(len(self.p))]
        return [*self.p, *self._weights, *self._sums], [*names, *map(str, self._weights), *map(str, self._sums)]

    @cached_property
    def noted_projection(self) -> Noted:
        """p, weights of the kinds, sums -> the upper triangle of S by rows, F."""
        symbols, names = self._arguments()
        builder = Builder(symbols, {}, self._definitions)
        for one in self._first:
            builder.place_of(one)
        triangle = [(i, j) for i in range(len(self.p)) for j in range(i, len(self.p))]
        wanted = [*(self._s[i][j] for i, j in triangle), *self._f]
        shown = {self._sums[at]: f"sum {self._text(one, shifted=False)}" for one, at in self.places.items()}
        moments = {one: f"sum {self._text(m)}" for m, one in self._moments.items() if one not in shown}
        whole = {self._s[i][j]: f"S[{i}][{j}]" for i, j in triangle if self._s[i][j].is_Symbol}
        return Noted.of(builder, names, wanted, {**shown, **moments, **whole})

    @property
    def projection(self) -> Program:
        """The same without notes."""
        return self.noted_projection.program

    @cached_property
    def distance(self) -> Program:
        """p, weights of the kinds, sums -> sum (Y - Q)^2."""
        symbols, names = self._arguments()
        builder = Builder(symbols, {}, self._definitions)
        results = (builder.place_of(sp.sympify(self._distance)),)
        return Program(tuple(names), tuple(builder.values), results)

    @cached_property
    def innovation(self) -> Innovation:
        """Residual and gradient of each kind."""
        atoms = len(self.atoms)
        shifted = [_SHIFT if a == self._u else one for a, one in enumerate(self._symbols)]
        definitions: dict[sp.Expr, sp.Expr] = {}
        shown: dict[sp.Expr, str] = {}
        if self._u is not None:
            definitions[_SHIFT] = self._symbols[self._u] + self._w
        values: dict[Monomial, sp.Expr] = {(): sp.Integer(1), **{((a, 1),): shifted[a] for a in range(atoms)}}
        needed = [m for kind in self.kinds for part in (*kind.gradient, kind.rest) for m in part]
        _multiply(values, definitions, chains_of(needed, atoms), "m")
        wanted: list[sp.Expr] = []
        entries = []
        for k, kind in enumerate(self.kinds):
            own = {j: sp.Symbol(f"g{k}_{j}") for j, g in enumerate(kind.gradient) if g}
            for j, name in own.items():
                definitions[name] = sp.Add(*[c * values[m] for m, c in kind.gradient[j].items()])
                shown[name] = f"g[{k}][{j}]"
            y = sp.Integer(0) if kind.known is None else self._symbols[kind.known]
            rest = sp.Add(*[c * values[m] for m, c in kind.rest.items()])
            wanted += [y - rest - sp.Add(*[self.p[j] * own[j] for j in self.linear if j in own]), *own.values()]
            entries.append(list(own))
        builder = Builder([*self.p, *self._symbols], {}, definitions)
        names = (*(f"p{a}" for a in range(len(self.p))), *(f"x{a}" for a in range(atoms)))
        products = {one: self._text(m) for m, one in values.items() if one in definitions}
        return Innovation(Noted.of(builder, names, wanted, products | shown), entries)

    @cached_property
    def bound(self) -> Program:
        """Atoms -> a sum of squares that bounds the square of every entry of the rows: of each family of powers of u
        the square of the rest times 1 + the highest even power, without sines and signs, which 1 bounds."""
        small = {a for a, one in enumerate(self.atoms) if one.is_Function}
        families: dict[Monomial, set[int]] = {}
        for kind in self.kinds:
            for m in [*self._polynomial(kind.product), *([kind.y] if kind.y else [])]:
                rest, power = self._split(tuple(one for one in m if one[0] not in small))
                families.setdefault(rest, set()).add(power)
        definitions: dict[sp.Expr, sp.Expr] = {}
        values: dict[Monomial, sp.Expr] = {((a, 1),): one for a, one in enumerate(self._symbols)}
        _multiply(values, definitions, chains_of(families, len(self.atoms)), "m")
        alone, spread, most = [], [], 0
        for rest, powers in families.items():
            if max(powers) == 0 and rest:
                alone.append(values[rest] ** 2)
            elif max(powers):
                most = max(most, *powers)
                spread.append(values[rest] ** 2 if rest else sp.Integer(1))
        if self._u is not None and spread:
            alone.append((1 + (self._symbols[self._u] ** 2) ** most) * sp.Add(*spread))
        builder = Builder(self._symbols, {}, definitions)
        results = (builder.place_of(sp.Add(*alone, evaluate=False) if alone else sp.Integer(0)),)
        names = tuple(f"x{a}" for a in range(len(self.atoms)))
        return Program(names, tuple(builder.values), results)

    @cached_property
    def atoms_program(self) -> Program:
        """Inputs -> atoms."""
        inputs = self.strong.functions.inputs
        builder = Builder([one.symbol for one in inputs], {})
        results = tuple(builder.place_of(e) for e in self.atoms)
        return Program(tuple(f"in{k}" for k in range(len(inputs))), tuple(builder.values), results)

    @property
    def chains(self) -> list[Chain]:
        """The products of the sums."""
        return chains_of((one for one in self.places if one), len(self.atoms))


def _multiply(
    values: dict[Monomial, sp.Expr], definitions: dict[sp.Expr, sp.Expr], chains: Iterable[Chain], stem: str
) -> None:
    """Adds the products to the values, each as a symbol."""
    for one in chains:
        name = sp.Symbol(stem + "_".join(f"{a}x{k}" for a, k in one.made))
        left, right = values[one.left], values[one.right]
        definitions[name] = left**2 if left == right else sp.Mul(left, right, evaluate=False)
        values[one.made] = name


def text_of(monomial: Monomial, names: Mapping[int, str] | None = None) -> str:
    """As in x0 x1^2; 1 without a factor."""
    parts = [f"{(names or {}).get(a, f'x{a}')}{f'^{k}' if k > 1 else ''}" for a, k in monomial]
    return " ".join(parts) or "1"
