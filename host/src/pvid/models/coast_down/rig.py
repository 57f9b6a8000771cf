"""A car of 1 400 kg that rolls out from 120 km/h; a speed of 0.01 km/h (satellite receiver) at 20 Hz."""

from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="coast_down",
    truth=dict(F0=140.0, F1=1.5, F2=0.42),
    drive={},
    start={"v": 33.3},
    sample_rate=20.0,
    duration=120.0,
    window_s=8.0,
)
