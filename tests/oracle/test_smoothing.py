"""A filter that blurs a derivative bends the estimate and leaves no residual; a shorter one shows it."""

from dataclasses import replace

import numpy as np

from bench.mechanisms import design_of
from pvid.oracle.weak.identify import identify
from pvid.sim.simulated_run import PERFECT, simulation_of


def test_derivative_that_is_smoothed_too_long_is_named() -> None:
    """The pivot's acceleration from steps of 16 samples with two exact frequencies, not four: p is 25 standard errors
    off at a chi2 of 1."""
    simulation = simulation_of("kapitza")
    run, design = simulation.run(0), replace(design_of(simulation, PERFECT), decimation=16)
    right, blurred = (
        identify(simulation.model, run, 1000.0, simulation.truth, replace(design, rate_taps=131, rate_degree=degree))
        for degree in (6, 4)
    )
    assert right.verdict.status == "good"
    assert np.all(np.abs(right.p - simulation.truth) < 4 * right.se)
    assert np.any(np.abs(blurred.p - simulation.truth) > 10 * blurred.clustered)
    assert "smoothing" in [one.name for one in blurred.verdict.reasons if one.alarm]
