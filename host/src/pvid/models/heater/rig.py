"""A plate of 80 J/K with a cartridge of 60 W in steps of half a minute; two sensors of 1/16 K at 2 Hz."""

from pvid.models.drive import Sines, Steps
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="heater",
    truth=dict(C=80.0, h=0.35, h2=1.5e-3),
    drive={"P": Steps((60.0, 0.0, 30.0, 60.0, 15.0, 0.0, 45.0), 120.0), "Ta": Sines(((0.5, 1e-3, 0.0),), offset=295.0)},
    start={"T": 295.0},
    sample_rate=2.0,
    duration=2400.0,
    window_s=60.0,
)
