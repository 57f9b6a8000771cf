"""Sensors that are sampled at two instants, put right by a delay of the rig file."""

import numpy as np
import pytest

from pvid.identification.reading import aligned
from pvid.models.mechanisms import compiled_of
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording


@pytest.mark.parametrize(("name", "sensor"), [("kapitza", "y"), ("dc_motor", "i")])
def test_a_shift_and_its_opposite_leave_a_straight_line_as_it_was(name: str, sensor: str) -> None:
    t = np.arange(100) / 1000.0
    model = compiled_of(name)
    recording = Recording(t, {one.name: 3 * t for one in model.signals}, 1000.0)
    moved = aligned(recording, MechanismRig(name, sensor={sensor: {"delay": 0.0013}}).applied(model))
    assert np.allclose(moved.signals[sensor][2:-2], 3 * (t - 0.0013)[2:-2])
    assert all(moved.signals[one.name] is recording.signals[one.name] for one in model.signals if one.name != sensor)
    assert aligned(recording, model) is recording
    assert f"{sensor} was moved by 1.3 ms" in moved.notes[0]
