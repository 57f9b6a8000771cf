"""A synchronous buck converter, averaged over a cycle: duty set; coil current and output voltage measured."""

from pvid.model import Model

model = Model("buck converter")
d = model.input("d", "", hold="zoh", reach=1, gain_sd=1e-3)  # a timer; both voltages have dividers of 0.1 %
vin = model.sensor("vin", "V", resolution=20 / 2**12, reach=20, driven=True, gain_sd=1e-3)
i = model.sensor("i", "A", resolution=20 / 2**12, reach=10)
v = model.sensor("v", "V", resolution=10 / 2**12, reach=10, gain_sd=1e-3)
vc = model.unmeasured("vc", "V")
L, C = model.unknown("L", "H", 2e-5), model.unknown("C", "F", 1e-4)
RL = model.unknown("RL", "ohm", 0.05)
Rc = model.unknown("Rc", "ohm", 0.02)
Ro = model.unknown("Ro", "ohm", 2.0)
model.equation(L * i.d() + RL * i + v - d * vin)
model.equation(C * vc.d() - i + v / Ro)
model.equation(v - vc - Rc * (i - v / Ro))
model.words(L="inductance", C="capacitance", RL="resistance of coil and switches")
model.words(Rc="resistance in series with the capacitor", Ro="load resistance")
