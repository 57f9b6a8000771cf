"""Expressions without sense as model files: each is a report or one sentence, never a traceback."""

import random

import sympy as sp

from pvid.base.errors import PvidError
from pvid.model import Model, cos, sgn, sin
from pvid.model.report import check_report
from pvid.model.signals import Jet

_UNITS = ("s", "m", "rad", "kg*m^2", "1/s", "mm", "V", "furlong", "A*", "deg")


def test_every_description_without_sense_is_reported_or_refused_in_one_sentence() -> None:
    refused = 0
    for seed in range(40):
        try:
            assert "sum of theta * N = Y" in check_report(described(random.Random(seed)).compiled("random")), seed
        except PvidError as error:
            assert "\n" not in str(error) and len(str(error)) >= 20, seed
            refused += 1
    assert 10 < refused < 40


def described(source: random.Random) -> Model:
    """Whatever the symbols allow."""
    model = Model("random expressions")
    odd = 0.05 if source.random() < 0.2 else 0.0  # how often a unit is a wrong one
    signals = [_signal(model, source, f"z{k}", _unit(source, odd)) for k in range(source.randint(1, 3))]
    unknowns = [_unknown(model, source, f"p{k}", _unit(source, odd)) for k in range(source.randint(1, 4))]
    second = model.known("s0", "s", 1.0)
    leaves = [*signals, *signals, *unknowns, *(one.d(n) * second**n for one in signals for n in (1, 2, 3))]
    for _ in range(source.randint(1, 3)):
        whole = _expression(source, leaves, source.randint(1, 4))
        model.equation(whole + sum(source.choice(unknowns) * source.choice(leaves) for _ in range(2)))
    return model


def _signal(model: Model, source: random.Random, name: str, unit: str) -> Jet:
    kind = source.randrange(8)
    if kind == 0:
        return model.unmeasured(name, unit)
    if kind == 1:
        return model.input(name, unit, hold=source.choice(("zoh", "sampled")))
    return model.sensor(name, unit, resolution=1e-3)


def _unknown(model: Model, source: random.Random, name: str, unit: str) -> sp.Expr:
    if source.random() < 0.1:
        return model.known(name, unit, source.choice((0.5, 9.81, 2.0)))
    if source.random() < 0.15:
        return model.unknown(name, unit, 0.0, positive=False, sd=1.0)
    return model.unknown(name, unit, source.choice((1e-3, 0.3, 1.0, 20.0)))


def _unit(source: random.Random, odd: float) -> str:
    return source.choice(_UNITS) if source.random() < odd else ""


def _expression(source: random.Random, leaves: list[sp.Expr], depth: int) -> sp.Expr:
    if depth == 0:
        leaf = source.choice(leaves)
        return leaf if source.random() < 0.9 else sp.Float(source.choice((0.5, 2.0, 3.3)))
    one = _expression(source, leaves, depth - 1)
    other = _expression(source, leaves, source.randrange(depth))
    kind = source.randrange(14)
    if kind < 5:
        return one + other
    if kind < 9:
        return one * other
    if kind == 9:
        return one / (other if other != 0 else sp.Integer(1))
    if kind == 10:
        return source.choice((sin, cos, sgn, abs, sp.exp, sp.sqrt, sp.tan, sp.tanh))(one)
    if kind == 11:
        return one ** source.choice((2, 3, -1, 0.5))
    return one - other
