"""The strong form in C on simulated rigs: what its standard errors contain, and from how far off it converges."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from bench.mechanisms import start_of
from pvid.codegen.strong_library import strong_native
from pvid.configuration.strong import reference_of, strong_design
from pvid.identification.analysis import analysed
from pvid.oracle.weak.edges import with_edges
from pvid.rig.run import Recording
from pvid.sim.simulated_run import SOFT, RigSimulation, simulation_of

Float = npt.NDArray[np.float64]


def identifier_of(name: str) -> tuple[RigSimulation, Callable[[int, Float], tuple[Float, Float]]]:
    """The rig, its inputs' jumps sampled as `identify` finds it; and p and its standard errors [n_p] from a run and a
    start [n_p], with the window that the first run calls for."""
    simulation = simulation_of(name)
    run, rate = simulation.run(0, SOFT), simulation.rig.sample_rate
    model = with_edges(simulation.model, run, rate)
    simulation = replace(simulation, model=model)
    recorded = Recording(run["t"], {one.name: run[one.name] for one in model.signals}, rate)
    design = strong_design(model, recorded, reference=reference_of(analysed(recorded, model).found))
    native = strong_native(design.strong, design.config)

    def of(seed: int, start: Float) -> tuple[Float, Float]:
        own = replace(design.config.estimator, start=start.astype(np.float32))
        core = native.identifier_of(replace(design.config, estimator=own))
        run = simulation.run(seed, SOFT)
        samples = np.stack([np.asarray(run[one.name], np.float32) for one in design.strong.signals], axis=1)
        p = core.run_samples(samples, sums=False).p[-1].astype(np.float64)
        return p, core.assess()["se"][: len(p)].astype(np.float64)

    return simulation, of


@pytest.mark.parametrize("name", ["cart_pendulum", "battery_2rc", "coasting_motor"])
def test_two_standard_errors_contain_the_truth_of_other_runs(name: str) -> None:
    """By rows and other windows alone 42, 43 and 85 % of the parameters: the window is where the bias changes least."""
    simulation, identify = identifier_of(name)
    found = [identify(seed, start_of(simulation, seed)) for seed in range(1, 6)]
    off = np.array([(p - simulation.truth) / se for p, se in found])
    assert np.mean(np.abs(off) < 2) > 0.9
    assert np.median(np.abs(off), axis=0).max() > 0.3  # no error is far too large for all


def test_starts_at_twice_the_truth_and_at_half_of_it_end_where_the_truth_ends() -> None:
    simulation, identify = identifier_of("ring_down")
    truth = np.asarray(simulation.truth)
    unknowns = simulation.model.unknowns
    end, se = identify(0, truth)
    for factor in (0.5, 2.0):
        start = np.clip(truth * factor, [one.low for one in unknowns], [one.high for one in unknowns])
        assert (np.abs(identify(0, start)[0] - end) < 2 * se).all()
