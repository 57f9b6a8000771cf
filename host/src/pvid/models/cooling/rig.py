"""A block of aluminium that cools from 80 degrees for an hour; two sensors of 1/16 K at 1 Hz."""

from pvid.models.drive import Sines
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="cooling",
    truth=dict(a=1 / 640.0, e=0.3),
    drive={"Ta": Sines(((0.7, 4e-4, 0.0),), offset=295.0)},
    start={"T": 353.0},
    sample_rate=1.0,
    duration=3600.0,
    window_s=300.0,
)
