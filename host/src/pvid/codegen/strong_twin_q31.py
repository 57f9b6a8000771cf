"""Twin of NAME_strong_q31.c: printed from that C, with what it includes and calls of the core."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from pvid.codegen.strong_library_q31 import strong_sources_q31
from pvid.codegen.strong_q31 import StrongQ31
from pvid.core.model_library import NATIVE, core_of
from pvid.core.sources import FOLDERS
from pvid.settings.record import Record
from pvid.twin.printer.program import printed_module


class StrongTwinQ31:
    """The strong form of a rig in integers of Python, in the state after its init.

    Attributes
    ----------
    state : NAME_strong_q31 as printed
    """

    def __init__(self, strong_q31: StrongQ31) -> None:
        sources, name = strong_sources_q31(strong_q31), strong_q31.name
        self._module = printed_module(
            core_of(sources.build, False),
            [*FOLDERS, NATIVE],
            {macro: str(size) for macro, size in sources.sizes.items()},
            [*(f"{name}_{verb}_q31" for verb in ("init_layout", "step", "gap", "freeze")), f"{name}_config"],
            sources.texts,
        )
        self._name = name
        self.state = getattr(self._module, f"{name}_q31")()
        given = getattr(self._module, f"{name}_config")
        status = self._function("init_layout")(self.state, given, self._module.pvid_layout())
        assert status == 0, status

    def _function(self, verb: str) -> Callable[..., int]:
        function: Callable[..., int] = getattr(self._module, f"{self._name}_{verb}_q31")
        return function

    def gap(self) -> None:
        """Samples are missing before the next call of `run`."""
        self._function("gap")(self.state)

    def freeze(self, frozen: bool) -> None:
        """Freezes or resumes it."""
        self._function("freeze")(self.state, frozen)

    def run(self, readings: npt.ArrayLike, progress: Callable[[int], None] | None = None) -> Record:
        """Steps through readings [ticks, signals]: p, sums, exponent and reason after every tick."""
        given = np.asarray(readings, np.int32).tolist()
        step, estimator = self._function("step"), self.state.estimator
        information = estimator.information
        n_p, n_sums = int(estimator.model.n_p), int(information.n_sums)
        p, sums = np.empty((len(given), n_p), np.int32), np.empty((len(given), n_sums), np.int64)
        exponents, reasons = np.empty(len(given), np.uint8), np.empty(len(given), np.uint8)
        for tick, reading in enumerate(given):
            reasons[tick] = step(self.state, reading)
            p[tick], sums[tick] = estimator.p[:n_p], information.sums[:n_sums]
            exponents[tick] = information.exponent
            if progress is not None:
                progress(1)
        return Record(p=p, sums=sums, reason=reasons, exponent=exponents)
