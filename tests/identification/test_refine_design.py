"""Settings of the second stage from a run."""

import numpy as np
import pytest

from pvid.codegen.refine import refine_functions
from pvid.configuration.refine import full_motion_of, refine_settings
from pvid.models.drive import Sines
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig


@pytest.mark.parametrize("block_s", [3.1, 8.4, 16.0])
def test_the_range_of_a_second_derivative_has_room_for_the_drive(block_s: float) -> None:
    """However long the windows of the weak form are: beyond its range the drive is not known."""
    compiled, rig = compiled_of("kapitza"), simulated_rig("kapitza")
    truth = [rig.truth[name] for name in compiled.p_names]
    made, run = refine_functions(compiled), full_motion_of(compiled, 20.0)
    settings = refine_settings(made, run, 1000.0, truth, block_s)
    drive_of_y = rig.drive["y"]
    assert isinstance(drive_of_y, Sines)
    largest = sum(amplitude * (2 * np.pi * hz) ** 2 for amplitude, hz, _ in drive_of_y.tones)
    (drive,) = (one for one in settings.signal if one.order == 2)
    assert 2.0 < drive.range / (largest / compiled.knowns[0].value) < 10.0
