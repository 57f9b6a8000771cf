"""A rotary (Furuta) pendulum, driven by a motor's voltage; b1 contains the motor's back EMF."""

from math import pi

from pvid.model import Model, cos, sin

model = Model("rotary pendulum, motor voltage")
V, kv = model.input("V", "V", hold="zoh", reach=12, smooth=True), model.known("kv", "N*m/V", 0.005)  # torque at rest
th = model.sensor("th", "rad", resolution=2 * pi / 2**12, reach=10)
a = model.sensor("a", "rad", resolution=2 * pi / 2**12, reach=4)
J0, Jp = model.unknown("J0", "kg*m^2", 2e-3), model.unknown("Jp", "kg*m^2", 1.2e-3)
h, G = model.unknown("h", "kg*m^2", 1.3e-3), model.unknown("G", "N*m", 0.06)
b1, b2 = model.unknown("b1", "N*m*s", 3e-4), model.unknown("b2", "N*m*s", 5e-5)
T = (J0 + Jp * sin(a) ** 2) * th.d() ** 2 / 2 + Jp * a.d() ** 2 / 2 + h * cos(a) * th.d() * a.d()
model.lagrange(T + G * cos(a), [th, a], [kv * V - b1 * th.d(), -b2 * a.d()])
model.words(J0="inertia of the arm with the pendulum at its end", Jp="inertia of the pendulum")
model.words(h="coupling of arm and pendulum", G="weight of the pendulum times its length")
model.words(b1="friction and back EMF of the motor", b2="viscous friction of the pendulum")
