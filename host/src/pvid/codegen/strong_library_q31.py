"""The strong form of a mechanism in fixed-point C, on this computer: generated, compiled, loaded, stepped, twinned."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.codegen import files_strong_q31
from pvid.codegen.strong_q31 import StrongQ31
from pvid.core.headers import Filled
from pvid.core.model_library import ModelSources
from pvid.core.native import Arithmetic, Native, OfEstimator, Stepper
from pvid.core.sizes import roomy
from pvid.settings.cores import STRONG_FIXED
from pvid.settings.record import Record

_MADE_BY = "identification"

_HEADER = """\
#include "{name}_q31.h"
#include "replay_q31.h"

extern const {name}_config_q31 *{name}_settings;

/* Steps an initialised identifier through readings[ticks][signals]. */
void pvid_replay_readings_q31({name}_q31 *self, uint32_t ticks, const int32_t readings[],
                              const pvid_record_q31 *record);
"""

_SOURCE = """\
#include "{name}_replay.h"

#include "{name}_design_q31.h"
#include "record_tick_q31.h"

const {name}_config_q31 *{name}_settings = &{name}_config;

void pvid_replay_readings_q31({name}_q31 *self, uint32_t ticks, const int32_t readings[],
                              const pvid_record_q31 *record)
{{
    for (uint32_t tick = 0; tick < ticks; tick++) {{
        const pvid_reason reason = {name}_step_q31(self, &readings[(size_t)tick * {upper}_SIGNALS]);
        record_tick(record, tick, &self->estimator, reason);
    }}
}}
"""


def strong_sources_q31(strong_q31: StrongQ31) -> ModelSources:
    """C of the strong form for a rig, in fixed point."""
    name = strong_q31.name
    words = {"name": name, "upper": name.upper()}
    texts = {
        **files_strong_q31.files_of(strong_q31, _MADE_BY),
        f"{name}_replay.h": _HEADER.format(**words),
        f"{name}_replay.c": _SOURCE.format(**words),
    }
    return ModelSources(name, texts, roomy(strong_q31.sizes), STRONG_FIXED, (f"{name}_replay.h",))


class StrongNativeQ31(Native):
    """A library of pvid.core.model_library with the strong form for a rig; PvidError when there is no compiler."""

    def __init__(self, strong_q31: StrongQ31) -> None:
        self.strong_q31, self.sources = strong_q31, strong_sources_q31(strong_q31)
        path: Path = self.sources.library()
        super().__init__(path)

    def started(self) -> StrongIdentifierQ31:
        """An initialised identifier."""
        return StrongIdentifierQ31(self)


class StrongIdentifierQ31(Stepper):
    """The identifier: readings of every tick in counts."""

    _prefix = ""

    def __init__(self, native: StrongNativeQ31) -> None:
        name = native.strong_q31.name
        settings = getattr(native.library, f"{name}_settings")[0]  # a constant of the library
        self._owned = native.headers.ffi.new(f"{name}_config_q31 *", settings)
        super().__init__(native, name, "q31", native.strong_q31.config, replay="readings")

    def _filled_with(self, native: Native, kind: str, config: object) -> Filled:
        """A copy of the configuration in the library."""
        return Filled(self._owned[0], {}, {}, [])

    @property
    def estimator(self) -> Any:
        """pvid_estimator_q31 in it."""
        return self.state.estimator

    def _kind_of(self, arithmetic: Arithmetic) -> OfEstimator:
        return OfEstimator(arithmetic.any_model.sizes, f"{self._name}_assess_q31", of_identifier=True)

    def run_samples(self, readings: npt.ArrayLike, *, sums: bool = True, estimate_every: int = 0) -> Record:
        """Steps through readings [ticks, signals]."""
        given = np.ascontiguousarray(readings, np.int32)
        return self._recorded(len(given), [given], sums, True, estimate_every)
