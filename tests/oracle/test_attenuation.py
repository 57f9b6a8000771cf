"""Force noise shrinks an inertia where the band is wide; the other line and its alarm show it."""

from functools import lru_cache

import numpy as np
import pytest
from conftest import ROOT

from pvid.models.drive import Sines
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import SimulatedRig
from pvid.oracle.weak import verdict
from pvid.oracle.weak.attenuation import other_line
from pvid.oracle.weak.choice import chosen
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.solve import Fit, batch
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import RigSimulation

MODEL = compiled_of(ROOT / "tests" / "data" / "recordings" / "simple_pendulum.py")
RATE = 250.0
J = 0.18  # kg m^2
RIG = SimulatedRig(
    model=MODEL.name,
    truth={"J": J, "G": 3.6, "b": 0.05, "c": 0.1, "o": 0.02},
    drive={"tau": Sines(((1.0, 0.45, 0.0), (0.8, 0.8, 1.0)))},
    sample_rate=RATE,
    duration=20.0,
    substeps=4,
    friction_width=0.3,
)
NARROW = WeakDesign(RATE, window_s=2.0, functions=5, rate_taps=15)  # to 1 Hz
WIDE = WeakDesign(RATE, window_s=1.0, functions=25, rate_taps=15)  # to 12 Hz: the drive has nothing there
FORCE_NOISE = 0.1  # N m / sqrt(Hz): the motion at 12 Hz is its work alone


@lru_cache
def run(noise: float, seed: int) -> dict[str, np.ndarray]:
    imperfections = Imperfections(process={0: noise} if noise else {})
    return RigSimulation.of(MODEL, RIG).run(seed, imperfections)


def fitted(noise: float, seed: int, design: WeakDesign) -> Fit:
    return batch(WeakRows.of(ready(MODEL), run(noise, seed), design))


def alarms(fit: Fit) -> list[verdict.Reason]:
    found = uncertainty(fit)
    return verdict.of_attenuation(MODEL, fit, found, other_line(fit), found.se)


@pytest.mark.parametrize("seed", [0, 1])
def test_wide_band_shrinks_the_inertia_and_the_other_line_does_not(seed: int) -> None:
    fit = fitted(FORCE_NOISE, seed, WIDE)
    other = other_line(fit)
    assert other is not None
    se = uncertainty(fit).se[0]
    assert fit.p[0] < J - 3 * se  # a sixth too small
    assert abs(other[0] - J) < 3 * se
    (reason,) = alarms(fit)
    assert reason.name == "attenuation" and reason.alarm
    assert "J" in reason.text


@pytest.mark.parametrize("seed", [0, 1])
def test_narrow_band_covers_the_truth_without_an_alarm(seed: int) -> None:
    fit = fitted(FORCE_NOISE, seed, NARROW)
    assert abs(fit.p[0] - J) < 3 * uncertainty(fit).se[0]
    assert alarms(fit) == []


@pytest.mark.parametrize("design", [NARROW, WIDE], ids=["narrow", "wide"])
def test_without_force_noise_both_lines_are_one(design: WeakDesign) -> None:
    fit = fitted(0.0, 0, design)
    other = other_line(fit)
    assert alarms(fit) == []
    if other is not None:
        np.testing.assert_allclose(other[:2], fit.p[:2], rtol=1e-3)


def test_design_is_chosen_where_the_lines_agree() -> None:
    ten_seconds = {name: values[:2500] for name, values in run(FORCE_NOISE, 0).items()}
    design = chosen(ready(MODEL), ten_seconds, RATE)
    assert alarms(batch(WeakRows.of(ready(MODEL), ten_seconds, design))) == []


def test_rows_whose_known_side_is_the_highest_derivative_have_no_other_line() -> None:
    model = compiled_of(ROOT / "tests" / "data" / "recordings" / "free_pendulum.py")
    t = np.arange(2000) / RATE
    q = np.pi + 0.5 * np.exp(-0.02 * t) * np.cos(8.0 * t)
    assert other_line(batch(WeakRows.of(ready(model), {"q": q}, NARROW))) is None


def test_disagreement_within_the_published_error_is_a_note() -> None:
    """What is smaller than the error that it is a part of is no alarm: two estimates 0.3 % apart, with a gain's 2 %."""
    parameters = ready(MODEL).parameters
    one = np.array([parameters.guess[k] for k in range(len(MODEL.p))])
    other, clash = 1.003 * one, np.full(len(one), 5.0)

    def alarms(covered: float) -> list[bool]:
        found = verdict.disagreement("windows", MODEL, parameters, one, other, clash, "{names} {one}", covered * one)
        return [reason.alarm for reason in found]

    assert alarms(0.02) == [False] and alarms(0.002) == [True] and alarms(0.0) == [True]
