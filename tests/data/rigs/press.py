"""A random rig, seed 1001: press."""

from pvid.model import Model, sgn

model = Model("press")
x = model.sensor("x", "m", resolution=7.4e-07, reach=0.00209, gain_sd=0, driven=True)
f = model.sensor("f", "N", resolution=0.051, reach=75.3, gain_sd=0)
k = model.unknown("k", "N/m", 33000.0)
c = model.unknown("c", "N*s/m", 860.0)
Fc = model.unknown("Fc", "N", 7.5)
f0 = model.unknown("f0", "N", 0.0, positive=False, sd=50.0)
model.equation(k * x + c * x.d() + Fc * sgn(x.d()) + f0 - f)
