"""Recordings of other laboratories: their mechanisms, and how pieces are cut from files of their formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from bench import recordings
from bench.recordings import SOURCES, Piece, Source
from pvid.base.errors import PvidError

NAMES = [source.name for source in SOURCES]


def source(name: str) -> Source:
    return SOURCES[NAMES.index(name)]


def made(checkouts: Path, one: Source, piece: Piece) -> Path:
    """The place of the piece's file in a checkout, its folders made."""
    path = checkouts / one.origin.folder / piece.path
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


@pytest.mark.parametrize("name", NAMES)
def test_mechanism_has_the_recorded_signals_and_the_published_parameters(name: str) -> None:
    one = source(name)
    model = one.model()
    assert {signal.name: signal.unit for signal in model.signals} == {c.name: c.unit for c in one.channels}
    assert set(one.published) <= set(model.p_names)
    assert all(next(k.value for k in model.knowns if k.name == name) == value for name, value in one.knowns.items())


@pytest.mark.parametrize("name", NAMES)
def test_two_pieces_differ_and_the_licence_permits_use(name: str) -> None:
    one = source(name)
    assert one.identify != one.predict
    assert one.licence.startswith(("MIT", "BSD"))
    assert len(one.origin.commit) == 40


def test_table_is_cut_onto_an_even_clock(tmp_path: Path) -> None:
    """Rows with a time that does not grow are left out; the rest is read between the samples."""
    one = source("simple_pendulum")
    t = np.array([0.0, 0.005, 0.005, 0.011, 0.015, 0.020, 0.025])
    rows = [f"{a},{2 * a},{9.0},{1 - a}" for a in t]
    rows[2] = "0.005,77,9.0,77"
    path = made(tmp_path, one, one.identify)
    path.write_text("\n".join(["time,position,velocity,torque", *rows]), encoding="utf-8")
    cut = one.cut(tmp_path, one.identify)
    np.testing.assert_allclose(cut.t, 0.005 * np.arange(6), atol=1e-12)
    np.testing.assert_allclose(cut.signals["q"], 2 * cut.t, atol=1e-6)
    np.testing.assert_allclose(cut.signals["tau"], 1 - cut.t, atol=1e-4)


def test_pieces_of_one_swing_are_joined(tmp_path: Path) -> None:
    one = source("free_pendulum")
    t = 0.001 * np.arange(40)
    halves = (t[:20], t[20:])
    pieces = np.empty(2, dtype=object)
    times = np.empty(2, dtype=object)
    for k, part in enumerate(halves):
        times[k], pieces[k] = part, np.vstack([np.cos(part), -np.sin(part)])
    content = {"Time_id": times, "Y_id": pieces, "Time_vad": times, "Y_vad": pieces}
    savemat(made(tmp_path, one, one.identify), content)
    cut = one.cut(tmp_path, one.identify)
    assert list(cut.signals) == ["q"]
    np.testing.assert_allclose(cut.signals["q"], np.cos(t), atol=1e-6)


def test_charge_of_a_discharge_is_counted_from_its_start(tmp_path: Path) -> None:
    one = source("cell_dmegc")
    kind = [("t", "O"), ("I", "O"), ("V", "O")]
    runs = np.empty(26, dtype=kind)
    for k in range(26):
        runs[k] = (10.0 * np.arange(12), np.full(12, 2.0), np.full(12, 4.0 - 0.01 * k))
    savemat(made(tmp_path, one, one.identify), {"rw_data": runs})
    cut = one.cut(tmp_path, one.identify)
    np.testing.assert_allclose(cut.signals["q"], 2.0 * cut.t)
    np.testing.assert_allclose(cut.signals["v"], 4.0 - 0.01 * one.identify.part)


def test_missing_checkout_is_named(tmp_path: Path) -> None:
    with pytest.raises(PvidError, match="check out dynamicslab/MultiArm-Pendulum at e99a7e1"):
        source("free_pendulum").cut(tmp_path, source("free_pendulum").identify)


def test_piece_is_read_back_as_it_was_cut(tmp_path: Path) -> None:
    one = source("simple_pendulum")
    t = 0.004 * np.arange(60)
    rows = [f"{a:.6f},{np.sin(a):.9f},0,{np.cos(a):.9f}" for a in t]
    for piece in one.pieces.values():
        made(tmp_path, one, piece).write_text("\n".join(["time,position,velocity,torque", *rows]), encoding="utf-8")
    written = recordings.write_source(one, tmp_path, tmp_path / "cut")
    cut, back = one.cut(tmp_path, one.predict), one.load(tmp_path / "cut", "predict")
    np.testing.assert_array_equal(back.signals["q"], cut.signals["q"])
    assert back.sample_rate == pytest.approx(250.0)
    note = written[-1].read_text(encoding="utf-8")
    assert note.startswith("# simple_pendulum\n")
    assert all(word in note for word in (str(one.origin), one.licence, one.identify.path, "tau [N*m] torque"))
