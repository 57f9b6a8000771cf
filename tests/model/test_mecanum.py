"""The shipped mecanum platform against Kane's method of SymPy, from where its rollers touch the ground."""

import numpy as np
import sympy as sp
from sympy.physics.mechanics import KanesMethod, Point, ReferenceFrame, RigidBody, dynamicsymbols, inertia

from pvid.model.signals import sgn
from pvid.models.mechanisms import compiled_of


def test_equations_are_those_of_kanes_method_with_the_rollers_constraints() -> None:
    """Seven speeds, of which the rollers tie those of the wheels to the three quasi-velocities."""
    m, S, Jz, Jw, b, Tc, r, length, width = sp.symbols("m S Jz Jw b Tc r length width", real=True)
    x, y, psi, *turned = dynamicsymbols("x y psi q1:5")
    vx, vy, w, *spins = dynamicsymbols("vx vy w w1:5")
    torques = sp.symbols("t1:5", real=True)
    ground, platform = ReferenceFrame("ground"), ReferenceFrame("platform")
    platform.orient_axis(ground, psi, ground.z)
    platform.set_ang_vel(ground, w * platform.z)
    middle, origin = Point("middle"), Point("origin")
    origin.set_vel(ground, 0)
    middle.set_vel(ground, vx * platform.x + vy * platform.y)
    mass_centre = middle.locatenew("mass_centre", S / m * platform.x)
    mass_centre.v2pt_theory(middle, ground, platform)
    own = inertia(platform, 0, 0, Jz - S**2 / m)  # about the centre of mass
    bodies = [RigidBody("platform", mass_centre, platform, m, (own, mass_centre))]
    loads, constraints = [], []
    places = [(length, width, -1), (length, -width, 1), (-length, width, 1), (-length, -width, -1)]
    for n, ((ahead, left, way), spin, angle, torque) in enumerate(zip(places, spins, turned, torques, strict=True)):
        hub = middle.locatenew(f"hub{n}", ahead * platform.x + left * platform.y)
        hub.v2pt_theory(middle, ground, platform)
        wheel = ReferenceFrame(f"wheel{n}")
        wheel.orient_axis(platform, angle, platform.y)
        wheel.set_ang_vel(ground, w * platform.z + spin * platform.y)
        # The mass of the wheels is part of m and Jz: what is left is the inertia about the axle.
        bodies.append(RigidBody(f"wheel{n}", hub, wheel, 0, (inertia(platform, 0, Jw, 0), hub)))
        drive = (torque - b * spin - Tc * sgn(spin)) * platform.y
        loads += [(wheel, drive), (platform, -drive)]
        touches = hub.vel(ground) - r * spin * platform.x  # the roller's, which may only move across its axle
        constraints.append(sp.expand(touches.dot(platform.x + way * platform.y)))
    kinematic = [
        x.diff() - vx * sp.cos(psi) + vy * sp.sin(psi),
        y.diff() - vx * sp.sin(psi) - vy * sp.cos(psi),
        psi.diff() - w,
        *(angle.diff() - spin for angle, spin in zip(turned, spins, strict=True)),
    ]
    method = KanesMethod(
        ground,
        q_ind=[x, y, psi, *turned],
        u_ind=[vx, vy, w],
        kd_eqs=kinematic,
        u_dependent=spins,
        velocity_constraints=constraints,
    )
    forces, inertias = method.kanes_equations(bodies, loads)
    speeds = [sp.sympify(one) for one in sp.solve(constraints, spins, dict=True)[0].values()]
    time = dynamicsymbols._t
    random, model = np.random.default_rng(1), compiled_of("mecanum")
    for _ in range(5):
        values = {one: sp.Rational(int(random.integers(1, 50)), 7) for one in (m, S, Jz, Jw, b, Tc, r, length, width)}
        values |= {one: sp.Rational(int(random.integers(-50, 50)), 7) for one in torques}
        for one in (vx.diff(), vy.diff(), w.diff(), vx, vy, w):
            values[one] = sp.Rational(int(random.integers(-50, 50)), 11)
        spin_rates = {spin.diff(): speed.diff(time).subs(values) for spin, speed in zip(spins, speeds, strict=True)}
        spin_values = {spin: speed.subs(values) for spin, speed in zip(spins, speeds, strict=True)}
        kane = (forces + inertias).subs(spin_rates).subs(spin_values).subs(values)
        of_model = {f"{one}": value for one, value in values.items() if one.is_Symbol}
        of_model |= {"s": values[length] + values[width]}
        of_model |= {f"{one.func}": values[one] for one in (vx, vy, w)}
        of_model |= {f"{one.func}_1": values[one.diff()] for one in (vx, vy, w)}
        for theirs, equation in zip(kane, model.equations, strict=True):
            ours = equation.subs({one: of_model[str(one)] for one in equation.free_symbols})
            assert ours != 0 and ours + theirs == 0
