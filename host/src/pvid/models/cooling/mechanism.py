"""A body that cools in air: its temperature and that of the air are measured."""

from pvid.model import Model

model = Model("cooling in air")
T = model.sensor("T", "K", resolution=0.0625, reach=400, gain_sd=0)
Ta = model.sensor("Ta", "K", resolution=0.0625, reach=400, driven=True, gain_sd=0)
a = model.unknown("a", "1/s", 2e-3)
e = model.unknown("e", "K", 0.0, positive=False, sd=1.0)
model.equation(T.d() + a * (T - Ta - e))
model.output("tau", "s", 1 / a)
model.words(a="loss over heat capacity", e="difference of the two sensors in equilibrium", tau="time constant")
