"""A mass of 0.8 kg on a linear guide, a voice coil and a position sensor of 10 um; two sines and steps."""

from pvid.models.drive import RandomSteps, Sines, Sum
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="mass_on_spring",
    truth=dict(m=0.8, c=1.4, k=160.0, Fc=0.15, x0=0.002),
    drive={"F": Sum((Sines(((2.0, 0.9, 0.0), (1.5, 2.6, 1.0))), RandomSteps(1.0, 0.2, seed=1)))},
    friction_width=0.01,
    window_s=1.0,
)
