"""A winding at steps of voltage: the current is measured."""

from pvid.model import Model

model = Model("RL step")
V = model.input("V", "V", hold="zoh", reach=24)
i = model.sensor("i", "A", resolution=10 / 2**12, reach=5)
R, L = model.unknown("R", "ohm", 1.0), model.unknown("L", "H", 2e-3)
i0 = model.unknown("i0", "A", 0.0, positive=False, sd=0.1)
model.equation(L * i.d() + R * (i - i0) - V)
model.output("tau", "s", L / R)
model.words(R="resistance", L="inductance", i0="offset of the current sensor", tau="time constant")
