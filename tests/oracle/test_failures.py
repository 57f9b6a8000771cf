"""Numbers that run away: of a check beside the fit they are named, of the fit itself nothing is identified."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from pvid.model.compiled import CompiledModel
from pvid.model.description import Model
from pvid.oracle.weak import identify as module
from pvid.oracle.weak import solve
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.gate import gated
from pvid.oracle.weak.identify import Identified, identify, ready
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.solve import DivergedError, batch

Float = npt.NDArray[np.float64]
RATE = 200.0
DESIGN = WeakDesign(RATE, 1.0, 12)


def cart() -> CompiledModel:
    model = Model("cart")
    x = model.sensor("x", "m", resolution=1e-5)
    force = model.input("F", "N", hold="zoh", gain_sd=0.0)
    m = model.unknown("m", "kg", 1.0)
    c = model.unknown("c", "N*s/m", 1.0)
    model.equation(m * x.d(2) + c * x.d() - force)
    return model.compiled("cart")


def run(seed: int = 0, seconds: float = 24.0) -> dict[str, Float]:
    """m 1.3, c 1.7; steps of the force, exact between samples."""
    rng = np.random.default_rng(seed)
    count = int(seconds * RATE)
    force = np.repeat(rng.normal(size=count // 40 + 1), 40)[:count]
    decay, m, c = np.exp(-1.7 / 1.3 / RATE), 1.3, 1.7
    x, v = np.zeros(count), 0.0
    for k in range(count - 1):
        rest = force[k] / c
        x[k + 1] = x[k] + rest / RATE + (v - rest) * (1 - decay) * m / c
        v = rest + (v - rest) * decay
    return {"x": np.round(x / 1e-5) * 1e-5, "F": force}


@pytest.mark.parametrize("error", [np.linalg.LinAlgError("singular"), ZeroDivisionError(), FloatingPointError()])
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("other_length", "windows of another length"),
        ("by_sensors", "the weights of the sensors"),
        ("shorter_rates", "shorter derivatives"),
        ("Missing.of", "what is missing"),
        ("as_white_force", "a white force"),
        ("other_line", "attenuation"),
    ],
)
def test_a_check_whose_numbers_run_away_is_named_and_the_rest_stands(
    name: str, words: str, error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: Any, **__: Any) -> None:
        raise error

    *owner, last = name.split(".")
    monkeypatch.setattr(getattr(module, owner[0]) if owner else module, last, fails)
    found = identify(cart(), run(), RATE, design=DESIGN)
    assert found.p == pytest.approx([1.3, 1.7], rel=0.01)
    assert "unchecked" in {one.name for one in found.verdict.reasons} and words in (found.verdict.warning or "")


def _diverging_after(passes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    plain, calls = solve.gauss_newton, [0]

    def away(parameters: Any, moments: Any, p: Float, prior: Float, steps: int) -> tuple[Float, float]:
        calls[0] += 1
        p, size = plain(parameters, moments, p, prior, steps)
        return (p if calls[0] <= passes else np.full(len(p), np.nan)), size

    monkeypatch.setattr(solve, "gauss_newton", away)


def test_a_search_that_runs_away_gives_its_last_estimate_with_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = WeakRows.of(ready(cart()), run(), DESIGN)
    _diverging_after(2, monkeypatch)
    with pytest.raises(DivergedError) as raised:
        batch(rows)
    fit = raised.value.fit
    assert fit.diverged and not fit.settled and np.isfinite(fit.p).all()


def test_a_fit_that_runs_away_is_not_identified_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    _diverging_after(2, monkeypatch)
    found = identify(cart(), run(), RATE, design=DESIGN)
    assert found.verdict.status == "not_identified"
    assert "ran away" in found.verdict.reasons[0].text


def test_weights_without_a_fixed_point_leave_the_answer_of_the_sensors_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = gated

    def unsettled(rows: WeakRows, start: Float | None, equation_error: bool, *rest: Any, **named: Any) -> solve.Fit:
        fit = plain(rows, start, equation_error, *rest, **named)
        return replace(fit, p=1e-6 * fit.p, settled=False) if equation_error else fit

    monkeypatch.setattr(module, "gated", unsettled)
    found = identify(cart(), run(), RATE, design=DESIGN)
    assert found.p == pytest.approx([1.3, 1.7], rel=0.01) and found.verdict.status == "warning"
    (reason,) = [one for one in found.verdict.reasons if one.name == "not_settled"]
    assert reason.alarm and "--weights sensors" in reason.text


@pytest.mark.parametrize(
    "spoil",
    [
        lambda x, rng: rng.normal(size=x.size) * 1e140,
        lambda x, rng: np.cumsum(np.cumsum(rng.standard_cauchy(x.size))),
        lambda x, rng: np.where(rng.random(x.size) < 0.3, 1e30, x),
        lambda x, rng: x * 1e-200,
    ],
    ids=["huge", "cauchy", "mixed", "tiny"],
)
def test_nonsense_is_an_answer_without_an_exception(spoil: Callable[..., Float]) -> None:
    data = run()
    with np.errstate(all="ignore"):
        found: Identified = identify(
            cart(), {**data, "x": spoil(data["x"], np.random.default_rng(3))}, RATE, design=DESIGN
        )
        assert found.history.shape == (len(found.times), 2)
    assert found.verdict.status != "good"
