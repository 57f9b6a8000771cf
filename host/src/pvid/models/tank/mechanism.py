"""A tank with an outlet: the pump's flow set, the level measured; the outflow follows Torricelli's law."""

from pvid.model import Model, sqrt

model = Model("tank, root law")
q = model.input("q", "m^3/s", hold="zoh", reach=1e-3)
h = model.sensor("h", "m", resolution=1e-3, reach=1)
A = model.unknown("A", "m^2", 0.02)  # cross-section of the tank
a = model.unknown("a", "m^2", 5e-5)  # of the outlet, times its contraction
q0 = model.unknown(
    "q0", "m^3/s", 0.0, positive=False, sd=1e-5
)  # what else leaves it, as a leak or a dead band of the pump
g = model.known("g", "m/s^2", 9.81)
model.equation(A * h.d() + a * sqrt(2 * g * abs(h)) + q0 - q)
