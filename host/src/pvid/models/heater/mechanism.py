"""A heated body in air: power set, its temperature and that of the air measured; radiation is a second loss."""

from pvid.model import Model

model = Model("heater")
P = model.input("P", "W", hold="zoh", reach=100)
T = model.sensor("T", "K", resolution=0.0625, reach=500, gain_sd=0)
Ta = model.sensor("Ta", "K", resolution=0.0625, reach=500, driven=True, gain_sd=0)
C, h = model.unknown("C", "J/K", 100.0), model.unknown("h", "W/K", 0.5)
h2 = model.unknown("h2", "W/K^2", 1e-3)  # the loss grows with the difference: convection, radiation
model.equation(C * T.d() + (h + h2 * (T - Ta)) * (T - Ta) - P)
model.words(C="heat capacity", h="loss by temperature", h2="growth of the loss with temperature")
