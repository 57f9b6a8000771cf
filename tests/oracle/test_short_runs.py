"""A run with few windows is identified, without a comparison of its halves; one with none is refused."""

import numpy as np
import pytest
from conftest import ROOT

from pvid.base.errors import PvidError
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import SimulatedRig
from pvid.oracle.weak.choice import chosen
from pvid.oracle.weak.identify import identify, ready
from pvid.sim.simulated_run import RigSimulation, simulation_of

MODEL = compiled_of(ROOT / "tests" / "data" / "recordings" / "free_pendulum.py")
RATE = 100.0
RIG = SimulatedRig(
    model=MODEL.name,
    truth={"w2": 64.0, "k": 0.05, "c": 0.1, "o": 0.0},
    drive={},
    start={"q": np.pi + 1.0},
    sample_rate=RATE,
    duration=2.4,
    friction_width=0.1,
)
SWING = RigSimulation.of(MODEL, RIG)


def test_run_of_240_samples_is_identified_without_halves() -> None:
    found = identify(MODEL, SWING.run(0), RATE)
    assert found.halves is None
    assert "short" in [one.name for one in found.verdict.reasons]
    assert (np.abs(found.p - SWING.truth) < 4 * found.se).all()


@pytest.mark.parametrize("seed", [0, 1, 4, 5])
def test_short_run_of_a_motor_lacks_nothing(seed: int) -> None:
    """The rows of both equations have the noise of one encoder, which moves by few steps: whitened together they
    leave 2.4 times what they leave one by one."""
    model, simulation = compiled_of("dc_motor"), simulation_of("dc_motor")
    run = {name: values[:700] for name, values in simulation.run(seed).items()}
    found = identify(model, run, simulation.rig.sample_rate)
    assert found.chi2 < 1.5 and found.verdict.status == "good"
    assert (np.abs(found.p - simulation.truth) < 4 * found.se).all()


def test_run_that_moves_at_its_begin_alone_is_refused() -> None:
    at_rest = np.concatenate([SWING.run(0)["q"][:80], np.full(240, np.pi)])
    with pytest.raises(PvidError, match=r"the run of 320 samples .* or moves in too little of that: record more"):
        chosen(ready(MODEL), {"q": at_rest}, RATE)


def test_run_of_50_samples_is_refused() -> None:
    expected = r"the run of 50 samples \(0.5 s\) is too short for .*: record more samples, at least 220 \(2.2 s\)$"
    with pytest.raises(PvidError, match=expected):
        chosen(ready(MODEL), {"q": SWING.run(0)["q"][:50]}, RATE)
    assert np.isfinite(chosen(ready(MODEL), {"q": SWING.run(0)["q"][:220]}, RATE).window_s)
