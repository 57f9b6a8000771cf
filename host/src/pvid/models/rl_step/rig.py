"""A locked motor's winding of 3.5 ms on a bridge with a 12-bit current sensor: steps of 3 V at 10 kHz."""

from pvid.models.drive import RandomSteps
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="rl_step",
    truth=dict(R=0.8, L=2.8e-3, i0=0.03),
    drive={"V": RandomSteps(3.0, 0.004, seed=1)},
    start={"i": 0.03},
    sample_rate=10000.0,
    duration=2.0,
    window_s=0.05,
)
