"""A drive with an elastic shaft; current and motor angle are measured, the load's angle is not."""

from math import pi

from pvid.model import Model, sgn

model = Model("two-mass drive, load not measured")
i = model.sensor("i", "A", resolution=20 / 2**12, reach=10, driven=True)
th, x = model.sensor("th", "rad", resolution=2 * pi / 2**14, reach=1000), model.unmeasured("x", "rad")
kt, Tc = model.known("kt", "N*m/A", 0.1), model.unknown("Tc", "N*m", 0.03)
J1, J2 = model.unknown("J1", "kg*m^2", 4e-4), model.unknown("J2", "kg*m^2", 8e-4)
k, c = model.unknown("k", "N*m/rad", 2.0), model.unknown("c", "N*m*s", 2e-3)
b1, b2 = model.unknown("b1", "N*m*s", 1e-3), model.unknown("b2", "N*m*s", 2e-3)
i0 = model.unknown("i0", "A", 0.0, positive=False, sd=0.2)
shaft = k * (th - x) + c * (th.d() - x.d())
model.equation(J1 * th.d(2) + b1 * th.d() + Tc * sgn(th.d()) + shaft - kt * (i - i0))
model.equation(J2 * x.d(2) + b2 * x.d() - shaft)
model.words(J1="inertia of the motor", J2="inertia of the load", k="stiffness of the shaft", c="damping of the shaft")
model.words(b1="viscous friction of the motor", b2="viscous friction of the load", Tc="dry friction of the motor")
model.words(i0="offset of the current sensor")
