"""A steel beam of 7.5 Hz and a laser sensor of 1 um, knocked by 3 mm; five seconds at 1 kHz."""

from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="ring_down", truth=dict(w2=2220.0, d=0.9, x0=2e-4), drive={}, start={"x": 3e-3}, duration=5.0, window_s=0.5
)
