"""A process of two seconds behind a dead time of 0.3 s: a recorder of 12 bits at 100 Hz, steps of the input."""

from pvid.models.drive import RandomSteps
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="first_order_step",
    truth=dict(K=1.8, tau=2.0, Td=0.3, y0=0.1),
    drive={"u": RandomSteps(0.5, 2.0, seed=2)},
    start={"y": 0.1},
    sample_rate=100.0,
    duration=150.0,
    window_s=6.0,
)
