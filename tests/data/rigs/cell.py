"""A random rig, seed 5049: cell."""

from pvid.model import Integral, Model

model = Model("cell")
i = model.input("i", "A", hold="zoh", reach=23.9, gain_sd=0)
v = model.sensor("v", "V", resolution=0.0007, reach=6.98, gain_sd=0)
E = model.unknown("E", "V", 5.6)
R0 = model.unknown("R0", "ohm", 0.0059)
s = model.unknown("s", "V/(A*s)", 8.3e-05)
R1 = model.unknown("R1", "ohm", 0.0022)
T1 = model.unknown("T1", "s", 2.9)
z = model.define("z", "A*s", Integral(i, 1))
h1 = model.unmeasured("h1", "V")
model.equation(v - E + R0 * i + s * z + h1)
model.equation(T1 * h1.d() + h1 - R1 * i)
