"""A motor of 2e-4 kg m^2 that runs out from 3 000 turns a minute, its angle by a 12-bit encoder at 1 kHz."""

from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="coasting_motor",
    truth=dict(b=6e-5, Tc=0.008, q=2e-7),
    drive={},
    start={"phi_1": 314.0},
    duration=4.0,
    friction_width=0.5,
    window_s=0.3,
)
