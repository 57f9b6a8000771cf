"""The dead zone: p rests while the data ask for less than noise explains; its bits, its rule, that it is off."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from linear_rig import LINEAR_RIG

from pvid.base.errors import PvidError
from pvid.cases import case_of
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.compare import first_difference
from pvid.setup.f32 import config_of
from pvid.setup.q31 import config_of_q31, counts_of, p_of, se_of
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors
from pvid.twin.strong import StrongTwin
from pvid.twin.weak import WeakTwin

RIG = LINEAR_RIG
FORMS = ("weak", "strong")
LAWS: dict[str, dict[str, Any]] = {
    "gauss-newton": {"feedback_hz": 0.0},
    "feedback": {"feedback_hz": 10.0},
    "paper": {"law": "pseudovelocity"},
}


def rig_with(**identifier: Any) -> RigFile:
    return replace(RIG, identifier=replace(RIG.identifier, stride=8, **identifier))


@pytest.fixture(scope="module")
def run() -> Run:
    """20 s of the standard rig with an encoder of 14 bits."""
    return simulate(sensors=standard_sensors(14), truth="linear", duration=20.0, seed=1).run


def native_of(native: Native, form: str, config: Any) -> Any:
    return native.identifier(config) if form == "weak" else native.identifier(config)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("form", FORMS)
def test_float32_equals_its_twin(form: str, law: str, native: Native, run: Run) -> None:
    config = config_of(rig_with(form=form, dead_zone=1.5, forgetting_s=4.0, **LAWS[law]), 1000.0)
    ticks = 20_000 if form == "weak" else 2_000
    phi, y = run.phi[:ticks], run.y[:ticks]
    twin: Any = WeakTwin(config) if form == "weak" else StrongTwin(config)  # type: ignore[arg-type]
    expected = twin.run(phi, y)
    core = native_of(native, form, config)
    record = core.run(phi, y, hashes=False)
    assert first_difference(record, expected.lane()) is None
    assert core.counters == {name: int(of[0]) for name, of in twin.estimator.counters.items()}
    assert core.counters["at_rest"] > 0 or law == "paper"  # whose F does not decay


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("form", FORMS)
def test_fixed_point_equals_its_twin(form: str, law: str, native: Native, run: Run) -> None:
    config = config_of_q31(rig_with(form=form, dead_zone=1.5, forgetting_s=4.0, **LAWS[law]), 1000.0)
    ticks = 20_000 if form == "weak" else 2_000
    phi, y = (c[:ticks] for c in counts_of(RIG, run))
    twin = case_of(config).twin(config)
    expected = twin.run(phi, y)
    core = native.identifier(config)
    assert first_difference(core.run(phi, y, hashes=False), expected.lane()) is None
    assert core.counters == {name: int(of[0]) for name, of in twin.estimator.counters.items()}
    assert core.counters["at_rest"] > 0 or law == "paper"


@pytest.mark.parametrize("core_name", ["f32", "q31"])
def test_p_stays_within_the_zone_of_the_solution(core_name: str, native: Native, run: Run) -> None:
    """As far as the zone says from the answer without one, hardly moved, and the published errors are the same."""
    ends, errors, solves = [], [], []
    for dead_zone in (0.0, 1.0):
        rig = rig_with(dead_zone=dead_zone)
        if core_name == "f32":
            config = config_of(rig, 1000.0)
            core: Any = native_of(native, "weak", config)
            record = core.run(run.phi, run.y, hashes=False)
            p, se = record.p, core.estimate["se"][:4]
        else:
            integers = config_of_q31(rig, 1000.0)
            core = native.identifier(integers)
            record = core.run(*counts_of(rig, run), hashes=False)
            p, se = p_of(integers, record.p), se_of(integers, core.estimate["se"][:4])
        ends.append(p[-1])
        errors.append(se)
        solves.append((core.counters["updates"], core.counters["at_rest"]))
    # each parameter within one standard error: the zone bounds the largest of all combinations
    assert (np.abs(ends[1] - ends[0]) <= 1.02 * errors[0]).all()
    assert errors[1] == pytest.approx(errors[0], rel=0.02)
    assert ends[1][:3] == pytest.approx(STANDARD_PENDULUM.linear, rel=2e-3)
    assert solves[0][1] == 0
    assert sum(solves[1]) == solves[0][0]  # the same solves, and most of them needed no step
    assert solves[1][1] > 0.8 * solves[0][0]


@pytest.mark.parametrize("core_name", ["f32", "q31"])
def test_a_mechanism_that_changes_is_followed(core_name: str, native: Native) -> None:
    """A change of many standard errors leaves the zone: where p comes to rest again differs by less than the zone."""
    heavier = replace(STANDARD_PENDULUM, g=STANDARD_PENDULUM.g * 1.05)
    parts = [
        simulate(pendulum, sensors=standard_sensors(14), truth="linear", duration=15.0, seed=1).run
        for pendulum in (STANDARD_PENDULUM, heavier)
    ]
    rig = rig_with(dead_zone=1.0, forgetting_s=4.0)
    if core_name == "f32":
        core: Any = native_of(native, "weak", config_of(rig, 1000.0))
        for part in parts:
            p = core.run(part.phi, part.y, hashes=False).p[-1]
    else:
        config = config_of_q31(rig, 1000.0)
        core = native.identifier(config)
        for part in parts:
            p = p_of(config, core.run(*counts_of(rig, part), hashes=False).p[-1])
    assert p[0] == pytest.approx(heavier.linear[0], rel=5e-3)
    assert core.counters["at_rest"] > 0


def test_off_by_default() -> None:
    for form in FORMS:
        rig = rig_with(form=form)
        assert config_of(rig, 1000.0).estimator.dead_zone == 0.0
        assert config_of_q31(rig, 1000.0).estimator.dead_zone == 0
        asked = rig_with(form=form, dead_zone=2.5)
        assert config_of(asked, 1000.0).estimator.dead_zone == 2.5
        assert config_of_q31(asked, 1000.0).estimator.dead_zone == round(2.5 * 2**16)


def test_rig_file_contains_the_parameter_bounds() -> None:
    with pytest.raises(PvidError, match="dead_zone"):
        RigFile.parse("l1 = 0.3\n[identifier]\ndead_zone = 101\n")
