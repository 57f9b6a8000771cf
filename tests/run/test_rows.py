"""Least squares over the rows of a run."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pvid.models.kapitza import MODEL
from pvid.rig.file import RigFile
from pvid.run.rows import Fit, RunRows, least_squares
from pvid.setup.f32 import nominal_start, weak_design_of
from pvid.sim.pendulum import simulate


@pytest.mark.filterwarnings("error")
def test_a_window_with_a_jump_leaves_errors_that_are_numbers() -> None:
    """Three windows at rest and one with an angle of 1e9 rad: products of 1e25 cancel in the covariance."""
    information = np.array(
        [
            [4.3419283312132629e11, 1.7929914669656243e09, 1.5223111591017245e17, 1.3912007817174313e18],
            [1.7929914669656246e09, 1.9522362851444788e07, 1.7861874479082828e15, 1.6343122579716762e16],
            [1.5223111591017245e17, 1.7861874479082825e15, 1.6674323572047846e23, 1.5271899006865707e24],
            [1.3912007817174313e18, 1.6343122579716762e16, 1.5271899006865710e24, 1.3988422924710656e25],
        ]
    )
    scores = np.array(
        [
            [6.9673899567392842e-04, 2.7065020289961982e-03, -2.1686822145461582e-04, 1.3378706430643032e-02],
            [-2.2991064493071387e-04, -1.2676516045578526e-03, 3.1724761599650309e-04, 5.2718147792835193e-03],
            [5.6670708391304862e-05, 6.6950091704484637e-04, -4.4672395124802224e-04, -2.5752049393667268e-02],
            [-8.5796009111345779e17, -1.0066782565063910e16, -9.3974901659063771e23, -8.6070970201086114e24],
        ]
    )
    energy = np.ones(4)
    fit = Fit(np.ones(4), 1.0, information, scores, energy, energy, 1.0)
    assert (fit.clustered_se > 0).all()


def test_a_search_that_diverges_ends_where_it_is() -> None:
    """From far off d2 falls without bound; the search is left after three decades and not after all its steps."""
    rig, run = RigFile.standard(), simulate(duration=10.0).run
    rows = RunRows.of(rig, run, weak_design_of(rig, run.sample_rate))
    right = np.append(nominal_start(rig), 0.0)
    assert MODEL.is_plausible(rows.fitted(right).p)
    white = rows.whitened(right)
    moments = np.einsum("wik,wjk->ij", white, white)
    moments[1:, 0], moments[0, 1:] = -moments[1:, 0], -moments[0, 1:]  # as of an angle of the other sign
    p = least_squares(moments, right)
    moved = np.abs(np.log(p[:3] / right[:3])).max()
    assert not MODEL.is_plausible(p)
    assert math.log(1e3) < moved < math.log(1e3) + 0.5  # a step is at most 0.5
