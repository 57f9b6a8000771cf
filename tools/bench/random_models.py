"""Random descriptions of mechanisms: `check` of each is a report or one sentence, never a traceback.

Half of them are mechanisms with a fault or none (Lagrangians, linear systems with hidden coordinates); the other half
are expressions without sense.
"""

from __future__ import annotations

import random
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import sympy as sp
from sympy.core.cache import clear_cache

from pvid.base.errors import PvidError
from pvid.model import Integral, Model, cos, sgn, sin
from pvid.model.identifiability import identifiable
from pvid.model.report import check_report
from pvid.model.signals import Jet
from pvid.models import mechanisms

HEADER = ("models", "compiled", "identifiable", "not identifiable", "refused", "tracebacks", "longest [s]")
_UNITS = ("s", "m", "rad", "kg*m^2", "1/s", "mm", "V", "furlong", "A*", "deg")


@dataclass
class Tally:
    """Outcomes of many descriptions.

    Attributes
    ----------
    count : of each kind of outcome
    causes : first words of the refusals
    tracebacks : (seed, error) of what must not happen
    longest : processor time of the slowest one [s], and its seed
    """

    count: Counter[str] = field(default_factory=Counter)
    causes: Counter[str] = field(default_factory=Counter)
    tracebacks: list[tuple[int, str]] = field(default_factory=list)
    longest: tuple[float, int] = (0.0, -1)

    def row(self) -> tuple[str, ...]:
        """Cells of the table."""
        compiled = self.count["identifiable"] + self.count["not identifiable"]
        numbers = (compiled + self.count["refused"] + len(self.tracebacks), compiled, self.count["identifiable"])
        rest = (self.count["not identifiable"], self.count["refused"], len(self.tracebacks))
        return (*map(str, numbers + rest), f"{self.longest[0]:.2f} (seed {self.longest[1]})")


def run(seeds: range, advance: Callable[[int], None] = lambda done: None) -> Tally:
    """Describes, compiles and reports one model for each seed."""
    tally = Tally()
    for seed in seeds:
        began = time.process_time()
        try:
            model = described(random.Random(seed))
            compiled = model.compiled("random")
            text = check_report(compiled)
            assert "sum of theta * N = Y" in text
            tally.count["not identifiable" if "Not identifiable: " in text else "identifiable"] += 1
        except PvidError as error:
            cause = str(error)
            if "\n" in cause or len(cause) < 20:
                tally.tracebacks.append((seed, f"not a sentence: {cause!r}"))
            tally.count["refused"] += 1
            tally.causes[" ".join(cause.split(": ", 1)[-1].split()[:4])] += 1
        except Exception as error:  # what is looked for
            tally.tracebacks.append((seed, f"{type(error).__name__}: {error}"))
        tally.longest = max(tally.longest, (time.process_time() - began, seed))
        advance(seed - seeds.start + 1)
    return tally


COMPILE_HEADER = ("mechanism", "theta", "unknowns", "compiled in [s]", "judged in [s]")


def compile_times() -> list[tuple[str, ...]]:
    """Processor time of each shipped mechanism, in a process that has compiled none yet."""
    out: list[tuple[str, ...]] = []
    for name in mechanisms.names():
        clear_cache()
        began = time.process_time()
        compiled = mechanisms.described(name).compiled(name)
        done = time.process_time()
        identifiable(compiled)
        thetas = " + ".join(str(len(row.theta)) for row in compiled.rows)
        times = (f"{done - began:.2f}", f"{time.process_time() - done:.2f}")
        out.append((name, thetas, str(len(compiled.p)), *times))
    return out


def described(source: random.Random) -> Model:
    """A random description."""
    return source.choice((_lagrangian, _linear, _senseless, _senseless))(source)


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


def _lagrangian(source: random.Random) -> Model:
    """One to three coordinates, masses and stiffnesses, sines of sums, friction; some of it not measured."""
    model = Model("random Lagrangian")
    n = source.randint(1, 3)
    q = [_signal(model, source, f"q{k}", "rad") for k in range(n)]
    u = [_signal(model, source, f"u{k}", "1/s^2") for k in range(n)]
    offset = _unknown(model, source, "c", "rad") if source.random() < 0.3 else sp.Integer(0)
    angles = [sin(q[0] - offset), cos(q[-1] - offset), sp.Integer(1), q[0], q[-1] ** 2, cos(q[0] - q[-1])]
    total = sp.Integer(0)
    for k in range(source.randint(n, n + 2)):
        speeds = source.choice(q).d() * source.choice(q).d()
        total += _unknown(model, source, f"m{k}", "") * speeds * source.choice(angles) * source.choice(angles)
    for k in range(source.randint(0, 2)):
        total -= _unknown(model, source, f"g{k}", "1/s^2") * source.choice(angles)
    forces = []
    for k in range(n):
        friction = _unknown(model, source, f"b{k}", "1/s") * q[k].d()
        if source.random() < 0.4:
            friction += _unknown(model, source, f"f{k}", "1/s^2") * source.choice((sgn(q[k].d()), abs(q[k]), sgn(u[k])))
        forces.append(u[k] - friction)
    model.lagrange(total, q, forces)
    return model


def _linear(source: random.Random) -> Model:
    """Linear equations with constant coefficients, often too few; now and then a product with a signal."""
    model = Model("random linear system")
    signals = [_signal(model, source, f"z{k}", "") for k in range(source.randint(2, 5))]
    if source.random() < 0.2:
        signals.append(model.define("w", "s", Integral(signals[0], 1)))
    units = {0: "1", 1: "s", 2: "s^2"}
    for e in range(source.randint(1, 4)):
        whole = sp.Integer(0)
        for k, one in enumerate(source.sample(signals, source.randint(1, len(signals)))):
            order = source.randint(0, 2)
            factor = _unknown(model, source, f"p{e}{k}", units[order]) if source.random() < 0.7 else sp.Integer(1)
            term = factor * one.d(order) if source.random() < 0.85 else factor * one.d(order) * source.choice(signals)
            whole += term if factor != 1 or order == 0 else one
        model.equation(whole)
    return model


def _senseless(source: random.Random) -> Model:
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
