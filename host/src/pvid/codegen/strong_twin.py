"""Twin of NAME_strong_f32.c: printed from that C, with what it includes and calls of the core."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen import files_strong
from pvid.codegen.strong import StrongFunctions
from pvid.core.headers import Placed
from pvid.core.refusals import refused
from pvid.core.sizes import raised
from pvid.core.sources import PUBLIC_FOLDERS, SRC, source
from pvid.settings.enums import Status
from pvid.settings.record import Record
from pvid.settings.strong import StrongModelConfig
from pvid.twin import fnv
from pvid.twin.printer.program import printed_module
from pvid.twin.printer.values import filled
from pvid.twin.state import take_over

_CORE = (
    *("assess_f32", "cholesky_f32", "constraints_f32", "differentiator_f32", "elementary_f32", "finite_f32"),
    *("fnv", "gate_f32", "misfit_f32", "settings_f32", "trust_f32"),
)
_MADE_BY = "the twin"
_LAYOUT = """\
#include "pvid/layout.h"

uint32_t pvid_layout(void)
{
    return PVID_LAYOUT;
}
"""  # layout.c has the sizes in words as well


class StrongModelTwin:
    """The strong form of a model in numpy, in the state after its init.

    Attributes
    ----------
    samples, n_p : numbers of signals and of parameters
    reach : ticks from a sample until the identifier has processed it completely, at most
    running_hash : FNV-1a after the last tick
    refinement : None: the strong form has no second stage
    """

    refinement = None

    def __init__(self, strong: StrongFunctions, config: StrongModelConfig) -> None:
        self._name = strong.functions.name
        sizes = {**files_strong.sizes_of(strong), "PVID_MAX_WINDOW": config.memory}
        self._module = printed_module(
            [source(f"{one}.c") for one in _CORE],
            [*PUBLIC_FOLDERS, SRC],
            {name: str(value) for name, value in raised(sizes).items()},
            [f"{self._name}_{verb}_f32" for verb in ("init_layout", "step", "read_sums", "assess")],
            {**files_strong.files_of(strong, _MADE_BY), "layout.c": _LAYOUT},
        )
        self._config = filled(self._module, f"{self._name}_config_f32", config)
        self._state = getattr(self._module, f"{self._name}_f32")()
        status = self._function("init_layout")(self._state, self._config, self._module.pvid_layout())
        if status != Status.OK:
            raise PvidError(refused(Status(status), config))
        self.samples, self.n_p = len(strong.signals), len(strong.functions.model.unknowns)
        self.reach = config.window + config.block * config.estimator.divider
        self.running_hash = fnv.START

    def _function(self, verb: str) -> Any:
        return getattr(self._module, f"{self._name}_{verb}_f32")

    def take_over(self, placed: Sequence[Placed], running_hash: int) -> None:
        """Goes on from the state and the running hash of a compiled identifier with the same settings."""
        take_over(self._state, placed[0])
        self.running_hash = running_hash

    def run(self, samples: npt.ArrayLike, progress: Callable[[int], None] | None = None) -> Record:
        """Steps through samples [ticks, signals]: p, sums, reason and running hash after every tick."""
        given = np.asarray(samples, np.float32)
        step, read = self._function("step"), self._function("read_sums")
        estimator = self._state.estimator
        ticks, sums = len(given), [np.float32(0)] * len(estimator.low)
        p, all_sums = np.empty((ticks, len(estimator.p)), np.float32), np.empty((ticks, len(sums)), np.float32)
        reasons = np.empty(ticks, np.uint8)
        with np.errstate(all="ignore"):
            for tick in range(ticks):
                reasons[tick] = step(self._state, list(given[tick]))
                read(self._state, sums)
                p[tick], all_sums[tick] = estimator.p, sums
                if progress is not None:
                    progress(1)
        record = Record(p=p, sums=all_sums, reason=reasons)
        record.hash = fnv.running_hashes(record, self.running_hash)
        self.running_hash = int(record.hash[-1]) if ticks else self.running_hash
        return record

    @property
    def counters(self) -> dict[str, int]:
        """pvid_counters by name."""
        counters = self._state.estimator.counters
        return {name: int(getattr(counters, name)) for name in type(counters).__slots__}

    @property
    def estimate(self) -> Any:
        """The present estimate with its standard errors: pvid_estimate_f32 as printed."""
        estimate = self._module.pvid_estimate_f32()
        with np.errstate(all="ignore"):
            self._function("assess")(self._state, estimate)
        return estimate
