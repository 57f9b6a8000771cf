"""The pendulum of the paper: no offset of the encoder, the pivot's acceleration u = y''/l1 is an input."""

from pvid.model import Model

model = Model("Kapitza pendulum of the paper")
u = model.input("u", "1/s^2", hold="sampled", reach=30)
phi, phi1 = model.sensor("phi", "rad", resolution=1e-3), model.unmeasured("phi1", "rad")
w, d1, d2 = model.unknown("w", "1/s^2", 31.67), model.unknown("d1", "", 8.875), model.unknown("d2", "", 5.625)
G = w + u
model.equation(phi1.d(2) + G * phi1 - (d1 - d2 - 1) * G * phi)
model.equation(phi.d(2) - G * phi1 + (d1 - 1) * G * phi)
