"""The strong form of a mechanism in C, on this computer: generated, compiled, loaded, stepped through runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.codegen import files_strong
from pvid.codegen.strong import StrongFunctions
from pvid.core.model_library import model_library
from pvid.core.native import Arithmetic, Native, OfEstimator, Stepper
from pvid.core.sizes import raised
from pvid.settings.cores import STRONG
from pvid.settings.record import Record
from pvid.settings.strong import StrongModelConfig

MADE_BY = "identification"

_REPLAY_HEADER = """\
#include "{name}.h"
#include "replay.h"

/* Steps an initialised identifier through samples[ticks][signals]. */
void pvid_replay_samples_f32({name}_f32 *self, uint32_t ticks, const float samples[], const pvid_record_f32 *record);

/* The same through inputs[ticks][inputs] of the rows. */
void pvid_replay_inputs_f32({name}_f32 *self, uint32_t ticks, const float inputs[], const pvid_record_f32 *record);
"""

_REPLAY = """\
#include "{name}_replay.h"

#include <stddef.h>
#include <string.h>

static void record_tick(const pvid_record_f32 *record, uint32_t tick, const {name}_f32 *self, pvid_reason reason)
{{
    memcpy(&record->p[(size_t)tick * {upper}_P], self->estimator.p, sizeof self->estimator.p);
    if (record->sums != NULL) {{
        {name}_read_sums_f32(self, &record->sums[(size_t)tick * {upper}_SUMS]);
    }}
    record->reason[tick] = (uint8_t)reason;
    *record->running_hash = {name}_fnv_f32(*record->running_hash, &self->estimator, reason);
    if (record->hash != NULL) {{
        record->hash[tick] = *record->running_hash;
    }}
    if ((record->estimate != NULL) && ((tick % record->estimate_every) == 0u)) {{
        {name}_assess_f32(self, &record->estimate[tick / record->estimate_every]);
    }}
}}

void pvid_replay_samples_f32({name}_f32 *self, uint32_t ticks, const float samples[], const pvid_record_f32 *record)
{{
    for (uint32_t tick = 0; tick < ticks; tick++) {{
        const pvid_reason reason = {name}_step_f32(self, &samples[(size_t)tick * {upper}_SIGNALS]);
        record_tick(record, tick, self, reason);
    }}
}}

void pvid_replay_inputs_f32({name}_f32 *self, uint32_t ticks, const float inputs[], const pvid_record_f32 *record)
{{
    for (uint32_t tick = 0; tick < ticks; tick++) {{
        const pvid_reason reason = {name}_row_step_f32(self, &inputs[(size_t)tick * {upper}_INPUTS]);
        record_tick(record, tick, self, reason);
    }}
}}
"""


def sizes_of_strong(strong: StrongFunctions, config: StrongModelConfig | None = None) -> dict[str, int]:
    """Sizes of the core's arrays that the strong form of a model needs; `config`: with this bank."""
    needed = files_strong.sizes_of(strong)
    return needed if config is None else {**needed, "PVID_MAX_WINDOW": config.memory}


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
        """NAME_strong_estimator_f32 in it."""
        return self.state.estimator

    def _kind_of(self, arithmetic: Arithmetic) -> OfEstimator:
        return OfEstimator(lambda one: (len(one.p), len(one.low)), f"{self._name}_assess_f32", of_identifier=True)

    def run_samples(self, samples: npt.ArrayLike, *, sums: bool = True, estimate_every: int = 0) -> Record:
        """Steps through samples [ticks, signals], converted to float32 as a board would read them."""
        given = np.ascontiguousarray(samples, np.float32)
        return self._recorded(len(given), [given], sums, True, estimate_every)


def strong_native(strong: StrongFunctions, config: StrongModelConfig) -> StrongModelNative:
    """The library of the strong form of a model, with rings that hold the bank.

    Raises PvidError when there is no compiler.
    """
    name = strong.functions.name
    words = {"name": name, "upper": name.upper()}
    texts = {
        **files_strong.files_of(strong, MADE_BY),
        f"{name}_replay.h": _REPLAY_HEADER.format(**words),
        f"{name}_replay.c": _REPLAY.format(**words),
    }
    path = model_library(name, texts, raised(sizes_of_strong(strong, config)), STRONG, [f"{name}_replay.h"])
    return StrongModelNative(strong, path)
