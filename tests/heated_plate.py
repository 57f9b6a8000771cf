"""A plate that a heater warms above the air around it, slow and of order one: a model file of a user's own."""

from pvid import Model

model = Model("Heated plate")
P = model.input("P", "W", hold="zoh", reach=50)
T = model.sensor("T", "K", resolution=0.0625, reach=100)  # above the air
C = model.unknown("C", "J/K", 100.0)
h = model.unknown("h", "W/K", 0.5)
model.equation(C * T.d() + h * T - P)
