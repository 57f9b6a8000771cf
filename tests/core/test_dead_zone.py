"""The dead zone: p rests while the data ask for less than noise explains; its bits, its rule, that it is off."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lanes import assert_lanes_equal
from linear_rig import LINEAR_RIG

from pvid.base.errors import PvidError
from pvid.cases import CASES, Case
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors

RIG = LINEAR_RIG
every_case = pytest.mark.parametrize("case", CASES.values(), ids=lambda case: f"{case.form}-{case.core}")
both_cores = pytest.mark.parametrize("case", [CASES["weak", "f32"], CASES["weak", "q31"]], ids=lambda case: case.core)
LAWS: dict[str, dict[str, Any]] = {
    "gauss-newton": {"feedback_hz": 0.0},
    "feedback": {"feedback_hz": 10.0},
    "paper": {"law": "pseudovelocity"},
}


def rig_with(**identifier: Any) -> RigFile:
    return replace(RIG, identifier=replace(RIG.identifier, stride=8, **identifier))


@pytest.fixture(scope="module")
def run() -> Run:
    """19.9 s of the standard rig with an encoder of 14 bits: its last tick is not within a solve that is spread over
    ticks, whose counters would be those of a part of it."""
    return simulate(sensors=standard_sensors(14), truth="linear", duration=19.9, seed=1).run


@pytest.mark.parametrize("law", LAWS)
@every_case
def test_the_core_equals_its_twin(case: Case, law: str, native: Native, run: Run) -> None:
    rig = rig_with(form=case.form, dead_zone=1.5, forgetting_s=4.0, **LAWS[law])
    ticks = 19_900 if case.form == "weak" else 2_000
    phi, y = (x[:ticks] for x in case.samples(rig, run))
    (lane,) = assert_lanes_equal([native], case.settings(rig, 1000.0), phi, y)
    assert lane.counters["at_rest"] > 0 or law == "paper"  # whose F does not decay


@both_cores
def test_p_stays_within_the_zone_of_the_solution(case: Case, native: Native, run: Run) -> None:
    """As far as the zone says from the answer without one, hardly moved, and the published errors are the same."""
    ends, errors, solves = [], [], []
    for dead_zone in (0.0, 1.0):
        rig = rig_with(dead_zone=dead_zone)
        config = case.settings(rig, 1000.0)
        core = native.identifier(config)
        record = core.run(*case.samples(rig, run), hashes=False)
        ends.append(case.p_of(config, record.p[-1]))
        errors.append(case.se_of(config, core.estimate["se"][:4]))
        solves.append((core.counters["updates"], core.counters["at_rest"]))
    # each parameter within one standard error: the zone bounds the largest of all combinations
    assert (np.abs(ends[1] - ends[0]) <= 1.02 * errors[0]).all()
    assert errors[1] == pytest.approx(errors[0], rel=0.02)
    assert ends[1][:3] == pytest.approx(STANDARD_PENDULUM.linear, rel=2e-3)
    assert solves[0][1] == 0
    assert sum(solves[1]) == solves[0][0]  # the same solves, and most of them needed no step
    assert solves[1][1] > 0.8 * solves[0][0]


@both_cores
def test_a_mechanism_that_changes_is_followed(case: Case, native: Native) -> None:
    """A change of many standard errors leaves the zone: where p comes to rest again differs by less than the zone."""
    heavier = replace(STANDARD_PENDULUM, g=STANDARD_PENDULUM.g * 1.05)
    rig = rig_with(dead_zone=1.0, forgetting_s=4.0)
    config = case.settings(rig, 1000.0)
    core = native.identifier(config)
    for pendulum in (STANDARD_PENDULUM, heavier):
        part = simulate(pendulum, sensors=standard_sensors(14), truth="linear", duration=15.0, seed=1).run
        p = case.p_of(config, core.run(*case.samples(rig, part), hashes=False).p[-1])
    assert p[0] == pytest.approx(heavier.linear[0], rel=5e-3)
    assert core.counters["at_rest"] > 0


@every_case
def test_off_by_default(case: Case) -> None:
    one = 1.0 if case.core == "f32" else 2**16
    for given, expected in (({}, 0.0), ({"dead_zone": 2.5}, 2.5)):
        assert case.settings(rig_with(form=case.form, **given), 1000.0).estimator.dead_zone == expected * one


def test_rig_file_contains_the_parameter_bounds() -> None:
    with pytest.raises(PvidError, match="dead_zone"):
        RigFile.parse("l1 = 0.3\n[identifier]\ndead_zone = 101\n")
