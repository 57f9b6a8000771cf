"""A rotary pendulum that hangs from a driven arm, with two 12-bit encoders, driven by three sines."""

from pvid.models.drive import Sines
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="furuta",
    truth=dict(J0=2e-3, Jp=1.2e-3, h=1.3e-3, G=0.06, b1=3e-4, b2=5e-5),
    drive={"V": Sines(((3.5, 0.5, 1.6), (4.0, 1.4, 1.2), (3.5, 2.3, 2.0)))},
    start={"a": 0.3},
    window_s=1.0,
    design=dict(functions=24, decimation=2, taps=15, degree=4, rate_taps=41, rate_degree=6),
)
