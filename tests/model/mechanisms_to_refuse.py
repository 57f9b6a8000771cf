"""Mechanisms with something amiss, in one place for the tests of refusals and of identifiability."""

import sympy as sp

from pvid.model import Model, cos, sgn, sin

FINE = 1e-4  # resolution of every sensor here


def unknowns(model: Model, units: str) -> list[sp.Symbol]:
    """Of "R:ohm L:H", each with the guess 1."""
    return [model.unknown(name, unit, 1.0) for name, unit in (one.split(":") for one in units.split())]


def arm(elbow_known: bool) -> Model:
    """Two links; the mass at the elbow is declared as unknown or left out."""
    model = Model("arm")
    torques = [model.input(f"u{n}", "N*m", hold="zoh") for n in (1, 2)]
    q1, q2 = (model.sensor(f"q{n}", "rad", resolution=FINE) for n in (1, 2))
    l1, g = model.known("l1", "m", 0.3), model.known("g", "m/s^2", 9.81)
    i1, h1, i2, h2 = unknowns(model, "I1:kg*m^2 h1:kg*m I2:kg*m^2 h2:kg*m")
    m2 = model.known("m2", "kg", 0.8) if elbow_known else unknowns(model, "m2:kg")[0]
    kinetic = (i1 + m2 * l1**2) * q1.d() ** 2 / 2 + i2 * (q1.d() + q2.d()) ** 2 / 2
    kinetic += h2 * l1 * cos(q2) * q1.d() * (q1.d() + q2.d())
    model.lagrange(kinetic - g * ((h1 + m2 * l1) * sin(q1) + h2 * sin(q1 + q2)), [q1, q2], torques)
    return model


def motor(current: bool) -> Model:
    """A DC motor with a current sensor or without."""
    model = Model("motor")
    v, phi = model.input("V", "V", hold="zoh"), model.sensor("phi", "rad", resolution=FINE)
    i = model.sensor("i", "A", resolution=FINE) if current else model.unmeasured("i", "A")
    r, inductance, k, j, b, tc = unknowns(model, "R:ohm L:H k:N*m/A J:kg*m^2 b:N*m*s Tc:N*m")
    model.equation(inductance * i.d() + r * i + k * phi.d() - v)
    model.equation(j * phi.d(2) + b * phi.d() + tc * sgn(phi.d()) - k * i)
    return model


def cart(hidden: str = "", friction: bool = False) -> Model:
    """A pendulum on a cart with one of x and a not measured, with or without friction of the cart."""
    model = Model("cart")
    force = model.input("F", "N", hold="zoh")
    x, a = (
        model.unmeasured(name, unit) if name == hidden else model.sensor(name, unit, resolution=FINE)
        for name, unit in (("x", "m"), ("a", "rad"))
    )
    g = model.known("g", "m/s^2", 9.81)
    mt, ml, j, bp = unknowns(model, "mt:kg ml:kg*m J:kg*m^2 bp:N*m*s")
    b = unknowns(model, "b:N*s/m")[0] if friction else 0
    model.equation(mt * x.d(2) + ml * (cos(a) * a.d(2) - sin(a) * a.d() ** 2) + b * x.d() - force)
    model.equation(j * a.d(2) + ml * cos(a) * x.d(2) + ml * g * sin(a) + bp * a.d())
    return model


def cell(ranges: bool) -> Model:
    """Two RC pairs, with ranges that exclude their exchange or without."""
    model = Model("cell")
    v, i = (model.sensor(name, unit, resolution=FINE) for name, unit in (("v", "V"), ("i", "A")))
    h1, h2 = model.unmeasured("h1", "V"), model.unmeasured("h2", "V")
    r0, r1, r2 = unknowns(model, "R0:ohm R1:ohm R2:ohm")
    between = 50.0 if ranges else None
    t1, t2 = model.unknown("T1", "s", 10.0, high=between), model.unknown("T2", "s", 300.0, low=between)
    model.equation(v - r0 * i - h1 - h2)
    model.equation(t1 * h1.d() + h1 - r1 * i)
    model.equation(t2 * h2.d() + h2 - r2 * i)
    return model


def two_sums() -> Model:
    """Friction of the bearing and of the motor, which only add up."""
    model = Model("rotor")
    v, th = model.input("V", "V", hold="zoh"), model.sensor("th", "rad", resolution=FINE)
    j, b1, d = unknowns(model, "J:kg*m^2 b1:N*m*s D:N*m*s")
    model.equation(j * th.d(2) + (b1 + d) * th.d() - model.known("K", "N*m/V", 1.0) * v)
    return model


def free_pendulum() -> Model:
    """Nothing with a known scale acts on it."""
    model = Model("free pendulum")
    q = model.sensor("q", "rad", resolution=FINE)
    j, b, g = unknowns(model, "J:kg*m^2 b:N*m*s G:N*m")
    model.equation(j * q.d(2) + b * q.d() + g * sin(q))
    return model


def squares() -> Model:
    """sin^2 and cos^2 and a constant are three names of two functions."""
    model = Model("squares")
    q, u = model.sensor("q", "rad", resolution=FINE), model.input("u", "N*m", hold="zoh")
    a, b, c = unknowns(model, "a:N*m b:N*m c:N*m")
    model.equation(a * sin(q) ** 2 + b * cos(q) ** 2 + c - u)
    return model


def linear_in_nothing() -> Model:
    """An unknown frequency inside a sine."""
    model = Model("linear in nothing")
    x = model.sensor("x", "rad", resolution=FINE)
    k, b = unknowns(model, "k:1 b:1/s")
    model.equation(x.d() - b * sin(k * x))
    return model


def two_sensors() -> Model:
    """A second sensor measures k times the first one, so that two frictions look alike: b1 + k b2."""
    model = Model("two sensors")
    x, y = (model.sensor(name, "m", resolution=FINE) for name in ("x", "y"))
    u = model.input("u", "N", hold="zoh")
    k, b1, b2, m = unknowns(model, "k:1 b1:N*s/m b2:N*s/m m:kg")
    model.equation(y - k * x)
    model.equation(m * x.d(2) + b1 * x.d() + b2 * y.d() - u)
    return model
