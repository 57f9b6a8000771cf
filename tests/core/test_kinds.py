"""Rows of several kinds: M by blocks, in C against full rows and against float64, in either arithmetic."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from block_models import BlockModel, BlockModelQ31, EstimatorInC

from pvid.core.native import Native
from pvid.settings.cores import CORES
from pvid.settings.enums import Core, Law, Reason
from pvid.settings.parts import EstimatorConfig
from pvid.settings.q31 import EstimatorConfigQ31

AnyModel = BlockModel | BlockModelQ31
AnyConfig = EstimatorConfig | EstimatorConfigQ31
Numbers = npt.NDArray[Any]
Group = list[tuple[int, Numbers, float]]

RATE = 100.0
ROW_SD = 0.02
P_BITS, N_BITS, Y_BITS = 27, 20, 18
ONE = 2**30
UNITS: dict[Core, tuple[float, float, float]] = {"f32": (1.0, 1.0, 1.0), "q31": (2.0**P_BITS, 2.0**N_BITS, 2.0**Y_BITS)}
KINDS = {"two": (4, 9), "three": (3, 5, 10), "uneven": (1, 9)}
CONFIGS: dict[str, dict[Core, dict[str, Any]]] = {
    "plain": {"f32": {}, "q31": {}},
    "forgetting": {"f32": {"forgetting_s": 0.4}, "q31": {"forgetting_groups": 40}},  # folds after every second group
    # gamma = 0.2: the innovation's gradient
    "rate": {"f32": {"feedback_hz": 20.0, "forgetting_s": 1.0}, "q31": {"gain": ONE // 5, "forgetting_groups": 100}},
    "pseudovelocity": {"f32": {"law": Law.PSEUDOVELOCITY}, "q31": {"gain": 0}},
    "divider": {
        "f32": {"divider": 3, "row_weight": 0.75, "correlation": 2.0},
        "q31": {"divider": 3, "row_weight": 49152, "correlation": 2 << 16},
    },
    "dead zone": {"f32": {"dead_zone": 0.5}, "q31": {"dead_zone": 1 << 15}},
}
NO_PRIOR: dict[Core, dict[str, Any]] = {
    "f32": {"start_sd": np.full(4, 1e4, np.float32), "correlation": 1.5},
    "q31": {"start_sd": (2**31 - 1,) * 4, "correlation": 3 << 15},
}


def real_of(model: AnyModel) -> BlockModel:
    return model.real if isinstance(model, BlockModelQ31) else model


def random_model(core: Core, random: np.random.Generator, kind_end: tuple[int, ...], n_p: int = 4) -> AnyModel:
    return (BlockModel if core == "f32" else BlockModelQ31).random(random, kind_end, n_p)


def config_of(model: AnyModel, **fields: object) -> AnyConfig:
    n_p = real_of(model).n_p
    if isinstance(model, BlockModel):
        ones = np.ones(n_p, np.float32)
        start: AnyConfig = EstimatorConfig(
            start=1.5 * ones, start_sd=ones, lower=0.1 * ones, upper=10 * ones, row_sd=ROW_SD, noise_margin=0.0
        )
    else:
        unit = 2**P_BITS
        start = EstimatorConfigQ31(
            start=(3 * unit // 2,) * n_p,
            start_sd=(unit,) * n_p,
            lower=(unit // 10,) * n_p,
            upper=(10 * unit,) * n_p,
            p_bits=(P_BITS,) * n_p,
            n_bits=(N_BITS,) * model.real.n_theta,
            y_bits=Y_BITS,
            row_sd=round(ROW_SD * 2 ** (Y_BITS + 8)),
            noise_margin=0,
        )
    return replace(start, **fields)  # type: ignore[arg-type]


def rows_of(model: AnyModel, random: np.random.Generator, groups: int) -> tuple[Numbers, list[Group]]:
    """The true p, and groups of rows (kind, N, Y) as the core takes them: two of each kind."""
    real = real_of(model)
    p = random.uniform(0.8, 2.5, real.n_p)
    theta = real.theta(p)
    made = []
    for _ in range(groups):
        group: Group = []
        for kind, own in enumerate(real.kinds):
            for _ in range(2):
                n = random.standard_normal(own.stop - own.start)
                y = float(n @ theta[own]) + ROW_SD * random.standard_normal()
                if isinstance(model, BlockModel):
                    group.append((kind, n.astype(np.float32), y))
                else:
                    group.append((kind, np.round(n * 2**N_BITS).astype(np.int64), round(y * 2**Y_BITS)))
        made.append(group)
    return p, made


def estimator(native: Native, model: AnyModel, config: AnyConfig) -> EstimatorInC:
    return EstimatorInC(native, model, config, RATE if isinstance(model, BlockModel) else None)


@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize("name", CONFIGS)
def test_blocks_equal_full_rows_with_zeros(native: Native, name: str, core: Core) -> None:
    """Products with zero change no sum: the estimates have the same bits."""
    random = np.random.default_rng(8)
    model = random_model(core, random, (4, 10))
    real = real_of(model)
    whole = real.whole() if core == "f32" else BlockModelQ31(real.whole())
    blocks, full = (estimator(native, one, config_of(model, **CONFIGS[name][core])) for one in (model, whole))
    truth, groups = rows_of(model, random, 130)
    for group in groups:
        for kind, n, y in group:
            row = np.zeros(real.n_theta, n.dtype)
            row[real.kinds[kind]] = n
            assert blocks.add(kind, n, y) == full.add(0, row, y) == Reason.ACCUMULATED
        assert blocks.update() == full.update()
        assert blocks.iterate() == full.iterate()
        assert np.array_equal(blocks.p, full.p)
    assert blocks.assess().tobytes() == full.assess().tobytes()
    sums, more = (one.levels[0] if core == "f32" else one.sums for one in (blocks, full))
    assert np.allclose(blocks.p / UNITS[core][0], truth, rtol=0.05)  # rough: laws without iteration
    assert blocks.counters["in_dead_zone"] > 0 or name != "dead zone"
    assert (len(sums), len(more)) == (10 + 21 + 10 + 2, 55 + 10 + 2)


@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize("kind_end", KINDS.values(), ids=KINDS.keys())
def test_the_estimate_is_that_of_least_squares(native: Native, kind_end: tuple[int, ...], core: Core) -> None:
    """p and its standard errors against a Gauss-Newton solution of all rows in float64."""
    random = np.random.default_rng(17)
    model = random_model(core, random, kind_end)
    real, (p_unit, n_unit, y_unit) = real_of(model), UNITS[core]
    p, groups = rows_of(model, random, 100)
    own = estimator(native, model, config_of(model, **NO_PRIOR[core]))
    n_all, y_all = [], []
    for group in groups:
        for kind, n, y in group:
            own.add(kind, n, y)
            row = np.zeros(real.n_theta)
            row[real.kinds[kind]] = n / n_unit
            n_all.append(row)
            y_all.append(float(np.float32(y)) if core == "f32" else y / y_unit)
        own.update()
        own.iterate()
    n_rows, y_rows = np.array(n_all), np.array(y_all)
    for _ in range(20):
        c = n_rows @ real.dense(p)
        p = p + np.linalg.lstsq(c, y_rows - n_rows @ real.theta(p), rcond=None)[0]
    rss = float(np.sum((y_rows - n_rows @ real.theta(p)) ** 2))
    covariance = np.linalg.inv(c.T @ c) * (1.5 * rss / (len(y_rows) - 4))
    se = np.sqrt(np.diag(covariance))
    # float32 sums of 400 to 600 rows; 2^-18 of Y is 2e-4 of a row's noise, the prior of 16 units 1e-6 of the data
    assert np.all(np.abs(own.p / p_unit - p) < (0.02 if core == "f32" else 0.01) * se)
    estimate = own.assess()
    assert np.allclose(estimate["se"][:4] / p_unit, se, rtol=1e-3)
    if core == "f32":
        assert np.allclose(estimate["covariance"][:4, :4], covariance, rtol=1e-3, atol=1e-3 * se.min() ** 2)


def test_a_copy_of_the_state_continues_with_the_same_bits(native: Native) -> None:
    random = np.random.default_rng(3)
    model = BlockModel.random(random, (3, 5, 10), 4)
    config = config_of(model, forgetting_s=0.4)
    first, second = (estimator(native, model, config) for _ in range(2))
    _, groups = rows_of(model, random, 60)
    for group in groups[:31]:
        for row in group:
            first.add(*row)
        first.update()
    ffi = first.ffi
    own_model = second.state.model
    ffi.buffer(second.state)[:] = bytes(ffi.buffer(first.state))
    second.state.model = own_model
    for group in groups[31:]:
        for one in (first, second):
            for row in group:
                one.add(*row)
            one.update()
    assert first.p.tobytes() == second.p.tobytes()
    assert first.levels.tobytes() == second.levels.tobytes()


def test_adding_to_b_moves_the_solution_by_the_inverse_of_the_information(native: Native) -> None:
    random = np.random.default_rng(4)
    model = BlockModel.random(random, (4, 9), 4)
    config = config_of(model, start_sd=np.full(4, 1e4, np.float32))
    _, groups = rows_of(model, random, 40)
    plain, moved = (estimator(native, model, config) for _ in range(2))
    m = np.zeros((9, 9))
    for group in groups:
        for kind, n, y in group:
            own = model.kinds[kind]
            m[own, own] += np.outer(n, n)
            plain.add(kind, n, y)
            moved.add(kind, n, y)
        plain.update()
        moved.update()
    g = (1e-3 * random.standard_normal(9)).astype(np.float32)
    assert moved.add_to_b(g) == Reason.ACCUMULATED
    for _ in range(4):
        plain.iterate()
        moved.iterate()
    c = model.dense(plain.p.astype(np.float64))
    expected = np.linalg.solve(c.T @ m @ c, c.T @ g)
    # second order of the ties, and float32
    assert np.allclose(moved.p.astype(np.float64) - plain.p, expected, rtol=0.02, atol=3e-7)
