"""The two-link Kapitza pendulum: the pivot moves, the angle between the links is measured."""

from math import pi

from pvid.model import Model, cos, sgn, sin

model = Model("Kapitza pendulum, encoder offset")
l1 = model.known("l1", "m", 0.3, sd=3e-4, required=True)
y = model.sensor("y", "m", resolution=5e-6, noise=0.4, reach=0.02, driven=True, gain_sd=0.003)
phi = model.sensor("phi", "rad", resolution=2 * pi / 2**14, reach=0.2, neglected=1.0)  # small angles
u, x = model.define("u", "1/s^2", y.d(2) / l1), model.unmeasured("phi1", "rad")
w, d1, d2 = model.unknown("w", "1/s^2", 9.501 / l1), model.unknown("d1", "", 8.875), model.unknown("d2", "", 5.625)
c = model.unknown("c", "rad", 0.0, positive=False, sd=0.5)
L2, G, f = d1 - d2 - 1, w + u, phi - c
model.equation(x.d(2) + G * x - L2 * G * f)
model.equation(phi.d(2) - G * x + (d1 - 1) * G * f)
model.output("g", "m/s^2", w * l1)
model.output("l2", "m", l1 * L2 / d2)
model.output("rho2", "m", l1 * L2**0.5 / d2)

# The refinement: the full equations in absolute angles, with the friction of both joints.
a1, a2 = model.coordinate("a1", "rad"), model.coordinate("a2", "rad")
k1, k2 = model.refined("k1", "1/s", sd=0.1), model.refined("k2", "1/s", sd=0.05)
f1, f2 = (model.refined(f"f{n}", "1/s^2", sd=0.03, optional="dry_friction") for n in (1, 2))
slant = model.refined("slant", "rad", sd=0.1, optional="slant")  # of the pivot's slide against the vertical
lam, sig = model.shape("lam", "", L2 / d2), model.shape("sig", "", 1 / L2)  # l2/l1, (rho2/l2)^2
swing, v1, turn = sin(a2 - a1), a1.d(), a2.d() - a1.d()
joint, push, lift = k2 * turn + f2 * sgn(turn), slant * u, w + (1 - slant**2 / 2) * u  # y is along the slide
first = a1.d(2) + lam * (cos(a2 - a1) * a2.d(2) - swing * a2.d() ** 2) + lift * sin(a1) + push * cos(a1)
second = cos(a2 - a1) * a1.d(2) + (1 + sig) * lam * a2.d(2) + swing * v1**2 + lift * sin(a2) + push * cos(a2)
first, second = first + k1 * v1 + f1 * sgn(v1) - joint, second + joint / lam
model.refine([first, second], outputs={phi: a2 - a1 + c}, region=[L2 - 0.02])
model.words(g="gravity", l2="distance of the rod's centre of mass from its joint", rho2="radius of gyration of the rod")
model.words(
    w="gravity over l1",
    d1="first combination of the lengths",
    d2="second combination of the lengths",
    c="offset of the encoder",
)
