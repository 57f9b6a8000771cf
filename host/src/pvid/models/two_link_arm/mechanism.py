"""An arm with two driven joints in a vertical plane: base parameters; the elbow's mass is known."""

from math import pi

from pvid.model import Model, cos, sgn, sin

model = Model("two-link arm")
t1, t2 = model.input("t1", "N*m", hold="zoh", reach=8), model.input("t2", "N*m", hold="zoh", reach=2)
q1 = model.sensor("q1", "rad", resolution=2 * pi / 2**14, reach=4)
q2 = model.sensor("q2", "rad", resolution=2 * pi / 2**14, reach=4)
l1, m2, g = model.known("l1", "m", 0.3), model.known("m2", "kg", 0.8), model.known("g", "m/s^2", 9.81)
I1, I2 = model.unknown("I1", "kg*m^2", 0.03), model.unknown("I2", "kg*m^2", 0.016)
h1, h2 = model.unknown("h1", "kg*m", 0.15), model.unknown("h2", "kg*m", 0.09)
v1, v2 = model.unknown("v1", "N*m*s", 0.06), model.unknown("v2", "N*m*s", 0.03)
c1, c2 = model.unknown("c1", "N*m", 0.12), model.unknown("c2", "N*m", 0.06)
swing = I2 * (q1.d() + q2.d()) ** 2 / 2 + h2 * l1 * cos(q2) * q1.d() * (q1.d() + q2.d())
P = g * ((h1 + m2 * l1) * sin(q1) + h2 * sin(q1 + q2))
forces = [t1 - v1 * q1.d() - c1 * sgn(q1.d()), t2 - v2 * q2.d() - c2 * sgn(q2.d())]
model.lagrange((I1 + m2 * l1**2) * q1.d() ** 2 / 2 + swing - P, [q1, q2], forces)
model.words(I1="inertia of the first link", I2="inertia of the second link")
model.words(h1="mass times centre's distance, first link", h2="mass times centre's distance, second link")
model.words(v1="viscous friction of the shoulder", v2="viscous friction of the elbow")
model.words(c1="dry friction of the shoulder", c2="dry friction of the elbow")
