"""The two-link Kapitza pendulum: the pivot moves, the angle between the links is measured."""

from math import pi

from pvid.model import Model

model = Model("Kapitza pendulum, unknown zero")
l1 = model.known("l1", "m", 0.3)
y = model.sensor("y", "m", resolution=5e-6, noise=0.4, reach=0.02, driven=True)
phi = model.sensor("phi", "rad", resolution=2 * pi / 2**14, reach=0.2, neglected=1.0)  # small angles
u, x = model.define("u", "1/s^2", y.d(2) / l1), model.unmeasured("phi1", "rad")
w, d1, d2 = model.unknown("w", "1/s^2", 31.67), model.unknown("d1", "", 8.875), model.unknown("d2", "", 5.625)
c = model.unknown("c", "rad", 0.0, positive=False, sd=0.5)  # the encoder's zero
L2, G, f = d1 - d2 - 1, w + u, phi - c
model.equation(x.d(2) + G * x - L2 * G * f)
model.equation(phi.d(2) - G * x + (d1 - 1) * G * f)
model.output("g", "m/s^2", w * l1)
model.output("l2", "m", l1 * L2 / d2)
model.output("rho2", "m", l1 * L2**0.5 / d2)
