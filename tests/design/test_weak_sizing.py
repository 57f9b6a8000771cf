"""Sizes of the weak form's design: they follow the modes of any rig at any rate, within what a core holds."""

from __future__ import annotations

import math
import re
from itertools import product

import numpy as np
import numpy.typing as npt
import pytest
from conftest import ROOT

from pvid.base.errors import PvidError
from pvid.design.weak import design
from pvid.design.weak_sizing import (
    HOST,
    Bounds,
    Sizes,
    bounds_of,
    raised_bounds,
    sized,
    slow_and_fast_hz,
    window_for_run,
)
from pvid.models.kapitza.modes import modes_hz
from pvid.sim.pendulum import STANDARD_PENDULUM

Float = npt.NDArray[np.float64]

FASTEST_HZ = 10.0


def p_of(slow_hz: float, fast_hz: float) -> Float:
    """(w, d1, d2) with these modes."""
    w = 30.0
    slow, fast = (2 * math.pi * slow_hz) ** 2, (2 * math.pi * fast_hz) ** 2
    return np.array([w, (slow + fast) / w, slow * fast / w**2])


MODES = [(slow, slow * ratio) for slow, ratio in product((0.3, 0.7, 1.5, 4.0), (1.5, 2.5, 4.0, 6.0))]
MODES = [(slow, fast) for slow, fast in MODES if fast <= FASTEST_HZ]


def test_rigs_have_the_stated_modes() -> None:
    for slow, fast in MODES:
        assert modes_hz(p_of(slow, fast)) == pytest.approx((slow, fast))


@pytest.mark.parametrize("rate", [200.0, 500.0, 1000.0, 2000.0, 5000.0])
@pytest.mark.parametrize("bounds", [HOST, Bounds()], ids=["host", "default"])
def test_sizes_follow_the_modes_within_the_bounds(rate: float, bounds: Bounds) -> None:
    taps = None if bounds is HOST and rate <= 1000.0 else 81  # filters of 5 kHz have a test of their own
    for slow, fast in MODES:
        one = sized(p_of(slow, fast), rate, Sizes(taps=taps), bounds)
        assert 1 <= one.decimation <= bounds.decimation
        assert 9 <= one.window <= bounds.window and one.window % 2 == 1
        assert 8 <= one.functions <= bounds.functions
        assert 9 <= one.front.taps <= bounds.taps and one.front.taps % 2 == 1
        window_s = (one.window - 1) * one.decimation / rate
        if bounds is HOST:
            # 1.3 slow periods, less where the functions would not reach the fast mode, rounded to two samples
            slack = 2 * one.decimation / rate * slow
            assert 0.8 - slack <= window_s * slow <= 1.3 + slack
        # functions reach 1.5 times the fast mode, or there are as many as the core holds
        assert one.functions == bounds.functions or one.functions >= 2 * window_s * 1.49 * fast - 1
        # the window has the samples that its functions need: four for each half wave of the last one
        assert one.window > 4 * one.functions


def test_filters_are_good_where_they_may_be_long_enough() -> None:
    for slow, fast in MODES:
        assert sized(p_of(slow, fast), 1000.0, Sizes()).front.badness <= 2


def test_a_rig_at_5_khz_has_a_design() -> None:
    for slow, fast in ((0.3, 1.8), (0.74, 2.56), (4.0, 10.0)):
        tables = design(0.3, 5000.0, p_of(slow, fast))
        assert tables.window_s * slow == pytest.approx(1.3, abs=0.5)
        assert np.isfinite(tables.chi).all() and np.isfinite(tables.gram).all()
        assert tables.taps <= HOST.taps and tables.decimation <= HOST.decimation


def test_given_sizes_are_taken() -> None:
    given = Sizes(window_s=1.0, functions=9, decimation=5, taps=41, pass_hz=20.0)
    one = sized(STANDARD_PENDULUM.linear, 1000.0, given)
    assert (one.functions, one.decimation, one.window, one.front.taps) == (9, 5, 201, 41)
    wider = sized(STANDARD_PENDULUM.linear, 1000.0, Sizes(window_s=1.0, functions=9, decimation=5, taps=41, pass_hz=30))
    assert not np.array_equal(one.front.smooth.weights, wider.front.smooth.weights)


def test_unphysical_p_puts_both_modes_in_the_middle() -> None:
    slow, fast = slow_and_fast_hz(np.array([30.0, 2.0, 3.0]))
    assert slow == fast == pytest.approx(math.sqrt(30.0) / (2 * math.pi))
    assert sized(np.array([30.0, 2.0, 3.0]), 1000.0, Sizes()).window > 100


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (Sizes(window_s=0.0), "window_s must be a positive number of seconds, not 0"),
        (Sizes(window_s=math.nan), "window_s must be a positive"),
        (Sizes(window_s=5.0, decimation=8), "window_s = 5 s is 625 samples .*PVID_MAX_WEAK_WINDOW"),
        (Sizes(functions=17), "functions must be 4 to 16 \\(PVID_MAX_FUNCTIONS of the core\\), not 17"),
        (Sizes(functions=3), "functions must be 4 to 16, not 3"),
        (Sizes(decimation=65), "decimation must be 1 to 64 \\(PVID_MAX_DECIMATION"),
        (Sizes(taps=403), "taps must be 9 to 401 \\(PVID_MAX_TAPS"),
        (Sizes(taps=80), "taps must be odd, not 80"),
    ],
)
def test_sizes_that_no_core_holds_are_named(given: Sizes, named: str) -> None:
    with pytest.raises(PvidError, match=named):
        sized(STANDARD_PENDULUM.linear, 1000.0, given)


@pytest.mark.parametrize(("slow", "fast"), MODES[::3])
def test_a_short_run_gets_a_window_that_it_holds_often_enough(slow: float, fast: float) -> None:
    p = p_of(slow, fast)
    own = (sized(p, 1000.0, Sizes(taps=81)).window - 1) * sized(p, 1000.0, Sizes(taps=81)).decimation / 1000.0
    assert window_for_run(p, 10 * own) is None
    duration = 2.0 * own
    window_s = window_for_run(p, duration)
    assert window_s is not None and window_s < own
    short = sized(p, 1000.0, Sizes(window_s=window_s, taps=81))
    hop_s = (short.window - 1) // 2 * short.decimation / 1000.0
    complete = math.floor((duration - 2 * hop_s) / hop_s + 1e-9) + 1
    assert complete >= 4


# ---- what a core of the default bounds lacks


def test_the_default_bounds_are_the_cores() -> None:
    text = (ROOT / "firmware" / "include" / "pvid" / "config.h").read_text(encoding="utf-8")
    for macro, value in bounds_of(Bounds()).items():
        found = re.search(rf"#define {macro} (\d+)", text)
        assert found is not None and int(found.group(1)) == value, macro


def test_bounds_are_raised_where_a_design_exceeds_them_and_nowhere_else() -> None:
    assert raised_bounds(design(0.3, 1000.0, STANDARD_PENDULUM.linear, Sizes(taps=81))) == {}
    large = design(0.3, 5000.0, STANDARD_PENDULUM.linear, Sizes(taps=301))
    assert large.decimation > 32
    assert raised_bounds(large) == {"PVID_MAX_TAPS": 301, "PVID_MAX_DECIMATION": large.decimation}
    assert raised_bounds(large.f32) == raised_bounds(large)
