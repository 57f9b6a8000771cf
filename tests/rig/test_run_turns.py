"""An encoder that starts over after a turn: joined and told; nothing else is changed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from pvid.base.errors import PvidError
from pvid.rig.run import read_run
from pvid.rig.turns import joined

Float = npt.NDArray[np.float64]

TURN = 2 * np.pi
LSB = TURN / 4096
T = np.arange(3000) / 500
NOISE = np.random.default_rng(1).integers(-1, 2, T.size)
SWING: Float = np.float64(LSB) * (np.rint(0.1 * np.sin(15 * T) / LSB) + NOISE)


@pytest.mark.parametrize("rest", [0.0, 0.05, np.pi, -2.0])
@pytest.mark.parametrize("first", [0.0, -np.pi, 0.04])
def test_turns_are_joined_to_the_angle_as_it_was(rest: float, first: float) -> None:
    angle = SWING + LSB * round(rest / LSB)
    phi: Float = (angle - first) % TURN + first
    got, jumps = joined(phi)
    assert jumps == np.count_nonzero(np.abs(np.diff(phi)) > 3)
    expected = angle - TURN * np.rint(np.median(angle) / TURN)
    if jumps:
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12)
    else:
        assert got is phi


def test_missing_samples_stay_missing() -> None:
    phi: Float = SWING % TURN
    phi[::50] = np.nan
    got, jumps = joined(phi)
    assert jumps > 0 and np.isnan(got[::50]).all()
    there = np.isfinite(phi)
    np.testing.assert_allclose(got[there], SWING[there], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "phi",
    [
        60 * np.sin(15 * T),  # degrees, steps of up to 1.8
        400 * np.sin(15 * T),  # steps of a turn among others
        np.where(T == T[500], 5.0, SWING),  # one wrong sample
        np.where(T > 3, SWING + 6.0, SWING),  # an encoder that slipped, by no turn
        np.random.default_rng(2).uniform(0, TURN, T.size),
        10 * T,  # a rotation that is counted
        np.r_[np.zeros(20), 6.2, np.zeros(20)],  # too few to say
    ],
)
def test_nothing_else_is_joined(phi: Float) -> None:
    before = phi.copy()
    got, jumps = joined(phi)
    assert jumps == 0 and got is phi
    np.testing.assert_array_equal(phi, before)


def test_run_of_wrapping_counts_is_read_with_a_note(tmp_path: Path) -> None:
    from pvid.rig.columns import Columns

    counts = np.rint(SWING / LSB).astype(int) % 4096
    path = tmp_path / "run.csv"
    path.write_text("t,count,y\n" + "".join(f"{t:.3f},{c},0.1\n" for t, c in zip(T, counts, strict=True)))
    run = read_run(path, columns=Columns.parse("phi=count:rev/4096"))
    np.testing.assert_allclose(run.phi, SWING, rtol=0, atol=1e-12)
    assert len(run.notes) == 1 and "count jumps by a turn" in run.notes[0]


@pytest.mark.parametrize(("unit", "scale"), [("us", 1e6), ("ns", 1e9)])
def test_clock_in_another_unit_is_reported_with_its_option(unit: str, scale: float, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t,phi,y\n" + "".join(f"{t * scale:.0f},{p},0.1\n" for t, p in zip(T, SWING, strict=True)))
    with pytest.raises(PvidError, match=f"t looks like {unit}: use --columns t=t:{unit}"):
        read_run(path)
