"""The standard rig: three sines move the pivot by 15 mm, a 14-bit encoder between the links."""

from pvid.models.drive import Sines
from pvid.models.simulated_rig import SimulatedRig

RIG = SimulatedRig(
    model="kapitza",
    truth=dict(w=9.5 / 0.3, d1=8.875, d2=5.625, c=0.0),
    drive={"y": Sines(((6e-3, 1.1, 0.3), (5e-3, 2.3, 1.7), (4e-3, 4.1, 4.0)))},
    start={"phi1": 0.06, "phi": 0.08},
    whole_start={"a1": 0.06, "a2": 0.14},
    duration=40.0,
    window_s=1.536,
    design=dict(functions=7, decimation=24, taps=41, rate_taps=61, rate_degree=6, comb=True),
)
