"""Random rigs the whole road, in short."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.random_models import Road, road_of, roads, table_of
from bench.random_motion import random_run
from bench.random_rigs import IN_C, KINDS, random_rig

# Seeds; together they have most kinds, known and measured inputs or none, hidden coordinates, friction, no mass.
WHOLE = (2, 65, 1001, 1003)
ANALYSED = (0, 3, 4, 62, 64, 66, 70)


def of_night(seeds: Sequence[object], by_day: int) -> list[Any]:
    """All but the first."""
    return [*seeds[:by_day], *(pytest.param(one, marks=pytest.mark.night) for one in seeds[by_day:])]


# Seeds of rigs that failed once, and why.
CURED = {
    "the current is sampled before the voltage jumps": 1097,
    "the rate in abs(v)*v is blurred by a short filter": 5021,
    "a homogeneous equation shrinks to nothing": 5061,
    "a friction that may be 0 is found by the refinement": 6011,
    "the voltage of a cell is sampled before the current jumps": 5049,
}


@pytest.mark.parametrize("seed", of_night(WHOLE, 1))
def test_a_random_rig_goes_the_whole_road(seed: int) -> None:
    road = road_of(seed)
    assert road.failures == []
    assert {"identify", "f32", "q31", "build", "compile", "deploy", "fixed deploy"} <= set(road.reached)


@pytest.mark.parametrize("seed", of_night(ANALYSED, 3))
def test_a_random_rig_is_identified_and_refined_in_float64(seed: int) -> None:
    road = road_of(seed, in_c=False)
    assert road.failures == []
    assert {"check", "identify", "refine"} <= set(road.reached)
    assert road.outcome != "refused"


@pytest.mark.parametrize("why", of_night(list(CURED), 1))
def test_a_rig_that_failed_once_is_right(why: str) -> None:
    road = road_of(CURED[why], in_c=False)
    assert road.failures == []
    assert road.outcome == "good"


@pytest.mark.night
def test_a_drag_that_ran_down_to_0_starts_the_core_within_float32() -> None:
    road = road_of(6028)
    assert road.failures == []
    assert {"f32", "q31", "deploy"} <= set(road.reached)


def test_a_rig_with_fewer_functions_than_unknowns_is_refused_by_the_cores_in_a_sentence() -> None:
    road = road_of(5008)
    assert road.failures == []
    assert "3 functions of its 4 unknowns" in road.refusals["f32"]


def test_every_kind_draws_the_same_rig_again_and_others_from_other_seeds() -> None:
    for kind in KINDS:
        texts = [random_rig(seed, kind).text for seed in (1, 1, 2)]
        assert texts[0] == texts[1] != texts[2]


def test_the_grammar_draws_every_feature_that_real_rigs_have() -> None:
    drawn = {one for seed in range(300) for one in random_rig(seed).features}
    wanted = {
        *("friction of a measured speed", "measured supply", "no inductance", "no mass", "force cell", "accelerometer"),
        *("no input", "integral", "encoder offset", "truth 0", "more than 8 unknowns", "hidden coordinate", "feedback"),
        *("steps", "sines", "prbs", "chirp", "held input", "sampled input", "measured drive", "Lagrangian", "gyro"),
        *("air drag", "cubic spring", "constant load", "base motion", "dry friction", "measured speed"),
    }
    assert wanted <= drawn
    assert max(len(random_rig(seed).truth) for seed in range(300)) > IN_C


def test_a_block_slides_and_stops_as_coulomb_says(tmp_path: Path) -> None:
    """A vehicle that coasts down without drag: v falls by Fr/m a second, and it then stays."""
    rig = next(one for seed in range(999) if "no input" in (one := random_rig(seed, "vehicle")).features)
    values = dict(zip([*rig.truth, "m"], range(9), strict=False))
    bare = [0.0 if name in ("b", "cw") else rig.values[place] for name, place in values.items()]
    decay = bare[values["Fr"]] / bare[values["m"]]
    stop = rig.start[0] / decay
    run = random_run(type(rig)(**{**vars(rig), "values": bare, "lasts": 2 * stop, "pace": 1 / stop}), 1, tmp_path)
    v, t = run.signals["v"], run.signals["t"]
    step = run.rig.sensed[0].resolution
    assert np.abs(v - np.maximum(rig.start[0] - decay * t, 0.0)).max() < 5 * step
    assert run.stuck == pytest.approx(0.5, abs=0.01)


def test_rigs_that_were_kept_are_not_travelled_again(tmp_path: Path) -> None:
    kept = tmp_path / "kept.jsonl"
    kept.write_text(json.dumps(asdict(Road(7, "cell", [], "good", {"E": 0.5}))) + "\n", encoding="utf-8")
    assert [one.kind for one in roads(range(7, 8), kept)] == ["cell"]


def test_the_table_counts_failures_by_kind() -> None:
    some = [Road(1, "cell", [], "good", {"E": 0.5}), Road(2, "cell", [], "warning", {"E": -1.5}, ["f32: bits differ"])]
    header, whole = table_of(some)
    assert header[:8] == ("cell", "2", "1", "1", "1", "0", "0", "1.00")
    assert header[8] == "0.5"
    assert whole[0] == "all"
