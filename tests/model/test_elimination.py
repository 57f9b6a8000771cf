"""What is not measured is eliminated exactly, or refused by name."""

import random

import pytest
import sympy as sp
from mechanisms_to_refuse import FINE, cart, linear_in_nothing, motor, unknowns

from pvid.base.errors import PvidError
from pvid.model import Model, cos, sin
from pvid.model.compiled import CompiledModel, Part
from pvid.model.signals import TIME, Integral, Jet, jets, total_derivative
from pvid.model.zero import is_zero


def on_solutions(compiled: CompiledModel, measured: dict[str, sp.Expr]) -> list[sp.Expr]:
    """sum theta N - Y of each row, with expressions in free jets in place of signals: 0 where the row is right."""

    def rate(part: Part) -> sp.Expr:
        return sum((total_derivative(psi, m) for m, psi in part.items()), sp.Integer(0))

    out = []
    for row in compiled.rows:
        whole = sum(theta * rate(part) for theta, part in zip(row.theta, row.regressors, strict=True)) - rate(row.known)
        used = [jet for jet in jets(sp.expand(whole)) if jet.of in measured]
        out.append(sp.expand(whole).xreplace({jet: total_derivative(measured[jet.of], jet.order) for jet in used}))
    return out


@pytest.mark.parametrize("seed", range(8))
def test_random_linear_systems_with_hidden_coordinates(seed: int) -> None:
    """h hidden coordinates with constant coefficients, h + 1 or more equations, each with a force of its own: the rows
    vanish for every motion."""
    source = random.Random(seed)
    model = Model("random")
    hidden = [model.unmeasured(f"x{n}", "") for n in range(source.randint(1, 2))]
    q = model.sensor("q", "", noise=1e-3)
    forces = {}
    for k in range(len(hidden) + source.randint(1, 2)):
        force = model.sensor(f"u{k}", "", noise=1e-3)
        whole = sin(q) * model.known(f"g{k}", "", 2.0)
        for n, x in enumerate([*hidden, q]):
            for order in source.sample(range(3), source.randint(1, 2)):
                unit = "*".join(["s"] * order) or "1"
                whole += model.unknown(f"p{k}{n}{order}", unit, 1.0) * x.d(order)
        forces[f"u{k}"] = whole
        model.equation(whole - force)
    compiled = model.compiled()
    assert compiled.rows
    for residual in on_solutions(compiled, forces):
        assert is_zero(residual)
    names = {x.of for x in hidden}
    psis = [psi for row in compiled.rows for part in (*row.regressors, row.known) for psi in part.values()]
    assert not any(jet.of in names for psi in psis for jet in jets(psi))


@pytest.mark.parametrize("seed", range(10))
def test_random_substitutions(seed: int) -> None:
    """An acceleration that is not measured, multiplied by sines of a measured angle."""
    source = random.Random(seed)
    model = Model("random")
    a, x = model.sensor("a", "", noise=1e-3), model.unmeasured("x", "")
    order = source.randint(0, 2)
    forces = {}
    for k in range(source.randint(2, 3)):
        force = model.sensor(f"u{k}", "", noise=1e-3)
        unit = "*".join(["s"] * order) or "1"
        gain = source.choice([sp.Integer(1), cos(a), sin(a)])
        whole = model.unknown(f"m{k}", unit, 1.0) * gain * x.d(order) + model.unknown(f"j{k}", "s^2", 1.0) * a.d(2)
        whole += model.unknown(f"g{k}", "", 1.0) * source.choice([sin(a), cos(a), sp.Integer(1)])
        forces[f"u{k}"] = whole
        model.equation(whole - force)
    for residual in on_solutions(model.compiled(), forces):
        assert is_zero(residual)


def along(part: Part, motion: dict[str, sp.Expr]) -> sp.Expr:
    """sum D^m[psi] of a motion whose signals are polynomials of the time; running integrals begin at 0."""

    def value(psi: sp.Expr) -> sp.Expr:
        integrals = {}
        for one in psi.atoms(Integral):
            inside = value(one.args[0])
            for _ in range(int(one.args[1])):
                inside = sp.integrate(sp.expand(inside), (TIME, 0, TIME))
            integrals[one] = inside
        moving = {jet: sp.diff(motion[jet.of], TIME, jet.order) for jet in jets(psi.xreplace(integrals))}
        return psi.xreplace(integrals).xreplace(moving)

    return sp.expand(sum((sp.diff(value(psi), TIME, m) for m, psi in part.items()), sp.Integer(0)))


@pytest.mark.parametrize("seed", range(4))
def test_random_integrator_chains(seed: int) -> None:
    """Two equations that share G x, G a function of a signal: the row's residual lies in the span of its nuisances."""
    source = random.Random(seed)
    model = Model("chain")
    phi, u, f1, f2 = (model.sensor(name, "", noise=1e-3) for name in ("phi", "u", "f1", "f2"))
    x, second = model.unmeasured("x", ""), model.known("s", "s", 1.0)
    w, d, c = (model.unknown(name, "", value) for name, value in (("w", 3.0), ("d", 2.0), ("c", 0.5)))
    top, gain = source.choice((1, 2)), source.choice((w + u, w * (1 + u**2), u))
    first = second**top * x.d(top) + gain * x - d * source.choice((phi, phi * u))
    other = second**2 * phi.d(2) - gain * x + w * d * (phi - c) * source.choice((gain, sp.Integer(1)))
    model.equation(first - f1)
    model.equation(other - f2)
    (row,) = model.compiled().rows
    assert len(row.nuisances) in (top, 0)

    def polynomial() -> sp.Expr:
        return sum(sp.Rational(source.randint(-5, 5), source.randint(1, 5)) * TIME**n for n in range(5))

    p = {one: sp.Rational(source.randint(1, 9), 4) for one in (w, d, c)} | {second: sp.Integer(1)}
    motion = {name: polynomial() for name in ("phi", "u", "x")}
    for name, whole in (("f1", first), ("f2", other)):
        motion[name] = along({0: whole.xreplace(p)}, motion)
    residual = sum(
        theta.xreplace(p) * along(part, motion).xreplace(p)
        for theta, part in zip(row.theta, row.regressors, strict=True)
    )
    residual = sp.expand(residual - along(row.known, motion).xreplace(p))
    free = [along(part, motion).xreplace(p) for part in row.nuisances]
    powers = range(60)
    columns = [[sp.expand(one).coeff(TIME, n) for n in powers] for one in (*free, residual)]
    assert sp.Matrix(columns).rank() == sp.Matrix(columns[:-1]).rank() if free else residual == 0


def test_a_cart_without_sensor_is_substituted_and_normalised() -> None:
    compiled = cart(hidden="x").compiled()
    (row,) = compiled.rows
    assert row.known, "a homogeneous row must be divided"
    motion = cart().compiled()
    force = motion.equations[0] + Jet("F")
    x2 = sp.solve(motion.equations[1], Jet("x", 2))[0]
    (residual,) = on_solutions(compiled, {"F": sp.expand(force.xreplace({Jet("x", 2): x2}))})
    assert is_zero(residual)


def test_a_motor_without_current_sensor_keeps_the_sign_of_its_speed_undifferentiated() -> None:
    (row,) = motor(current=False).compiled().rows
    friction = [part for part in row.regressors if any("sgn" in str(psi) for psi in part.values())]
    assert {m for part in friction for m in part} == {0, 1}
    assert row.top == 3


def refusal(model: Model) -> str:
    with pytest.raises(PvidError) as caught:
        model.compiled()
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_a_hidden_coordinate_with_friction_is_refused_with_what_helps() -> None:
    text = refusal(cart(hidden="x", friction=True))
    assert "x cannot be eliminated" in text
    assert "ml*x''*cos(a)" in text
    assert "b*x'" in text
    assert "a sensor for x would help" in text


def test_a_hidden_angle_is_refused() -> None:
    text = refusal(cart(hidden="a"))
    assert "a cannot be eliminated" in text
    assert "not linear in a" in text
    assert "sensor for a" in text


def test_too_few_equations_are_refused() -> None:
    model = Model("one equation")
    x, y, u = model.unmeasured("x", ""), model.sensor("y", "", noise=0.1), model.input("u", "", hold="zoh")
    (k,) = unknowns(model, "k:1")
    model.equation(k * x + y - u)
    text = refusal(model)
    assert "x cannot be eliminated: 1 equation for 1 unmeasured coordinate" in text
    assert "sensor for x" in text


def test_friction_of_a_hidden_speed_is_refused() -> None:
    from pvid.model import sgn

    model = Model("hidden friction")
    x, y, u = model.unmeasured("x", "m"), model.sensor("y", "m", noise=0.1), model.input("u", "N", hold="zoh")
    m, k, c = unknowns(model, "m:kg k:N/m c:N")
    model.equation(m * x.d(2) + c * sgn(x.d()) + k * (x - y))
    model.equation(m * y.d(2) + k * (y - x) - u)
    text = refusal(model)
    assert "sgn(x') is not linear in it" in text
    assert "sensor for x" in text


def test_a_coordinate_that_no_equation_contains_is_refused() -> None:
    model = motor(current=True)
    model.unmeasured("z", "m")
    assert "no equation contains it" in refusal(model)


def test_an_equation_linear_in_nothing_is_refused() -> None:
    text = refusal(linear_in_nothing())
    assert "the unknown k stands inside sin(k*x)" in text
    assert "declare k as known" in text
    assert "mechanisms_to_refuse.py, line" in text


def test_an_equation_without_unknowns_is_refused() -> None:
    model = Model("kinematics")
    x, v = model.sensor("x", "m", resolution=FINE), model.sensor("v", "m/s", resolution=FINE)
    (b,) = unknowns(model, "b:1/s")
    model.equation(x.d() - v)
    model.equation(v.d() + b * v)
    assert "equation 1 contains no unknown" in refusal(model)


def test_an_unknown_that_nothing_contains_is_refused() -> None:
    model = motor(current=True)
    model.unknown("ghost", "m", 1.0)
    assert "ghost" in refusal(model)
