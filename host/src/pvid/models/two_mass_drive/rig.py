"""A motor that drives a load over an elastic shaft, with a 14-bit encoder at the motor and a 12-bit current sensor."""

from pvid.models.drive import Sines
from pvid.models.simulated_rig import SimulatedRig

_HZ = (1.3, 3.1, 5.7, 8.3, 11.9, 15.1, 19.7)
_PHASES = (1.6, 1.8, 4.9, 0.6, 2.2, 3.1, 5.5)

RIG = SimulatedRig(
    model="two_mass_drive",
    truth=dict(J1=4e-4, J2=8e-4, k=2.0, c=2e-3, b1=1e-3, b2=2e-3, Tc=0.03, i0=0.04),
    drive={"i": Sines(((1.0, 0.35, 0.0), *((0.5, hz, phase) for hz, phase in zip(_HZ, _PHASES, strict=True))), 0.04)},
    friction_width=1.0,
    window_s=0.5,
    design=dict(functions=24, power=8, rate_taps=15, rate_degree=6),
)
