"""A 12 V brush motor with a tachometer of 0.05 rad/s and a 12-bit current sensor, driven by two sines and steps."""

from pvid.models.drive import RandomSteps, Sines, Sum
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="motor_speed",
    truth=dict(R=1.2, L=3e-3, k=0.05, J=2e-4, b=1e-4, Tc=0.012, i0=0.03),
    drive={"V": Sum((Sines(((4.4, 0.7, 0.0), (2.8, 2.3, 1.0))), RandomSteps(1.5, 0.01, seed=1)))},
    start={"i": 0.03},
    friction_width=3.0,
    window_s=0.64,
)
