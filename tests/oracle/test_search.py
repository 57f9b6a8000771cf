"""Searches of a design and of p that start far off, or with filters that blur a measured drive."""

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pvid.identification.core import identify_in_c
from pvid.identification.road import identified
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak import reversals
from pvid.oracle.weak.blur import blur_of, rates_of_drives
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.identify import identify, ready
from pvid.oracle.weak.rows import WeakRows, WhiteRows
from pvid.oracle.weak.shared import neglected
from pvid.oracle.weak.starts import starts_about
from pvid.rig.run import Recording
from pvid.settings.enums import Core
from pvid.sim.simulated_run import simulation_of

PENDULUM = ready(compiled_of("kapitza"))
MOTOR = ready(compiled_of("dc_motor"))


def sine(
    hz: float, noise: float = 0.0, rate: float = 200.0
) -> dict[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    t = np.arange(4000) / rate
    y = 5e-3 * np.sin(2 * np.pi * hz * t) + noise * np.random.default_rng(0).normal(size=t.size)
    return {"y": y, "phi": 0.05 * np.cos(t)}


def test_starts_are_spread_over_the_positive_parameters_alone() -> None:
    guess = np.array([30.0, 9.0, 5.0, 0.02])
    found = np.array(list(starts_about(PENDULUM.parameters, guess)))
    assert (found[:, 3] == 0.02).all()
    steps = np.log(found[:, :3] / guess[:3]) / np.log(3.0)
    assert (np.abs(steps) <= 1).all() and (steps.max(axis=0) > 0.6).all() and (steps.min(axis=0) < -0.6).all()
    apart = np.abs(steps[:, np.newaxis] - steps).max(axis=2) + 10 * np.eye(len(steps))
    assert apart.min() > 0.3


@pytest.mark.parametrize(("taps", "degree"), [(21, 3), (31, 4), (61, 6)])
def test_blur_is_the_relative_error_of_the_drives_second_derivative(taps: int, degree: int) -> None:
    """Of a sine: one less the filter's gain at its frequency, whatever the noise."""
    design = WeakDesign(200.0, 1.0, rate_taps=taps, rate_degree=degree)
    hz = 4.0
    run = sine(hz)
    half = taps // 2
    t = np.arange(-half, half + 1) / 200.0
    fit = np.polynomial.Polynomial.fit(t, np.cos(2 * np.pi * hz * t), degree).convert().coef
    gain = 2 * fit[2] / -((2 * np.pi * hz) ** 2)
    assert blur_of(PENDULUM, run, design) == pytest.approx(abs(1 - gain), rel=0.02)
    assert blur_of(PENDULUM, sine(hz, noise=5e-6), design) == pytest.approx(abs(1 - gain), rel=0.05)


def test_blur_of_a_signal_that_has_changed_in_place_is_that_of_its_present_samples() -> None:
    design = WeakDesign(200.0, 1.0, rate_taps=21, rate_degree=3)
    run = sine(1.0)
    before = blur_of(PENDULUM, run, design)
    run["y"][:] = sine(8.0)["y"]
    assert blur_of(PENDULUM, run, design) == blur_of(PENDULUM, sine(8.0), design) > 10 * before
    assert blur_of(PENDULUM, run, WeakDesign(200.0, 1.0, rate_taps=31, rate_degree=3)) > blur_of(PENDULUM, run, design)


def test_only_measured_drives_blur() -> None:
    assert [(one.of, one.order) for one in rates_of_drives(PENDULUM)] == [("y", 2)]
    assert rates_of_drives(MOTOR) == []
    run = {name: np.random.default_rng(1).normal(size=500) for name in ("V", "i", "phi")}
    assert blur_of(MOTOR, run, WeakDesign(1000.0, 0.1)) == 0.0


def test_small_angles_neglect_the_square_of_the_largest() -> None:
    run = sine(1.0)
    largest = np.max(np.abs(run["phi"] - np.mean(run["phi"])))
    assert neglected(compiled_of("kapitza"), run) == pytest.approx(largest**2)
    assert neglected(compiled_of("dc_motor"), run) == 0.0


def test_a_clean_run_is_identified_by_few_weightings_and_few_searches_for_reversals(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What takes the time: 250 and 72 before designs were compared to what scores need and reversals were kept."""
    count: Counter[str] = Counter()
    white, located = WeakRows.white, reversals.located

    def counted_white(self: WeakRows, *given: Any) -> WhiteRows:
        count["white"] += 1
        return white(self, *given)

    def counted_located(*given: Any) -> reversals.Signs:
        count["located"] += 1
        return located(*given)

    monkeypatch.setattr(WeakRows, "white", counted_white)
    monkeypatch.setattr(reversals, "located", counted_located)
    simulation = simulation_of("dc_motor")
    found = identify(simulation.model, simulation.run(3), simulation.rig.sample_rate)
    assert found.verdict.warning is None
    assert 20 < count["white"] < 190 and 5 < count["located"] < 35, count


@pytest.mark.parametrize(("name", "seconds"), [("coast_down", 300.0), ("coasting_motor", 12.0)])
def test_a_mechanism_that_comes_to_rest_is_identified_from_its_motion(name: str, seconds: float) -> None:
    """At rest the noise of a speed is no reversal of it, and friction is any force up to its own."""
    shipped = simulation_of(name)
    simulation = replace(shipped, rig=replace(shipped.rig, duration=seconds), _motions={})
    found = identify(simulation.model, simulation.run(3), simulation.rig.sample_rate)
    assert found.verdict.warning is None and found.chi2 == pytest.approx(1.0, abs=0.2)  # 28 windows of 12 rows
    assert all(one.status == "identified" for one in found.judged)
    assert np.all(np.abs(found.p - simulation.truth) < 4 * found.se)
    assert sum(one.reversals for one in found.fit.rows.record.signs) < 200


@pytest.mark.parametrize("core", ["f32", "q31"])
@pytest.mark.parametrize(("name", "seconds"), [("coast_down", 300.0), ("coasting_motor", 12.0)])
def test_the_design_of_a_core_is_for_the_motion_before_the_rest(name: str, seconds: float, core: Core) -> None:
    shipped = simulation_of(name)
    run = replace(shipped, rig=replace(shipped.rig, duration=seconds), _motions={}).run(3)
    answer = identified(Recording(run.pop("t"), run, shipped.rig.sample_rate), shipped.model, refine=False)
    found = identify_in_c(answer, core)
    assert found.published and found.misfit == pytest.approx(1.0, abs=0.3)
    for name, true in zip(shipped.model.p_names, shipped.truth, strict=True):
        one = found.values[name]
        assert one.se is not None and abs(one.value - true) < 4 * one.se and one.se < 0.03 * true
