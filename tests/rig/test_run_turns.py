"""An encoder that starts over after a turn: joined and told; nothing else is changed."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from pendulum_run import read_run

from pvid.base.errors import PvidError
from pvid.rig.turns import counted_on, joined

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
    assert counted_on(phi, 1.0) is None and counted_on(np.rint(phi / LSB), 1.0) is None
    np.testing.assert_array_equal(phi, before)


COUNTS: Float = np.rint(np.cumsum(90 + 60 * np.sin(3 * T)) + 0.5 * np.random.default_rng(3).standard_normal(T.size))


@pytest.mark.parametrize("modulus", [4096, 65536, 20_000, 36_000, 30_011])
@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("unit", [1.0, 1.3e-5])
def test_counter_of_any_modulus_is_joined(modulus: int, signed: bool, unit: float) -> None:
    low = -(modulus // 2) if signed else 0
    x = ((COUNTS - low) % modulus + low) * unit
    found = counted_on(x, 1.0)
    assert found is not None
    assert found.modulus == pytest.approx(modulus * unit, abs=1.01 * unit)
    assert found.jumps == np.count_nonzero(np.abs(np.diff(x)) > modulus * unit / 2)
    moved = found.values / unit - COUNTS
    assert np.ptp(moved) < 1e-6 + abs(found.modulus / unit - modulus) * found.jumps


def test_single_wrap_is_joined_only_of_a_word() -> None:
    whole = np.rint(np.cumsum(np.full(1200, 60.0)))
    found = counted_on(whole % 2**16, 1.0)
    assert found is not None and found.modulus == 2**16 and found.jumps == 1
    assert counted_on(whole % 50_000, 1.0) is None


def test_counter_is_joined_beside_wild_samples() -> None:
    x = COUNTS % 2**16
    places = np.random.default_rng(4).choice(T.size - 20, 12, replace=False) + 10
    x[places] = 0.0
    found = counted_on(x, 1.0)
    assert found is not None and found.modulus == 2**16
    sound = np.setdiff1d(np.arange(T.size), places)
    assert np.ptp((found.values - COUNTS)[sound]) < 1e-6


def test_encoder_that_is_zeroed_on_the_way_is_not_joined() -> None:
    x = COUNTS - COUNTS[0]
    x[1000:] -= x[1000]
    x[2100:] -= x[2100]
    assert counted_on(x, 1.0) is None


def test_run_of_wrapping_counts_is_read_with_a_note(tmp_path: Path) -> None:

    counts = np.rint(SWING / LSB).astype(int) % 4096
    path = tmp_path / "run.csv"
    path.write_text("t,count,y\n" + "".join(f"{t:.3f},{c},0.1\n" for t, c in zip(T, counts, strict=True)))
    run = read_run(path, text="phi=count:rev/4096")
    np.testing.assert_allclose(run.phi, SWING, rtol=0, atol=1e-12)
    assert len(run.notes) == 1 and "count jumps by a turn" in run.notes[0]


@pytest.mark.parametrize(("unit", "scale"), [("us", 1e6), ("ns", 1e9)])
def test_clock_in_another_unit_is_reported_with_its_option(unit: str, scale: float, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t,phi,y\n" + "".join(f"{t * scale:.0f},{p},0.1\n" for t, p in zip(T, SWING, strict=True)))
    with pytest.raises(PvidError, match=f"t looks like {unit}: use --columns t=t:{unit}"):
        read_run(path)
