"""The fixed-point weak engine of every shipped mechanism: C and twin, integer by integer after every tick."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from weak_q31 import DESIGNS, Core, Rig, core_in, rig

from pvid.base.errors import PvidError
from pvid.design.weak_q31 import scaled_number
from pvid.settings.enums import Reason, Status
from pvid.settings.q31 import GateConfigQ31
from pvid.settings.record import Array
from pvid.settings.weak_q31 import WeakConfigQ31
from pvid.setup.weak_q31 import row_formats
from pvid.twin.q31.elementary import tanh
from pvid.twin.q31.integer import Int
from pvid.twin.record import Reasons, Recorder
from pvid.twin.weak_q31 import WeakTwinQ31

Frozen = npt.NDArray[np.uint8]

TICKS = 3000

# Of a parameter after two windows or more from a start 40 % off; a friction that hardly shows by then: 10 %.
_CLOSE = 0.04
_FRICTION = 0.1


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Core:
    return core_in(tmp_path_factory.getbasetemp() / "weak_q31")


@pytest.fixture(params=DESIGNS)
def one(request: pytest.FixtureRequest) -> Rig:
    return rig(request.param, TICKS)


def assert_equal(
    one: Rig, core: Core, config: WeakConfigQ31, readings: Int, frozen: Frozen | None = None
) -> tuple[Array, Array]:
    """Reasons and p after the last tick, once C and twin are equal."""
    status, found = core.identify(one, config, readings, frozen)
    assert status == Status.OK
    twin = WeakTwinQ31(config, one.parameters.model)
    twin.frozen = None if frozen is None else frozen.astype(np.bool_)
    recorder = Recorder(twin.estimator, readings.shape[1], True, None, twin.trust)
    of_ticks: list[Array] = []

    def after(tick: int, reasons: Reasons) -> None:
        recorder(tick, reasons)
        of_ticks.append(twin.trust.estimate["se"][0, : one.parameters.model.n_p].copy())

    wanted = recorder.finished(twin.follow(readings.T, after)).lane()
    assert np.array_equal(found.published_se, np.array(of_ticks)), "published_se"
    for name in ("reason", "p", "sums", "exponent", "published"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    return found.reason, found.p[-1]


def test_every_mechanism_is_identified_with_the_bits_of_the_twin(one: Rig, core: Core) -> None:
    _, last = assert_equal(one, core, one.config, one.counts)
    p = last * 2.0 ** -np.array(one.parameters.p_bits)
    known = one.compiled.parameters
    for name, value, truth, positive in zip(known.names, p, one.truth, known.positive, strict=True):
        if positive:
            assert abs(value / truth - 1) < (_FRICTION if name.startswith("b") else _CLOSE), name


def test_hostile_readings_have_the_bits_of_the_twin(one: Rig, core: Core) -> None:
    """Offsets, jumps beyond full scale and the reach of jets, a frozen stretch, too little drive, a gate."""
    random = np.random.default_rng(5)
    readings = one.counts.copy()
    readings[:, random.integers(0, TICKS, 2)] = 2**31 - 1
    readings[:, 2400] = np.array(one.design.full_scale)
    offset = tuple(random.integers(-9, 9, len(readings)).tolist())
    frozen = np.zeros(TICKS, np.uint8)
    frozen[1700:2100] = 1
    config = replace(
        one.config,
        offset=offset,
        drive_min=tuple(int(x) for x in np.std(one.counts, axis=1) * 0.7),
        gate=GateConfigQ31(sigmas=3 << 16, patience_groups=50),
    )
    reasons, _ = assert_equal(one, core, config, readings, frozen)
    assert np.sum(reasons == Reason.REJECTED_SATURATED) >= 2


@pytest.mark.parametrize("law", [{"divider": 3}, {"gain": 2**29, "divider": 2}, {"gain": 0}, {"forgetting_groups": 4}])
def test_other_laws_have_the_bits_of_the_twin(core: Core, law: dict[str, Any]) -> None:
    """Their scores are those of several windows, or weigh as much as forgetting leaves."""
    one = rig("dc_motor", TICKS)
    config = replace(one.config, estimator=replace(one.config.estimator, **law))
    assert_equal(one, core, config, one.counts)


def test_soft_signs_have_the_bits_of_the_twin_and_are_tanh(core: Core) -> None:
    one = rig("dc_motor", TICKS)
    bits = one.fixed.formats.arguments[0]
    soft = replace(one.design, sign_width=(round(0.5 * 2.0**bits),) * one.design.model.signs)
    assert_equal(one, core, replace(one.config, design=soft), one.counts)
    v = np.concatenate([np.arange(-300, 300), np.geomspace(1, 2**31 - 1, 2000).astype(np.int64)])
    for width in (1, 77, 10**6, 2**31 - 1):
        assert np.max(np.abs(tanh(v, width) * 2.0**-30 - np.tanh(v / width))) < 2.0**-26


def test_rows_beyond_fixed_point_are_refused_by_name() -> None:
    one = rig("rigid_body", TICKS)
    quiet = one.rows.only(slice(0, 2))
    quiet.columns = [1e6 * column for column in quiet.columns]
    with pytest.raises(PvidError, match=r"rigid_body: the residual Y - N theta is .* too much for the rows"):
        row_formats(quiet, one.truth)


@pytest.mark.parametrize("name", ["kapitza", "cart_pendulum"])
def test_nothing_is_identified_from_the_noise_of_the_sensors(core: Core, name: str) -> None:
    """A mechanism at rest: only the excitation check stops the step, which without it is taken."""
    one = rig(name, TICKS)
    random = np.random.default_rng(11)
    readings = random.integers(-1, 2, one.counts.shape)
    reasons, last = assert_equal(one, core, one.config, readings)
    assert np.sum(reasons == Reason.HELD_NOT_EXCITED) >= 2 and Reason.UPDATED not in reasons
    assert last.tolist() == list(one.config.estimator.start)
    unchecked = replace(one.config, estimator=replace(one.config.estimator, noise_margin=0))
    _, moved = assert_equal(one, core, unchecked, readings)
    assert moved.tolist() != last.tolist()


def test_residuals_are_compared_with_what_the_sensors_explain(core: Core) -> None:
    """An equation's own error, ten times the sensors' variance, is a misfit although the rows are white with it."""
    one = rig("battery_2rc", TICKS)
    error = scaled_number(20 * one.design.noise[0].factor[0] * 2.0 ** one.design.noise[0].factor[1])
    wide = replace(one.design, error_variance=(error,), error_order=(0,))
    twin = WeakTwinQ31(replace(one.config, design=wide), one.parameters.model)
    twin.run(one.counts)
    sensors = twin.noise.known.sensors
    assert 0 < float(sensors.m[0]) * 2.0 ** float(sensors.e[0]) < 0.5
    assert_equal(one, core, replace(one.config, design=wide), one.counts)


def test_an_equation_s_own_error_that_comes_and_goes_has_the_bits_of_the_twin(core: Core) -> None:
    """White noise of a motor's recorded voltage, in the first half of the run: the variance of the error rises, older
    rows count no more; then it falls."""
    one = rig("dc_motor", 12000)
    readings = one.counts.copy()
    place = one.made.samples.index("V")
    readings[place, :6000] += np.rint(np.random.default_rng(2).standard_normal(6000) / one.lsb[place]).astype(np.int64)
    of_half, of_run = (WeakTwinQ31(one.config, one.parameters.model) for _ in range(2))
    of_half.run(readings[:, :6000])
    of_run.run(readings)
    first, last = (
        max(float(x.variance.m[0]) * 2.0 ** float(x.variance.e[0]) for x in twin.noise.errors)
        for twin in (of_half, of_run)
    )
    assert first > 10 * last
    assert_equal(one, core, one.config, readings)
