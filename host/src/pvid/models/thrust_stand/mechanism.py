"""A propeller on a thrust stand: its motor's voltage set; current, speed, thrust and torque measured."""

from pvid.model import Model

model = Model("thrust stand")
V = model.input("V", "V", hold="zoh", reach=16)
i = model.sensor("i", "A", resolution=80 / 2**12, reach=40)
w = model.sensor("w", "rad/s", resolution=0.5, reach=1500)
F = model.sensor("F", "N", resolution=5e-3, reach=30)
R, k = model.unknown("R", "ohm", 0.1), model.unknown("k", "V*s", 0.01)
J, kq = model.unknown("J", "kg*m^2", 5e-5), model.unknown("kq", "N*m*s^2", 2e-7)
kt, F0 = model.unknown("kt", "N*s^2", 1e-5), model.unknown("F0", "N", 0.0, positive=False, sd=1.0)
Tc = model.unknown("Tc", "N*m", 0.01)
model.equation(R * i + k * w - V)
model.equation(J * w.d() + kq * w**2 + Tc - k * i)
model.equation(F - F0 - kt * w**2)
model.words(R="resistance of the winding", k="torque constant", J="inertia", kq="torque by squared speed")
model.words(kt="thrust by squared speed", F0="offset of the thrust sensor", Tc="dry friction and iron losses")
