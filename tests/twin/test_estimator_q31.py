"""The fixed-point estimator fed rows: sums that come near the end of an int64, forgetting, rows beyond the limit."""

from dataclasses import dataclass, replace

import numpy as np
from block_models import BlockModelQ31, EstimatorInC, Int
from printed_estimator import PrintedEstimator, block_model, printed_core

from pvid.core.native import Native
from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31

LIMIT, SUM_LIMIT = 2**28, 2**60  # of a row; above it the sums are divided by 4
UNIT = 2**26  # of p
N_P, N_THETA = 4, 8
MODEL = BlockModelQ31.random(np.random.default_rng(3), (N_THETA,), N_P)
CONFIG = EstimatorConfigQ31(
    start=(UNIT // 2,) * N_P,
    start_sd=(UNIT,) * N_P,
    lower=(UNIT // 16,) * N_P,
    upper=(15 * UNIT,) * N_P,
    p_bits=(26,) * N_P,
    n_bits=(20,) * N_THETA,
    y_bits=20,
    row_sd=256,
)


@dataclass(frozen=True)
class Steps:
    """State after every tick: p [ticks, n_p], sums [ticks, n_sums], their exponent and the reason [ticks]."""

    p: Int
    sums: Int
    exponent: Int
    reason: Int


def against_twin(native: Native, config: EstimatorConfigQ31, n: Int, y: Int) -> Steps:
    """Steps the core and the twin through rows N [ticks, 8], Y [ticks], a group each; all integers must be equal."""
    module, steps = printed_core("q31"), []
    core, twin = (
        EstimatorInC(native, MODEL, config),
        PrintedEstimator(native, module, block_model(module, MODEL), config),
    )
    for tick in range(len(y)):
        own, other = (one.add(0, n[tick], int(y[tick])) for one in (core, twin))
        assert own == other, tick
        if own == Reason.ACCUMULATED:
            own, other = core.update(), twin.update()
        assert own == other, tick
        assert np.array_equal(twin.p, core.p), tick
        assert np.array_equal(twin.sums, core.sums), tick
        exponent = int(core.state.information.exponent)
        assert twin.state.information.exponent == exponent, tick
        steps.append((core.p, core.sums, exponent, own))
    assert core.counters == twin.counters
    assert core.assess().tobytes() == twin.assess().tobytes()
    return Steps(*(np.array(part) for part in zip(*steps, strict=True)))


def loud_rows(ticks: int, largest: int = LIMIT) -> tuple[Int, Int]:
    """Rows at the limit in one place, N8, and small elsewhere, with the Y that the start explains."""
    random = np.random.default_rng(5)
    n = random.integers(-2000, 2001, (ticks, N_THETA))
    n[:, 7] = largest
    theta, (bits, _) = MODEL.theta(np.array(CONFIG.start)), MODEL.formats(CONFIG.p_bits)
    y = np.rint(n @ (theta * 2.0 ** -np.array(bits, np.float64))).astype(np.int64)
    return n, y


def test_sums_at_full_scale_are_divided_and_never_wrap(native: Native) -> None:
    config = replace(CONFIG, kappa_min=2**29)  # held: what is to be seen are the sums
    record = against_twin(native, config, *loud_rows(1200))
    # 2^56 a row: beyond 2^60 after 16 of them, beyond 2^66 after 1200, which is 2^60 times 4^3
    assert record.exponent[10] == 0
    assert record.exponent[-1] == 4
    assert np.abs(record.sums[:, :-1]).max() <= 2 * SUM_LIMIT
    # M_88 is still the sum: 1200 2^56
    assert abs(int(record.sums[-1, 35]) * 4**4 - 1200 * 2**56) < 2**56


def test_forgetting_brings_the_sums_back(native: Native) -> None:
    loud, y_loud = loud_rows(300)
    quiet, y_quiet = loud_rows(1200, largest=2000)
    n, y = np.concatenate([loud, quiet]), np.concatenate([y_loud, y_quiet])
    record = against_twin(native, replace(CONFIG, forgetting_groups=20, kappa_min=2**29), n, y)
    assert record.exponent.max() == 1
    assert record.exponent[-1] == 0
    # rows of one weight, the last forgotten once and each before it once more: a geometric sum, in Q16
    expected = CONFIG.row_weight / np.expm1(1 / 20)
    assert abs(int(record.sums[-1, -1]) - expected) < 1e-4 * expected


def test_a_row_beyond_the_limit_is_refused_and_changes_nothing(native: Native) -> None:
    n, y = loud_rows(20, largest=1000)
    n[7, 2] = LIMIT + 1
    n[8, 0] = -(2**31)
    y[9] = 2**31 - 1
    record = against_twin(native, CONFIG, n, y)
    assert (record.reason[7:10] == Reason.REJECTED_SATURATED).all()
    assert np.array_equal(record.sums[9], record.sums[6])
    assert record.reason[10] != Reason.REJECTED_SATURATED


def test_random_rows_equal_the_twin(native: Native) -> None:
    random = np.random.default_rng(11)
    scales = 2 ** random.integers(0, 29, (400, 8))
    n = np.rint(random.uniform(-1, 1, (400, 8)) * scales).astype(np.int64)
    y = random.integers(-LIMIT, LIMIT + 1, 400)
    for kappa_min in (0, CONFIG.kappa_min):
        record = against_twin(native, replace(CONFIG, kappa_min=kappa_min), n, y)
        assert (record.p >= np.array(CONFIG.lower)).all() and (record.p <= np.array(CONFIG.upper)).all()
