"""A 10 inch propeller on a 920 rpm/V motor: steps of voltage for a quarter of a minute at 1 kHz."""

from pvid.models.drive import RandomSteps, Sines, Sum
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="thrust_stand",
    truth=dict(R=0.12, k=0.0104, J=4.5e-5, kq=2.4e-7, kt=1.35e-5, F0=0.4, Tc=0.012),
    drive={"V": Sum((Sines(((2.5, 0.13, 0.0),), offset=7.0), RandomSteps(1.2, 0.5, seed=1)))},
    start={"w": 500.0},
    duration=15.0,
    window_s=0.5,
)
