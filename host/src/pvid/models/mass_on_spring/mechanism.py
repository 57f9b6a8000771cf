"""A mass on a spring: force known, position measured; the spring's rest position is unknown."""

from pvid.model import Model, sgn

model = Model("mass on a spring")
F = model.input("F", "N", hold="zoh", reach=10)
x = model.sensor("x", "m", resolution=1e-5, reach=0.1)
m, c, k = model.unknown("m", "kg", 1.0), model.unknown("c", "N*s/m", 1.0), model.unknown("k", "N/m", 200.0)
Fc = model.unknown("Fc", "N", 0.2)
x0 = model.unknown("x0", "m", 0.0, positive=False, sd=0.01)
model.equation(m * x.d(2) + c * x.d() + Fc * sgn(x.d()) + k * (x - x0) - F)
model.words(m="mass", c="viscous friction", k="stiffness", Fc="dry friction", x0="rest position")
