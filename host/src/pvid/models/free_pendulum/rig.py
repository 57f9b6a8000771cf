"""A rod of half a metre on ball bearings with a 12-bit encoder, released at 100 degrees."""

from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="free_pendulum",
    truth=dict(w2=31.0, k=0.04, c=0.15, q0=0.03),
    drive={},
    start={"q": 1.75},
    sample_rate=500.0,
    friction_width=0.05,
    window_s=1.0,
)
