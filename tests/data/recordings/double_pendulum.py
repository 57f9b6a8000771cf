"""A double pendulum with a motor in each joint, angles from hanging; torques are those of the motors' currents."""

from pvid.model import Model, cos, sgn

model = Model("Double pendulum with motors")
t1, t2 = (model.input(f"t{k}", "N*m", hold="sampled", reach=8) for k in (1, 2))
q1, q2 = (model.sensor(f"q{k}", "rad", resolution=4e-4, reach=20) for k in (1, 2))
l1, g = model.known("l1", "m", 0.3), model.known("g", "m/s^2", 9.81)
J1, J2, Jm = (model.unknown(name, "kg*m^2", guess) for name, guess in (("J1", 0.08), ("J2", 0.04), ("Jm", 0.003)))
h1, h2 = model.unknown("h1", "kg*m", 0.3), model.unknown("h2", "kg*m", 0.15)  # mass times distance
b1, b2 = (model.unknown(f"b{k}", "N*m*s/rad", 0.01, positive=False, sd=0.1) for k in (1, 2))
c1, c2 = (model.unknown(f"c{k}", "N*m", 0.1) for k in (1, 2))
o1, o2 = (model.unknown(f"o{k}", "N*m", 0.0, positive=False, sd=0.5) for k in (1, 2))  # offsets of the torques
w1, w2 = q1.d(), q1.d() + q2.d()
kinetic = J1 * w1**2 / 2 + J2 * w2**2 / 2 + h2 * l1 * cos(q2) * w1 * w2 + Jm * q2.d() ** 2 / 2
potential = -g * h1 * cos(q1) - g * h2 * cos(q1 + q2)
friction = [b * q.d() + c * sgn(q.d()) + o for q, b, c, o in ((q1, b1, c1, o1), (q2, b2, c2, o2))]
model.lagrange(kinetic - potential, [q1, q2], [t1 - friction[0], t2 - friction[1]])
