"""The gate of the fixed-point weak form: what it publishes, what it holds back, and float32's verdicts beside it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import groupby

import numpy as np
import numpy.typing as npt
import pytest

from bench.hard import CASES, Case
from pvid.core.native import Identifier, Native
from pvid.rig.file import RigFile
from pvid.run.compare import compare_run
from pvid.settings.enums import Reason
from pvid.settings.record import Record
from pvid.setup.f32 import weak_config
from pvid.setup.q31 import config_for_run, counts_of, p_of, se_of, weak_config_q31
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors, standard_start
from pvid.twin.q31 import weak_finish as weak_finish_q31
from pvid.twin.weak_q31 import WeakTwinQ31

VERDICTS = (Reason.UPDATED, Reason.MISFIT, Reason.HELD_NOT_EXCITED, Reason.HELD_PIVOT, Reason.HELD_UNCERTAIN)


SEEDS = 2
DURATION_S = 20.0


def case(label: str) -> Case:
    return next(one for one in CASES if one.label == label)


@lru_cache
def played(label: str, seed: int) -> tuple[Identifier, Record]:
    one = case(label)
    run = one.run(seed, duration=DURATION_S)
    core = Native().identifier(weak_config_q31(one.rig, run.sample_rate, standard_start(seed)))
    return core, core.run(*counts_of(one.rig, run), sums=False, hashes=False)


def verdicts(reason: npt.NDArray[np.uint8]) -> list[Reason]:
    """What became of the windows, in their order; runs of the same told once, for the cores' ticks differ."""
    reported: Iterator[Reason] = (Reason(r) for r in reason if r in VERDICTS)
    return [key for key, _ in groupby(reported)]


@pytest.mark.parametrize(
    "label",
    [
        "no drive, free swing",
        "no drive, no motion",
        "drive, no motion",
        "drive x0.03, 14 bits",
        "slow mode only, one tone, 14 bits",
        "slow mode only, 12 bits",
        "fast mode only, 12 bits",
    ],
)
def test_estimate_without_information_is_not_published(label: str) -> None:
    for seed in range(SEEDS):
        core, record = played(label, seed)
        assert not core.is_published
        assert not np.isin(record.reason, (Reason.UPDATED, Reason.MISFIT)).any()
        estimate = core.estimate
        assert (estimate["se"][:3] > 0.4 * estimate["p"][:3]).all()  # the start's, which may be half wrong


@pytest.mark.parametrize("label", ["encoder of 14 bits", "encoder of 10 bits", "drive x0.1, 12 bits"])
def test_sufficient_data_are_published_with_errors(label: str) -> None:
    one = case(label)
    for seed in range(SEEDS):
        core, _ = played(label, seed)
        config = weak_config_q31(one.rig, 1000.0, standard_start(seed))
        assert core.is_published
        error = p_of(config, core.estimate["p"][:4])[:3] - STANDARD_PENDULUM.linear
        # 18 numbers within 4 standard errors: 6e-5 of such numbers lie beyond
        assert (np.abs(error) < 4 * se_of(config, core.estimate["se"][:4])[:3]).all()


@pytest.mark.parametrize("label", ["full equations, 0.107 rad, 14 bits", "friction of 0.0001 m^2/s, 14 bits"])
def test_another_mechanism_raises_the_alarm(label: str) -> None:
    for seed in range(SEEDS):
        core, record = played(label, seed)
        assert not core.is_published or Reason.MISFIT in record.reason
        assert core.counters["misfits"] == np.count_nonzero(record.reason == Reason.MISFIT)


@pytest.mark.parametrize("truth", ["linear", "full"])
def test_the_verdicts_are_those_of_float32(native: Native, truth: str) -> None:
    # rows that neither core corrects; a full scale five times the drive's 4 m/s^2: ten make u's rounding a third of
    # the noise
    rig = replace(RigFile.standard(), sensor=replace(RigFile.standard().sensor, acceleration_range=20.0))
    for seed in range(SEEDS):
        run = simulate(sensors=standard_sensors(14), truth=truth, duration=DURATION_S, seed=seed).run  # type: ignore[arg-type]
        start = standard_start(seed)
        reference = native.identifier(weak_config(rig, 1000.0, start)).run(run.phi, run.y, sums=False, hashes=False)
        core = native.identifier(config_for_run(rig, run, start))
        own = core.run(*counts_of(rig, run), sums=False, hashes=False)
        assert verdicts(own.reason) == verdicts(reference.reason)
        # large angles in linear rows are alarmed from the first publication on
        assert (Reason.UPDATED if truth == "linear" else Reason.MISFIT) in own.reason


def test_published_estimate_changes_only_when_trusted() -> None:
    core, record = played("full equations, 0.107 rad, 14 bits", 0)
    changed = 1 + np.flatnonzero((record.published[1:] != record.published[:-1]).any(axis=1))
    trusted = np.isin(record.reason, (Reason.UPDATED, Reason.MISFIT))
    first = int(np.argmax(trusted))
    assert trusted[first]
    # before that it changes once, where the zero goes to the first window's mean
    assert np.count_nonzero(changed < first) == 1
    assert trusted[changed[changed >= first]].all()
    assert np.array_equal(record.published[-1], core.estimate["p"][:4])


@pytest.mark.parametrize(
    "label",
    [
        "drive x0.03, 14 bits",
        "drive, no motion",
        "slow mode only, 14 bits",
        "full equations, 0.107 rad, 14 bits",
    ],
)
def test_the_twin_has_the_same_integers_where_it_is_hard(native: Native, label: str) -> None:
    """8 s: windows that are held, steps back to a refuge, an alarm. What is published is compared as well."""
    one = case(label)
    run = one.run(3, duration=8.0)
    config = weak_config_q31(one.rig, run.sample_rate, standard_start(3))
    result = compare_run(native, config, *counts_of(one.rig, run))
    assert result.equal, str(result.difference)


@pytest.mark.parametrize("seed", range(4))
def test_the_noise_in_the_rows_is_that_of_float64(seed: int) -> None:
    """tr(R0^-1 G) / K for the tables of chi'' and chi at a start anywhere within 50 % of the truth, from tables of 14
    bits and rows of 13: to 3 per cent, which a margin of 16 does not see."""
    config = weak_config_q31(RigFile.standard(), 1000.0, standard_start(seed))
    design, twin = config.design, WeakTwinQ31(config)
    by = weak_finish_q31.whitening(design, twin.estimator)
    noise = weak_finish_q31.noise_of(design, by, twin.estimator)
    functions = design.functions
    rows, columns = np.tril_indices(functions)
    tables = np.zeros((6, functions, functions))
    tables[:, rows, columns] = design.gram * 2.0 ** -np.array(design.gram_bits, np.float64)[:, None]
    tables[:, columns, rows] = tables[:, rows, columns]
    w, d1, d2 = twin.estimator.p[:3, 0] * 2.0 ** -np.array(config.estimator.p_bits[:3], np.float64)
    two, zero = d1 * w, d2 * w * w
    r0 = np.tensordot([1.0, two, zero, two**2, two * zero, zero**2], tables, axes=1)
    of_n = np.array(config.estimator.n_bits, np.float64)[[1, 4]] - config.estimator.y_bits
    formats = (2 * of_n[0], of_n[0] + of_n[1] - 1, 2 * of_n[1])  # the mixed table holds G20 + G02
    for own, table, bits in zip(noise, tables[3:], formats, strict=True):
        expected = np.trace(np.linalg.solve(r0, table)) / functions * 2.0**bits
        assert float(own.m[0]) * 2.0 ** int(own.e[0]) == pytest.approx(expected, rel=0.03)
