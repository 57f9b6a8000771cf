"""White columns of the fixed-point weak engine: C and twin bit for bit, both near the rows of the float64 oracle."""

from __future__ import annotations

import numpy as np
import pytest
from weak_q31 import DESIGNS, Core, Rig, core_in, rig

from pvid.design.weak_q31 import scaled_number
from pvid.oracle.weak.rows import EquationError
from pvid.settings.weak import NONE
from pvid.twin.q31 import weak_collect, weak_white
from pvid.twin.q31.integer import Int
from pvid.twin.q31.scaled import Scaled

TICKS = 3000

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


def scaled_theta(one: Rig, kind: int, factor: float, lanes: int) -> Scaled:
    """theta at `factor` times the truth [thetas, lanes]."""
    theta = one.compiled.parameters.theta(factor * one.truth)[kind]
    numbers = np.array([scaled_number(float(x)) for x in theta], np.int64)
    return Scaled(*(np.repeat(numbers[:, k : k + 1], lanes, axis=1) for k in range(2)))


def white_of(one: Rig, kind: int, theta: Scaled) -> weak_white.White:
    """With the design's variance of the equation's own error."""
    variance = Scaled(*(np.full_like(theta.m[0], x) for x in one.design.error_variance[kind]))
    return weak_white.white(one.design, kind, theta, variance)


def windows_of(one: Rig) -> Int:
    return weak_collect.collect(one.counts, one.design).windows


@pytest.mark.parametrize("factor", [1.0, 0.5])
def test_c_and_twin_have_the_same_columns(one: Rig, core: Core, factor: float) -> None:
    windows = windows_of(one)
    for kind in range(len(one.design.model.kind)):
        theta = scaled_theta(one, kind, factor, len(windows))
        made = weak_white.columns(white_of(one, kind, theta), kind, windows)
        for w in range(len(windows)):
            x, exponent, live = core.columns(one, kind, Scaled(theta.m[:, w], theta.e[:, w]), windows[w])
            assert np.array_equal(x, made.x[:, :, w])
            assert np.array_equal(exponent, made.exponent[:, w])
            assert live == made.live[w]


def test_windows_of_zeros_and_of_full_scale_have_the_same_columns(one: Rig, core: Core) -> None:
    random = np.random.default_rng(3)
    shape = windows_of(one).shape[1:]
    most = 2**31 - 1
    windows = np.stack([np.zeros(shape, np.int64), random.choice([-most, most], shape), random.integers(-3, 4, shape)])
    for place, channel in enumerate(one.design.model.channel):
        if channel.gain == NONE:  # its sums are never others
            windows[:, place] = windows_of(one)[0, place]
    for kind in range(len(one.design.model.kind)):
        theta = scaled_theta(one, kind, 1.0, len(windows))
        made = weak_white.columns(white_of(one, kind, theta), kind, windows)
        for w in range(len(windows)):
            x, exponent, live = core.columns(one, kind, Scaled(theta.m[:, w], theta.e[:, w]), windows[w])
            assert np.array_equal(x, made.x[:, :, w])
            assert np.array_equal(exponent, made.exponent[:, w])
            assert live == made.live[w]


def test_products_of_columns_are_those_of_the_oracle(one: Rig) -> None:
    """Its K white rows and these differ by a rotation; the first ones of these contain the nuisances."""
    windows = windows_of(one)
    theta = one.compiled.parameters.theta(one.truth)
    for kind in range(len(one.design.model.kind)):
        scaled = scaled_theta(one, kind, 1.0, len(windows))
        made = weak_white.columns(white_of(one, kind, scaled), kind, windows)
        found = made.x * 2.0 ** made.exponent[:, np.newaxis, :]
        found[:, np.arange(found.shape[1])[:, np.newaxis] < made.live] = 0
        white = one.rows.white((kind,), theta, [EquationError()] * one.rows.kinds)
        wanted = np.concatenate([white.regressors, white.known[:, np.newaxis]], axis=1)[: len(windows)]
        products = np.einsum("akw,bkw->wab", found, found)
        reference = np.einsum("wak,wbk->wab", wanted, wanted)
        length = np.sqrt(np.einsum("waa->wa", reference))
        size = length[:, :, np.newaxis] * length[:, np.newaxis, :]
        size[size < 1e-3] = np.inf  # nothing but rounding: no known terms, or the derivative of a sign that stays
        tolerance = _OF_HIGH_POWER if one.design.power > 6 else _TOLERANCE
        tolerance = _OF_A_RUN if one.design.model.runs else tolerance
        assert np.max(np.abs(products - reference) / size) < tolerance
