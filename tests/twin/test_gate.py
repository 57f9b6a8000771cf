"""The outlier gate of both cores: its bits, its rule, what it keeps out, what it lets in again, and where it is on."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lanes import assert_lanes_equal

from pvid.base.errors import PvidError
from pvid.cases import CASES, case_of
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.enums import Reason
from pvid.settings.f32 import GateConfig
from pvid.settings.q31 import GateConfigQ31
from pvid.setup.f32 import strong_config
from pvid.setup.q31 import gate_config_q31, strong_config_q31
from pvid.sim.pendulum import simulate, standard_sensors
from pvid.twin.f32.gate import Gate
from pvid.twin.q31.gate import GateQ31
from pvid.twin.q31.scaled import Scaled, scaled

RIG = RigFile.standard()
OUTLIER = Reason.REJECTED_OUTLIER
CORES = ("f32", "q31")


def rig_with(**identifier: Any) -> RigFile:
    return replace(RIG, identifier=replace(RIG.identifier, **identifier))


@pytest.fixture(scope="module")
def jolted() -> Run:
    """40 s of the standard rig, 14 bits; at 25 s somebody touches it, at 30 s the encoder sticks."""
    run = simulate(sensors=standard_sensors(14), truth="linear", duration=40.0, seed=1).run
    phi = run.phi.copy()
    phi[25_000:25_600] += 0.02 * np.sin(np.pi * np.arange(600) / 600) ** 2
    phi[30_000:30_300] = phi[30_000]
    return replace(run, phi=phi)


# ---- the rule in float32 ----


def gate(sigmas: float, patience_s: float = 0.0, memory: float = 10.0, floor: float = 1.0) -> Gate:
    rate = np.float32(100.0)
    return Gate(GateConfig(sigmas, patience_s), rate, np.float32(memory), np.array([floor], np.float32))


def feed(one: Gate, square: float, times: int) -> int:
    """How many of them pass."""
    return sum(bool(one.passes(np.array([square], np.float32))[0]) for _ in range(times))


def test_gate_passes_everything_while_warming_up() -> None:
    assert feed(gate(4.0), 1e9, 10) == 10


def test_residual_beyond_the_limit_is_rejected() -> None:
    one = gate(4.0)
    feed(one, 100.0, 40)
    assert feed(one, 15.9 * 100.0, 1) == 1
    one = gate(4.0)
    feed(one, 100.0, 40)
    assert feed(one, 16.2 * 100.0, 100) == 0


def test_scale_is_never_below_its_floor() -> None:
    one = gate(4.0, floor=1.0)
    assert feed(one, 0.0, 1000) == 1000
    assert feed(one, 15.9, 1) == 1
    assert feed(one, 1e3, 10) == 0


def test_outliers_are_rejected_and_a_lasting_change_is_accepted() -> None:
    never, later = gate(4.0), gate(4.0, patience_s=3.0)
    for one in (never, later):
        feed(one, 1.0, 100)
    assert feed(never, 1e4, 100_000) == 0
    # the scale of squares grows by 1e4 in 3 s, 300 residuals; it needs 1e4 / 16
    refused = 0
    while feed(later, 1e4, 1) == 0:
        refused += 1
    assert refused == pytest.approx(300 * np.log(1e4 / 16) / np.log(1e4), rel=0.03)


def test_one_percent_of_outliers_barely_widens_the_scale() -> None:
    one = gate(4.0, patience_s=10.0)
    feed(one, 1.0, 100)
    for _ in range(200):
        feed(one, 1.0, 99)
        assert feed(one, 1e4, 1) == 0
    assert float(one.scale[0]) < 1.2


def test_opening_gate_reports_a_change_in_both_cores() -> None:
    single = gate(4.0, patience_s=3.0, memory=4.0)
    integer = GateQ31(gate_config_q31(GateConfig(4.0, 3.0), 100.0), 4, one_lane(1.0))
    told = {}
    for tick, square in enumerate([1.0] * 8 + [1e4] * 50 + [15.0] + [1e4] * 400 + [1.0] * 20 + [9.0]):
        passes, opens = single.judge(np.array([square], np.float32))
        again = integer.judge(one_lane(square), np.ones(1, np.bool_))
        assert (bool(again[0][0]), bool(again[1][0])) == (passes[0], opens[0]), tick
        if opens[0]:
            told[tick] = square
    assert list(told.values()) == [1e4] and 200 < list(told)[0] < 300


@settings(deadline=None)
@given(squares=st.lists(st.floats(0, 1e38), max_size=60), patience=st.floats(0, 1e6))
def test_gate_scale_stays_finite(squares: list[float], patience: float) -> None:
    one = gate(4.0, patience)
    for square in squares:
        feed(one, square, 1)
        assert 1.0 <= one.scale[0] <= np.float32(1e30)
    assert feed(one, float("nan"), 1) == 1
    assert feed(one, float("inf"), 1) == 1


# ---- the rule in fixed point ----


def one_lane(value: float) -> Scaled:
    mantissa, exponent = np.frexp(np.array([value]))
    return scaled(np.rint(mantissa * 2**30).astype(np.int64), exponent.astype(np.int64) - 30)


@settings(deadline=None, max_examples=200)
@given(
    squares=st.lists(st.floats(-6, 6), min_size=1, max_size=60),
    patience=st.sampled_from([0.0, 0.5, 10.0]),
    sigmas=st.sampled_from([2.0, 4.0, 1000.0]),
)
def test_scale_follows_that_of_float32(squares: list[float], patience: float, sigmas: float) -> None:
    config = GateConfig(sigmas, patience)
    single = Gate(config, np.float32(100.0), np.float32(10.0), np.array([1.0], np.float32))
    integer = GateQ31(gate_config_q31(config, 100.0), 10, one_lane(1.0))
    for power in squares:
        square = np.float32(10.0**power)
        limit = float(single.limit * single.scale[0])
        expected = bool(single.passes(np.array([square]))[0])
        if abs(float(square) / limit - 1) > 1e-4:  # else rounding may decide
            assert bool(integer.passes(one_lane(float(square)))[0]) == expected
        elif bool(integer.passes(one_lane(float(square)))[0]) != expected:
            return
        scale = float(integer.scale.m[0]) * 2.0 ** float(integer.scale.e[0])
        assert scale == pytest.approx(float(single.scale[0]), rel=1e-4)  # 60 float32 roundings, and ln 1e4 to 3e-6


def test_disabled_gate_accepts_and_keeps_scale() -> None:
    gate = GateQ31(GateConfigQ31(4 << 16), 1, one_lane(1.0))
    before = gate.scale
    assert gate.passes(one_lane(1e9), np.zeros(1, np.bool_)).all()
    assert gate.judged[0] == 0
    assert (gate.scale.m == before.m).all() and (gate.scale.e == before.e).all()


# ---- in the identifiers ----


STRONG = {"form": "strong", "stride": 8, "outlier_gate": 6.0, "forgetting_s": 2.0}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("core", "identifier"),
    [
        ("q31", STRONG),
        ("q31", {**STRONG, "outlier_patience_s": 0.5}),
    ],
)
def test_the_core_equals_its_twin(
    core: str, identifier: dict[str, Any], matrix: dict[str, Native], jolted: Run
) -> None:
    rig, case = rig_with(**identifier), CASES[identifier["form"], core]
    config, samples = case.settings(rig, 1000.0), case.samples(rig, jolted)
    samples = samples[0][28_500:31_000], samples[1][28_500:31_000]
    (lane,) = assert_lanes_equal(matrix.values(), config, *samples)
    assert (lane.record.reason == OUTLIER).sum() == lane.counters["rejected_outlier"] > 0


def test_the_strong_form_equals_its_twin_in_every_lane(matrix: dict[str, Native], jolted: Run) -> None:
    phi, y = jolted.phi[22_000:32_000], jolted.y[22_000:32_000]
    rig = rig_with(form="strong", stride=8, outlier_gate=6.0, outlier_patience_s=5.0)
    config = strong_config(rig, 1000.0)
    lanes = [replace(config.estimator, forgetting_s=tau, feedback_hz=f) for tau in (0.0, 2.0) for f in (0.0, 10.0)]
    for lane in assert_lanes_equal(matrix.values(), config, phi, y, lanes):
        assert lane.counters["rejected_outlier"] == (lane.record.reason == OUTLIER).sum() > 0


def test_rows_that_do_not_fit_are_refused_as_such(native: Native) -> None:
    """A row beyond its formats is not an outlier, and the gate never sees it."""
    rig = rig_with(form="strong", stride=8, outlier_gate=2.0)
    config = strong_config_q31(rig, 1000.0)
    bank = config.design.bank
    t = np.arange(1500)
    y = np.rint(2000 * np.sin(2 * np.pi * 4.0 * t / 1000)).astype(np.int64)
    phi = np.where(y > 0, bank.phi_max, -bank.phi_max).astype(np.int64)
    config = replace(config, drive_min=0)
    assert assert_lanes_equal([native], config, phi, y)[0].counters["rejected_saturated"] > 0


@pytest.mark.parametrize("core", CORES)
def test_gate_is_enabled_in_the_stationary_law_and_can_be_disabled(core: str, jolted: Run) -> None:
    kind, one = (GateConfig, 1) if core == "f32" else (GateConfigQ31, 1 << 16)
    for chosen, expected in (({}, 6), ({"law": "pseudovelocity"}, 0), ({"outlier_gate": 0.0}, 0)):
        config = CASES["strong", core].settings_for_run(rig_with(form="strong", stride=8, **chosen), jolted)
        assert config.gate == kind(expected * one, 0)


# ---- settings ----


def test_a_rig_file_s_gate_reaches_the_core_and_the_board() -> None:
    settings = {"outlier_gate": 4.5, "outlier_patience_s": 60.0}
    config = strong_config_q31(rig_with(form="strong", stride=8, **settings), 1000.0)
    assert config.gate == GateConfigQ31(round(4.5 * 2**16), 60_000)
    header = " ".join(case_of(config).header(config, RIG.l1, config.form, "a test").split())
    assert ".gate = { .sigmas = 294912u, .patience_groups = 60000u, }," in header


def test_a_patience_that_cannot_be_counted_is_refused() -> None:
    assert gate_config_q31(GateConfig(4.0, 1e-9), 1000.0).patience_groups == 1
    assert gate_config_q31(GateConfig(4.0, 2.0**20), 1024.0).patience_groups == 2**30
    with pytest.raises(PvidError, match=r"outlier_patience_s = 2e\+06 is too long for core q31"):
        strong_config_q31(rig_with(form="strong", stride=8, outlier_gate=4.0, outlier_patience_s=2e6), 1000.0)


@pytest.mark.parametrize(("forgetting_s", "sentence"), [(1e-9, "1e-09 is too short"), (1e9, "1e+09 is too long")])
def test_a_forgetting_that_cannot_be_counted_is_refused_before_the_patience_that_follows_it(
    forgetting_s: float, sentence: str
) -> None:
    with pytest.raises(PvidError, match=re.escape(f"forgetting_s = {sentence} for core q31")):
        strong_config_q31(rig_with(form="strong", forgetting_s=forgetting_s), 1000.0)
