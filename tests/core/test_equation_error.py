"""Rigs whose equations have an error of their own that the design does not contain."""

from functools import cache

import numpy as np
import pytest

from bench.board_weak import Answer, BoardWeak, FixedBoard, Float, FloatBoard, Signals
from bench.weak import rms
from pvid.configuration.weak import config_for_simulated_rig, simulated_run_of, weak_config
from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.models.mechanisms import compiled_of
from pvid.settings.enums import Core
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import simulation_of

RUNS = 6

# White torque about the first axis of a body [N m / sqrt(Hz)]; white torque of the pendulum's joint of a cart.
CASES = {"rigid_body": Imperfections(process={0: 1e-3}), "cart_pendulum": Imperfections(process={1: 1e-3})}


@cache
def informed(name: str) -> tuple[list[Signals], list[Float], list[Answer]]:
    """Runs, starts, and the answers of float32 with a design that contains the disturbance."""
    compiled, imperfect, simulation = compiled_of(name), CASES[name], simulation_of(name)
    _, design, p = simulated_run_of(compiled)
    config = weak_config(compiled, simulation.run(99, imperfect), design, p)
    own = config_for_simulated_rig(compiled).design
    assert (config.design.error_variance > 30 * own.error_variance).any()
    starts = [simulation.truth * np.random.default_rng(seed).uniform(0.7, 1.4, len(p)) for seed in range(RUNS)]
    runs: list[Signals] = [simulation.run(seed, imperfect) for seed in range(RUNS)]
    board = FloatBoard(compiled, config)
    return runs, starts, [board.answer(run, start) for run, start in zip(runs, starts, strict=True)]


@pytest.mark.parametrize("core", ["f32", "q31"])
@pytest.mark.parametrize("name", sorted(CASES))
def test_a_disturbance_of_one_equation_does_not_spoil_the_others(name: str, core: Core) -> None:
    """As good as with the variance that the disturbed rig has, which the design here does not contain.

    With the design's own variance the errors are ten to a thousand times as large: 20 % of Ixz, 10 % of the cart's
    mass.
    """
    runs, starts, wanted = informed(name)
    compiled, truth = compiled_of(name), simulation_of(name).truth
    board: BoardWeak = (
        FixedBoard(weak_q31_for_simulated_rig(compiled))
        if core == "q31"
        else FloatBoard(compiled, config_for_simulated_rig(compiled))
    )
    found = [board.answer(run, start) for run, start in zip(runs, starts, strict=True)]
    assert all(one.published for one in found)
    size = np.where(truth != 0, truth, 1.0)
    errors, least = (rms(np.array([(one.p - truth) / size for one in answers])) for answers in (found, wanted))
    # The windows before the variance is known are lost: a sixth to a third of those of a run.
    assert (errors < np.maximum(4 * least, 2e-4)).all()
    # 3 of the cart's mass by its sharp friction, without a disturbance
    assert np.max(rms(np.array([(one.p - truth) / one.se for one in found]))) < 2.6
