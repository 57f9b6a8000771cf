"""A random rig, seed 6028: vehicle."""

from pvid.model import Model, sgn

model = Model("vehicle")
F = model.input("F", "N", hold="zoh", reach=20.2, gain_sd=0)
v = model.sensor("v", "m/s", resolution=0.0095, reach=38.7, gain_sd=0)
m = model.unknown("m", "kg", 86.0)
Fr = model.unknown("Fr", "N", 4.0)
b = model.unknown("b", "N*s/m", 1.2)
model.equation(m * v.d() + Fr * sgn(v) + b * v - F)
