"""A motor that carries a pendulum, angle from hanging; its torque is that of the motor's current."""

from pvid.model import Model, sgn, sin

model = Model("Motor with a pendulum")
tau = model.input("tau", "N*m", hold="sampled", reach=8)
q = model.sensor("q", "rad", resolution=4e-4, reach=20)
J, G = model.unknown("J", "kg*m^2", 0.1), model.unknown("G", "N*m", 2.0)
b = model.unknown("b", "N*m*s/rad", 0.05, positive=False, sd=0.2)
c = model.unknown("c", "N*m", 0.1)
o = model.unknown("o", "N*m", 0.0, positive=False, sd=0.5)  # offset of the torque
model.equation(J * q.d(2) + b * q.d() + c * sgn(q.d()) + G * sin(q) + o - tau)
