"""The fixed-point weak identifier of every shipped mechanism has the bits of its printed twin, after every tick."""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from weak_rig import assert_same, wild
from weak_rig_q31 import DESIGNS, Int, Rig, rig

from pvid.base.errors import PvidError
from pvid.codegen.weak_library import weak_native_q31, weak_sources_q31
from pvid.configuration.weak_formats_q31 import row_formats
from pvid.core.weak_native_q31 import WeakNativeQ31
from pvid.design.weak_q31 import scaled_number
from pvid.settings.enums import Reason
from pvid.settings.q31 import GateConfigQ31
from pvid.settings.weak_q31 import WeakConfigQ31
from pvid.twin.printed import PrintedTwin

TICKS = 3000

# Of a parameter after two windows or more from a start 40 % off; a friction that hardly shows by then: 10 %.
_CLOSE = 0.04
_FRICTION = 0.1


@pytest.fixture(params=DESIGNS)
def one(request: pytest.FixtureRequest) -> Rig:
    return rig(request.param, TICKS)


def assert_equal(
    one: Rig, config: WeakConfigQ31, readings: Int, frozen: slice | None = None
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[Any], PrintedTwin]:
    """Reasons, p after the last tick, and the twin, once core and twin are equal.

    readings : [samples, ticks]; frozen : ticks in which p is held
    """
    native = weak_native_q31(one.fixed, one.parameters, config)
    core, twin = native.identifier(), PrintedTwin(native.sources, config)
    given, reasons = readings.T.astype(np.int32), []
    held = frozen or slice(0, 0)
    for part, hold in ((slice(0, held.start), False), (held, True), (slice(held.stop, None), False)):
        for identifier in (core, twin):
            identifier.freeze(hold)
        record = core.run_samples(given[part])
        assert_same(record, twin.run(given[part]))
        reasons.append(record.reason)
    assert core.counters == twin.counters
    for field in ("p", "se", "correlation"):
        assert np.ravel(core.estimate[field]).tolist() == list(getattr(twin.estimate, field))
    return np.concatenate(reasons), record.p[-1], twin


def test_every_mechanism_is_identified_with_the_bits_of_the_twin(one: Rig) -> None:
    """Also from counts at both ends of their range, with a dead sensor and a jump that stays."""
    reasons, _, _ = assert_equal(one, one.config, wild(one.counts.T.astype(np.int32), 40).T)
    assert np.sum(reasons == Reason.REJECTED_SATURATED) >= 2
    _, last, _ = assert_equal(one, one.config, one.counts)
    p = last * 2.0 ** -np.array(one.parameters.p_bits)
    known = one.compiled.parameters
    for name, value, truth, positive in zip(known.names, p, one.truth, known.positive, strict=True):
        if positive:
            assert abs(value / truth - 1) < (_FRICTION if name.startswith("b") else _CLOSE), name


def test_the_bits_of_a_model_do_not_depend_on_the_room_for_unknowns() -> None:
    """With PVID_MAX_P = 16 one of its standard errors was 45 % smaller: a column of the inverse was cut off."""
    one = rig("battery_2rc", TICKS)
    own = weak_sources_q31(one.fixed, one.parameters, one.config)
    roomy = replace(own, sizes={**own.sizes, "PVID_MAX_P": 16})
    libraries = [WeakNativeQ31(it.name, it.library(), one.config, it) for it in (own, roomy)]
    record, other = (it.identifier().run_samples(one.counts.T.astype(np.int32)) for it in libraries)
    n_p = one.parameters.model.n_p
    assert own.sizes["PVID_MAX_P"] <= 8 and np.array_equal(record.hash, other.hash)
    assert record.published_se[-1, :n_p].any()
    for field in ("published", "published_se", "standing"):
        assert np.array_equal(getattr(record, field), getattr(other, field))


@pytest.mark.by_day(2)
def test_hostile_readings_have_the_bits_of_the_twin(one: Rig) -> None:
    """Offsets, jumps beyond full scale and the reach of jets, a frozen stretch, too little drive, a gate."""
    random = np.random.default_rng(5)
    readings = one.counts.copy()
    readings[:, random.integers(0, TICKS, 2)] = 2**31 - 1
    readings[:, 2400] = np.array(one.design.full_scale)
    config = replace(
        one.config,
        offset=tuple(random.integers(-9, 9, len(readings)).tolist()),
        drive_min=tuple(int(x) for x in np.std(one.counts, axis=1) * 0.7),
        gate=GateConfigQ31(sigmas=3 << 16, patience_groups=50),
        trust=replace(one.config.trust, groups_min=1, se_max=2**31 - 1),
    )
    reasons, _, _ = assert_equal(one, config, readings, slice(1700, 2100))
    assert np.sum(reasons == Reason.REJECTED_SATURATED) >= 2


@pytest.mark.by_day(2)
@pytest.mark.parametrize("law", [{"divider": 3}, {"gain": 2**29, "divider": 2}, {"gain": 0}, {"forgetting_groups": 4}])
def test_other_laws_have_the_bits_of_the_twin(law: dict[str, Any]) -> None:
    """Their scores are those of several windows, or weigh as much as forgetting leaves."""
    one = rig("dc_motor", TICKS)
    assert_equal(one, replace(one.config, estimator=replace(one.config.estimator, **law)), one.counts)


def test_soft_signs_have_the_bits_of_the_twin_and_are_tanh() -> None:
    one = rig("dc_motor", TICKS)
    bits = one.fixed.formats.arguments[0]
    soft = replace(one.design, sign_width=(round(0.5 * 2.0**bits),) * one.design.model.signs)
    _, _, twin = assert_equal(one, replace(one.config, design=soft), one.counts)
    v = [*range(-300, 300), *np.geomspace(1, 2**31 - 1, 2000).astype(np.int64).tolist()]
    for width in (1, 77, 10**6, 2**31 - 1):
        found = np.array([twin.module.pvid_tanh_q31(one, width) for one in v])
        assert np.max(np.abs(found * 2.0**-30 - np.tanh(np.array(v) / width))) < 2.0**-26


def test_rows_beyond_fixed_point_are_refused_by_name() -> None:
    one = rig("rigid_body", TICKS)
    quiet = one.rows.only(slice(0, 2))
    quiet.columns = [1e6 * column for column in quiet.columns]
    with pytest.raises(PvidError, match=r"rigid_body: the residual Y - N theta is .* too much for the rows"):
        row_formats(quiet, one.truth)


@pytest.mark.parametrize("name", ["kapitza", "cart_pendulum"])
def test_nothing_is_identified_from_the_noise_of_the_sensors(name: str) -> None:
    """A mechanism at rest: only the excitation check stops the step, which without it is taken."""
    one = rig(name, TICKS)
    readings = np.random.default_rng(11).integers(-1, 2, one.counts.shape)
    reasons, last, _ = assert_equal(one, one.config, readings)
    assert np.sum(reasons == Reason.HELD_NOT_EXCITED) >= 2 and Reason.UPDATED not in reasons
    assert last.tolist() == list(one.config.estimator.start)
    unchecked = replace(one.config, estimator=replace(one.config.estimator, noise_margin=0))
    _, moved, _ = assert_equal(one, unchecked, readings)
    assert moved.tolist() != last.tolist()


def test_residuals_are_compared_with_what_the_sensors_explain() -> None:
    """An equation's own error, ten times the sensors' variance, is a misfit although the rows are white with it."""
    one = rig("battery_2rc", TICKS)
    error = scaled_number(20 * one.design.noise[0].factor[0] * 2.0 ** one.design.noise[0].factor[1])
    wide = replace(one.design, error_variance=(error,), error_order=(0,))
    _, _, twin = assert_equal(one, replace(one.config, design=wide), one.counts)
    sensors = twin.state.finish.known.sensors
    assert 0 < sensors.m * 2.0**sensors.e < 0.5


def test_an_equation_s_own_error_that_comes_and_goes_has_the_bits_of_the_twin() -> None:
    """White noise of a motor's recorded voltage, in the first half of the run: the variance of the error rises, older
    rows count no more; then it falls."""
    one = rig("dc_motor", 12000)
    readings = one.counts.copy()
    place = one.made.samples.index("V")
    readings[place, :6000] += np.rint(np.random.default_rng(2).standard_normal(6000) / one.lsb[place]).astype(np.int64)

    def largest(twin: PrintedTwin) -> float:
        kinds = twin.state.finish.error[: len(one.design.model.kind)]
        return max(float(x.variance.m * 2.0**x.variance.e) for x in kinds)

    native = weak_native_q31(one.fixed, one.parameters, one.config)
    half = PrintedTwin(native.sources, one.config)
    half.run(readings[:, :6000].T.astype(np.int32))
    assert largest(half) > 10 * largest(assert_equal(one, one.config, readings)[2])
