"""Which rigs a campaign draws: always the same ones, in the ranges and shares of the population."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from bench.campaign.pivot import KINDS, draw_motion
from bench.campaign.population import Population, RandomRig, load, parse, shipped
from pvid.base.errors import PvidError


def drawn(population: Population, seed: int, index: int) -> RandomRig:
    return next(rig for attempt in range(100) if (rig := population.draw(seed, index, attempt)) is not None)


def test_a_rig_is_drawn_alike_every_time_and_by_itself() -> None:
    one, other = drawn(shipped(), 4, 17), drawn(shipped(), 4, 17)
    assert np.array_equal(one.motion.tones, other.motion.tones)
    assert (one.pendulum, one.guess_l2, one.zero, one.release) == (
        other.pendulum,
        other.guess_l2,
        other.zero,
        other.release,
    )


def test_other_seeds_and_other_indices_are_other_rigs() -> None:
    lengths = {drawn(shipped(), seed, index).pendulum.l1 for seed in range(3) for index in range(10)}
    assert len(lengths) == 30


def test_the_shares_are_exact_in_every_cycle() -> None:
    population = shipped()
    cycle = sum(condition.share for condition in population.conditions.values())
    for begin in (0, cycle):
        counted = Counter(population.condition_of(7, index) for index in range(begin, begin + cycle))
        assert counted == {name: condition.share for name, condition in population.conditions.items()}
    orders = [[population.condition_of(seed, index) for index in range(cycle)] for seed in (7, 8)]
    assert orders[0] != orders[1]


def test_every_property_lies_in_its_range() -> None:
    population = shipped()
    for index in range(190):
        rig = drawn(population, 1, index)
        ranges = dict(population.base)
        for name in rig.combined:
            ranges.update(population.conditions[name].ranges)

        def within(value: float, key: str, scale: float = 1.0) -> bool:
            low, high = ranges[key]  # noqa: B023 - called in this turn only
            return bool(scale * low * (1 - 1e-9) <= value <= scale * high * (1 + 1e-9))

        l1, l2, rho2 = rig.pendulum.l1, rig.pendulum.l2, rig.pendulum.rho2
        assert within(l1, "l1") and within(l2 / l1, "l2_over_l1") and within(rho2 / l2, "rho2_over_l2")
        assert within(rig.bits, "bits") and within(rig.y_lsb, "y_lsb") and within(rig.duration, "duration")
        assert within(abs(rig.zero), "zero") and within(rig.angle, "angle")
        assert within(abs(rig.skew), "skew") and within(abs(rig.gain), "gain") and within(abs(rig.slant), "slant")
        assert within(rig.jitter, "jitter") and within(rig.backlash, "backlash")
        assert within(rig.hysteresis, "hysteresis") and within(rig.eccentricity, "eccentricity")
        assert within(max(rig.guess_l2 / l2, l2 / rig.guess_l2), "guess")
        assert within(max(rig.guess_rho2 / rho2, rho2 / rig.guess_rho2), "guess")
        assert all(within(friction, "dry", rig.pendulum.g * l2) for friction in rig.dry)
        assert rig.sample_rate in ranges["sample_rate"] and rig.sample_rate >= 20 * rig.modes_hz[1]
        assert rig.drive in KINDS


def test_imperfection_occurs_in_its_condition_only() -> None:
    population = shipped()
    for index in range(190):
        rig = drawn(population, 2, index)
        found = {
            "damp": rig.pendulum.damping1 > 0,
            "dry": rig.dry[0] > 0,
            "skew": rig.skew != 0,
            "jitter": rig.jitter > 0,
            "gain": rig.gain != 0,
            "backlash": rig.backlash > 0,
            "hysteresis": rig.hysteresis > 0,
            "ecc": rig.eccentricity > 0,
            "nonvert": rig.slant != 0,
        }
        assert {name for name, there in found.items() if there} == set(rig.combined) & set(found)


def test_mixture_combines_the_stated_number_of_conditions() -> None:
    population = shipped()
    mixed = [drawn(population, 1, index) for index in range(190) if population.condition_of(1, index) == "mixed"]
    assert {len(rig.combined) for rig in mixed} == {2, 3, 4}


def test_four_rigs_in_ten_are_tilted_and_the_others_are_not() -> None:
    gravities = np.array([drawn(shipped(), 1, index).pendulum.g for index in range(190)])
    assert ((gravities == 9.8) | (gravities <= 9.8 * math.cos(0.2))).all()
    # 190 draws of 0.4: standard deviation 0.036
    assert np.mean(gravities < 9.8) == pytest.approx(0.4, abs=3 * 0.036)


@pytest.mark.parametrize("kind", KINDS)
def test_a_drive_has_the_acceleration_wanted_or_the_travel_allowed(kind: str) -> None:
    t = np.arange(0, 60, 1e-3)
    for seed in range(5):
        motion = draw_motion(kind, (0.7, 2.5), np.random.default_rng(seed), 0.06, 3.0, 0.0)
        assert motion is not None
        rms, travel = np.sqrt(np.mean(motion.acceleration(t) ** 2)), np.ptp(motion.position(t))
        # the travel is measured on a grid of a twentieth of the fastest period
        assert travel <= 0.06 * 1.02 and rms <= 3.0 * 1.02
        assert travel >= 0.06 * 0.98 or rms >= 3.0 * 0.98


@pytest.mark.parametrize("kind", KINDS)
def test_acceleration_is_the_second_derivative_of_the_height(kind: str) -> None:
    motion = draw_motion(kind, (0.7, 2.5), np.random.default_rng(1), 0.06, 3.0, 0.0)
    assert motion is not None
    t = np.arange(0, 5, 1e-3)
    second = np.diff(motion.position(t), 2) / 1e-6
    # (2 pi 3.75 Hz 1 ms)^2 / 12 of 10 m/s^2
    assert second == pytest.approx(motion.acceleration(t)[1:-1], abs=1e-3)


def test_drive_that_needs_more_travel_is_refused() -> None:
    assert draw_motion("tones1", (0.3, 0.4), np.random.default_rng(1), 0.01, 3.0, 3.0) is None


def test_own_population_inherits_missing_keys_from_the_shipped_one() -> None:
    population = parse("[base]\nl1 = [0.3, 0.3]\n[conditions.short]\nduration = [5, 6]\n")
    rig = drawn(population, 1, 0)
    assert rig.pendulum.l1 == pytest.approx(0.3) and 5 <= rig.duration <= 6 and rig.condition == "short"
    assert population.base["bits"] == shipped().base["bits"]


def test_the_hash_changes_with_any_number() -> None:
    text = "[conditions.clean]\nangle = [0.01, 0.1]\n"
    assert parse(text).hash == parse(text).hash
    assert parse(text).hash != parse(text.replace("0.1]", "0.11]")).hash
    assert parse(text).hash != parse(text + "share = 2\n").hash


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("", "at least one condition"),
        ("[conditions.a]\nlength = [1, 2]\n", "'length' is not a key of a population"),
        ("[conditions.a]\nl1 = 0.3\n", "l1 must be a range"),
        ("[conditions.a]\nl1 = [0.3, 0.1]\n", "low <= high"),
        ("[conditions.a]\nl1 = [0, 0.1]\n", "above 0"),
        (
            "[conditions.a]\nskew = [0, 0.1]\n",
            r"above 0 (or \[0, 0\] for none)".replace("(", r"\(").replace(")", r"\)"),
        ),
        ("[conditions.a]\nguess = [0.5, 2]\n", "factors from 1 on"),
        ("[conditions.a]\ndrive = ['waltz']\n", "drive must be a list of some of tones1"),
        ("[conditions.a]\nsample_rate = 100\n", "sample_rate must be a list of positive numbers"),
        ("[conditions.a]\nshare = -1\n", "share must be a whole number"),
        ("[conditions.a]\nshare = 0\n", "must have a share above 0"),
        ("[conditions.a]\nof = ['b']\n", "'b' is not the name of a condition"),
        ("[conditions.a]\n[conditions.b]\nof = ['a']\ncount = [1, 2]\n", "from 1 to 1"),
        ("[other]\n", "'other' is not a key"),
        ("[conditions", "is not TOML"),
    ],
)
def test_a_wrong_population_is_refused_by_name(text: str, wanted: str) -> None:
    with pytest.raises(PvidError, match=wanted):
        parse(text)


def test_a_population_that_is_not_there_is_named() -> None:
    with pytest.raises(PvidError, match=r"nowhere\.toml: cannot be read"):
        load("nowhere.toml")
