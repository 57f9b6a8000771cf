"""A vertical arm of two links with two 14-bit encoders; servos follow sines."""

from pvid.models.drive import Sines
from pvid.models.simulated_rig import Servo, SimulatedRig

RIG = SimulatedRig(
    model="two_link_arm",
    truth=dict(I1=0.03, h1=0.15, h2=0.09, I2=0.016, v1=0.06, c1=0.12, v2=0.03, c2=0.06),
    drive={
        "t1": Servo("q1", Sines(((0.5, 0.4, 0.0), (0.3, 0.9, 1.0), (0.1, 1.7, 0.0)), offset=-1.2), kp=40.0, kd=3.0),
        "t2": Servo("q2", Sines(((0.7, 0.52, 2.0), (0.4, 1.08, 0.0), (0.15, 1.87, 0.0)), offset=0.4), kp=12.0, kd=0.6),
    },
    start={"q1": -0.9475587, "q2": 1.0365082},
    friction_width=0.1,
    window_s=1.0,
    design=dict(functions=20, decimation=2, taps=15, degree=4, rate_taps=35, rate_degree=4),
)
