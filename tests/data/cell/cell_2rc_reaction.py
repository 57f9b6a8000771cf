"""battery_2rc with one more term: the resistance of the reaction falls as the current grows (- r i^3)."""

from pvid.model import Integral, Model

model = Model("cell, 2 RC pairs, reaction")
v = model.sensor("v", "V", resolution=1e-4, reach=5)
i = model.sensor("i", "A", resolution=1e-3, reach=10, driven=True)
z = model.define("z", "A*s", Integral(i, 1))
h1, h2 = model.unmeasured("h1", "V"), model.unmeasured("h2", "V")
R0, R1, R2 = model.unknown("R0", "ohm", 0.02), model.unknown("R1", "ohm", 0.015), model.unknown("R2", "ohm", 0.02)
T1, T2 = model.unknown("T1", "s", 20.0, low=1, high=100), model.unknown("T2", "s", 300.0, low=100, high=3000)
s, E = model.unknown("s", "V/(A*s)", 2e-5), model.unknown("E", "V", 3.7, sd=1.0)
r = model.unknown("r", "V/A^3", 1e-4, positive=False, sd=1e-3)
model.equation(v - E + s * z + R0 * i - r * i**3 + h1 + h2)
model.equation(T1 * h1.d() + h1 - R1 * i)
model.equation(T2 * h2.d() + h2 - R2 * i)
