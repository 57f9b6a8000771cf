"""A cart of 0.8 kg on a rail with a pendulum below it, driven by three sines; the encoder's zero is unknown."""

from pvid.models.drive import Sines
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="cart_pendulum",
    truth=dict(mt=0.8, ml=0.04, J=0.0107, b=1.0, Fc=0.3, bp=2e-3, c=0.05),
    drive={"F": Sines(((2.2, 0.6, 0.0), (2.5, 1.3, 1.0), (2.0, 2.1, 2.0)))},
    start={"a": 0.15},
    friction_width=0.1,
    window_s=1.0,
    design=dict(functions=12, decimation=8, taps=61, rate_taps=61, rate_degree=6, joint=True),
)
