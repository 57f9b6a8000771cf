"""A body of 0.02 kg m^2 on gyros of 1 mrad/s, turned about all axes by a controller of its rates."""

from pvid.models.drive import Sines
from pvid.models.simulated_rig import Servo, SimulatedRig


def _servo(axis: int) -> Servo:
    tones = ((0.6, 0.5 + 0.3 * axis, float(axis)), (0.4, 1.7 + 0.6 * axis, 0.0))
    return Servo(f"w{axis}", Sines(tones), kp=0.3, kd=0.0)


RIG = SimulatedRig(
    model="rigid_body",
    truth=dict(Ixx=0.012, Iyy=0.014, Izz=0.022, Ixy=5e-4, Ixz=-3e-4, Iyz=4e-4),
    drive={f"m{axis}": _servo(axis) for axis in range(3)},
    window_s=1.0,
    design=dict(functions=12, decimation=8, taps=61, rate_taps=61, rate_degree=6),
)
