"""A laboratory's tank of 154 cm^2 with a pump of 8 litres a minute; a level of 1 mm at 5 Hz, steps of a minute."""

from pvid.models.drive import Steps
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="tank",
    truth=dict(A=0.0154, a=4.2e-5, q0=2e-6),
    drive={"q": Steps((9e-5, 5e-5, 1.2e-4, 7e-5, 1.1e-4, 4e-5), 60.0)},
    start={"h": 0.15},
    sample_rate=5.0,
    duration=1200.0,
    window_s=40.0,
)
