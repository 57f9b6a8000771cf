"""A vehicle that rolls out on a level road: its mass is known, its speed measured."""

from pvid.model import Model, sgn

model = Model("vehicle coast-down")
v = model.sensor("v", "m/s", resolution=0.01 / 3.6, reach=60)
m = model.known("m", "kg", 1400.0, sd=14.0, required=True)  # with the wheels' inertia over r^2
F0, F1 = model.unknown("F0", "N", 150.0), model.unknown("F1", "N*s/m", 2.0)
F2 = model.unknown("F2", "kg/m", 0.4)  # drag: density of air * cross-section * coefficient / 2
model.equation(m * v.d() + F0 * sgn(v) + F1 * v + F2 * v * abs(v))
model.words(F0="rolling resistance", F1="drag by speed", F2="air drag by squared speed")
