"""A synchronous motor with permanent magnets, in d-q coordinates: voltages set, currents and shaft angle measured.

The inverter's dead time and the drop of its switches take V0 from each phase, against that phase's current: on the
average over a turn 4/pi of it, against the current's vector.
"""

from pvid.model import Model, pi, sgn, sqrt

model = Model("PMSM, d-q, with dead time")
vd, vq = (model.input(name, "V", hold="zoh", reach=30) for name in ("vd", "vq"))
id_, iq = (model.sensor(name, "A", resolution=40 / 2**12, reach=20) for name in ("id", "iq"))
th = model.sensor("th", "rad", resolution=float(2 * pi) / 2**14, reach=1e4)
pp = model.known("pp", "", 7)  # pole pairs
R, V0 = model.unknown("R", "ohm", 0.2), model.unknown("V0", "V", 0.1)
Ld, Lq, psi = model.unknown("Ld", "H", 2e-4), model.unknown("Lq", "H", 2e-4), model.unknown("psi", "V*s", 0.01)
J, b, Tc = model.unknown("J", "kg*m^2", 1e-4), model.unknown("b", "N*m*s", 1e-4), model.unknown("Tc", "N*m", 0.02)
w, lost = pp * th.d(), 4 * V0 / (pi * sqrt(id_**2 + iq**2))  # the field's rate [rad/s]; V/A
model.equation(Ld * id_.d() + (R + lost) * id_ - w * Lq * iq - vd)
model.equation(Lq * iq.d() + (R + lost) * iq + w * (Ld * id_ + psi) - vq)
model.equation(J * th.d(2) + b * th.d() + Tc * sgn(th.d()) - 3 * pp / 2 * (psi * iq + (Ld - Lq) * id_ * iq))
model.words(R="resistance of a winding", V0="voltage lost by dead time", Ld="inductance along the magnet")
model.words(Lq="inductance across the magnet", psi="flux linkage of the magnet", J="inertia", b="viscous friction")
model.words(Tc="dry friction")
