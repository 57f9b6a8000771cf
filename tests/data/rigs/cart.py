"""A random rig, seed 5061: cart."""

from pvid.model import Model, cos, sgn

model = Model("cart with pendulum")
F = model.input("F", "N", hold="zoh", reach=0.58, gain_sd=0)
x = model.sensor("x", "m", resolution=0.012, reach=7.92, gain_sd=0)
a = model.sensor("a", "rad", resolution=0.0034, reach=2.1, gain_sd=0)
mt = model.unknown("mt", "kg", 0.12)
ml = model.unknown("ml", "kg*m", 0.00091)
Jp = model.unknown("Jp", "kg*m^2", 6.4e-05)
b = model.unknown("b", "N*s/m", 0.13)
bp = model.unknown("bp", "N*m*s", 3.3e-05)
Fc = model.unknown("Fc", "N", 0.031)
g = model.known("g", "m/s^2", 9.81)
T = mt * x.d() ** 2 / 2 + ml * cos(a) * x.d() * a.d() + Jp * a.d() ** 2 / 2
model.lagrange(T + ml * g * cos(a), [x, a], [F - b * x.d() - Fc * sgn(x.d()), -bp * a.d()])
