"""The bench of the pendulum through the weak engine: its short form."""

from __future__ import annotations

import numpy as np

from bench import pendulum
from pvid.core.native import Native


def test_the_engine_is_as_accurate_as_the_pendulums_own_form(native: Native) -> None:
    """Five runs at 14 bits; 80 runs of every rig: `pvid bench pendulum`."""
    rig = pendulum.RIGS[1]
    assert (rig.name, rig.bits) == ("standard", 14)
    found = pendulum.errors_of(native, rig, 5)
    assert found.published == 5
    # The RMS over 80 runs is 0.011 / 0.012 / 0.024 %; that of five is uncertain by a third.
    assert (pendulum.rms(found.engine) < 1.5 * np.array([0.011, 0.012, 0.024])).all()
    assert len(pendulum.row_of(rig, found)) == len(pendulum.HEADER)


def test_windows_follow_the_slow_mode() -> None:
    slow = pendulum.RIGS[-1]
    standard, slower = pendulum.design_for(pendulum.RIGS[0]), pendulum.design_for(slow)
    assert slow.name == "twice as slow"
    assert slower.window_s > 1.5 * standard.window_s and slower.decimation > standard.decimation
    assert np.isclose(slower.hop, standard.hop, rtol=0.1)
