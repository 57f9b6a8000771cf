"""Unknowns whose truth is 0, unknowns that the run does not determine, and bounds of the search."""

from collections.abc import Callable
from functools import cache
from typing import Any

import motor_run
import numpy as np
import numpy.typing as npt
import pytest

from pvid.model.compiled import CompiledModel
from pvid.model.description import Model
from pvid.model.signals import sgn
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.identify import identify, ready
from pvid.oracle.weak.zero import upper_bound

Float = npt.NDArray[np.float64]
RATE = 200.0
DESIGN = WeakDesign(RATE, 1.0, 12)
M, C, K = 1.3, 1.7, 82.0


def cart(more: Callable[..., object] | None = None, **m: Any) -> CompiledModel:
    """m x'' + c x' + k x = F, and what a test adds."""
    model = Model("cart")
    x = model.sensor("x", "m", resolution=1e-6)
    force = model.input("F", "N", hold="zoh", gain_sd=0.0)
    mass = model.unknown("m", "kg", 1.0, **m)
    c, k = model.unknown("c", "N*s/m", 1.0), model.unknown("k", "N/m", 100.0)
    added = 0 if more is None else more(model, x)
    model.equation(mass * x.d(2) + c * x.d() + k * x + added - force)
    return model.compiled("cart")


@cache
def run(seed: int, cubic: float = 0.0) -> dict[str, Float]:
    """Steps of the force; RK4 at 20 steps a sample."""
    rng = np.random.default_rng(seed)
    count = int(24 * RATE)
    force = np.repeat(rng.normal(size=count // 40 + 1), 40)[:count]
    s, v, h = 0.0, 0.0, 1 / RATE / 20

    def rate(s: float, v: float, f: float) -> float:
        return (f - C * v - K * s - cubic * s**3) / M

    x = np.empty(count)
    for n, f in enumerate(force.tolist()):
        x[n] = s
        for _ in range(20):
            a = rate(s, v, f)
            v2 = v + h / 2 * a
            b = rate(s + h / 2 * v, v2, f)
            v3 = v + h / 2 * b
            c = rate(s + h / 2 * v2, v3, f)
            v4 = v + h * c
            d = rate(s + h * v3, v4, f)
            s, v = s + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a + 2 * b + 2 * c + d)
    return {"x": np.round(x / 1e-6) * 1e-6, "F": force}


def friction(model: Model, x: object) -> object:
    return model.unknown("Fc", "N", 0.5) * sgn(x.d())  # type: ignore[attr-defined]


def superfluous(model: Model, x: object) -> object:
    return model.unknown("k3", "N/m^3", 1e4) * x**3  # type: ignore[operator]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("more", "name"), [(friction, "Fc"), (superfluous, "k3")])
def test_a_term_that_is_not_there_has_an_upper_bound_and_leaves_the_others_alone(
    more: Callable[..., object], name: str, seed: int
) -> None:
    model = cart(more)
    found = identify(model, run(seed), RATE, design=DESIGN)
    k = model.p_names.index(name)
    judged = found.judged[k]
    assert [one.status for one in found.judged] == ["identified"] * 3 + ["near_zero"]
    assert 0 <= found.p[k] < 3.5 * found.se[k]
    assert judged.below is not None and found.p[k] < judged.below < 0.5 * model.unknowns[k].guess
    off = np.abs(found.p[:3] / [M, C, K] - 1)
    assert (off < 0.01).all() and (np.abs(found.p[:3] - [M, C, K]) < 4.5 * found.se[:3]).all()
    assert found.verdict.identified and not any(one.name == "near_zero" and one.alarm for one in found.verdict.reasons)


def test_a_term_that_is_there_is_identified_as_before() -> None:
    model = cart(superfluous)
    found = identify(model, run(0, cubic=2e5), RATE, design=DESIGN)
    assert [one.status for one in found.judged] == ["identified"] * 4
    assert found.p[3] == pytest.approx(2e5, rel=0.1)


def test_what_the_run_does_not_determine_is_named_and_the_others_are_published() -> None:
    """m and a mass that adds to it: neither alone; c and k are determined."""
    model = cart(lambda model, x: model.unknown("mx", "kg", 0.5) * x.d(2))
    found = identify(model, run(0), RATE, design=DESIGN)
    status = dict(zip(model.p_names, (one.status for one in found.judged), strict=True))
    assert status == {"m": "not_identified", "mx": "not_identified", "c": "identified", "k": "identified"}
    assert found.verdict.status == "warning" and found.verdict.identified
    (reason,) = [one for one in found.verdict.reasons if one.name == "undetermined"]
    assert "not identifiable together" in reason.text and reason.alarm
    off = np.abs(found.p - [M, C, K, 0])[[1, 2]] / found.se[[1, 2]]
    assert (off < 4).all()


@pytest.mark.parametrize(("bounds", "at"), [({"low": 0.5, "high": 1.1}, 1.1), ({"low": 1.6, "high": 5}, 1.6)])
def test_the_search_stays_between_low_and_high(bounds: dict[str, float], at: float) -> None:
    model = cart(None, **bounds) if bounds["low"] < 1 else _with_guess(bounds)
    found = identify(model, run(0), RATE, design=DESIGN)
    assert found.p[0] == at
    assert found.judged[0].status == "not_identified" and "bound" in (found.judged[0].reason or "")


def test_a_value_far_below_its_guess_is_said_with_the_unit_in_question() -> None:
    found = identify(cart(), {**run(0), "F": 1e-7 * run(0)["F"]}, RATE, design=DESIGN, start=[1e-7, 1e-7, 1e-5])
    assert min(found.r2.values()) > 0.9
    assert found.judged[0].reason == "m would be 1.3e-07 kg, below a millionth of its guess: is that in another unit?"


def _with_guess(bounds: dict[str, Any]) -> CompiledModel:
    model = Model("cart")
    x = model.sensor("x", "m", resolution=1e-6)
    force = model.input("F", "N", hold="zoh", gain_sd=0.0)
    mass = model.unknown("m", "kg", 2.0, **bounds)
    c, k = model.unknown("c", "N*s/m", 1.0), model.unknown("k", "N/m", 100.0)
    model.equation(mass * x.d(2) + c * x.d() + k * x - force)
    return model.compiled("cart")


def test_a_range_that_follows_from_the_guess_does_not_bound_the_search() -> None:
    model = cart()
    found = identify(model, {**run(0), "F": 1e4 * run(0)["F"]}, RATE, design=DESIGN, start=[1e4, 1e4, 1e6])
    assert found.p == pytest.approx([1e4 * M, 1e4 * C, 1e4 * K], rel=0.02)
    assert "range" in {one.name for one in found.verdict.reasons}


def test_a_force_holds_a_parameter_at_its_bound_and_pulls_it_off() -> None:
    parameters = ready(cart(None, low=0.5, high=1.1)).parameters
    p = np.array([1.1, 1.0, 100.0])
    assert parameters.blocked(p, np.array([1.0, 1, 1])).tolist() == [True, False, False]
    assert not parameters.blocked(p, np.array([-1.0, 1, 1])).any()
    assert parameters.moved(p, np.array([2.0, 0, 0]))[0] == 1.1


@pytest.mark.parametrize(("value", "expected"), [(-1.0, 1.95996), (0.0, 1.95996), (5.0, 6.64485)])
def test_upper_bound_is_that_of_a_normal_distribution_cut_at_0(value: float, expected: float) -> None:
    assert upper_bound(2 * value, 2.0) == pytest.approx(2 * expected, rel=1e-4)


@pytest.mark.parametrize("guess", [0.02, 0.15])
def test_of_a_common_scale_that_is_free_nothing_has_a_bound(guess: float) -> None:
    """J w' + b w = kt i: the run determines J/kt and b/kt alone, and kt is not "below" anything."""
    model = Model("motor")
    v, i, w = (
        model.input("V", "V", hold="zoh"),
        model.sensor("i", "A", noise=0.01),
        model.sensor("w", "rad/s", noise=0.05),
    )
    ell, r, ke = model.unknown("L", "H", 3e-3), model.unknown("R", "ohm", 1.5), model.unknown("ke", "V*s", 0.04)
    kt, j, b = (
        model.unknown("kt", "N*m/A", guess),
        model.unknown("J", "kg*m^2", 1e-4),
        model.unknown("b", "N*m*s", 1e-4),
    )
    model.equation(ell * i.d() + r * i + ke * w - v)
    model.equation(j * w.d() + b * w - kt * i)
    found = identify(model.compiled("motor"), motor_run.recording().run, 1000.0)
    status = dict(zip(("L", "R", "ke", "kt", "J", "b"), [one.status for one in found.judged], strict=True))
    assert [name for name, one in status.items() if one == "not_identified"] == ["kt", "J", "b"]
    assert [name for name, one in status.items() if one == "identified"] == ["L", "R", "ke"]
