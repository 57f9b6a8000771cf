"""A run that the pendulum of a rig file would record, with its own guess as the truth."""

from __future__ import annotations

from collections.abc import Sequence

from pvid.base.errors import PvidError
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.sim.pendulum import Pendulum, Sensors, Tone, Truth, simulate

# White noise of the sensors beside their rounding [LSB]: that of the standard rig (theory.md 6). The rig file holds
# resolutions only.
PHI_NOISE_LSB, Y_NOISE_LSB = 0.5, 0.4


def sensors_of(rig: RigFile) -> Sensors:
    """The rig file's sensors, with the noise that the standard rig's have."""
    sensor = rig.sensor
    return Sensors(phi_lsb=sensor.phi_lsb, phi_noise_lsb=PHI_NOISE_LSB, y_lsb=sensor.y_lsb, y_noise_lsb=Y_NOISE_LSB)


def simulated_run(
    rig: RigFile, tones: Sequence[Tone], release: tuple[float, float], duration: float, truth: Truth = "linear"
) -> Run:
    """A run of `duration` [s] of the nominal rig, driven by tones and released at rest.

    Parameters
    ----------
    truth : of pvid.sim.pendulum.simulate

    Raises
    ------
    PvidError
        When the rig file has no sample rate or an exact encoder, or the drive makes no sense.
    """
    if rig.sensor.phi_lsb == 0.0:
        raise PvidError("phi_lsb is 0 in the rig file: errors can be predicted for an encoder with a resolution only")
    if rig.sample_rate is None:
        raise PvidError("sample_rate is required in the rig file to predict errors")
    return simulate(Pendulum.nominal(rig), tones, sensors_of(rig), rig.sample_rate, duration, release, truth).run
