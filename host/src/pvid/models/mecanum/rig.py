"""A platform of 18 kg: speeds of 1 mm/s and 1 mrad/s from its odometry at 200 Hz, torques from the drives' currents."""

from pvid.models.drive import RandomSteps, Sines, Sum
from pvid.models.simulated_rig import SimulatedRig


def _torque(n: int) -> Sum:
    tones = ((0.35, 0.23 + 0.09 * n, float(n)), (0.25, 0.71 + 0.13 * n, 2.0 * n))
    return Sum((Sines(tones), RandomSteps(0.15, 0.3, seed=n)))


RIG = SimulatedRig(
    model="mecanum",
    truth=dict(m=18.0, Jz=1.3, S=0.5, Jw=3e-3, b=4e-3, Tc=0.06),
    drive={f"t{n}": _torque(n) for n in range(1, 5)},
    sample_rate=200.0,
    duration=30.0,
    friction_width=0.2,
    window_s=1.0,
)
