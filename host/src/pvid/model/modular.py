"""Linear algebra over the rationals by residues of a large prime: as exact in practice, and without long fractions.

A rank is too small only where the prime divides a minor, with a probability of about 1e-17.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import isqrt

PRIME = 2**61 - 1


def residue(number: Fraction | int) -> int:
    """Of a rational number whose denominator the prime does not divide."""
    whole = Fraction(number)
    return whole.numerator * pow(whole.denominator, -1, PRIME) % PRIME


def rational(number: int) -> Fraction:
    """The rational number with this residue whose numerator and denominator are small."""
    limit = isqrt(PRIME // 2)
    r0, r1, t0, t1 = PRIME, number % PRIME, 0, 1
    while r1 > limit:
        quotient = r0 // r1
        r0, r1, t0, t1 = r1, r0 - quotient * r1, t1, t0 - quotient * t1
    return Fraction(r1, t1)


def echelon(rows: Sequence[Sequence[int]]) -> tuple[list[list[int]], list[int]]:
    """The reduced row echelon form without its zero rows, and its pivots."""
    left = [list(row) for row in rows]
    columns = len(left[0]) if left else 0
    done: list[list[int]] = []
    pivots: list[int] = []
    for j in range(columns):
        k = next((k for k, row in enumerate(left) if row[j]), None)
        if k is None:
            continue
        chosen = left.pop(k)
        scale = pow(chosen[j], -1, PRIME)
        chosen = [value * scale % PRIME for value in chosen]
        left = [_reduced(row, chosen, j) for row in left]
        done = [_reduced(row, chosen, j) for row in done]
        done.append(chosen)
        pivots.append(j)
    return done, pivots


def _reduced(row: list[int], by: list[int], j: int) -> list[int]:
    factor = row[j]
    return [(value - factor * other) % PRIME for value, other in zip(row, by, strict=True)] if factor else row
