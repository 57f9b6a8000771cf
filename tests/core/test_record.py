"""Parameters survive a change of settings: a record of one life is the start of the next, in either arithmetic.

Bytes, refusals and numbers of the record itself: tests/unit/test_record.c; on a board: tests/board/test_weak_boards.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from records import MECHANISM, Writer, load
from weak_rig_q31 import rig as fixed_rig

from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.configuration.weak import samples_of, simulated_run_of, weak_config
from pvid.core.weak_native import WeakNative
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.settings.enums import Reason, RecordStatus, Standing
from pvid.settings.record import Record
from pvid.settings.weak import WeakConfig
from pvid.sim.simulated_run import RigSimulation
from pvid.twin.printed import PrintedTwin

PUBLISHED = (Reason.UPDATED, Reason.MISFIT)


def record_of(core: Any, arithmetic: str, samples: Any, period: int, n_p: int) -> tuple[bytes, Any]:
    """The last record of a life, and the estimate that it is of: saved behind every window where it is valid."""
    writer, kept = Writer(core, arithmetic, n_p), (b"", None)
    for first in range(0, len(samples), period):
        core.run_samples(samples[first : first + period], sums=False, hashes=False)
        if core.estimate["standing"]["state"] == Standing.VALID:
            kept = writer.whole(), core.estimate.copy()
        else:
            assert writer.piece() is RecordStatus.NOT_VALID
    return kept


def first_of(record: Record) -> int:
    """The tick of the first publication."""
    return int(np.flatnonzero(np.isin(record.reason, PUBLISHED))[0])


@dataclass(frozen=True)
class Life:
    """A run of a shipped mechanism's rig, and the identifier that is designed for it."""

    native: WeakNative
    config: WeakConfig
    samples: npt.NDArray[np.float32]
    truth: npt.NDArray[np.float64]

    @staticmethod
    def of(name: str, seed: int, window: float = 1.0) -> Life:
        """window: of the shipped design's, its length; with it all tables are others."""
        compiled = compiled_of(name)
        run, design, truth = simulated_run_of(compiled)
        config = weak_config(compiled, run, replace(design, window_s=window * design.window_s), truth)
        other = RigSimulation.of(compiled, simulated_rig(name)).run(seed)
        return Life(weak_native(compiled, config.design), config, samples_of(config, other), truth)

    @property
    def period(self) -> int:
        """Ticks from window to window."""
        return self.config.design.hop * self.config.design.decimation


@pytest.mark.parametrize("name", ["dc_motor", "free_pendulum", "battery_2rc", "cart_pendulum"])
def test_a_life_goes_on_with_other_windows_and_limits(name: str) -> None:
    """The second life has shorter windows, other conditions of publication, and another run of the rig."""
    one, two = Life.of(name, 0), Life.of(name, 1, window=0.8)
    n_p = len(one.truth)
    record, last = record_of(one.native.identifier_of(one.config), "f32", one.samples, one.period, n_p)
    config = replace(two.config, trust=replace(two.config.trust, se_max=0.5, groups_min=4))
    core = two.native.identifier_of(config)
    assert two.period != one.period
    assert load(core, "f32", record, MECHANISM + 1) is RecordStatus.OTHER_MECHANISM
    assert load(core, "f32", record) is RecordStatus.DONE
    shown = core.estimate
    assert np.array_equal(shown["p"][:n_p], last["p"][:n_p]) and np.array_equal(shown["se"][:n_p], last["se"][:n_p])
    unit = np.outer(last["se"], last["se"])[:n_p, :n_p]
    assert (np.abs(shown["covariance"] - last["covariance"])[:n_p, :n_p] <= 2e-5 * unit).all()  # 2^-16, float32

    loaded = core.run_samples(two.samples)
    from_guess = two.native.identifier_of(config).run_samples(two.samples)
    assert first_of(loaded) <= first_of(from_guess) + 2 * two.period  # no later, but for the chance of a window
    sd = np.maximum(loaded.published_se[-1][:n_p], 1e-3 * np.abs(two.truth))
    assert (np.abs(loaded.published[-1][:n_p] - two.truth) <= 6 * sd).all()

    start = np.asarray(last["p"][:n_p], np.float32)
    twin = PrintedTwin(two.native.sources, replace(config, estimator=replace(config.estimator, start=start)))
    half = len(two.samples) // 4
    again = two.native.identifier_of(config)
    load(again, "f32", record)
    own, other = again.run_samples(two.samples[:half]), twin.run(two.samples[:half])
    for part in ("reason", "p", "sums", "hash"):
        assert getattr(own, part).tobytes() == getattr(other, part).tobytes(), part


def test_a_record_of_one_arithmetic_is_the_start_in_the_other() -> None:
    made, life = fixed_rig("dc_motor", 20_000), Life.of("dc_motor", 0)
    counts, n_p = made.counts.T.astype(np.int32), len(made.truth)
    native = weak_native_q31(made.fixed, made.parameters, made.config)
    unit = 2.0 ** -np.array(made.parameters.p_bits, np.float64)
    period = made.config.design.hop * made.config.design.decimation
    fixed_record, last = record_of(native.identifier(), "q31", counts, period, n_p)
    float_record, _ = record_of(life.native.identifier_of(life.config), "f32", life.samples, life.period, n_p)
    into_float = life.native.identifier_of(life.config)
    assert load(into_float, "f32", fixed_record) is RecordStatus.DONE
    p, se = (last[one][:n_p] * unit for one in ("p", "se"))
    assert np.allclose(into_float.estimate["p"][:n_p], p, rtol=2**-23, atol=0)
    assert np.allclose(into_float.estimate["se"][:n_p], se, rtol=2**-23, atol=0)
    into_fixed = native.identifier()
    assert load(into_fixed, "q31", float_record) is RecordStatus.DONE
    again = Writer(into_float, "f32", n_p)
    assert load(into_float, "f32", float_record) is RecordStatus.DONE
    assert again.piece() is RecordStatus.NOT_VALID  # of the life before: not yet confirmed by this one
    assert np.abs(into_fixed.estimate["p"][:n_p] * unit - into_float.estimate["p"][:n_p]).max() <= unit.max()
    reasons = into_fixed.run_samples(counts[: 20 * period], sums=False, hashes=False).reason
    assert set(PUBLISHED) & set(reasons.tolist())
