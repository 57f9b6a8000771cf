"""A ball that rolls on a beam: torque on the beam set; the ball's position and the beam's angle measured."""

from math import pi

from pvid.model import Model, sin

model = Model("ball on beam")
tq = model.input("tq", "N*m", hold="zoh", reach=5)
r = model.sensor("r", "m", resolution=5e-4, reach=0.5)
a = model.sensor("a", "rad", resolution=2 * pi / 2**12, reach=1)
M = model.unknown("M", "kg", 0.1)  # the ball's mass with its roll: m + J/radius^2
m, J = model.unknown("m", "kg", 0.1), model.unknown("J", "kg*m^2", 0.02)
b = model.unknown("b", "N*m*s", 0.02)
S = model.unknown("S", "kg*m", 0.0, positive=False, sd=0.05)
g = model.known("g", "m/s^2", 9.81)
T = M * r.d() ** 2 / 2 + (J + m * r**2) * a.d() ** 2 / 2
model.lagrange(T - m * g * r * sin(a) - S * g * sin(a), [r, a], [0, tq - b * a.d()])
model.words(M="mass of the ball with its roll", m="mass of the ball", J="inertia of the beam")
model.words(b="viscous friction of the beam", S="imbalance of the beam")
