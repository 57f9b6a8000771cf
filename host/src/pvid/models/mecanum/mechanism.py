"""A platform on four mecanum wheels, in quasi-velocities: speeds along its own axes and its turn rate.

Rolling without slip ties each wheel's speed to these three; friction acts in the drives.
"""

from pvid.model import Model, sgn

model = Model("mecanum platform, quasi-velocities")
torques = [model.input(f"t{n}", "N*m", hold="zoh", reach=5) for n in range(1, 5)]  # front left, right, rear left, right
vx, vy = (model.sensor(name, "m/s", resolution=1e-3, reach=3) for name in ("vx", "vy"))  # forward, to the left
w = model.sensor("w", "rad/s", resolution=1e-3, reach=6)
r, s = model.known("r", "m", 0.05), model.known("s", "m", 0.35)  # of the wheels; half the wheelbase + half the track
m, Jz = model.unknown("m", "kg", 15.0), model.unknown("Jz", "kg*m^2", 1.0)
S = model.unknown("S", "kg*m", 0.0, positive=False, sd=1.0)  # mass times the centre of mass's distance in front
Jw = model.unknown("Jw", "kg*m^2", 2e-3)
b, Tc = model.unknown("b", "N*m*s", 5e-3), model.unknown("Tc", "N*m", 0.05)
signs = [(1, -1, -1), (1, 1, 1), (1, 1, -1), (1, -1, 1)]  # of vx, vy and s w in the speed of each wheel
wheels = [(i * vx + j * vy + k * s * w) / r for i, j, k in signs]
rates = [(i * vx.d() + j * vy.d() + k * s * w.d()) / r for i, j, k in signs]
net = [t - Jw * a - b * one - Tc * sgn(one) for t, a, one in zip(torques, rates, wheels, strict=True)]
push = [sum(way[n] * one for way, one in zip(signs, net, strict=True)) / r for n in range(3)]
model.equation(m * (vx.d() - w * vy) - S * w**2 - push[0])
model.equation(m * (vy.d() + w * vx) + S * w.d() - push[1])
model.equation(Jz * w.d() + S * (vy.d() + w * vx) - s * push[2])
model.words(m="mass", Jz="inertia about the vertical", S="mass times the distance of its centre in front")
model.words(Jw="inertia of a wheel with its drive", b="viscous friction of a drive", Tc="dry friction of a drive")
