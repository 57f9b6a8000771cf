"""A random rig, seed 1097: ladder."""

from pvid.model import Model

model = Model("RC ladder")
u = model.input("u", "V", hold="zoh", reach=2.48, gain_sd=0)
i = model.sensor("i", "A", resolution=0.00029, reach=0.163, gain_sd=0)
v1 = model.sensor("v1", "V", resolution=0.005, reach=2.21, gain_sd=0)
R1 = model.unknown("R1", "ohm", 8.4)
C1 = model.unknown("C1", "F", 0.067)
model.equation(i - (u - v1) / R1)
model.equation(C1 * v1.d() - ((u - v1) / R1))
