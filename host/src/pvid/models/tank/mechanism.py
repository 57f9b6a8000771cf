"""A tank with an outlet: the pump's flow set, the level measured; the outflow follows Torricelli's law."""

from pvid.model import Model, sqrt

model = Model("tank, root law")
q = model.input("q", "m^3/s", hold="zoh", reach=1e-3)
h = model.sensor("h", "m", resolution=1e-3, reach=1)
A = model.unknown("A", "m^2", 0.02)
a = model.unknown("a", "m^2", 5e-5)
q0 = model.unknown("q0", "m^3/s", 0.0, positive=False, sd=1e-5)
g = model.known("g", "m/s^2", 9.81)
model.equation(A * h.d() + a * sqrt(2 * g * abs(h)) + q0 - q)
model.words(
    A="cross-section of the tank", a="effective cross-section of the outlet", q0="leak, or dead band of the pump"
)
