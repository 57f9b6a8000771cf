"""Sensors that are sampled at two instants: found from the run, covered by the standard errors, and put right."""

from __future__ import annotations

import numpy as np
import pytest

from bench.campaign.judge import identify_rig
from bench.campaign.population import shipped
from bench.campaign.truth import simulate_rig
from pvid.core.native import Native
from pvid.rig.run import Run
from pvid.run.skew import aligned


def test_a_shift_and_its_opposite_leave_a_straight_line_as_it_was() -> None:
    t = np.arange(100) / 1000.0
    run = Run(t=t, phi=0 * t, y=3 * t, sample_rate=1000.0)
    assert np.allclose(aligned(run, 0.0013).y[2:-2], 3 * (t - 0.0013)[2:-2])
    assert aligned(run, 0.0) is run
    assert "1.3 ms" in aligned(run, 0.0013).notes[0]


def test_delay_that_moves_the_estimate_is_estimated(native: Native) -> None:
    """2.4 ms took 27 % off d2 in the weak form: the refinement finds them."""
    simulated = simulate_rig(native, shipped(), 1, 41)
    record, result = identify_rig(native, simulated)
    assert result is not None and result.identified
    assert not record["silently_wrong"] and abs(record["d2_error"]) < 0.01  # type: ignore[arg-type]
    assert result.refinement is not None and result.refinement.adopted and result.refinement.outcome is not None
    tau, _ = result.refinement.outcome.extras["tau"]
    assert abs(tau) == pytest.approx(0.00244, rel=0.02)
