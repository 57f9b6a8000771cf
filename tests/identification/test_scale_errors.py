"""What a wrong gain or constant does to the parameters, and that the standard errors contain it: of any mechanism."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pvid.identification.analysis import analysed
from pvid.identification.core import identify_in_c
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.sim.simulated_run import PERFECT, RigSimulation

STEP = 1e-3


@cache
def recorded(name: str) -> tuple[Recording, MechanismRig]:
    """A run of the shipped rig, and its rig with exact scales."""
    rig = simulated_rig(name)
    model = compiled_of(name)
    run = dict(RigSimulation.of(model, rig).run(2, PERFECT))
    samples = round(15.0 * rig.sample_rate)
    signals = {one.name: run[one.name][:samples] for one in model.signals}
    knowns = {one.name: rig.knowns.get(one.name, one.value) for one in model.knowns}
    exact = {one.name: {"gain_sd": 0.0, "neglected": 0.0} for one in model.signals if one.kind == "sensor"}
    exact |= {one.name: {"gain_sd": 0.0} for one in model.signals if one.kind == "input"}
    alone = MechanismRig(name, rig.sample_rate, knowns, exact, known_sd=dict.fromkeys(knowns, 0.0), clock_sd=0.0)
    return Recording(np.arange(samples) / rig.sample_rate, signals, rig.sample_rate), alone


def model_of(rig: MechanismRig) -> CompiledModel:
    return rig.applied(compiled_of(rig.model))


@pytest.mark.parametrize(("name", "signal"), [("kapitza", "y"), ("dc_motor", "V")])
def test_a_wrong_gain_moves_the_estimate_by_what_the_standard_error_contains(name: str, signal: str) -> None:
    recording, alone = recorded(name)
    wide = model_of(replace(alone, sensor={**alone.sensor, signal: {"gain_sd": STEP}}))
    assert wide.signal(signal).gain_sd == STEP
    right = analysed(recording, wide)
    signals = {**recording.signals, signal: (1 + STEP) * recording.signals[signal]}
    wrong = analysed(replace(recording, signals=signals), wide)
    for parameter in wide.p_names:
        one, other = right.values[parameter], wrong.values[parameter]
        assert one.value is not None and other.value is not None and one.se_scale is not None
        least = max(0.5 * (one.se_noise or 0.0), 0.1 * STEP * abs(one.value))
        assert abs(other.value - one.value) == pytest.approx(one.se_scale, rel=0.1, abs=least), parameter


@pytest.mark.parametrize(("name", "known"), [("kapitza", "l1"), ("furuta", "kv")])
def test_a_wrong_constant_moves_the_estimate_by_what_the_standard_error_contains(name: str, known: str) -> None:
    recording, alone = recorded(name)
    value = alone.known[known]
    wide = replace(alone, known_sd={known: STEP * value})
    right = analysed(recording, model_of(wide))
    wrong = analysed(recording, model_of(replace(wide, known={**alone.known, known: (1 + STEP) * value})))
    for parameter, one in right.values.items():
        other = wrong.values[parameter]
        assert one.value is not None and other.value is not None and one.se_scale is not None
        least = max(0.5 * (one.se_noise or 0.0), 0.1 * STEP * abs(one.value))
        assert abs(other.value - one.value) == pytest.approx(one.se_scale, rel=0.1, abs=least), parameter


@pytest.mark.parametrize("core", ["f32", "q31"])
def test_the_errors_of_a_core_contain_the_scales_and_its_bits_do_not(core: str) -> None:
    recording, alone = recorded("kapitza")
    wide = replace(alone, sensor={**alone.sensor, "y": {"gain_sd": 0.003}}, known_sd={"l1": 0.0003})
    one, other = (identify_in_c(analysed(recording, model_of(rig)), core) for rig in (alone, wide))  # type: ignore[arg-type]
    assert one.hash == other.hash
    for parameter in ("w", "d1", "d2"):
        exact, rough = one.values[parameter], other.values[parameter]
        assert exact.value == rough.value and exact.se_noise == pytest.approx(rough.se_noise, rel=1e-9)
        assert exact.se_scale is not None and rough.se_scale is not None and exact.se_scale < rough.se_scale
    w = other.values["w"]
    assert w.value is not None and w.se_scale == pytest.approx(0.00316 * w.value, rel=0.01)
