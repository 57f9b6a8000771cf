"""Residues of a large prime stand for rational numbers."""

import random
from fractions import Fraction

import sympy as sp

from pvid.model.modular import echelon, rational, residue
from pvid.model.zero import Sampler, dependent


def test_small_rationals_come_back() -> None:
    source = random.Random(1)
    for _ in range(200):
        number = Fraction(source.randint(-(10**6), 10**6), source.randint(1, 10**6))
        assert rational(residue(number)) == number


def test_the_echelon_form_is_sympys() -> None:
    source = random.Random(2)
    for _ in range(20):
        rows, columns = source.randint(1, 5), source.randint(1, 5)
        some = [Fraction(one) for one in ("0", "0", "1", "-2", "1/3")]
        numbers = [[source.choice(some) for _ in range(columns)] for _ in range(rows)]
        numbers += [numbers[0]]  # not of full rank
        mine, pivots = echelon([list(map(residue, row)) for row in numbers])
        wanted, wanted_pivots = sp.Matrix(numbers).rref()
        assert tuple(pivots) == wanted_pivots
        for k, row in enumerate(mine):
            assert [sp.Rational(rational(value)) for value in row] == list(wanted.row(k))


def test_dependence_is_found_through_sines_and_powers() -> None:
    x, y = sp.symbols("x y")
    functions = [sp.sin(x) ** 2, sp.Integer(1), x, sp.cos(x) ** 2, sp.cos(2 * x), y**9, sp.sin(x + y)]
    functions += [3 * x - y**9 / 7, sp.sin(x) * sp.cos(y), sp.cos(x) * sp.sin(y)]
    found = dependent(functions)
    assert found == {3: {0: -1, 1: 1}, 4: {0: -2, 1: 1}, 7: {2: 3, 5: sp.Rational(-1, 7)}, 9: {6: 1, 8: -1}}


def test_a_sampler_keeps_the_identities_of_angles() -> None:
    x, y = sp.symbols("x y")
    zero = sp.sin(x - y) - sp.sin(x) * sp.cos(y) + sp.cos(x) * sp.sin(y)
    values = Sampler([zero, sp.sin(-x) + sp.sin(x), x]).at_random(random.Random(3))
    assert values[:2] == [0, 0]
    assert values[2] != 0
