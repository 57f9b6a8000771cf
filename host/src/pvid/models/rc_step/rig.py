"""10 kilohm and 2.2 microfarad at a microcontroller's pins: steps of 3.3 V, a 12-bit converter at 2 kHz."""

from pvid.models.drive import Steps
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="rc_step",
    truth=dict(C=2.2e-6, G=2e-6, v0=0.01),
    drive={"u": Steps((0.0, 3.3, 0.0, 3.3, 1.6), 0.1)},
    sample_rate=2000.0,
    duration=5.0,
    window_s=0.2,
)
