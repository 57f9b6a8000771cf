"""A quadrotor's axis on a stand: difference of the throttles set, gyro measured, the rotors' thrust lags."""

from pvid.model import Model

model = Model("quadrotor axis, rotor lag")
u = model.input("u", "", hold="zoh", reach=1)
p = model.sensor("p", "rad/s", resolution=1e-3, reach=10)
T = model.unmeasured("T", "N*m")
K = model.known("K", "N*m", 1.2, sd=0.012, required=True)  # torque at full difference, from a thrust stand
J, D = model.unknown("J", "kg*m^2", 0.01), model.unknown("D", "N*m*s", 0.01)
tau = model.unknown("tau", "s", 0.05)
u0 = model.unknown("u0", "", 0.0, positive=False, sd=0.1)  # the difference that keeps the axis at rest
model.equation(J * p.d() + D * p - T)
model.equation(tau * T.d() + T - K * (u - u0))
model.words(J="inertia", D="aerodynamic damping", tau="time constant of the rotors", u0="drive at rest")
