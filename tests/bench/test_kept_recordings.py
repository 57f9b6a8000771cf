"""Real hardware: the recordings in tests/data/recordings, identified on one part and predicted on another."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.optimize import curve_fit

from bench import recorded_rigs
from bench.recordings import KEPT, MECHANISMS, PIECES, Piece, Source, write_source
from pvid.base.errors import PvidError

NAMES = [source.name for source in KEPT]
LEAST_R2 = {"motor_generator": 0.985, "bicycle_fork": 0.995, "torso_lift": 0.94}


def source(name: str) -> Source:
    return KEPT[NAMES.index(name)]


@lru_cache
def rig(name: str) -> recorded_rigs.Rig:
    (one,) = recorded_rigs.rigs(MECHANISMS, [source(name)])
    return one


@pytest.mark.parametrize("name", NAMES)
def test_each_part_predicts_the_other_one(name: str) -> None:
    one = rig(name)
    assert recorded_rigs.missed(one) == []
    for run, estimate in ((1, one.estimates[0]), (0, one.estimates[1])):
        (match,) = one.replay(run).matches(estimate.p).values()
        assert match.r2 > LEAST_R2[name]


@pytest.mark.parametrize(
    ("name", "parameter"), [("motor_generator", "c"), ("bicycle_fork", "w2"), ("torso_lift", "c"), ("torso_lift", "W")]
)
def test_wrong_parameter_predicts_worse(name: str, parameter: str) -> None:
    one = rig(name)
    p = one.estimates[0].p.copy()
    p[one.model.p_names.index(parameter)] *= 1.3
    wrong = replace(one, estimates=(replace(one.estimates[0], p=p), one.estimates[1]))
    (match,), (right,) = wrong.predicted().values(), one.predicted().values()
    assert 1 - match.r2 > 2 * (1 - right.r2)


@pytest.mark.parametrize("name", NAMES)
def test_standard_errors_cover_the_difference_of_the_parts(name: str) -> None:
    assert (rig(name).clash() < recorded_rigs.CLASH).all()


def test_frequency_of_the_fork_is_that_of_a_fitted_sine() -> None:
    """A damped sine over the identified half: another method, another program."""
    one = rig("bicycle_fork")
    run = one.runs[0]

    def swing(t: np.ndarray, o: float, a: float, b: float, k: float, w: float) -> np.ndarray:
        return np.asarray(o + np.exp(-k * t) * (a * np.sin(w * t) + b * np.cos(w * t)))

    (*_, k, w), _ = curve_fit(swing, run.t, run.signals["v"], (0.0, 0.0, -1.0, 0.02, 3.95))
    estimate = one.estimates[0]
    assert abs(estimate.p[0] - (w**2 + k**2)) < 3 * estimate.se[0]


def test_weight_of_the_lift_is_half_way_between_its_currents_up_and_down() -> None:
    one = rig("torso_lift")
    for run, estimate in zip(one.runs, one.estimates, strict=True):
        rate, current = np.gradient(run.signals["q"], run.t), run.signals["i"]
        up, down = (float(current[sign * rate > 0.01].mean()) for sign in (1, -1))
        weight, friction, viscous = estimate.p
        assert weight == pytest.approx((up + down) / 2, abs=0.03)
        assert friction < (up - down) / 2 < friction + viscous * float(np.abs(rate).max())


@pytest.mark.parametrize("name", NAMES)
def test_origin_and_licence_stand_beside_the_pieces(name: str) -> None:
    one = source(name)
    note = (MECHANISMS / name / "PROVENANCE.md").read_text(encoding="utf-8")
    licence = (MECHANISMS / name / "LICENSE.txt").read_text(encoding="utf-8")
    assert f"{one.origin.name} {one.origin.version}" in note
    assert one.licence in note and one.note in note and one.identify.path in note
    assert one.licence.split(", ", 1)[1] in licence
    assert ("Redistribution and use" in licence) == one.licence.startswith("BSD")
    assert ("Apache License" in licence) == one.licence.startswith("Apache")


def test_pieces_are_small() -> None:
    sizes = [(MECHANISMS / name / f"{piece}.csv.gz").stat().st_size for name in NAMES for piece in PIECES]
    assert sum(sizes) < 150_000


@pytest.mark.parametrize("name", NAMES)
def test_mechanism_has_the_recorded_signals_in_ten_lines(name: str) -> None:
    one = source(name)
    assert {signal.name: signal.unit for signal in one.model().signals} == {c.name: c.unit for c in one.channels}
    text = (MECHANISMS / one.file).read_text(encoding="utf-8")
    assert len([line for line in text.splitlines() if line and not line.startswith('"')]) <= 10


def archive(tmp_path: Path, one: Source, path: str) -> Path:
    """The place of a file in the unpacked archive, its folders made."""
    place = tmp_path / one.origin.folder / path
    place.parent.mkdir(parents=True, exist_ok=True)
    return place


def test_switched_motor_is_cut_less_its_value_at_rest(tmp_path: Path) -> None:
    one = source("motor_generator")
    place = archive(tmp_path, one, one.identify.path)
    y = np.append(np.full(4000, -143.8), np.linspace(0.0, 3000.0, 2001))
    np.savetxt(place, y)
    np.savetxt(place.with_name("x_cc.csv"), np.append(np.zeros(4000), np.full(2001, 5.0)))
    cut = one.cut(tmp_path, Piece(one.identify.path, 4.0, 6.0))
    assert cut.sample_rate == pytest.approx(50.0)
    np.testing.assert_allclose(cut.signals["y"], 0.1438 + 1.5 * cut.t, atol=1e-4)
    assert set(cut.signals["u"]) == {1.0}


def test_gyroscope_is_cut_less_its_middle(tmp_path: Path) -> None:
    one = source("bicycle_fork")
    savemat(archive(tmp_path, one, one.identify.path), {"data": np.full(1000, 1.4), "ActualRate": 1000})
    cut = one.cut(tmp_path, one.identify)
    assert cut.sample_rate == pytest.approx(200.0)
    np.testing.assert_allclose(cut.signals["v"], 0.044, atol=1e-9)


def test_lift_is_cut_into_means_and_written_with_its_licence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = source("torso_lift")
    t = np.arange(7000) / 100.0
    place = archive(tmp_path, one, one.identify.path)
    np.savetxt(place, np.column_stack([t, 0.01 * t, 9 * t]), delimiter=",", header="t,torso,arm", comments="")
    efforts = np.column_stack([t, np.arange(7000) % 5, 9 * t])
    np.savetxt(place.with_name("tiago_effort.csv"), efforts, delimiter=",", header="t,torso,arm", comments="")
    archive(tmp_path, one, "LICENSE").write_text("the licence", encoding="utf-8")
    written = write_source(one, tmp_path, tmp_path / "kept")
    back = one.load(tmp_path / "kept", "predict")
    np.testing.assert_allclose(back.signals["i"], 2.0, atol=1e-4)
    np.testing.assert_allclose(np.diff(back.signals["q"]), 0.01 / 20.0, atol=1e-6)
    assert written[-1].read_text(encoding="utf-8") == "the licence"


def test_missing_archive_is_named(tmp_path: Path) -> None:
    with pytest.raises(PvidError, match=r"unpack the source archive of the Python package sysidentpy 0\.1\.9 there"):
        source("motor_generator").cut(tmp_path, source("motor_generator").identify)
