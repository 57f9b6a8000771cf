"""A DC motor: voltage set, current and angle measured."""

from math import pi

from pvid.model import Model, sgn

model = Model("DC motor, Kt = Ke")
V = model.input("V", "V", hold="zoh", reach=12)
i = model.sensor("i", "A", resolution=10 / 2**12, reach=5)
phi = model.sensor("phi", "rad", resolution=2 * pi / 2**12, reach=1000)
R, L, k = model.unknown("R", "ohm", 1.2), model.unknown("L", "H", 3e-3), model.unknown("k", "N*m/A", 0.05)
J, b, Tc = model.unknown("J", "kg*m^2", 2e-4), model.unknown("b", "N*m*s", 1e-4), model.unknown("Tc", "N*m", 0.012)
i0 = model.unknown("i0", "A", 0.0, positive=False, sd=0.1)
model.equation(L * i.d() + R * (i - i0) + k * phi.d() - V)
model.equation(J * phi.d(2) + b * phi.d() + Tc * sgn(phi.d()) - k * (i - i0))
model.words(R="winding resistance", L="winding inductance", k="torque constant", J="inertia", b="viscous friction")
model.words(Tc="dry friction", i0="current sensor offset")
