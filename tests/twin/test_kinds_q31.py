"""Rows of several kinds in fixed point: C against twin in every integer, both against float64."""

import subprocess
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from block_models import BlockModelQ31, EstimatorQ31InC, Int
from printed_estimator import PrintedEstimator, block_model, printed_core

from pvid.core.native import Native
from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, sources_of
from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31

P_BITS, N_BITS, Y_BITS = 27, 20, 18
ROW_SD = 0.02
ONE = 2**30
KINDS = {"two": (4, 9), "three": (3, 5, 10), "uneven": (1, 9)}
CONFIGS = {
    "plain": {},
    "forgetting": {"forgetting_groups": 40},
    "rate": {"gain": ONE // 5, "forgetting_groups": 100},
    "pseudovelocity": {"gain": 0},
    "divider": {"divider": 3, "row_weight": 49152, "correlation": 2 << 16},
    "dead zone": {"dead_zone": 1 << 15},
}

Group = list[tuple[int, Int, int]]


def config_of(model: BlockModelQ31, **fields: object) -> EstimatorConfigQ31:
    n_p, n_theta = model.real.n_p, model.real.n_theta
    unit = 2**P_BITS
    start = EstimatorConfigQ31(
        start=(3 * unit // 2,) * n_p,
        start_sd=(unit,) * n_p,
        lower=(unit // 10,) * n_p,
        upper=(10 * unit,) * n_p,
        p_bits=(P_BITS,) * n_p,
        n_bits=(N_BITS,) * n_theta,
        y_bits=Y_BITS,
        row_sd=round(ROW_SD * 2 ** (Y_BITS + 8)),
        noise_margin=0,
    )
    return replace(start, **fields)  # type: ignore[arg-type]


def rows_of(
    model: BlockModelQ31, random: np.random.Generator, groups: int, size: float = 1.0
) -> tuple[Int, list[Group]]:
    """The true p, and groups of rows (kind, N, Y) as integers: two of each kind; N of this size."""
    p = random.uniform(0.8, 2.5, model.real.n_p)
    theta = model.real.theta(p)
    made = []
    for _ in range(groups):
        group = []
        for kind, own in enumerate(model.real.kinds):
            for _ in range(2):
                n = np.round(size * random.standard_normal(own.stop - own.start) * 2**N_BITS)
                y = float(n / 2**N_BITS @ theta[own]) + ROW_SD * random.standard_normal()
                group.append((kind, n.astype(np.int64), round(y * 2**Y_BITS)))
        made.append(group)
    return np.round(p * 2**P_BITS).astype(np.int64), made


class Pair:
    """The estimator in C and its twin; sizes: of the core that is not the default one."""

    def __init__(
        self, native: Native, model: BlockModelQ31, config: EstimatorConfigQ31, sizes: Mapping[str, int] | None = None
    ) -> None:
        self.core = EstimatorQ31InC(native, model, config)
        module = printed_core("q31", sizes)
        self.twin = PrintedEstimator(native, module, block_model(module, model), config)

    def add(self, kind: int, n: Int, y: int) -> Reason:
        reason = self.twin.add(kind, n, y)
        assert self.core.add(kind, n, y) == reason
        return Reason(reason)

    def add_to_b(self, m: Int, e: Int) -> Reason:
        reason = self.twin.add_to_b(m, e)
        assert self.core.add_to_b(m, e) == reason
        return Reason(reason)

    def solve(self, ends_group: bool) -> None:
        own, other = ((one.update if ends_group else one.iterate)() for one in (self.core, self.twin))
        assert own == other

    def assert_equal(self) -> None:
        assert np.array_equal(self.core.p, self.twin.p)
        assert np.array_equal(self.core.sums, self.twin.sums)
        assert self.core.state.information.exponent == self.twin.state.information.exponent


@pytest.mark.by_day(6)
@pytest.mark.parametrize("fields", CONFIGS.values(), ids=CONFIGS.keys())
@pytest.mark.parametrize("kind_end", KINDS.values(), ids=KINDS.keys())
def test_core_and_twin_have_the_same_integers(
    native: Native, kind_end: tuple[int, ...], fields: dict[str, object]
) -> None:
    random = np.random.default_rng(sum(kind_end))
    model = BlockModelQ31.random(random, kind_end, 4)
    pair = Pair(native, model, config_of(model, **fields))
    truth, groups = rows_of(model, random, 130)
    for number, group in enumerate(groups):
        for kind, n, y in group:
            assert pair.add(kind, n, y) is Reason.ACCUMULATED
        if number % 10 == 3:
            theta = model.real.n_theta
            pair.add_to_b(random.integers(-ONE, ONE, theta), random.integers(-8, 0, theta))
        pair.solve(ends_group=True)
        if number % 4 == 1:
            pair.solve(ends_group=False)
        pair.assert_equal()
    assert pair.core.assess().tobytes() == pair.twin.assess().tobytes()
    assert pair.core.counters == pair.twin.counters
    assert pair.core.counters["in_dead_zone"] > 0 or "dead_zone" not in fields
    # rough: the laws without iteration, and what was added to b, leave more than the rows' noise
    assert np.allclose(pair.core.p, truth, rtol=0.05)


@pytest.mark.parametrize("loud", range(3))
def test_every_block_keeps_within_its_limit(native: Native, loud: int) -> None:
    """A loud entry in each kind in turn: the sums are divided by 4, and multiplied again when they have faded."""
    random = np.random.default_rng(2)
    model = BlockModelQ31.random(random, (2, 3, 6), 3)
    # held, the sums are the test's subject; with few bits of Y the loudest N theta is within the limit of a row
    pair = Pair(native, model, config_of(model, forgetting_groups=20, kappa_min=ONE // 2, y_bits=8))
    exponents = []
    for number in range(400):
        for kind, own in enumerate(model.real.kinds):
            n = random.integers(-2000, 2000, own.stop - own.start)
            if kind == loud and number < 60:
                n[-1] = 2**28  # 2^56 a row: beyond 2^60 after 16 of them
            assert pair.add(kind, n, 0) is Reason.ACCUMULATED
        pair.solve(ends_group=True)
        exponents.append(int(pair.core.state.information.exponent))
        if number % 20 == 0:
            pair.assert_equal()
    assert max(exponents) == 1
    assert exponents[0] == exponents[-1] == 0


def test_blocks_equal_full_rows_with_zeros(native: Native) -> None:
    random = np.random.default_rng(8)
    model = BlockModelQ31.random(random, (4, 10), 4)
    whole = BlockModelQ31(model.real.whole())
    config = config_of(model, forgetting_groups=50)
    blocks, full = EstimatorQ31InC(native, model, config), EstimatorQ31InC(native, whole, config)
    _, groups = rows_of(model, random, 80)
    for group in groups:
        for kind, n, y in group:
            row = np.zeros(model.real.n_theta, np.int64)
            row[model.real.kinds[kind]] = n
            assert blocks.add(kind, n, y) == full.add(0, row, y) == Reason.ACCUMULATED
        assert blocks.update() == full.update()
        assert blocks.iterate() == full.iterate()
        assert np.array_equal(blocks.p, full.p)
    assert blocks.assess().tobytes() == full.assess().tobytes()
    assert len(blocks.sums) == 10 + 21 + 10 + 2


@pytest.mark.parametrize("kind_end", KINDS.values(), ids=KINDS.keys())
def test_the_estimate_is_that_of_least_squares(native: Native, kind_end: tuple[int, ...]) -> None:
    random = np.random.default_rng(17)
    model = BlockModelQ31.random(random, kind_end, 4)
    config = config_of(model, start_sd=(2**31 - 1,) * 4)  # nearly no prior
    truth, groups = rows_of(model, random, 100)
    core = EstimatorQ31InC(native, model, config)
    n_all, y_all = [], []
    for group in groups:
        for kind, n, y in group:
            core.add(kind, n, y)
            row = np.zeros(model.real.n_theta)
            row[model.real.kinds[kind]] = n / 2**N_BITS
            n_all.append(row)
            y_all.append(y / 2**Y_BITS)
        core.update()
        core.iterate()
    n_rows, y_rows = np.array(n_all), np.array(y_all)
    p = truth / 2**P_BITS
    for _ in range(20):
        c = n_rows @ model.real.dense(p)
        p = p + np.linalg.lstsq(c, y_rows - n_rows @ model.real.theta(p), rcond=None)[0]
    rss = float(np.sum((y_rows - n_rows @ model.real.theta(p)) ** 2))
    se = np.sqrt(np.diag(np.linalg.inv(c.T @ c)) * (rss / (len(y_rows) - 4)))
    # 2^-18 of Y is 2e-4 of a row's noise; the prior of 16 units weighs 1e-6 of the data
    assert np.all(np.abs(core.p / 2**P_BITS - p) < 0.01 * se)
    assert np.allclose(core.assess()["se"][:4] / 2**P_BITS, se, rtol=1e-3)


def test_what_cannot_be_added_changes_nothing(native: Native) -> None:
    random = np.random.default_rng(4)
    model = BlockModelQ31.random(random, (4, 9), 4)
    pair = Pair(native, model, config_of(model, gain=ONE // 2))
    fine = np.ones(5, np.int64)
    pair.add(1, fine, 1)
    before = pair.core.sums
    large = fine.copy()
    large[4] = 2**28 + 1
    assert pair.add(1, large, 1) is Reason.REJECTED_SATURATED
    assert pair.add(0, fine[:4], -(2**28) - 1) is Reason.REJECTED_SATURATED
    assert pair.core.add(2, fine, 1) == Reason.NOT_READY  # there are kinds 0 and 1
    g = np.zeros(9, np.int64)
    g[7] = ONE
    assert pair.add_to_b(g, np.full(9, 40)) is Reason.REJECTED_SATURATED
    assert np.array_equal(pair.core.sums, before)
    assert pair.add_to_b(g, np.full(9, 30)) is Reason.ACCUMULATED
    pair.assert_equal()
    assert pair.core.sums[10 + 15 + 7] == before[10 + 15 + 7] + 2**60
    assert pair.core.counters == pair.twin.counters


ROOMY = {"PVID_MAX_P": 8, "PVID_MAX_THETA_Q31": 31, "PVID_MAX_MOMENTS_Q31": 496, "PVID_MAX_C_Q31": 62}


@pytest.fixture(scope="module")
def roomy(tmp_path_factory: pytest.TempPathFactory) -> Native:
    """The core with room for the largest mechanisms, and its headers for cffi as host/native makes them."""
    folder = tmp_path_factory.mktemp("roomy")
    options = ["-std=c99", *(f"-D{name}={size}" for name, size in ROOMY.items())]
    sources = [str(path) for path in sources_of("q31")]
    library = folder / "libpvid_roomy.so"
    subprocess.run(["gcc", *options, "-O1", "-shared", "-fPIC", *INCLUDES, *sources, "-o", str(library)], check=True)
    for name in ("stdbool", "stddef", "stdint", "string", "math"):
        (folder / f"{name}.h").touch()
    (folder / "all.h").write_text('#include "pvid/estimator_q31.h"\n', encoding="utf-8")
    plain = [
        "-E",
        "-P",
        "-nostdinc",
        f"-I{folder}",
        *PUBLIC_INCLUDES,
        str(folder / "all.h"),
        "-o",
        str(folder / "pvid.i"),
    ]
    subprocess.run(["gcc", *options, *plain], check=True)
    return Native(library)


@pytest.mark.parametrize("kind_end", [(5, 10, 15), (15,), (16,), (9, 20, 31), (31,)], ids=str)
def test_more_theta_than_eleven_have_guard_bits(roomy: Native, kind_end: tuple[int, ...]) -> None:
    """As many as the largest mechanisms have, in blocks and in one; every entry of C in the same column."""
    random = np.random.default_rng(5)
    model = BlockModelQ31.random(random, kind_end, 2)
    pair = Pair(roomy, model, config_of(model), ROOMY)
    truth, groups = rows_of(model, random, 40)
    for group in groups:
        for kind, n, y in group:
            assert pair.add(kind, n, y) is Reason.ACCUMULATED
        pair.solve(ends_group=True)
        pair.assert_equal()
    core, twin = pair.core.assess(), pair.twin.assess()
    for field in ("p", "se"):
        assert np.array_equal(core[field][:2], twin[field][:2])
    # twice as far as its standard error is 1 in 20, and there are ten numbers
    assert np.all(np.abs(pair.core.p - truth) < 4 * core["se"][:2])


def test_equal_columns_of_equal_rows_do_not_overflow(roomy: Native) -> None:
    """All entries of N equal: every product has the same sign and the greatest size."""
    random = np.random.default_rng(5)
    for n_theta in (11, 12, 22, 23, 31):
        model = BlockModelQ31.random(random, (n_theta,), 2)
        model = BlockModelQ31(
            replace(model.real, factor=np.ones(n_theta, np.float32), factors=((0, -1),) * n_theta, n_p=1)
        )
        pair = Pair(roomy, model, config_of(model), ROOMY)
        n = np.full(n_theta, (2**24) - 1)  # M_ii h^2 just below 2^30
        for _ in range(16):
            y = n_theta * 2.0 * n[0] / 2**N_BITS * 2**Y_BITS
            assert pair.add(0, n, round(y)) is Reason.ACCUMULATED
            pair.solve(ends_group=True)
            pair.assert_equal()
        assert abs(int(pair.core.p[0]) / 2**P_BITS - 2) < 1e-5
