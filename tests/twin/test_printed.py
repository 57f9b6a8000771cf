"""The printed twin of every form and arithmetic has the bits of the C core, on hostile samples as well."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from weak_q31 import DESIGNS, rig
from weak_rig import engine_rig

from pvid.codegen.refine import refine_functions
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.configuration.refine import refine_settings
from pvid.models import mechanisms
from pvid.models.simulated_rig import simulated_rig
from pvid.settings.enums import Reason
from pvid.settings.f32 import TrustConfig
from pvid.settings.record import Record
from pvid.twin.printed import PrintedTwin

EARLY = TrustConfig(se_max=10.0, groups_min=1, kappa_min=0.0)


def assert_same(core: Record, twin: Record) -> None:
    for part in ("p", "sums", "exponent", "reason", "published", "published_se", "hash"):
        own, other = getattr(core, part), getattr(twin, part)
        assert own.dtype == other.dtype and own.shape == other.shape
        if own.tobytes() != other.tobytes():
            different = np.flatnonzero((own.reshape(len(own), -1) != other.reshape(len(own), -1)).any(axis=1))
            pytest.fail(f"{part}, first at tick {different[:1]}")


def wild(samples: npt.NDArray[Any], most: float) -> npt.NDArray[Any]:
    """No numbers, or counts at the end of their range; a dead sensor, a jump, a value beyond the range."""
    out, n = samples.copy(), len(samples)
    fixed = out.dtype.kind == "i"
    out[n // 8, 0] = 2**31 - 1 if fixed else np.nan
    out[n // 3 : n // 3 + 40] = 0
    out[n // 2 :, -1] += out.dtype.type(most)
    out[3 * n // 4] = -(2**31) if fixed else np.inf
    out[-5, -1] = out.dtype.type(2**30 if fixed else 1e30)
    return out


@pytest.mark.parametrize("name", mechanisms.names())
def test_the_weak_form_in_float32_has_the_bits_of_its_printed_twin(name: str) -> None:
    """Also over gaps, a frozen stretch, an estimate that is published early, and calls one after the other."""
    one = engine_rig(name)
    samples = wild(one.samples[:9000], 0.01)
    config = replace(one.config, trust=EARLY)
    core, twin = one.native.identifier_of(config), PrintedTwin(one.native.sources, config)
    for frozen, part in ((False, samples[:6500]), (True, samples[6500:7500]), (False, samples[7500:])):
        for identifier in (core, twin):
            identifier.freeze(frozen)
        assert_same(core.run_samples(part), twin.run(part))
    for identifier in (core, twin):
        identifier.gap()
    assert_same(core.run_samples(samples[:200]), twin.run(samples[:200]))
    assert core.counters == twin.counters and core.is_published == twin.is_published
    assert core.counters["rejected_not_finite"] > 0
    for field in ("p", "se", "covariance"):
        assert core.estimate[field].tobytes() == np.array(getattr(twin.estimate, field), np.float32).tobytes()


@pytest.mark.parametrize("name", DESIGNS)
def test_the_weak_form_in_fixed_point_has_the_bits_of_its_printed_twin(name: str) -> None:
    one = rig(name, 6000 if name == "kapitza" else 3000)  # its window is the longest
    native = weak_native_q31(one.fixed, one.parameters, one.config)
    core, twin = native.identifier(), PrintedTwin(native.sources, one.config)
    readings = wild(one.counts.T.astype(np.int32), 40)
    record = core.run_samples(readings)
    assert_same(record, twin.run(readings))
    assert core.counters == twin.counters
    assert (record.reason == Reason.REJECTED_SATURATED).any() and (record.p[-1] != record.p[0]).any()


@pytest.mark.parametrize("name", ["rigid_body", "dc_motor"])
def test_both_stages_have_the_bits_of_their_printed_twin(name: str) -> None:
    one, made, simulated = engine_rig(name), refine_functions(mechanisms.compiled_of(name)), simulated_rig(name)
    run = {signal: one.samples[:, k] for k, signal in enumerate(one.config.design.model.sample_names)}
    settings = refine_settings(made, run, simulated.sample_rate, one.truth, 2 * simulated.window_s)
    config = replace(one.config, trust=TrustConfig(se_max=10.0, groups_min=1))
    library = weak_native(made.model, config.design, made)
    core, twin = library.refined_of(config, settings), PrintedTwin(library.sources, config, settings)
    samples = one.samples[:5000].copy()
    samples[2500, 0] = np.nan
    record, found = core.run_both(samples), twin.run(samples)
    assert np.array_equal(record.hash, found.hash)
    assert (record.told == Reason.UPDATED).any()
    (stage, estimate), (own_stage, own) = core.best, twin.best
    assert stage == own_stage and estimate["p"].tobytes() == np.array(own.p, np.float32).tobytes()
