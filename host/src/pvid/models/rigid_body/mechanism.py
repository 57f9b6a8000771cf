"""A rigid body with three gyros and known torques: its inertia tensor."""

from sympy import Matrix

from pvid.model import Model

model = Model("rigid body, gyros and torques")
w = Matrix([model.sensor(f"w{n}", "rad/s", resolution=1e-3, reach=10) for n in range(3)])
torque = Matrix([model.input(f"m{n}", "N*m", hold="zoh", reach=0.2, smooth=True) for n in range(3)])
Ixx, Iyy, Izz = (model.unknown(f"I{n}{n}", "kg*m^2", v) for n, v in (("x", 0.012), ("y", 0.014), ("z", 0.022)))
Ixy, Ixz, Iyz = (model.unknown(f"I{n}", "kg*m^2", 0.0, positive=False, sd=2e-3) for n in ("xy", "xz", "yz"))
inertia = Matrix([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]])
for row in inertia * w.applyfunc(lambda one: one.d()) + w.cross(inertia * w) - torque:
    model.equation(row)
model.words(Ixx="moment of inertia about x", Iyy="moment of inertia about y", Izz="moment of inertia about z")
model.words(Ixy="element xy of the inertia tensor", Ixz="element xz of the inertia tensor")
model.words(Iyz="element yz of the inertia tensor")
