"""Rows of several kinds: M by blocks. C against twin bit for bit, both against float64."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from block_models import BlockModel, EstimatorInC
from printed_estimator import PrintedEstimator, block_model, printed_core

from pvid.core.native import Native
from pvid.settings.enums import Law, Reason
from pvid.settings.parts import EstimatorConfig

Float32 = npt.NDArray[np.float32]

RATE = 100.0
ROW_SD = 0.02
KINDS = {"two": (4, 9), "three": (3, 5, 10), "uneven": (1, 9)}
CONFIGS = {
    "plain": {},
    "forgetting": {"forgetting_s": 0.4},  # 40 groups: folds after every second
    "rate": {"feedback_hz": 20.0, "forgetting_s": 1.0},  # g = 0.2: the innovation's gradient
    "pseudovelocity": {"law": Law.PSEUDOVELOCITY},
    "divider": {"divider": 3, "row_weight": 0.75, "correlation": 2.0},
    "dead zone": {"dead_zone": 0.5},
}


def config_of(model: BlockModel, **fields: object) -> EstimatorConfig:
    ones = np.ones(model.n_p, np.float32)
    start = EstimatorConfig(
        start=1.5 * ones, start_sd=ones, lower=0.1 * ones, upper=10 * ones, row_sd=ROW_SD, noise_margin=0.0
    )
    return replace(start, **fields)  # type: ignore[arg-type]


def rows_of(
    model: BlockModel, random: np.random.Generator, groups: int
) -> tuple[Float32, list[list[tuple[int, Float32, float]]]]:
    """The true p, and groups of rows (kind, N, Y): a few of each kind."""
    p = random.uniform(0.8, 2.5, model.n_p)
    theta = model.theta(p)
    made = []
    for _ in range(groups):
        group = []
        for kind, own in enumerate(model.kinds):
            for _ in range(2):
                n = random.standard_normal(own.stop - own.start)
                y = float(n @ theta[own]) + ROW_SD * random.standard_normal()
                group.append((kind, n.astype(np.float32), y))
        made.append(group)
    return p.astype(np.float32), made


class Pair:
    """The estimator in C and its twin."""

    def __init__(self, native: Native, model: BlockModel, config: EstimatorConfig) -> None:
        self.core = EstimatorInC(native, model, config, RATE)
        module = printed_core("f32")
        self.twin = PrintedEstimator(native, module, block_model(module, model), config, RATE)

    def add(self, kind: int, n: Float32, y: float) -> Reason:
        reason = self.twin.add(kind, n, y)
        assert self.core.add(kind, n, y) == reason
        return Reason(reason)

    def add_to_b(self, g: Float32) -> Reason:
        reason = self.twin.add_to_b(g)
        assert self.core.add_to_b(g) == reason
        return Reason(reason)

    def solve(self, ends_group: bool) -> None:
        own, other = ((one.update if ends_group else one.iterate)() for one in (self.core, self.twin))
        assert own == other

    def assert_equal(self) -> None:
        assert self.core.p.tobytes() == self.twin.p.tobytes()
        assert self.core.levels.tobytes() == self.twin.levels.tobytes()
        assert self.core.state.information.rounding == self.twin.state.information.rounding


@pytest.mark.by_day(6)
@pytest.mark.parametrize("fields", CONFIGS.values(), ids=CONFIGS.keys())
@pytest.mark.parametrize("kind_end", KINDS.values(), ids=KINDS.keys())
def test_core_and_twin_have_the_same_bits(native: Native, kind_end: tuple[int, ...], fields: dict[str, object]) -> None:
    random = np.random.default_rng(sum(kind_end))
    model = BlockModel.random(random, kind_end, 4)
    pair = Pair(native, model, config_of(model, **fields))
    truth, groups = rows_of(model, random, 130)
    for number, group in enumerate(groups):
        for kind, n, y in group:
            assert pair.add(kind, n, y) is Reason.ACCUMULATED
        if number % 10 == 3:
            pair.add_to_b(random.standard_normal(model.n_theta).astype(np.float32) * np.float32(1e-3))
        pair.solve(ends_group=True)
        if number % 4 == 1:
            pair.solve(ends_group=False)
        pair.assert_equal()
    assert pair.core.assess().tobytes() == pair.twin.assess().tobytes()
    assert pair.core.counters == pair.twin.counters
    assert pair.core.counters["in_dead_zone"] > 0 or "dead_zone" not in fields
    # rough: the laws without iteration, and what was added to b, leave more than the rows' noise
    assert np.allclose(pair.core.p, truth, rtol=0.05)


def test_a_copy_of_the_state_continues_with_the_same_bits(native: Native) -> None:
    random = np.random.default_rng(3)
    model = BlockModel.random(random, (3, 5, 10), 4)
    config = config_of(model, forgetting_s=0.4)
    first, second = (EstimatorInC(native, model, config, RATE) for _ in range(2))
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


@pytest.mark.parametrize("fields", CONFIGS.values(), ids=CONFIGS.keys())
def test_blocks_equal_full_rows_with_zeros(native: Native, fields: dict[str, object]) -> None:
    """Products with zero change no sum: the estimates have the same bits."""
    random = np.random.default_rng(8)
    model = BlockModel.random(random, (4, 10), 4)
    config = config_of(model, **fields)
    blocks, whole = EstimatorInC(native, model, config, RATE), EstimatorInC(native, model.whole(), config, RATE)
    _, groups = rows_of(model, random, 80)
    for group in groups:
        for kind, n, y in group:
            full = np.zeros(model.n_theta, np.float32)
            full[model.kinds[kind]] = n
            assert blocks.add(kind, n, y) == whole.add(0, full, y) == Reason.ACCUMULATED
        assert blocks.update() == whole.update()
        assert blocks.iterate() == whole.iterate()
        assert np.array_equal(blocks.p, whole.p)
    assert blocks.assess().tobytes() == whole.assess().tobytes()
    assert blocks.n_moments == 10 + 21
    assert whole.n_moments == 55


@pytest.mark.parametrize("kind_end", KINDS.values(), ids=KINDS.keys())
def test_the_estimate_is_that_of_least_squares(native: Native, kind_end: tuple[int, ...]) -> None:
    """p and its covariance against a Gauss-Newton solution of all rows in float64."""
    random = np.random.default_rng(17)
    model = BlockModel.random(random, kind_end, 4)
    config = config_of(model, start_sd=np.full(4, 1e4, np.float32), correlation=1.5)  # nearly no prior
    truth, groups = rows_of(model, random, 100)
    core = EstimatorInC(native, model, config, RATE)
    n_all, y_all = [], []
    for group in groups:
        for kind, n, y in group:
            core.add(kind, n, y)
            row = np.zeros(model.n_theta)
            row[model.kinds[kind]] = n
            n_all.append(row)
            y_all.append(np.float32(y))
        core.update()
        core.iterate()
    n_rows, y_rows = np.array(n_all), np.array(y_all, np.float64)
    p = truth.astype(np.float64)
    for _ in range(20):
        c = n_rows @ model.dense(p)
        p = p + np.linalg.lstsq(c, y_rows - n_rows @ model.theta(p), rcond=None)[0]
    rss = float(np.sum((y_rows - n_rows @ model.theta(p)) ** 2))
    covariance = np.linalg.inv(c.T @ c) * (1.5 * rss / (len(y_rows) - 4))
    se = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(core.p - p) < 0.02 * se)  # float32 sums of 400 to 600 rows
    estimate = core.assess()
    assert np.allclose(estimate["se"][:4], se, rtol=1e-3)
    assert np.allclose(estimate["covariance"][:4, :4], covariance, rtol=1e-3, atol=1e-3 * se.min() ** 2)


def test_adding_to_b_moves_the_solution_by_the_inverse_of_the_information(native: Native) -> None:
    random = np.random.default_rng(4)
    model = BlockModel.random(random, (4, 9), 4)
    config = config_of(model, start_sd=np.full(4, 1e4, np.float32))
    _, groups = rows_of(model, random, 40)
    plain, moved = (EstimatorInC(native, model, config, RATE) for _ in range(2))
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


def test_what_cannot_be_added_changes_nothing(native: Native) -> None:
    random = np.random.default_rng(4)
    model = BlockModel.random(random, (4, 9), 4)
    pair = Pair(native, model, config_of(model))
    fine = np.ones(5, np.float32)
    pair.add(1, fine, 1.0)
    before = pair.core.levels
    large = np.full(9, 2e28, np.float32)
    bad = fine.copy()
    bad[4] = np.nan
    assert pair.add(1, bad, 1.0) is Reason.REJECTED_NOT_FINITE
    assert pair.add(0, fine[:4], np.inf) is Reason.REJECTED_NOT_FINITE
    assert pair.add(0, np.full(4, 1e14, np.float32), 0.0) is Reason.REJECTED_SATURATED
    assert pair.add_to_b(np.full(9, np.nan, np.float32)) is Reason.REJECTED_NOT_FINITE
    assert pair.add_to_b(-large) is Reason.REJECTED_SATURATED
    assert pair.core.add(2, fine, 1.0) == Reason.NOT_READY  # there are kinds 0 and 1
    assert np.array_equal(pair.core.levels, before)
    assert pair.core.counters == pair.twin.counters
