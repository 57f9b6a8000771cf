"""A pendulum that swings freely: no known force, so only ratios to its inertia are identifiable."""

from math import pi

from pvid.model import Model, sgn, sin

model = Model("free pendulum, encoder offset")
q = model.sensor("q", "rad", resolution=2 * pi / 2**12, reach=4)  # from the lowest point
w2 = model.unknown("w2", "1/s^2", 40.0)  # square of the natural frequency of small swings
k = model.unknown("k", "1/s", 0.05)
c = model.unknown("c", "rad/s^2", 0.1)
q0 = model.unknown("q0", "rad", 0.0, positive=False, sd=0.2)
model.equation(q.d(2) + k * q.d() + c * sgn(q.d()) + w2 * sin(q - q0))
model.output("l", "m", model.known("g", "m/s^2", 9.81) / w2)
model.words(w2="squared natural frequency of small swings", k="viscous friction over inertia")
model.words(c="dry friction over inertia", q0="offset of the encoder")
model.words(l="length of the simple pendulum of the same period")
