"""A robot's torso on its spindle: its motor's current against weight and friction; it moves too slowly for inertia."""

from pvid.model import Model, sgn

model = Model("Lift with friction")
q = model.input("q", "m", hold="sampled", reach=1)
i = model.sensor("i", "A", resolution=0.001, reach=10)
W = model.unknown("W", "A", 0.7)  # that holds the weight
c = model.unknown("c", "A", 0.5)  # Coulomb friction
b = model.unknown("b", "A*s/m", 2.0, positive=False, sd=10.0)  # viscous friction
model.equation(W + c * sgn(q.d()) + b * q.d() - i)
