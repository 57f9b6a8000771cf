"""Physical parameters in integers against the closed form in float64."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from pvid.core.native import Native
from pvid.models.kapitza.physical import linear, physical
from pvid.rig.file import RigFile
from pvid.settings.q31 import ScaleQ31
from pvid.setup.q31 import covariance_of, p_of, scale_of, strong_config_q31, units_of
from pvid.twin import estimates as layouts
from pvid.twin.kapitza import physical_q31 as kapitza_q31

RIG = RigFile.standard()
STRONG = replace(RIG, identifier=replace(RIG.identifier, form="strong"))
CONFIG = strong_config_q31(STRONG, 1000.0)
SCALE = scale_of(CONFIG, RIG.l1)


def estimate_of(p: npt.ArrayLike, relative_se: float, correlation: float) -> npt.NDArray[np.void]:
    """An estimate of (w [1/s^2], d1, d2) with equal relative errors."""
    out = np.zeros((), layouts.Q31)
    one = p_of(CONFIG, np.eye(3))[np.arange(3), np.arange(3)]
    out["p"][:3] = np.rint(np.asarray(p) / one)
    out["se"][:3] = np.rint(relative_se * np.asarray(p) / one)
    out["correlation"][:3, :3] = 2**30 * np.eye(3)
    out["correlation"][1, 2] = out["correlation"][2, 1] = round(correlation * 2**30)
    return out


@pytest.mark.parametrize("seed", range(40))
def test_values_equal_the_closed_form(native: Native, seed: int) -> None:
    random = np.random.default_rng(seed)
    g, l2, rho2 = random.uniform(2, 30), random.uniform(0.03, 0.5), random.uniform(0.03, 0.5)
    p = linear(g, l2, rho2, RIG.l1)
    estimate = estimate_of(p, 10 ** random.uniform(-4, -1), random.uniform(-0.999, 0.999))
    answer = native.physical_q31(estimate, SCALE)
    exact = p_of(CONFIG, estimate["p"][:3])
    assert answer is not None
    value, se = (a / 2.0**24 for a in answer)
    # a unit of the result, and the 30 bits of the quotients
    assert value == pytest.approx(physical(exact, RIG.l1), rel=1e-7, abs=2.0**-23)
    expected = RIG.mechanism.physical_errors(exact, covariance_of(CONFIG, estimate)[:3, :3])
    # three roundings to a unit each; where they nearly cancel the root keeps half the digits
    assert se == pytest.approx(expected, rel=1e-4, abs=2.0**-20)


@pytest.mark.parametrize("p", [(30.0, 5.0, 6.0), (30.0, 5.0, 4.0), (30.0, 9.0, 0.0), (0.0, 9.0, 5.0)])
def test_outside_the_physical_region_there_are_none(native: Native, p: tuple[float, float, float]) -> None:
    assert native.physical_q31(estimate_of(p, 0.01, 0.0), SCALE) is None


def test_a_length_that_does_not_fit_is_refused(native: Native) -> None:
    """l2 = l1 L2/d2 beyond 127 m."""
    assert native.physical_q31(estimate_of((30.0, 60.0, 0.1), 0.01, 0.0), SCALE) is None


def test_core_and_twin_agree_on_any_estimate(native: Native) -> None:
    """Estimates of every size and sign, and scales of every shift: the same integers, or none in both."""
    random = np.random.default_rng(9)
    count = 3000
    estimates = np.zeros(count, layouts.Q31)
    sizes = random.integers(0, 31, (2, count, 3))
    estimates["p"][:, :3] = random.integers(0, 2**31, (count, 3)) >> sizes[0]
    estimates["p"][::50, 0] *= -1
    # half of them near the mechanism, where there is an answer
    near = np.rint(np.array([31.7, 8.9, 5.6]) / units_of(CONFIG)[:3] * random.uniform(0.5, 2, (count // 2, 3)))
    estimates["p"][: count // 2, :3] = np.minimum(near, 2**31 - 1)
    estimates["se"][:, :3] = random.integers(0, 2**31, (count, 3)) >> sizes[1]
    estimates["correlation"][:, 1, 2] = random.integers(-(2**30), 2**30 + 1, count)
    estimates["correlation"][::7, 1, 2] = 2**30
    for unit in (
        scale_of(CONFIG, RIG.l1),
        ScaleQ31(l1=1, g_multiplier=1, g_shift=62, d1_bits=0, d2_bits=31),
        ScaleQ31(l1=2**31 - 1, g_multiplier=2**31 - 1, g_shift=-31, d1_bits=31, d2_bits=0),
    ):
        values, errors, inside = kapitza_q31.physical(estimates, unit)
        for i in range(count):
            answer = native.physical_q31(estimates[i : i + 1], unit)
            assert (answer is not None) == inside[i], i
            if answer is not None:
                assert np.array_equal(answer[0], values[i]) and np.array_equal(answer[1], errors[i]), i
    assert 200 < kapitza_q31.physical(estimates, scale_of(CONFIG, RIG.l1))[2].sum() < count
