"""A 12 V converter of 27 uH and 150 uF, sampled each cycle of 100 kHz by a 12-bit converter; random duty."""

from pvid.models.drive import RandomSteps, Sines, Sum
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="buck_converter",
    truth=dict(L=2.7e-5, C=1.5e-4, RL=0.07, Rc=0.013, Ro=2.4),
    drive={
        "d": Sum((Sines((), offset=0.4), RandomSteps(0.08, 5e-4, seed=1))),
        "vin": Sines(((0.4, 37.0, 0.0),), offset=12.0),
    },
    start={"i": 2.0, "vc": 4.8},
    sample_rate=100000.0,
    duration=0.2,
    window_s=1e-3,
)
