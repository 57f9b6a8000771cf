"""A resistor and a capacitor at steps of voltage; the resistor is known, the capacitor leaks."""

from pvid.model import Model

model = Model("RC step")
u = model.input("u", "V", hold="zoh", reach=5, gain_sd=1e-3)  # the pin has the converter's reference
v = model.sensor("v", "V", resolution=5 / 2**12, reach=5, gain_sd=1e-3)
R = model.known("R", "ohm", 1e4, sd=100.0, required=True)
C, G = model.unknown("C", "F", 1e-6), model.unknown("G", "1/ohm", 1e-6)  # G: of the leak and the voltmeter
v0 = model.unknown("v0", "V", 0.0, positive=False, sd=0.05)
model.equation(R * (C * v.d() + G * (v - v0)) + v - v0 - u)
model.output("tau", "s", R * C / (1 + R * G))
model.words(C="capacitance", G="conductance of leak and voltmeter", v0="offset of the sensor", tau="time constant")
