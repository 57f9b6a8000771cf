"""The longevity bench in its short form: every disturbance, every forgetting. The long one: `pvid bench longevity`."""

from __future__ import annotations

import ctypes
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pvid import replay_image
from pvid.bench import longevity, longevity_target
from pvid.bench.longevity import (
    ENCODER,
    LANES,
    STRONG_FORGETTING_S,
    STRONG_LANES,
    WEAK_FORGETTING_S,
    WEAK_LANES,
    Lane,
    Outcome,
)
from pvid.bench.longevity_signals import RATE_HZ, SCENARIOS, Signals
from pvid.boards import board
from pvid.compare import first_difference
from pvid.errors import PvidError
from pvid.native import Native, Reason
from pvid.rig import Sensors, simulate
from pvid.rigfile import RigFile
from pvid.setup import strong_config, weak_config
from pvid.twin.strong import StrongTwin
from pvid.twin.weak import WeakTwin

TICKS = 100_000
TWIN_TICKS = {"weak": 25_000, "strong": 6_000}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return longevity.build_library(tmp_path_factory.mktemp("longevity"))


@pytest.fixture(scope="module")
def outcomes(native: Native, library: ctypes.CDLL) -> dict[str, dict[str, Outcome]]:
    return {name: longevity.measure(native, library, name, LANES, TICKS) for name in SCENARIOS}


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_nothing_of_ours_is_ever_not_finite(scenario: str, outcomes: dict[str, dict[str, Outcome]]) -> None:
    for lane in LANES:
        outcome = outcomes[scenario][lane.label]
        if lane.kind in ("weak", "strong"):
            assert (outcome.ticks, outcome.not_finite, outcome.singular) == (TICKS, 0, 0), lane.label


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_nothing_of_ours_is_ever_silently_wrong(scenario: str, outcomes: dict[str, dict[str, Outcome]]) -> None:
    # with the gate and without it
    for lane in (*WEAK_LANES, *STRONG_LANES):
        assert not outcomes[scenario][lane.label].silent, lane.label


# What passes and leaves the mechanism as it was: right again, or never wrong, and no alarm is left standing.
OVER = ("perfect", "absent", "constant", "one tone", "switching", "dropped samples")


@pytest.mark.parametrize("scenario", OVER)
def test_what_is_over_is_over(scenario: str, outcomes: dict[str, dict[str, Outcome]]) -> None:
    for lane in (lane for lane in (*WEAK_LANES, *STRONG_LANES) if lane.gated):
        outcome = outcomes[scenario][lane.label]
        assert outcome.told == Reason.UPDATED.text, lane.label
        assert outcome.errors <= longevity.BACK, lane.label
        assert abs(outcome.error_after) < (0.03 if lane.kind == "weak" else 0.2), lane.label


@pytest.mark.parametrize("scenario", ["stuck sensor", "saturated sensor", "sensor wrap", "outliers", "slipping clock"])
def test_sums_that_never_forget_survive_a_bad_sensor(scenario: str, outcomes: dict[str, dict[str, Outcome]]) -> None:
    # 0.18 % with the slipping clock, whose windows differ too little from the usual; alarm
    for lane in (Lane("weak", 0.0), Lane("strong", 0.0)):
        outcome = outcomes[scenario][lane.label]
        assert outcome.errors <= longevity.BACK
        assert abs(outcome.error_after) < 0.3
        assert outcome.told in (Reason.UPDATED.text, Reason.MISFIT.text)
        assert {Reason.REJECTED_OUTLIER.text, Reason.MISFIT.text} & outcome.disturbed.keys()


@pytest.mark.parametrize("scenario", ["step", "drift"])
@pytest.mark.parametrize("lane", ["weak, 10 s", "strong, 0.1 s", "strong, 1 s", "strong, 10 s"])
def test_forgetting_follows_a_parameter(lane: str, scenario: str, outcomes: dict[str, dict[str, Outcome]]) -> None:
    # 80 s after the step and 40 s after the end of the drift: four time constants and more
    outcome = outcomes[scenario][lane]
    assert outcome.errors <= longevity.BACK
    assert abs(outcome.error_after) < 1.0


@pytest.mark.parametrize("scenario", ["step", "drift"])
@pytest.mark.parametrize("kind", ["weak", "strong"])
def test_sums_that_never_forget_say_that_they_cannot_follow(
    kind: str, scenario: str, outcomes: dict[str, dict[str, Outcome]]
) -> None:
    outcome = outcomes[scenario][Lane(kind, 0.0).label]
    assert abs(outcome.error_after) > 3.0
    assert outcome.told != Reason.UPDATED.text


def test_the_baselines_die_where_ours_lives(outcomes: dict[str, dict[str, Outcome]]) -> None:
    # without excitation their covariance grows by 1 / lambda a tick until float32 ends
    for kind in longevity.PEERS:
        for scenario in ("absent", "constant", "stuck sensor"):
            assert outcomes[scenario][f"{kind}, 0.1 s"].ticks < TICKS // 2, (kind, scenario)
        assert abs(outcomes["perfect"][f"{kind}, none"].error_after) < 1.0, "the baseline itself is sound"


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_weak_form_equals_its_twin(scenario: str, native: Native, library: ctypes.CDLL) -> None:
    phi, y = samples(library, scenario, "weak")
    config = weak_config(RigFile.standard(), RATE_HZ)
    lanes = [replace(config.estimator, forgetting_s=tau) for tau in WEAK_FORGETTING_S]
    expected = WeakTwin(config, lanes).run(phi, y)
    for lane, estimator in enumerate(lanes):
        record = native.weak(replace(config, estimator=estimator)).run(phi, y, hashes=False)
        theirs = (expected.p[:, :, lane], expected.sums[:, :, lane], expected.reason[:, lane])
        assert first_difference(record, *theirs, expected.published[:, :, lane]) is None


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_strong_form_equals_its_twin(scenario: str, native: Native, library: ctypes.CDLL) -> None:
    phi, y = samples(library, scenario, "strong")
    rig = RigFile.standard()
    settings = replace(rig.identifier, form="strong", stride=longevity.STRIDE)
    config = strong_config(replace(rig, identifier=settings), RATE_HZ)
    lanes = [replace(config.estimator, forgetting_s=tau) for tau in STRONG_FORGETTING_S]
    expected = StrongTwin(config, lanes).run(phi, y)
    for lane, estimator in enumerate(lanes):
        record = native.strong(replace(config, estimator=estimator)).run(phi, y, hashes=False)
        theirs = (expected.p[:, :, lane], expected.sums[:, :, lane], expected.reason[:, lane])
        assert first_difference(record, *theirs) is None


def samples(library: ctypes.CDLL, scenario: str, kind: str) -> tuple[np.ndarray, np.ndarray]:
    chunks = list(Signals(library, scenario, TWIN_TICKS[kind], ENCODER).chunks())
    return np.concatenate([phi for phi, _ in chunks]), np.concatenate([y for _, y in chunks])


# ---- the bench itself ----


def test_the_motion_is_that_of_the_rig(library: ctypes.CDLL) -> None:
    # the simulator integrates the same equations with error control
    sensing = replace(ENCODER, phi_lsb=0.0, y_lsb=0.0, zero=0.0)
    phi, y = next(iter(Signals(library, "perfect", 50_000, sensing).chunks()))
    run = simulate(sensors=Sensors(), truth="linear", duration=len(phi) / RATE_HZ, seed=1).run
    n = min(len(phi), len(run.phi))
    assert np.abs(phi[:n] - run.phi[:n]).max() < 1e-7
    assert np.abs(y[:n] - run.y[:n]).max() < 1e-12


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_disturbance_begins_and_ends(scenario: str, library: ctypes.CDLL) -> None:
    whole = [Signals(library, name, 50_000, replace(ENCODER, phi_lsb=0.0, y_lsb=0.0)) for name in ("perfect", scenario)]
    same = []
    for signals in whole:
        chunks = list(signals.chunks())
        same.append([np.concatenate([chunk[i] for chunk in chunks]) for i in (0, 1)])
    differs = np.zeros(50_000, bool)
    for one, other in zip(*same, strict=True):
        differs |= ~((one == other) | (np.isnan(one) & np.isnan(other)))
    assert not differs[: whole[0].first].any()
    assert (scenario == "perfect") == (not differs.any())


def test_results_are_kept_for_the_same_core_alone(tmp_path: Path) -> None:
    place = tmp_path / "longevity.json"
    assert longevity.load(place) == {}
    longevity.save({"perfect": {"ticks": 7, "lanes": {}}}, place)
    assert longevity.load(place) == {"perfect": {"ticks": 7, "lanes": {}}}
    stored = json.loads(place.read_text())
    place.write_text(json.dumps(stored | {"core": "another"}))
    assert longevity.load(place) == {}


def test_wrong_answers_without_a_word_are_called_silent() -> None:
    assert Outcome(told="updated", errors=4.0).silent
    assert Outcome(told="updated", errors=float("nan")).silent
    assert not Outcome(told="updated", errors=2.0).silent
    assert not Outcome(told="misfit", errors=40.0).silent


def test_an_error_is_charged_beyond_the_filter_s_own() -> None:
    assert longevity.FILTER_BIAS["weak"] == (0.0, 0.0, 0.0)
    assert max(longevity.FILTER_BIAS["strong"]) < 0.005


def test_two_processes_do_what_one_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(longevity, "RESULTS", tmp_path / "longevity.json")
    monkeypatch.setattr(longevity, "LANES", (Lane("weak", 0.0), Lane("RLS", 1.0)))
    told: list[int] = []
    names = ("perfect", "absent")
    found = longevity.run_missing(50_000, names, tmp_path, 2, told.append)
    assert told == [0, 1, 2]
    again = longevity.run_missing(50_000, names, tmp_path, 1, told.append)
    assert told[3:] == [2]
    assert json.dumps(again, sort_keys=True) == json.dumps(found, sort_keys=True)
    library = longevity.build_library(tmp_path)
    alone = longevity.measure(Native(), library, "absent", longevity.LANES, 50_000)
    assert found["absent"]["lanes"]["weak, none"]["error_after"] == alone["weak, none"].error_after


# ---- on a board ----


@pytest.mark.parametrize(("scenario", "form"), [("dropped samples", "weak"), ("step", "strong")])
def test_a_board_has_the_host_s_hashes(
    scenario: str, form: str, library: ctypes.CDLL, native: Native, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the long runs' way: samples in a file that the assembler takes in
    monkeypatch.setattr(replay_image, "MANY_TICKS", 10_000)
    found = longevity_target.measure_on(board("mps2-an386"), library, native, scenario, form, 20_000)
    assert (found.ticks, found.compared, found.differs_at) == (20_000, 40, None)
    assert found.cells[-1] == "equal"


def test_counts_are_the_samples(library: ctypes.CDLL) -> None:
    run = longevity_target.run_of(library, "dropped samples", "weak", 40_000)
    missing = run.counts[:, 0] == replay_image.MISSING
    assert missing.any()
    assert np.array_equal(missing, np.isnan(run.phi))
    assert np.array_equal(missing, np.isnan(run.y))
    phi = np.concatenate([phi for phi, _ in Signals(library, "dropped samples", 40_000, ENCODER).chunks()])
    assert np.array_equal(run.counts[~missing, 0], np.rint(phi[~missing] / np.float64(run.phi_lsb)))


def test_what_does_not_fit_a_count_is_left_out_and_refused(library: ctypes.CDLL) -> None:
    assert ("sensor wrap", "strong") not in longevity_target.combinations(tuple(SCENARIOS))
    assert len(longevity_target.combinations(tuple(SCENARIOS))) == 2 * len(SCENARIOS) - 1
    with pytest.raises(PvidError, match='"sensor wrap" does not fit 16-bit counts'):
        longevity_target.run_of(library, "sensor wrap", "strong", 40_000)


def test_a_hash_that_differs_is_named() -> None:
    one = longevity_target.OnBoard("mps2-an386", "perfect", "weak", 1000, 1, 2, 1000)
    assert one.cells[-1] == "DIFFERENT within the 500 before 1000"


def test_the_long_columns_are_kept_beside_the_others() -> None:
    lanes = {lane.label: vars(Outcome(ticks=7, told="updated", errors=1.0, error_after=0.5)) for lane in LANES}
    kept = {"perfect": {"ticks": 7, "lanes": lanes}, "step" + longevity.LONG: {"ticks": 10**7, "lanes": lanes}}
    found = {marker: (header, rows) for marker, header, rows in longevity.tables(kept)}
    header, rows = found["longevity-long"]
    assert header == ("disturbance", "ticks", "weak, 10 s", "weak, none", "strong, 1 s", "strong, none")
    assert rows == [(f"step: {SCENARIOS['step']}", "1e7", "0.5 %", "0.5 %", "0.5 %", "0.5 %")]
    assert [len(found[marker][1]) for marker in ("longevity-weak", "longevity-strong", "longevity-peers")] == [1, 1, 1]
