"""Settings of the second stage from a run."""

from __future__ import annotations

import numpy as np
import pytest

from pvid.codegen.refine import refine_functions
from pvid.configuration.refine import full_pendulum, refine_settings
from pvid.models.mechanisms import compiled_of
from pvid.sim.pendulum import STANDARD_DRIVE, STANDARD_PENDULUM


@pytest.mark.parametrize("block_s", [3.1, 8.4, 16.0])
def test_the_range_of_a_second_derivative_has_room_for_the_drive(block_s: float) -> None:
    """However long the windows of the weak form are: beyond its range the drive is not known."""
    truth = [*STANDARD_PENDULUM.linear, 0.0]
    made = refine_functions(compiled_of("kapitza"))
    settings = refine_settings(made, full_pendulum(20.0), 1000.0, truth, block_s)
    largest = sum(one.amplitude_m * (2 * np.pi * one.frequency_hz) ** 2 for one in STANDARD_DRIVE)
    (drive,) = (one for one in settings.signal if one.order == 2)
    assert 2.0 < drive.range / (largest / STANDARD_PENDULUM.l1) < 10.0
