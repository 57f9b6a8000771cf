"""Test functions as sums of exponentials, half-window sums, running integrals and located reversals, by brute force."""

import gc
import weakref

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import quad

from pvid.oracle.weak import reversals
from pvid.oracle.weak.channels import running_integrals
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.functions import Float, TestFunctions
from pvid.oracle.weak.whitener import Whitener, holders, inverse_of_lower

FUNCTIONS = TestFunctions(count=13, power=6, hop=50, dt=0.01)
T = FUNCTIONS.dt * np.arange(2 * FUNCTIONS.hop)


def values(functions: TestFunctions, order: int) -> npt.NDArray[np.float64]:
    """chi^(order) at the samples 0..2 hop - 1 [2 hop, K]."""
    turns = np.exp(1j * functions.dt * np.outer(np.arange(2 * functions.hop), functions.rates))
    return np.asarray(np.real((turns * (1j * functions.rates) ** order) @ functions.coefficients))


def test_functions_are_powers_of_a_sine_times_harmonics() -> None:
    x = T / FUNCTIONS.length
    bell = np.sin(np.pi * x) ** 6
    chi = values(FUNCTIONS, 0)
    assert np.allclose(chi[:, 0], bell, atol=1e-14)
    assert np.allclose(chi[:, 3], bell * np.cos(4 * np.pi * (x - 0.5)), atol=1e-14)
    assert np.allclose(chi[:, 4], bell * np.sin(4 * np.pi * (x - 0.5)), atol=1e-14)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_each_order_is_the_derivative_of_the_one_before(order: int) -> None:
    fine = TestFunctions(13, 6, 5000, 1e-4)
    slope = np.gradient(values(fine, order - 1), fine.dt, axis=0)[1:-1]
    assert np.allclose(slope, values(fine, order)[1:-1], atol=1e-4 * np.max(np.abs(slope)))  # of differences


@pytest.mark.parametrize("order", range(5))
def test_half_window_sums_give_the_direct_sums(order: int) -> None:
    x = np.random.default_rng(order).normal(size=4 * FUNCTIONS.hop + 7)
    halves = FUNCTIONS.half_sums(FUNCTIONS.halves(x))
    rows = FUNCTIONS.joined(halves[:-1], halves[1:]) @ FUNCTIONS.combine(order)
    assert rows.shape == (3, 13)
    for window, row in enumerate(rows):
        own = x[window * FUNCTIONS.hop :][: 2 * FUNCTIONS.hop]
        assert np.allclose(row, own @ values(FUNCTIONS, order), atol=1e-12 * np.max(np.abs(row)))


@pytest.mark.parametrize("first", range(5))
@pytest.mark.parametrize("second", range(5))
def test_gram_by_harmonics_is_the_sum_over_the_samples(first: int, second: int) -> None:
    want = values(FUNCTIONS, first).T @ values(FUNCTIONS, second)
    assert np.allclose(FUNCTIONS.gram(first, second), want, atol=1e-13 * np.max(np.abs(want)) + 1e-12)


def test_overlap_is_the_covariance_of_neighbours() -> None:
    noise = np.zeros(3 * FUNCTIONS.hop)
    total = np.zeros((13, 13))
    for place in range(noise.size):
        noise[:] = 0.0
        noise[place] = 1.0
        earlier, later = (
            noise[: 2 * FUNCTIONS.hop] @ values(FUNCTIONS, 2),
            noise[FUNCTIONS.hop :] @ values(FUNCTIONS, 0),
        )
        total += np.outer(earlier, later)
    assert np.allclose(FUNCTIONS.overlap(2, 0), total, atol=1e-12 * np.max(np.abs(total)))


@pytest.mark.parametrize("fold", [1, 2, 3])
def test_running_integrals_restart_at_every_half(fold: int) -> None:
    dt, hop = 0.01, 50
    t = dt * np.arange(3 * hop)
    got = running_integrals(np.cos(5 * t), hop, fold, dt)[fold]
    for half in range(3):
        start = dt * hop * half
        s = dt * np.arange(hop + 1)
        exact = {
            1: (np.sin(5 * (start + s)) - np.sin(5 * start)) / 5,
            2: (np.cos(5 * start) - np.cos(5 * (start + s))) / 25 - s * np.sin(5 * start) / 5,
        }
        exact[3] = (
            np.cos(5 * start) * s / 25
            - (np.sin(5 * (start + s)) - np.sin(5 * start)) / 125
            - s**2 / 2 * np.sin(5 * start) / 5
        )
        # dt^4 of the rules; the run's last sample has no neighbour.
        assert np.allclose(got[half][:-1], exact[fold][:-1], atol=2e-6)


@pytest.mark.parametrize("at", [30.0, 30.3, 30.77, 31.999])
@pytest.mark.parametrize("harmonic", [0, 1, 4])
def test_corrected_steps_sum_to_the_exact_integral_of_a_sign(at: float, harmonic: int) -> None:
    def g(place: float) -> float:
        return float(np.sin(np.pi * place / 100) ** 6 * np.cos(2 * np.pi * harmonic * (place / 100 - 0.5)))

    k = int(at)
    values = np.where(np.arange(100) <= k, -1.0, 1.0)
    values[k - 1 : k + 3] += reversals.correction(np.array(at - k))
    exact = quad(g, at, 100, limit=200)[0] - quad(g, 0, at, limit=200)[0]
    plain = float(np.where(np.arange(100) < at, -1.0, 1.0) @ [g(j) for j in range(100)])
    got = float(values @ [g(j) for j in range(100)])
    # The correction is exact for cubics; what is left is the fourth power of 2 pi harmonic / 100.
    assert abs(got - exact) < 5e-5
    assert abs(got - exact) < abs(plain - exact) / 100


def kinked(t0: float, n: int = 400) -> npt.NDArray[np.float64]:
    """A position whose acceleration changes from -3 to -5 when its velocity changes sign at sample t0."""
    s = np.arange(n) - t0
    return np.asarray(np.where(s < 0, -1.5, -2.5) * s**2 * 1e-4)


@pytest.mark.parametrize("t0", [199.6, 200.0, 200.41])
def test_a_reversal_with_a_jump_of_acceleration_is_located(t0: float) -> None:
    x = kinked(t0)
    v = np.asarray(np.gradient(x), np.float64)
    signs = reversals.located(v, 1e-9, np.zeros(v.shape), 5, reversals.Position(x, np.arange(x.size), half=10, sd=1e-9))
    assert signs.reversals == 1 and not signs.stuck.any()
    assert abs(signs.times[0] - t0) < 1e-3
    assert np.all(signs.values[:190] == 1.0) and np.all(signs.values[210:] == -1.0)


def test_a_reversal_is_refined_once_from_each_start(monkeypatch: pytest.MonkeyPatch) -> None:
    x = kinked(200.41) + np.random.default_rng(0).normal(0, 2e-4, 400)
    position, once = reversals.Position(x, np.arange(x.size), half=15, sd=2e-4), reversals.refined
    searched: list[float] = []

    def counted(position: Float, start: Float, half: int, sd: float) -> tuple[Float, Float]:
        searched.extend(start.tolist())
        return once(position, start, half, sd)

    monkeypatch.setattr(reversals, "refined", counted)
    for starts in ([200.0, 201.0], [199.0, 201.0, 200.0], [201.0]):
        own = np.array(starts)
        assert np.array_equal(position.refined(own), once(x, own, 15, 2e-4), equal_nan=True)
    assert sorted(searched) == [199.0, 200.0, 201.0]


def test_the_variance_of_a_located_time_is_that_of_its_error() -> None:
    rng = np.random.default_rng(0)
    sd, errors, variances = 2e-4, [], []
    for _ in range(200):
        t0 = 200 + rng.uniform(-0.5, 0.5)
        time, variance = reversals.refined(kinked(t0) + rng.normal(0, sd, 400), np.array([round(t0)]) + 0.0, 15, sd)
        errors.append(time[0] - t0)
        variances.append(variance[0])
    kept = np.isfinite(variances)
    assert kept.mean() > 0.9
    assert np.sqrt(np.mean(np.square(errors)[kept]) / np.mean(np.array(variances)[kept])) == pytest.approx(
        1.0, abs=0.25
    )


def test_a_velocity_that_only_touches_zero_keeps_its_sign_and_is_in_doubt() -> None:
    v = np.asarray((np.arange(100) - 50.0) ** 2 * 1e-3, np.float64)
    signs = reversals.located(v, 3e-3, np.zeros(100), 10)
    assert signs.reversals == 0 and len(signs.times) == 1
    assert np.all(signs.values == 1.0)
    assert signs.times[0] == pytest.approx(50.0)


def test_sticking_is_cut_into_pieces_of_unknown_sign() -> None:
    v = np.concatenate([np.linspace(1, 0, 50), np.zeros(40), np.linspace(0, 1, 50)])
    signs = reversals.located(v, 1e-3, np.zeros(v.size), 8)
    assert signs.stuck[50:90].all() and not signs.stuck[:45].any()
    assert np.all(signs.values[signs.stuck] == 1.0)  # from + to +
    turned = reversals.located(np.sign(np.arange(v.size) - 70) * v, 1e-3, np.zeros(v.size), 8)
    assert turned.stuck[50:90].all() and np.all(np.diff(turned.values[turned.stuck]) > 0)  # from - to +
    assert len(signs.times) == 6 and np.all(np.diff(signs.times) <= 8)


def test_designs_that_are_kept_do_not_keep_their_tables() -> None:
    """A search keeps the scores of thousands of designs; the tables of one may be megabytes."""
    designs = [WeakDesign(sample_rate=997.0, window_s=1.0 + 0.1 * k, functions=8) for k in range(40)]
    tables = [weakref.ref(one.test_functions) for one in designs]
    gc.collect()
    assert sum(one() is not None for one in tables) <= 16
    assert designs[-1].test_functions is designs[-1].test_functions


def test_more_directions_than_rows_whiten_as_the_sum_of_their_covariances_does() -> None:
    """A friction that sticks has more doubts in a window than the window has rows."""
    rng = np.random.default_rng(5)
    windows, rows, directions = 3, 6, 25
    root = rng.normal(size=(rows, rows))
    covariance, u = root @ root.T + np.eye(rows), rng.normal(size=(windows, directions, rows))
    held = holders(np.repeat(np.arange(windows), directions), np.arange(windows * directions))
    whitener = Whitener.of_covariance(covariance, windows, u.reshape(-1, rows), held)
    whole = [covariance + one.T @ one for one in u]
    x = rng.normal(size=(windows, 2, rows))
    for place, (one, white) in enumerate(zip(whole, whitener.of(x), strict=True)):
        assert white @ white.T == pytest.approx(x[place] @ np.linalg.inv(one) @ x[place].T, rel=1e-9, abs=1e-9)
    expected = np.concatenate([direction @ np.linalg.inv(one) for direction, one in zip(u, whole, strict=True)])
    entries, found = whitener.inverse_of_directions()
    assert found == pytest.approx(expected[entries], rel=1e-8, abs=1e-9)
    assert sorted(entries) == list(range(windows * directions))
    assert whitener.total_inverse() == pytest.approx(sum(map(np.linalg.inv, whole)), rel=1e-9)
    assert whitener.log_determinant() == pytest.approx(sum(np.linalg.slogdet(one)[1] for one in whole))


def test_windows_are_whitened_at_the_cost_of_their_own_directions() -> None:
    """Most windows of a run hold few reversals, and one holds many."""
    rng = np.random.default_rng(6)
    windows, rows = 60, 20
    counts = np.where(np.arange(windows) == 7, 16, np.arange(windows) % 3)
    numbers = np.repeat(np.arange(windows), counts)
    u = rng.normal(size=(counts.sum() + 3, rows))  # the first three stand in no window
    whitener = Whitener.of_covariance(np.eye(rows), windows, u, holders(numbers, 3 + np.arange(counts.sum())))
    assert sum(one.v.size for one in whitener.alike) <= 2 * rows * counts.sum()
    whole = [np.eye(rows) + one.T @ one for one in (u[3:][numbers == window] for window in range(windows))]
    assert whitener.total_inverse() == pytest.approx(sum(map(np.linalg.inv, whole)), rel=1e-9)
    x = rng.normal(size=(windows, 2, rows))
    some = whitener.only(slice(5, 40))
    white = some.of(x[5:40])
    for place, one in enumerate(whole[5:40]):
        assert white[place] @ white[place].T == pytest.approx(x[5 + place] @ np.linalg.inv(one) @ x[5 + place].T)
    for one, other in zip(some.inverse_of_directions(), whitener.inverse_of_directions(), strict=True):
        assert len(one) == counts[5:40].sum()
        assert {*np.ravel(one)} <= {*np.ravel(other)}
    assert some.log_determinant() == pytest.approx(sum(np.linalg.slogdet(one)[1] for one in whole[5:40]))


def test_reversals_near_each_other_are_written_in_their_order() -> None:
    """Of a velocity that chatters: a later one replaces the signs and corrections of earlier ones around it."""
    rng = np.random.default_rng(3)
    v = rng.normal(size=300) * np.repeat(rng.uniform(0.02, 1.0, 30), 10)
    got = reversals.located(v, 0.05, np.zeros(v.size), 6)
    stretches = reversals.in_doubt(v, 3 * 0.05 + np.zeros(v.size))
    turns = [(i, j) for i, j in stretches if 0 < i and j < v.size and j - i <= 6 and v[i - 1] * v[j] < 0]
    assert len(turns) == got.reversals > 40
    values = got.values.copy()
    for i, j in turns:
        values[i:j] = 0.0
    values[~got.stuck & (values != 0)] = np.sign(v)[~got.stuck & (values != 0)]
    for i, j in stretches:
        if 0 < i and j < v.size and v[i - 1] * v[j] > 0 and j - i <= 6:
            values[i:j] = np.sign(v[j])
    for i, j in turns:
        t, up, span = reversals.zeros_between(v, np.array([i]), np.array([j]))[0], np.sign(v[j]), j - i + 1
        for step in range(max(int(t - span) - 2, 0), min(int(t + span) + 3, v.size)):
            if not got.stuck[step] and (values[step] == 0 or abs(step - t) <= span):
                values[step] = -up if step <= t else up
        if 1 <= int(t) < v.size - 2:
            values[int(t) - 1 : int(t) + 3] += up * reversals.correction(np.array(t % 1))
    assert got.values[~got.stuck] == pytest.approx(values[~got.stuck], abs=1e-12)


@pytest.mark.parametrize("n", [1, 8, 9, 41])
def test_inverses_of_lower_triangles_by_halves(n: int) -> None:
    k = np.tril(np.random.default_rng(n).normal(size=(3, n, n))) + 3 * np.eye(n)
    assert inverse_of_lower(k) @ k == pytest.approx(np.broadcast_to(np.eye(n), k.shape), abs=1e-9)


@pytest.mark.parametrize("gap", [1, 2, 7])
def test_the_zero_of_a_doubtful_stretch_is_that_of_its_least_squares_line(gap: int) -> None:
    v = np.linspace(-1.0, 1.5, gap + 2) + 0.1 * np.random.default_rng(gap).normal(size=gap + 2)
    slope, level = np.polyfit(np.arange(gap + 2), v, 1)
    assert reversals.zeros_between(v, np.array([1]), np.array([gap + 1])) == pytest.approx([-level / slope])
