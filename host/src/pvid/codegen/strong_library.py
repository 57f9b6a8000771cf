"""The strong form of a mechanism in C, on this computer: generated, compiled, loaded, stepped through runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.codegen import files_strong
from pvid.codegen.strong import StrongFunctions
from pvid.codegen.strong_twin import StrongModelConfig
from pvid.core.model_library import model_library
from pvid.core.native import Native, Stepper
from pvid.core.sizes import raised
from pvid.settings.engine_cores import STRONG
from pvid.settings.record import Record

MADE_BY = "identification"

_REPLAY_HEADER = """\
#include "{name}.h"
#include "replay.h"

/* Steps an initialised identifier through samples[ticks][signals]. */
void pvid_replay_samples_f32({name}_f32 *self, uint32_t ticks, const float samples[], const pvid_record_f32 *record);
"""

_REPLAY = """\
#include "{name}_replay.h"

#include <stddef.h>

#include "record_tick.h"

void pvid_replay_samples_f32({name}_f32 *self, uint32_t ticks, const float samples[], const pvid_record_f32 *record)
{{
    for (uint32_t tick = 0; tick < ticks; tick++) {{
        const pvid_reason reason = {name}_step_f32(self, &samples[(size_t)tick * {upper}_SIGNALS]);
        record_tick(record, tick, &self->estimator, reason);
    }}
}}
"""


def sizes_of_strong(strong: StrongFunctions, config: StrongModelConfig | None = None) -> dict[str, int]:
    """Sizes of the core's arrays that the strong form of a model needs; `config`: with this bank."""
    functions = strong.functions
    needed = {
        "PVID_MAX_P": len(functions.model.unknowns),
        "PVID_MAX_THETA": len(functions.theta.labels),
        "PVID_MAX_MOMENTS": functions.moments,
    }
    return needed if config is None else {**needed, "PVID_MAX_WINDOW": config.memory}


def strong_texts(strong: StrongFunctions, made_by: str) -> dict[str, str]:
    """The generated files of the identifier: name -> text."""
    name = strong.functions.name
    return {
        f"{name}.h": files_strong.header(strong, made_by),
        f"{name}_f32.c": files_strong.source(strong, made_by),
    }


class StrongModelNative(Native):
    """A library of pvid.core.model_library with the strong form of a model."""

    def __init__(self, strong: StrongFunctions, path: Path) -> None:
        super().__init__(path)
        self.strong = strong

    def identifier_of(self, config: StrongModelConfig) -> StrongModelIdentifier:
        """An initialised identifier."""
        return StrongModelIdentifier(self, config)


class StrongModelIdentifier(Stepper):
    """The identifier: samples of every tick in the units of the model."""

    _prefix = ""

    def __init__(self, native: StrongModelNative, config: StrongModelConfig) -> None:
        super().__init__(native, native.strong.functions.name, "f32", config, replay="samples")

    @property
    def estimator(self) -> Any:
        """pvid_estimator_f32 in it."""
        return self.state.estimator

    def run_samples(self, samples: npt.ArrayLike, *, sums: bool = True, estimate_every: int = 0) -> Record:
        """Steps through samples [ticks, signals], converted to float32 as a board would read them."""
        given = np.ascontiguousarray(samples, np.float32)
        return self._recorded(len(given), [given], sums, True, estimate_every)


def strong_native(strong: StrongFunctions, config: StrongModelConfig) -> StrongModelNative:
    """The library of the strong form of a model, with rings that hold the bank.

    Raises
    ------
    PvidError
        When there is no compiler.
    """
    name = strong.functions.name
    words = {"name": name, "upper": name.upper()}
    texts = {
        **strong_texts(strong, MADE_BY),
        f"{name}_replay.h": _REPLAY_HEADER.format(**words),
        f"{name}_replay.c": _REPLAY.format(**words),
    }
    path = model_library(name, texts, raised(sizes_of_strong(strong, config)), STRONG, [f"{name}_replay.h"])
    return StrongModelNative(strong, path)
