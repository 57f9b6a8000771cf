"""A lithium cell of two relaxations, at 1 Hz for four hours: steps of 15 s on steps of four minutes."""

from pvid.models.drive import RandomSteps, Sum
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="battery_2rc",
    truth=dict(R0=0.02, R1=0.015, T1=20.0, R2=0.02, T2=300.0, s=2e-5, E=3.7),
    # The current changes between two samples: current and voltage are taken at the same instant.
    drive={
        "i": Sum(
            (
                RandomSteps(2.0, 15.0, seed=3, normal=True, delay_s=0.5),
                RandomSteps(3.0, 240.0, seed=4, normal=True, delay_s=0.5),
            )
        )
    },
    sample_rate=1.0,
    duration=4 * 3600.0,
    substeps=4,
    window_s=1200.0,
    design=dict(functions=40),
)
