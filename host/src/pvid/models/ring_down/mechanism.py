"""The free oscillations of a structure after a knock: frequency, damping, and the sensor's offset."""

from pvid.model import Model, pi

model = Model("ring-down")
x = model.sensor("x", "m", resolution=1e-6, reach=0.01)
w2 = model.unknown("w2", "1/s^2", 2000.0)  # square of the natural frequency
d = model.unknown("d", "1/s", 1.0)  # damping over mass: the amplitude falls by e in 2/d
x0 = model.unknown("x0", "m", 0.0, positive=False, sd=1e-3)
model.equation(x.d(2) + d * x.d() + w2 * (x - x0))
model.output("f", "Hz", w2**0.5 / (2 * pi))
model.output("zeta", "", d / (2 * w2**0.5))
model.words(w2="squared natural frequency", d="damping over mass", x0="rest position", f="natural frequency")
model.words(zeta="damping ratio")
