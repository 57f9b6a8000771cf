"""A random rig, seed 5008: stores."""

from pvid.model import Model

model = Model("tanks")
q = model.input("q", "m^3/s", hold="zoh", reach=0.00433, gain_sd=0)
h3 = model.sensor("h3", "m", resolution=0.00039, reach=0.637, gain_sd=0)
C1 = model.unknown("C1", "m^2", 0.32)
C2 = model.unknown("C2", "m^2", 0.52)
C3 = model.unknown("C3", "m^2", 0.19)
R1 = model.unknown("R1", "s/m^2", 320.0)
R2 = model.known("R2", "s/m^2", 201.0)
R3 = model.known("R3", "s/m^2", 169.0)
h1 = model.unmeasured("h1", "m")
h2 = model.unmeasured("h2", "m")
model.equation(C1 * h1.d() + (h1 - h2) / R1 - q)
model.equation(C2 * h2.d() + (h2 - h3) / R2 - (h1 - h2) / R1)
model.equation(C3 * h3.d() + h3 / R3 - (h2 - h3) / R2)
