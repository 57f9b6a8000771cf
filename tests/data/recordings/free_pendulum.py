"""A pendulum that swings freely, angle from upright: no known force, so only ratios to its inertia are identifiable."""

from pvid.model import Model, cos, sgn, sin

model = Model("Pendulum, free swing")
q = model.sensor("q", "rad", resolution=2e-5, reach=7)
w2 = model.unknown("w2", "1/s^2", 50.0)  # square of the natural frequency of small swings
k = model.unknown("k", "1/s", 0.05, positive=False, sd=0.2)
c = model.unknown("c", "rad/s^2", 0.1, positive=False, sd=0.5)  # Coulomb friction over inertia
o = model.unknown("o", "1/s^2", 0.0, positive=False, sd=5.0)  # w2 times the zero of the encoder
model.equation(q.d(2) + k * q.d() + c * sgn(q.d()) - w2 * sin(q) - o * cos(q))
