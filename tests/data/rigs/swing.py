"""A random rig, seed 5021: pendulum."""

from pvid.model import Model, sin

model = Model("pendulum")
u = model.input("u", "N*m", hold="zoh", reach=13.3, gain_sd=0)
a = model.sensor("a", "rad", resolution=0.00074, reach=1.13, gain_sd=0)
J = model.unknown("J", "kg*m^2", 0.099)
G = model.unknown("G", "N*m", 13.0)
b = model.unknown("b", "N*m*s", 0.021)
cw = model.unknown("cw", "kg*m^2", 0.0028)
model.equation(J * a.d(2) + b * a.d() + cw * abs(a.d()) * a.d() + G * sin(a) - u)
