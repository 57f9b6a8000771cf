"""A quadrotor of 0.008 kg m^2 on a one-axis stand, flown by its rate controller; a gyro of 1 mrad/s at 1 kHz."""

from pvid.models.drive import RandomSteps
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="quadrotor_axis",
    truth=dict(J=0.0082, D=0.014, tau=0.033, u0=0.02),
    drive={"u": RandomSteps(0.05, 0.06, seed=1)},
    start={"p": 0.0},
    window_s=0.3,
)
