"""The dead zone: p rests while the data ask for less than noise explains; its bits, its rule, that it is off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from lanes import assert_lanes_equal
from weak_rig import engine_rig

from pvid.base.errors import PvidError
from pvid.cases import CASES, Case
from pvid.codegen.weak_library import weak_native_q31
from pvid.configuration.weak_q31 import engine_for_simulated_rig
from pvid.core.native import Native
from pvid.models.mechanisms import compiled_of
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.sim.pendulum import simulate, standard_sensors

Float = npt.NDArray[np.float64]
RIG = RigFile.standard()
every_case = pytest.mark.parametrize("case", CASES.values(), ids=lambda case: f"{case.form}-{case.core}")
LAWS: dict[str, dict[str, Any]] = {
    "gauss-newton": {"feedback_hz": 0.0},
    "feedback": {"feedback_hz": 10.0},
    "paper": {"law": "pseudovelocity"},
}


def rig_with(**identifier: Any) -> RigFile:
    return replace(RIG, identifier=replace(RIG.identifier, stride=8, **identifier))


@pytest.fixture(scope="module")
def run() -> Run:
    """2 s of the standard rig with an encoder of 14 bits."""
    return simulate(sensors=standard_sensors(14), truth="linear", duration=2.0, seed=1).run


@pytest.mark.ticks(short=900, long=1400)
@pytest.mark.parametrize("law", LAWS)
@every_case
def test_the_core_equals_its_twin(case: Case, law: str, native: Native, run: Run, ticks: int) -> None:
    rig = rig_with(form=case.form, dead_zone=1.5, forgetting_s=4.0, **LAWS[law])
    phi, y = (x[:ticks] for x in case.samples(rig, run))
    (lane,) = assert_lanes_equal([native], case.settings(rig, 1000.0), phi, y)
    assert lane.counters["in_dead_zone"] > 0 or law == "paper"  # whose F does not decay


Played = tuple[Float, Float, dict[str, int]]


def in_float(dead_zone: float) -> Played:
    """The end p of the pendulum's shipped rig in the weak form, its published standard errors, the counters."""
    rig = engine_rig("kapitza")
    estimator = replace(rig.config.estimator, dead_zone=dead_zone)
    core = rig.native.identifier_of(replace(rig.config, estimator=estimator))
    record = core.run_samples(rig.samples, hashes=False)
    return np.array(record.p[-1], np.float64), np.array(core.estimate["se"][:4], np.float64), core.counters


def in_fixed_point(dead_zone: float) -> Played:
    """The same in fixed point."""
    engine, rig = engine_for_simulated_rig(compiled_of("kapitza")), engine_rig("kapitza")
    estimator = replace(engine.config.estimator, dead_zone=round(dead_zone * 2**16))
    config = replace(engine.config, estimator=estimator)
    core = weak_native_q31(engine.made, engine.parameters, config).identifier()
    samples = dict(zip(engine.sample_names, rig.samples.T, strict=True))
    record = core.run_samples(engine.counts_of(samples), hashes=False)
    return engine.values(record.p[-1]), engine.values(core.estimate["se"][:4]), core.counters


@pytest.mark.parametrize("played", [in_float, in_fixed_point])
def test_p_stays_within_the_zone_of_the_solution(played: Callable[[float], Played]) -> None:
    """As far as the zone says from the answer without one, hardly moved, and the published errors are no smaller."""
    (end, error, counters), (rested, as_before, at_rest) = played(0.0), played(1.0)
    # each parameter within one standard error: the zone bounds the largest of all combinations
    assert (np.abs(rested - end) <= 1.02 * error).all()
    # not smaller; the scores of windows scatter more where p is off by up to a standard error
    assert (as_before >= 0.98 * error).all() and (as_before <= 1.1 * error).all()
    assert counters["in_dead_zone"] == 0
    assert at_rest["updates"] + at_rest["in_dead_zone"] == counters["updates"]  # the same solves
    assert at_rest["in_dead_zone"] > 0.5 * counters["updates"]  # and most of them needed no step


@every_case
def test_off_by_default(case: Case) -> None:
    one = 1.0 if case.core == "f32" else 2**16
    for given, expected in (({}, 0.0), ({"dead_zone": 2.5}, 2.5)):
        assert case.settings(rig_with(form=case.form, **given), 1000.0).estimator.dead_zone == expected * one


def test_rig_file_contains_the_parameter_bounds() -> None:
    with pytest.raises(PvidError, match="dead_zone"):
        RigFile.parse("l1 = 0.3\n[identifier]\ndead_zone = 101\n")
