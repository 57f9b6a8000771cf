"""A build for one design alone: smaller buffers, the same bits whatever the samples; other designs are refused."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from own_mechanisms import OWN, own_recording
from weak_rig import weak_rig
from weak_rig_q31 import rig as rig_q31

from pvid.base.errors import PvidError
from pvid.board.mechanism_image import MechanismRun, mechanism_run, run_of_samples
from pvid.codegen import files_weak
from pvid.codegen.fitted_sizes import config_header, fitted_sizes
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.weak_library import weak_native, weak_sources_q31
from pvid.codegen.weak_stages import column_stages, column_stages_q31, shares_place, shares_place_q31, window_stages
from pvid.configuration.weak import config_for_recording, samples_of
from pvid.core.model_library import ModelSources
from pvid.core.weak_native import WeakNative
from pvid.settings.enums import Reason
from pvid.twin.printed import PrintedTwin


@cache
def run_of(name: str) -> MechanismRun:
    """Of a shipped rig, or of a recording of a mechanism of one's own."""
    if name not in OWN:
        return mechanism_run(name)
    compiled, recording = OWN[name].compiled, own_recording(name)
    config = config_for_recording(compiled, recording)
    return run_of_samples(compiled, config, samples_of(config, recording.signals))


@cache
def fitted(name: str) -> WeakNative:
    run = run_of(name)
    sources = ModelSources(name, files_weak.printed(GeneratedModel(run.compiled, "test")), fitted_sizes(run.config))
    return WeakNative(name, sources.library(), sources)


def test_a_window_and_a_block_share_places_where_there_is_time() -> None:
    sizes = fitted_sizes(run_of("kapitza").config)
    assert (sizes["PVID_MAX_BLOCKS"], sizes["PVID_MAX_WINDOWS"], sizes["PVID_EXACT"]) == (1, 0, 1)
    motor = fitted_sizes(mechanism_run("dc_motor").config)
    assert (motor["PVID_MAX_BLOCKS"], motor["PVID_MAX_WINDOWS"], motor["PVID_EXACT"]) == (2, 1, 1)


@pytest.mark.parametrize("name", ["kapitza", "cart_pendulum"])
def test_stages_are_counted_as_the_core_counts_them(name: str) -> None:
    """Of one kind, and of two with nuisances; a design whose windows find no place is refused."""
    rig, found = weak_rig(name), set()
    sources = replace(rig.native.sources, sizes={**rig.native.sources.sizes, "PVID_MAX_WINDOWS": 0})
    for functions, hop, decimation, iterations, margin in (
        (16, 24, 16, 2, 4.0),
        (8, 24, 16, 1, 0.0),
        (24, 64, 4, 3, 4.0),
    ):
        config = rig.resized(functions=functions, hop=hop, decimation=decimation)
        estimator = replace(config.estimator, noise_margin=margin)
        config = replace(config, estimator=estimator, iterations=iterations)
        found.add(shares_place(config))
        if not shares_place(config):
            with pytest.raises(PvidError, match="refused the configuration"):
                PrintedTwin(sources, config)
            continue
        twin = PrintedTwin(sources, config)
        assert twin.module.pvid_weak_finish_stages_f32(twin.state) == window_stages(config)
        assert twin.module.pvid_weak_finish_columns_f32(twin.state) == column_stages(config)
    assert found == {True, False}


@pytest.mark.parametrize(("name", "decimation"), [("kapitza", 16), ("dc_motor", 64), ("dc_motor", 16)])
def test_stages_in_fixed_point_are_counted_as_the_core_counts_them(name: str, decimation: int) -> None:
    one = rig_q31(name, 3000)
    full = tuple(x // decimation for x in one.design.full_scale)  # a sum over a step fits
    config = replace(one.config, design=replace(one.design, decimation=decimation, full_scale=full))
    sources = weak_sources_q31(one.fixed, one.parameters, config)
    sources = replace(sources, sizes={**sources.sizes, "PVID_MAX_WINDOWS": 0})
    assert shares_place_q31(config.design) == (decimation != 16 or name == "kapitza")
    if shares_place_q31(config.design):
        twin = PrintedTwin(sources, config)
        assert twin.state.finish.known.used
        assert twin.module.pvid_weak_finish_columns_q31(twin.state) == column_stages_q31(config.design)
    else:
        with pytest.raises(PvidError, match="bad iterations"):
            PrintedTwin(sources, config)


@pytest.mark.parametrize("name", ["kapitza", "dc_motor", *OWN])
def test_the_bits_are_those_of_a_roomy_build_with_samples_missing_anywhere(name: str) -> None:
    """Restarts while a block is added, a window joined, its columns formed and its solve under way."""
    run = run_of(name)
    samples, config = np.tile(run.samples, (3, 1)), run.config
    period = config.design.hop * config.design.decimation
    random = np.random.default_rng(5)
    for gap in np.cumsum(2 * period + random.integers(0, max(period // 4, 2), 5)):
        samples[gap] = np.nan
    roomy = weak_native(run.compiled, config.design).identifier_of(config).run_samples(samples)
    found = fitted(name).identifier_of(config).run_samples(samples)
    assert np.array_equal(found.hash, roomy.hash)
    assert np.array_equal(found.reason, roomy.reason)
    reasons = set(roomy.reason.tolist())
    assert Reason.REJECTED_NOT_FINITE in reasons and reasons & {Reason.UPDATED, Reason.HELD_UNCERTAIN}


def test_a_design_without_time_for_one_block_is_refused() -> None:
    hasty = replace(run_of("kapitza").config, design=replace(run_of("kapitza").config.design, decimation=8))
    with pytest.raises(PvidError, match="design"):
        fitted("kapitza").identifier_of(hasty)


def test_the_header_defines_every_size() -> None:
    sizes = fitted_sizes(run_of("kapitza").config)
    text = config_header("kapitza_config", sizes, "test")
    assert all(f"#ifndef {macro}\n#define {macro} {size}\n" in text for macro, size in sizes.items())
