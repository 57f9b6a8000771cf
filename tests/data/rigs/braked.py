"""A random rig, seed 65: vehicle."""

from pvid.model import Model, sgn

model = Model("vehicle")
v = model.sensor("v", "m/s", resolution=0.00059, reach=5.22, gain_sd=0)
m = model.known("m", "kg", 1260.0)
Fr = model.unknown("Fr", "N", 37.0)
b = model.unknown("b", "N*s/m", 41.0)
cw = model.unknown("cw", "kg/m", 13.0)
model.equation(m * v.d() + Fr * sgn(v) + b * v + cw * v * abs(v))
