"""A cell with two RC pairs; the open-circuit voltage falls by s for each coulomb drawn since the start."""

from pvid.model import Integral, Model

model = Model("battery, 2 RC")
v = model.sensor("v", "V", resolution=1e-3, reach=5)
i = model.sensor("i", "A", resolution=5e-3, reach=12, driven=True)
z = model.define("z", "A*s", Integral(i, 1))
h1, h2 = model.unmeasured("h1", "V"), model.unmeasured("h2", "V")
R0, R1, R2 = model.unknown("R0", "ohm", 0.02), model.unknown("R1", "ohm", 0.015), model.unknown("R2", "ohm", 0.02)
T1, T2 = model.unknown("T1", "s", 20.0, low=1, high=100), model.unknown("T2", "s", 300.0, low=100, high=3000)
s, E = model.unknown("s", "V/(A*s)", 2e-5), model.unknown("E", "V", 3.7, sd=1.0)
model.equation(v - E + s * z + R0 * i + h1 + h2)
model.equation(T1 * h1.d() + h1 - R1 * i)
model.equation(T2 * h2.d() + h2 - R2 * i)
model.words(R0="resistance at once", R1="resistance of the fast part", R2="resistance of the slow part")
model.words(T1="time constant of the fast part", T2="time constant of the slow part")
model.words(s="fall of the open-circuit voltage by charge", E="open-circuit voltage at the start")
