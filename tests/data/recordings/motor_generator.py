"""A motor that turns a generator, switched on and off: its own voltage brakes it only while it is on."""

from pvid.model import Model, sgn

model = Model("Switched motor with a generator")
u = model.input("u", "", hold="zoh", reach=2)  # 1: on, 0: off
y = model.sensor("y", "", resolution=1e-4, reach=10)  # speed w, by the filtered voltage of the generator
T = model.unknown("T", "s", 0.2)  # of the filter: w = y + T y'
a = model.unknown("a", "1/s", 10.0)  # torque of the motor at rest over inertia
e = model.unknown("e", "1/s", 2.0)  # torque lost with speed while it is on
k = model.unknown("k", "1/s", 0.1, positive=False, sd=1.0)  # viscous friction over inertia
c = model.unknown("c", "1/s", 1.0)  # Coulomb friction over inertia
model.equation(y.d() + T * y.d(2) + (k + e * u) * (y + T * y.d()) + c * sgn(y) - a * u)
