"""A plate that a heater warms above the air around it, slow and of order one: a model file of the user's own."""

from pvid.model import Model

model = Model("Heated plate")
P = model.input("P", "W", hold="zoh", reach=60)
T = model.sensor("T", "K", resolution=0.01, reach=80)  # above the air
C = model.unknown("C", "J/K", 40.0)
k = model.unknown("k", "W/K", 0.8)
model.equation(C * T.d() + k * T - P)
