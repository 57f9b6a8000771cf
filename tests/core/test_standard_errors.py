"""Standard errors that are published: of sums that lost their digits, and of rows that are not white."""

import numpy as np
import pytest

from bench.board_weak import PUBLISHED, FixedBoard, FloatBoard
from bench.hard import Case, board, simulation_for
from pvid.configuration.weak import config_for_simulated_rig
from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.identify import ready
from pvid.settings.enums import Core
from pvid.sim.bound import bound
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import RigSimulation

FINE = Case("an encoder of 17 bits", coarser=1 / 8)


@pytest.mark.parametrize("core", ["f32", "q31"])
def test_a_large_step_leaves_standard_errors(core: Core) -> None:
    """A fine encoder and a guess that is far off: after the first steps nothing is left of the residuals' sum of
    squares in float32. Without a floor under it the core publishes standard errors of exactly 0."""
    rig = simulation_for("kapitza", FINE)
    far = rig.truth * np.array([0.65, 0.5, 1.5, 1.0])
    found = board("kapitza", core, FINE.coarser).answer(rig.run(1), far)
    of_publications = found.errors[np.isin(found.reasons, PUBLISHED)]
    assert len(of_publications) and (of_publications > 0).all()
    assert (found.se > 0.5 * bound(rig)).all()


@pytest.mark.parametrize("core", ["f32", "q31"])
def test_the_scatter_of_the_windows_makes_standard_errors_honest(core: Core) -> None:
    """A motor whose load is disturbed: the rows are whitened for the sensors' noise and their residuals are not white.

    24 runs, so that the root mean square of errors over standard errors is known to 14 %. From the residuals alone the
    standard errors of J, b and Tc are too small: 1.6.
    """
    compiled = compiled_of("dc_motor")
    simulation = RigSimulation.of(compiled, simulated_rig("dc_motor"))
    of_rig = dict(zip(simulation.model.p_names, simulation.truth, strict=True))
    names = ready(compiled).model.p_names
    truth = np.array([of_rig.get(name, 0.0) for name in names])
    own = (
        FixedBoard(weak_q31_for_simulated_rig(compiled))
        if core == "q31"
        else FloatBoard(compiled, config_for_simulated_rig(compiled))
    )
    answers = [own.answer(simulation.run(seed, Imperfections(process={1: 3e-4})), truth) for seed in range(24)]
    assert all(one.published for one in answers)
    relative = np.array([(one.p - truth) / one.se for one in answers])
    of_load = [names.index(name) for name in ("J", "b", "Tc")]
    assert 0.75 < np.sqrt(np.mean(relative[:, of_load] ** 2)) < 1.2
    assert np.sqrt(np.mean(relative**2, axis=0)).max() < 1.4
