"""A motor of 7 pole pairs on a 24 V inverter with a dead time of 1 us, at 10 kHz; it turns one way, without end."""

from pvid.models.drive import RandomSteps, Sines, Sum
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="pmsm",
    truth=dict(R=0.13, V0=0.25, Ld=1.4e-4, Lq=1.9e-4, psi=0.0082, J=8e-5, b=1.6e-4, Tc=0.03),
    drive={
        "vd": RandomSteps(0.8, 0.011, seed=2),
        "vq": Sum((Sines(((1.5, 1.1, 0.0),), offset=5.0), RandomSteps(0.8, 0.017, seed=1))),
    },
    start={"id": -1.0, "iq": 4.0, "th_1": 80.0},
    sample_rate=10000.0,
    duration=2.0,
    window_s=0.05,
)
