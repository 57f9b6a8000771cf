"""A pendulum that hangs from a cart; the encoder's zero is unknown."""

from math import pi

from pvid.model import Model, cos, sgn

model = Model("cart-pendulum, encoder offset")
F, x = model.input("F", "N", hold="zoh", reach=20), model.sensor("x", "m", resolution=2e-5, reach=1)
a = model.sensor("a", "rad", resolution=2 * pi / 2**12, reach=4)
mt, ml, J = model.unknown("mt", "kg", 0.8), model.unknown("ml", "kg*m", 0.04), model.unknown("J", "kg*m^2", 0.0107)
b, Fc, bp = model.unknown("b", "N*s/m", 1.0), model.unknown("Fc", "N", 0.3), model.unknown("bp", "N*m*s", 2e-3)
c, g = model.unknown("c", "rad", 0.0, positive=False, sd=0.5), model.known("g", "m/s^2", 9.81)
T = mt * x.d() ** 2 / 2 + ml * cos(a - c) * x.d() * a.d() + J * a.d() ** 2 / 2
model.lagrange(T + ml * g * cos(a - c), [x, a], [F - b * x.d() - Fc * sgn(x.d()), -bp * a.d()])
model.words(mt="mass of cart and pendulum", ml="mass of the pendulum times its length")
model.words(J="inertia of the pendulum about its joint", b="viscous friction of the cart")
model.words(Fc="dry friction of the cart", bp="viscous friction of the joint", c="offset of the encoder")
