"""A random rig, seed 6011: pendulum."""

from pvid.model import Model, sgn, sin

model = Model("pendulum")
u = model.input("u", "N*m", hold="zoh", reach=2.85, gain_sd=0)
a = model.sensor("a", "rad", resolution=0.071, reach=92.5, gain_sd=0)
J = model.unknown("J", "kg*m^2", 0.031)
G = model.unknown("G", "N*m", 5.7)
b = model.unknown("b", "N*m*s", 0.0088)
Tc = model.unknown("Tc", "N*m", 0.037)
a0 = model.known("a0", "rad", -0.0159)
model.equation(J * a.d(2) + b * a.d() + Tc * sgn(a.d()) + G * sin(a - a0) - u)
