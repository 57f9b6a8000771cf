"""The outlier gate of the fixed-point core: its bits, its rule beside float32's, what it keeps out, settings."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pvid.base.errors import PvidError
from pvid.cases import case_of
from pvid.core.native import Identifier, Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.compare import first_difference
from pvid.settings.enums import Reason, Status
from pvid.settings.f32 import GateConfig
from pvid.settings.q31 import GateConfigQ31, StrongConfigQ31, WeakConfigQ31
from pvid.setup.q31 import config_for_run, counts_of, gate_config_q31, p_of, strong_config_q31, weak_config_q31
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors
from pvid.twin.f32.gate import Gate
from pvid.twin.q31.gate import GateQ31
from pvid.twin.q31.scaled import Scaled, scaled
from pvid.twin.strong_q31 import StrongTwinQ31
from pvid.twin.weak_q31 import WeakTwinQ31

RIG = RigFile.standard()
OUTLIER = Reason.REJECTED_OUTLIER
Counts = npt.NDArray[np.int64]


def rig_with(**identifier: Any) -> RigFile:
    return replace(RIG, identifier=replace(RIG.identifier, **identifier))


def jolt(run: Run) -> Run:
    """At 25 s somebody touches the mechanism, at 30 s its encoder sticks."""
    phi = run.phi.copy()
    phi[25_000:25_600] += 0.02 * np.sin(np.pi * np.arange(600) / 600) ** 2
    phi[30_000:30_300] = phi[30_000]
    return replace(run, phi=phi)


@pytest.fixture(scope="module")
def jolted() -> Run:
    """40 s of the standard rig with an encoder of 14 bits."""
    return jolt(simulate(sensors=standard_sensors(14), truth="linear", duration=40.0, seed=1).run)


# ---- the rule ----


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


def gated_like(
    twin: WeakTwinQ31 | StrongTwinQ31,
    config: WeakConfigQ31 | StrongConfigQ31,
    phi: npt.NDArray[Any],
    y: npt.NDArray[Any],
    matrix: dict[str, Native],
) -> list[Identifier]:
    """The core in every build, whose bits and counters were the twin's, and whose gate has kept something out."""
    expected = twin.run(phi, y)
    cores = [native.identifier(config) for native in matrix.values()]
    for core in cores:
        record = core.run(phi, y, hashes=False)
        assert first_difference(record, expected.lane()) is None, core.native.build
        assert core.counters == {name: int(of[0]) for name, of in twin.estimator.counters.items()}
        assert (record.reason == OUTLIER).sum() == core.counters["rejected_outlier"] > 0
    return cores


@pytest.mark.parametrize(("patience_s", "zero"), [(0.0, True), (2.0, False)])
def test_the_weak_form_equals_its_twin(patience_s: float, zero: bool, matrix: dict[str, Native], jolted: Run) -> None:
    rig = rig_with(outlier_gate=4.0, outlier_patience_s=patience_s, zero=zero, test_functions=8)
    config = weak_config_q31(rig, 1000.0)
    phi, y = counts_of(rig, jolted)
    twin = WeakTwinQ31(config)
    for core in gated_like(twin, config, phi, y, matrix):
        assert core.publishes
        assert core.estimate.tobytes() == twin.trust.estimate[0].tobytes()


@pytest.mark.parametrize("patience_s", [0.0, 0.5])
def test_the_strong_form_equals_its_twin(patience_s: float, matrix: dict[str, Native], jolted: Run) -> None:
    rig = rig_with(form="strong", stride=8, outlier_gate=6.0, outlier_patience_s=patience_s, forgetting_s=2.0)
    config = strong_config_q31(rig, 1000.0)
    phi, y = (c[28_500:31_000] for c in counts_of(rig, jolted))
    assert gated_like(StrongTwinQ31(config), config, phi, y, matrix)


def test_disturbed_windows_are_rejected(native: Native, jolted: Run) -> None:
    errors = {}
    for sigmas in (0.0, 4.0):
        rig = rig_with(outlier_gate=sigmas)
        config = weak_config_q31(rig, 1000.0)
        core = native.identifier(config)
        record = core.run(*counts_of(rig, jolted), sums=True)
        errors[sigmas] = np.abs(p_of(config, record.published[-1])[:3] / STANDARD_PENDULUM.linear - 1).max()
        refused = np.flatnonzero(record.reason == OUTLIER)
        # each lies in two or three windows of 1.25 s, and nothing else is refused
        assert len(refused) == 0 if sigmas == 0.0 else 4 <= len(refused) <= 6
        assert np.isin(refused // 1000, (25, 26, 27, 30, 31, 32)).all()
        for tick in refused:  # and it changes nothing but its counter
            assert np.array_equal(record.p[tick - 300], record.p[tick])
            assert np.array_equal(record.sums[tick - 300], record.sums[tick])
    assert errors[4.0] < 5e-4 < errors[0.0]


def test_rows_that_do_not_fit_are_refused_as_such(native: Native) -> None:
    """A row beyond its formats is not an outlier, and the gate never sees it."""
    rig = rig_with(form="strong", stride=8, outlier_gate=2.0)
    config = strong_config_q31(rig, 1000.0)
    bank = config.design.bank
    t = np.arange(1500)
    y = np.rint(2000 * np.sin(2 * np.pi * 4.0 * t / 1000)).astype(np.int64)
    phi = np.where(y > 0, bank.phi_max, -bank.phi_max).astype(np.int64)
    twin = StrongTwinQ31(replace(config, drive_min=0))
    expected = twin.run(phi, y)
    core = native.identifier(replace(config, drive_min=0))
    assert first_difference(core.run(phi, y, hashes=False), expected.lane()) is None
    assert core.counters["rejected_saturated"] > 0


# ---- settings ----


def test_enabled_as_in_float32_except_for_the_papers_law(jolted: Run) -> None:
    for form, sigmas in (("weak", 4), ("strong", 6)):
        assert config_for_run(rig_with(form=form, stride=8), jolted).gate == GateConfigQ31(sigmas << 16, 0)
        paper = rig_with(form=form, stride=8, law="pseudovelocity")
        assert config_for_run(paper, jolted).gate == GateConfigQ31(0, 0)


def test_a_rig_file_s_gate_reaches_the_core_and_the_board(jolted: Run) -> None:
    settings = {"outlier_gate": 4.5, "outlier_patience_s": 60.0}
    weak = weak_config_q31(rig_with(**settings), 1000.0)
    windows = 60.0 * 1000.0 / (weak.design.decimation * weak.hop)
    assert weak.gate == GateConfigQ31(round(4.5 * 2**16), round(windows))
    strong = strong_config_q31(rig_with(form="strong", stride=8, **settings), 1000.0)
    assert strong.gate == GateConfigQ31(round(4.5 * 2**16), 60_000)
    for config, groups in ((strong, 60_000), (weak, round(windows))):
        header = " ".join(case_of(config).header(config, RIG.l1, config.form, "a test").split())
        assert f".gate = {{ .sigmas = 294912u, .patience_groups = {groups}u, }}," in header


def test_a_patience_that_cannot_be_counted_is_refused() -> None:
    assert gate_config_q31(GateConfig(4.0, 1e-9), 1000.0).patience_groups == 1
    assert gate_config_q31(GateConfig(4.0, 2.0**20), 1024.0).patience_groups == 2**30
    with pytest.raises(PvidError, match=r"outlier_patience_s = 2e\+06 is too long for core q31"):
        strong_config_q31(rig_with(form="strong", stride=8, outlier_gate=4.0, outlier_patience_s=2e6), 1000.0)


@pytest.mark.parametrize("form", ["weak", "strong"])
@pytest.mark.parametrize(("forgetting_s", "sentence"), [(1e-9, "1e-09 is too short"), (1e9, "1e+09 is too long")])
def test_a_forgetting_that_cannot_be_counted_is_refused_before_the_patience_that_follows_it(
    form: str, forgetting_s: float, sentence: str
) -> None:
    config = {"weak": weak_config_q31, "strong": strong_config_q31}[form]
    with pytest.raises(PvidError, match=re.escape(f"forgetting_s = {sentence} for core q31")):
        config(rig_with(form=form, forgetting_s=forgetting_s), 1000.0)


@pytest.mark.parametrize("form", ["weak", "strong"])
@pytest.mark.parametrize(
    ("gate", "status"),
    [
        (GateConfigQ31(1), Status.BAD_GATE_SIGMAS),
        (GateConfigQ31(2**17 - 1), Status.BAD_GATE_SIGMAS),
        (GateConfigQ31((1000 << 16) + 1), Status.BAD_GATE_SIGMAS),
        (GateConfigQ31(4 << 16, 2**30 + 1), Status.BAD_GATE_PATIENCE),
    ],
)
def test_invalid_gate_is_refused(form: str, gate: GateConfigQ31, status: Status, native: Native) -> None:
    with pytest.raises(PvidError, match=status.name.lower().replace("_", " ")):
        if form == "weak":
            native.identifier(replace(weak_config_q31(RIG, 1000.0), gate=gate))
        else:
            config = strong_config_q31(rig_with(form="strong", stride=8), 1000.0)
            native.identifier(replace(config, gate=gate))
