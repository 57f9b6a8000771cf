"""A motor that runs out, switched off: only ratios to its inertia are identifiable, which is known."""

from math import pi

from pvid.model import Model, sgn

model = Model("coasting motor")
phi = model.sensor("phi", "rad", resolution=2 * pi / 2**12, reach=1e4)
J = model.known("J", "kg*m^2", 2e-4, sd=4e-6, required=True)
b, Tc = model.unknown("b", "N*m*s", 1e-4), model.unknown("Tc", "N*m", 0.01)
q = model.unknown("q", "N*m*s^2", 1e-7)
w = phi.d()
model.equation(J * phi.d(2) + b * w + Tc * sgn(w) + q * w * abs(w))
model.words(b="viscous friction", Tc="dry friction", q="drag of the fan by squared speed")
