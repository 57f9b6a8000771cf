"""A process of first order: gain, time constant, dead time (Pade's approximation of order one over two), offset."""

from pvid.model import Model

model = Model("first-order step with dead time")
u = model.input("u", "", hold="zoh", reach=1)
y = model.sensor("y", "", resolution=1 / 2**12, reach=4)
z = model.unmeasured("z", "")  # z - Td/3 z' is the input after the dead time, without a jump
K, tau = model.unknown("K", "", 1.0), model.unknown("tau", "s", 1.0)
Td = model.unknown("Td", "s", 0.2)
y0 = model.unknown("y0", "", 0.0, positive=False, sd=0.5)
model.equation(tau * y.d() + y - y0 - K * (z - Td / 3 * z.d()))
model.equation(Td**2 / 6 * z.d(2) + 2 * Td / 3 * z.d() + z - u)
model.words(K="gain", tau="time constant", Td="delay", y0="offset of the output")
