"""A ball of 0.11 kg on a beam of a metre, balanced by its controller; a wire sensor of 0.5 mm and a 12-bit encoder."""

from pvid.models.drive import Sines
from pvid.models.simulated_rig import Servo, SimulatedRig

_REFERENCE = Sines(((0.1, 0.21, 0.0), (0.08, 0.47, 1.0), (0.05, 1.3, 2.0)))

RIG = SimulatedRig(
    model="ball_on_beam",
    truth=dict(M=0.154, m=0.11, J=0.021, b=0.03, S=0.012),
    # The beam turns to 0.9 rad for a metre, 0.9 rad for a metre a second: the weight of the ball is balanced.
    drive={"tq": Servo("a", _REFERENCE, kp=6.0, kd=0.7, others={"r": -5.4 - 1.08, "r_1": -5.4})},
    start={"r": 0.05},
    sample_rate=500.0,
    duration=30.0,
    window_s=1.0,
)
