"""The bench of the pendulum through the weak engine: its short form."""

from __future__ import annotations

import numpy as np

from bench import pendulum


def test_both_cores_are_as_accurate_as_over_80_runs() -> None:
    """Five runs at 14 bits; 80 runs of every rig: `pvid bench pendulum`."""
    rig = pendulum.RIGS[1]
    assert (rig.name, rig.bits) == ("standard", 14)
    found = {core: pendulum.errors_of(rig, 5, core) for core in pendulum.CORES}
    for one in found.values():
        assert one.published == 5
        # The RMS over 80 runs is 0.012 / 0.012 / 0.025 %; that of five is uncertain by a third.
        assert (pendulum.rms(one.relative) < 1.5 * np.array([0.012, 0.012, 0.025])).all()
        assert (one.since < 10.0).all()
    assert len(pendulum.row_of(rig, found)) == len(pendulum.HEADER)


def test_an_offset_of_the_encoder_costs_nothing() -> None:
    """0.1 rad, that of the largest angle: the same five runs to a tenth of their error."""
    plain, rig = pendulum.RIGS[1], pendulum.RIGS[5]
    assert rig.zero == 0.1
    one, other = (pendulum.errors_of(each, 5, "q31").relative for each in (plain, rig))
    assert (np.abs(one - other) < 0.3 * pendulum.rms(one) / 100).all()


def test_windows_follow_the_slow_mode() -> None:
    slow = next(one for one in pendulum.RIGS if one.name == "twice as slow")
    standard, slower = pendulum.design_for(pendulum.RIGS[0]), pendulum.design_for(slow)
    assert slower.window_s > 1.5 * standard.window_s and slower.decimation > standard.decimation
    assert np.isclose(slower.hop, standard.hop, rtol=0.1)


def test_the_bound_is_that_of_math_md() -> None:
    np.testing.assert_allclose(100 * pendulum.cramer_rao(pendulum.RIGS[1]), [0.0082, 0.0086, 0.0168], rtol=0.01)
