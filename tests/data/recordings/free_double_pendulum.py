"""A double pendulum that swings freely, both angles from upright; everything over m2 a2 L1, the coupled inertia."""

from pvid.model import Model, cos

model = Model("Double pendulum, free swing")
q1, q2 = (model.sensor(f"q{k}", "rad", resolution=2e-5, reach=7) for k in (1, 2))
A, B = model.unknown("A", "", 2.0), model.unknown("B", "", 1.0)  # inertias
G1, G2 = model.unknown("G1", "1/s^2", 80.0), model.unknown("G2", "1/s^2", 50.0)
k1, k2 = (model.unknown(f"k{k}", "1/s", 0.02, positive=False, sd=0.2) for k in (1, 2))
kinetic = A * q1.d() ** 2 / 2 + B * q2.d() ** 2 / 2 + cos(q1 - q2) * q1.d() * q2.d()
joint = k2 * (q2.d() - q1.d())
model.lagrange(kinetic - G1 * cos(q1) - G2 * cos(q2), [q1, q2], [joint - k1 * q1.d(), -joint])
