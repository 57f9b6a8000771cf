"""A lithium cell: open-circuit voltage as a polynomial of the charge drawn, a resistance and one RC pair."""

from pvid.model import Model

model = Model("Cell, 1 RC pair, curved open-circuit voltage")
i = model.input("i", "A", hold="sampled", reach=10)
q = model.input("q", "A*s", hold="sampled", reach=1e4)  # charge drawn, counted by the tester
v = model.sensor("v", "V", resolution=1e-4, reach=5)
h = model.unmeasured("h", "V")
R0, R1, T1 = model.unknown("R0", "ohm", 0.03), model.unknown("R1", "ohm", 0.01), model.unknown("T1", "s", 40.0)
E0 = model.unknown("E0", "V", 4.1, sd=1.0)
E1, E2, E3 = (model.unknown(f"E{n}", f"V/(A*s)^{n}", 0.0, positive=False, sd=1e-3**n) for n in (1, 2, 3))
model.equation(v - E0 - E1 * q - E2 * q**2 - E3 * q**3 + R0 * i + h)
model.equation(T1 * h.d() + h - R1 * i)
