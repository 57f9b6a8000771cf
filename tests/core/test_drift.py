"""Parameters that drift along given directions alone: the C core against the batch problem that it stands for, and a
motor whose winding heats."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

import pvid
from pvid.base.errors import PvidError

Float = npt.NDArray[np.float64]

ALPHA, BETA = 0.0039, 0.0012  # of copper and magnets [1/K]


def test_a_constant_direction_gives_the_least_squares_with_a_random_walk_along_it() -> None:
    """theta_(k+1) = theta_k + D nu_k with the precision keep/(1 - keep) D^T M_k D of nu_k, all at once."""
    rng = np.random.default_rng(1)
    d, keep, sigma, count = np.array([1.0, 0.5, 0.0]), np.exp(-1 / 8), 0.05, 60
    rows = rng.normal(size=(count, 3))
    at = np.array([1.0, 0.8, 0.5]) + 0.002 * np.arange(count)[:, None] * d
    y = np.sum(rows * at, axis=1) + sigma * rng.normal(size=count)
    core = pvid.Estimator(
        lambda p: p, lambda p: np.eye(3), start=[1.0] * 3, start_sd=[1e3] * 3, row_sd=sigma, lower=[-9.0] * 3,
        upper=[9.0] * 3, positive=[False] * 3, rate=8.0, drift=lambda p: d, drift_s=1.0,
    ).add(rows, y)  # fmt: skip
    m, whole, right = np.zeros((3, 3)), np.zeros((2 * count - 1, count + 2)), np.zeros(2 * count - 1)
    for k in range(count):
        if k:
            of_d = m @ d
            whole[count + k - 1, 2 + k] = np.sqrt(d @ of_d * keep / (1 - keep))
            m = m - (1 - keep) * np.outer(of_d, of_d) / (d @ of_d)
        m = m + np.outer(rows[k], rows[k])
        whole[k, :3], whole[k, 3 : 3 + k], right[k] = rows[k], rows[k] @ d, y[k]
    found = np.linalg.lstsq(whole, right, rcond=None)[0]
    best, errors = found[:3] + d * found[3:].sum(), sigma * np.sqrt(np.diag(np.linalg.inv(m)))
    assert np.max(np.abs(core.estimate.p - best) / errors) < 1e-3  # float32
    assert np.max(np.abs(at[-1] - best) / errors) < 4


def heated(seed: int) -> tuple[Float, Float, Float, Float]:
    """t, rows of V = R i + k w, and R and k: 20 s of steps, then 3 A and 60 rad/s with 1 % of ripple; 15 min, 20 Hz."""
    rng, n = np.random.default_rng(seed), 18000
    t: Float = np.arange(n, dtype=np.float64) / 20
    heat = 60 * (1 - np.exp(-t / 240))
    steps = 1.5 * np.sign(np.sin(1.7 * t)) + 0.5 * rng.normal(size=n)
    i = np.where(t < 20, steps, 3 + 0.03 * np.sin(0.9 * t))
    w = np.where(t < 20, 100 * np.sin(0.8 * t) + 60 * np.sin(2.3 * t), 60 + 0.5 * np.sin(0.5 * t))
    truth = np.stack([1.2 * (1 + ALPHA * heat), 0.05 * (1 - BETA * heat)], axis=1)
    v = np.sum(truth * np.stack([i, w], axis=1), axis=1) + 0.02 * rng.normal(size=n)
    measured = np.stack([i + 0.002 * rng.normal(size=n), w + 0.05 * rng.normal(size=n)], axis=1)
    return t, measured, v, truth


def followed(seed: int, start: tuple[float, float], drifts: bool, forgetting: float = 0.0) -> Float:
    """Largest part in percent by which R and k are off, RMS behind the first minute."""
    t, rows, v, truth = heated(seed)
    n = 3 if drifts else 2
    core = pvid.Estimator(
        lambda p: p, lambda p: np.eye(n), start=[*start, 0.0][:n], start_sd=[1.0, 0.05, 10.0][:n], row_sd=0.02,
        lower=[0.01, 1e-3, -100.0][:n], upper=[10.0, 1.0, 200.0][:n], positive=[True, True, False][:n], rate=20.0,
        forgetting=forgetting, drift=along_the_heat if drifts else None, drift_s=1.0,
    )  # fmt: skip
    if drifts:
        core.step([0.0, 0.0, 20.0], 0.0)  # the rise of the temperature, which no other row contains, begins at 0
    out = np.empty_like(truth)
    for k in range(len(t)):
        core.step([*rows[k], 0.0][:n], v[k])
        out[k] = [core._state.p[a] for a in range(2)]
    off = (out / truth - 1)[t > 60]
    return np.asarray(100 * np.sqrt(np.mean(off**2, axis=0)))


def along_the_heat(p: Float) -> Float:
    """Of R, k and the rise of the temperature."""
    return np.array([ALPHA * p[0] / (1 + ALPHA * p[2]), -BETA * p[1] / (1 - BETA * p[2]), 1.0])


@pytest.mark.parametrize("start", [(0.6, 0.025), (1.8, 0.025), (1.8, 0.075)])
def test_a_winding_that_heats_by_60_kelvin_is_followed(start: tuple[float, float]) -> None:
    """R and k by 0.2 %, from starts that are 50 % off."""
    assert (followed(0, start, drifts=True) < 0.2).all()


def test_free_parameters_with_the_best_forgetting_follow_it_ten_times_worse() -> None:
    assert (followed(0, (0.6, 0.025), drifts=False, forgetting=20.0) > [2.0, 3.0]).all()


def test_a_drift_of_less_than_four_rows_is_refused() -> None:
    with pytest.raises(PvidError, match="at least four rows: 4 s"):
        pvid.Estimator(
            lambda p: p, start=[1.0] * 3, start_sd=[1.0] * 3, row_sd=1.0, drift=lambda p: np.eye(3)[0], drift_s=1.0
        )
