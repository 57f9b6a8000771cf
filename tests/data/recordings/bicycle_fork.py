"""A bicycle's fork that swings on a knife edge, its rate measured by a gyroscope of unknown scale."""

from pvid.model import Model, sgn

model = Model("Compound pendulum with a rate gyroscope")
v = model.sensor("v", "V", resolution=0.005, reach=5)
h = model.unmeasured("h", "V*s")  # the angle, in the scale of the gyroscope
w2 = model.unknown("w2", "1/s^2", 20.0)  # square of the natural frequency
k = model.unknown("k", "1/s", 0.05, positive=False, sd=0.2)  # viscous friction over inertia
c = model.unknown("c", "V/s", 0.05, positive=False, sd=0.2)  # Coulomb friction over inertia
o = model.unknown("o", "V", 0.0, positive=False, sd=0.2)  # the gyroscope's voltage at rest
model.equation(h.d() - v + o)
model.equation(v.d() + k * (v - o) + c * sgn(v) + w2 * h)
