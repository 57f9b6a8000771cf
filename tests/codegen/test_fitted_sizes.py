"""A build for one design alone: smaller buffers, the same bits whatever the samples; other designs are refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pvid.base.errors import PvidError
from pvid.board.mechanism_image import MechanismRun, mechanism_run
from pvid.codegen import files_weak
from pvid.codegen.fitted_sizes import config_header, fitted_sizes
from pvid.codegen.weak import weak_functions_of
from pvid.codegen.weak_library import weak_native
from pvid.core.model_library import ModelSources
from pvid.core.weak_native import WeakNative
from pvid.settings.enums import Reason
from pvid.setup.weak_sizes import sizes_of_model


def pendulum() -> MechanismRun:
    return mechanism_run("kapitza")


@cache
def fitted() -> WeakNative:
    made, model = weak_functions_of(pendulum().compiled), pendulum().config.design.model
    texts = {
        f"{made.name}_weak.h": files_weak.header(made, model, sizes_of_model(model), "test"),
        f"{made.name}_weak_f32.c": files_weak.source(made, model, "test"),
    }
    sources = ModelSources(made.name, texts, fitted_sizes(pendulum().config))
    return WeakNative(made.name, sources.library(), sources)


def test_a_window_and_a_block_share_places_where_there_is_time() -> None:
    sizes = fitted_sizes(pendulum().config)
    assert (sizes["PVID_MAX_BLOCKS"], sizes["PVID_MAX_WINDOWS"], sizes["PVID_EXACT"]) == (1, 0, 1)
    motor = fitted_sizes(mechanism_run("dc_motor").config)
    assert (motor["PVID_MAX_BLOCKS"], motor["PVID_MAX_WINDOWS"], motor["PVID_EXACT"]) == (2, 1, 1)


def test_the_bits_are_those_of_a_roomy_build_with_samples_missing_anywhere() -> None:
    """Restarts while a block is added, a window joined, its columns formed and its solve under way."""
    samples = np.tile(pendulum().samples, (3, 1))
    period = pendulum().config.design.hop * pendulum().config.design.decimation
    random = np.random.default_rng(5)
    for gap in np.cumsum(2 * period + random.integers(0, period // 4, 5)):
        samples[gap] = np.nan
    roomy = (
        weak_native(pendulum().compiled, pendulum().config.design).identifier_of(pendulum().config).run_samples(samples)
    )
    found = fitted().identifier_of(pendulum().config).run_samples(samples)
    assert np.array_equal(found.hash, roomy.hash)
    assert np.array_equal(found.reason, roomy.reason)
    assert {Reason.REJECTED_NOT_FINITE, Reason.HELD_UNCERTAIN} <= set(roomy.reason.tolist())


def test_a_design_without_time_for_one_block_is_refused() -> None:
    hasty = replace(pendulum().config, design=replace(pendulum().config.design, decimation=8))
    with pytest.raises(PvidError, match="design"):
        fitted().identifier_of(hasty)


def test_the_header_defines_every_size() -> None:
    sizes = fitted_sizes(pendulum().config)
    text = config_header("kapitza_config", sizes, "test")
    assert all(f"#ifndef {macro}\n#define {macro} {size}\n" in text for macro, size in sizes.items())
