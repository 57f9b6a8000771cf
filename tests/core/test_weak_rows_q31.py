"""Front end, sums and white columns of the fixed-point weak form beside the float64 oracle; no count overflows."""

import numpy as np
import pytest
from weak_rig_q31 import DESIGNS, Core, Int, Rig, core_in, rig

from pvid.base.errors import PvidError
from pvid.codegen.weak_q31 import JetReaches, fixed_weak
from pvid.design.weak_q31 import Sensing, fixed_design, scaled_number
from pvid.oracle.weak.rows import EquationError
from pvid.settings.weak import NONE

TICKS = 3000
REJECTED = 3  # PVID_WEAK_REJECTED
_OF_SUMS = 2.0**-15  # of the sum of |channel|: the cosine has 16 bits; as much again for the rest
# Of the product of two columns' lengths; 16-bit cosines leave 1e-4 to 1e-3 where a column is large beside its rows.
_TOLERANCE = 2e-3
_OF_HIGH_POWER = 5e-3  # the oracle's ridge on its covariance, whose condition is (K/pi)^(2 n), shows at n = 8
_OF_A_RUN = 0.1  # the battery's charge begins at the first step here and at the first sample there


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Core:
    return core_in(tmp_path_factory.getbasetemp() / "weak_q31")


@pytest.fixture(params=DESIGNS)
def one(request: pytest.FixtureRequest) -> Rig:
    return rig(request.param, TICKS)


def theta_of(one: Rig, kind: int) -> Int:
    """m and e of each theta at the truth [thetas, 2]."""
    return np.array([scaled_number(float(x)) for x in one.compiled.parameters.theta(one.truth)[kind]], np.int64)


def test_sums_are_those_of_the_oracle(one: Rig, core: Core) -> None:
    """Of the same counts: within the rounding of the cosine and of the channels."""
    found, sizes, wanted = core.windows(one, one.counts)[0], one.sizes(), one.oracle_sums()
    count = min(len(found), len(next(iter(wanted.values()))))
    assert count >= 3
    for place, channel in enumerate(one.design.model.channel):
        sums, reference = found[:count, place] * one.design.units[place], wanted[place][:count]
        if channel.gain != NONE and "run_" in one.made.gain_names[channel.gain]:
            # a run begins at the first step here and at the first sample there: a constant
            sums, reference = sums[:, 1:], reference[:, 1:]
        assert np.max(np.abs(sums - reference)) <= _OF_SUMS * sizes[place], (place, channel)


def test_products_of_columns_are_those_of_the_oracle(one: Rig, core: Core) -> None:
    """Its K white rows and these differ by a rotation; the first ones of these contain the nuisances."""
    windows = core.windows(one, one.counts)[0]
    theta = one.compiled.parameters.theta(one.truth)
    for kind in range(len(one.design.model.kind)):
        white = one.rows.white((kind,), theta, [EquationError()] * one.rows.kinds)
        wanted = np.concatenate([white.regressors, white.known[:, np.newaxis]], axis=1)[: len(windows)]
        found = np.zeros(wanted.shape)
        for place, window in enumerate(windows[: len(wanted)]):
            x, exponent, live = core.columns(one, kind, theta_of(one, kind), window)
            found[place] = x * 2.0 ** exponent[:, np.newaxis]
            found[place][:, :live] = 0
        products = np.einsum("wak,wbk->wab", found, found)
        reference = np.einsum("wak,wbk->wab", wanted, wanted)
        length = np.sqrt(np.einsum("waa->wa", reference))
        size = length[:, :, np.newaxis] * length[:, np.newaxis, :]
        size[size < 1e-3] = np.inf  # nothing but rounding: no known terms, or the derivative of a sign that stays
        tolerance = _OF_HIGH_POWER if one.design.power > 6 else _TOLERANCE
        tolerance = _OF_A_RUN if one.design.model.runs else tolerance
        assert np.max(np.abs(products - reference) / size) < tolerance


def test_counts_beyond_full_scale_and_wild_jets_restart(one: Rig, core: Core) -> None:
    counts, full = one.counts.copy(), np.array(one.design.full_scale)
    counts[:, 700] = full  # a spike within full scale: derivatives beyond their reach
    counts[0, 1500] = full[0] + 1
    windows, ticks = core.windows(one, counts)
    assert ticks[1500] == REJECTED
    assert len(windows) < len(core.windows(one, one.counts)[0])


def test_extreme_counts_overflow_nothing(one: Rig, core: Core) -> None:
    """The library traps signed overflow; also in the columns of sums at both ends of their range."""
    random = np.random.default_rng(7)
    full = np.array(one.design.full_scale)[:, np.newaxis]
    slow = np.sign(np.sin(np.arange(TICKS) / random.uniform(50, 400, (len(full), 1))))
    for counts in (full * slow, full * random.choice([-1, 0, 1], (len(full), TICKS)), full * np.ones((1, TICKS))):
        core.windows(one, counts.astype(np.int64))
    plain = core.windows(one, one.counts)[0]
    shape, most = plain.shape[1:], 2**31 - 1
    windows = np.stack([np.zeros(shape, np.int64), random.choice([-most, most], shape), random.integers(-3, 4, shape)])
    for place, channel in enumerate(one.design.model.channel):
        if channel.gain == NONE:  # its sums are never others
            windows[:, place] = plain[0, place]
    for kind, own in enumerate(one.design.model.kind):
        for window in windows:
            live = core.columns(one, kind, theta_of(one, kind), window)[2]
            assert live <= own.nuisances


def test_a_quantity_that_does_not_fit_is_named() -> None:
    one = rig("kapitza", TICKS)
    with pytest.raises(PvidError, match="has no jet phi_7: its jets are"):
        fixed_weak(one.made, JetReaches(of={"phi_7": 1.0}))
    with pytest.raises(PvidError, match="full scale of sample 0 is 33554432 counts"):
        fixed_design(one.design.model, one.tables, Sensing(one.lsb, (2**25, 9), 1000.0), one.fixed.formats)
