"""The strong form of a described mechanism in C against its twin on a recording, bit for bit, after every tick."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.codegen.strong_library import strong_native
from pvid.codegen.strong_library_q31 import StrongNativeQ31
from pvid.codegen.strong_twin import StrongModelTwin
from pvid.codegen.strong_twin_q31 import StrongTwinQ31
from pvid.compare.bits import Comparison, first_difference
from pvid.configuration.strong import StrongDesign, strong_design
from pvid.configuration.strong_q31 import StrongDesignQ31, strong_design_to_identify
from pvid.core.native import Stepper
from pvid.model.compiled import CompiledModel
from pvid.rig.run import Recording
from pvid.settings.cores import STRONG, STRONG_FIXED
from pvid.settings.enums import Core, Law
from pvid.settings.record import Record
from pvid.twin import fnv


@dataclass(frozen=True, eq=False)
class StrongComparison:
    """A recording through the core and its twin.

    Attributes
    ----------
    design : window and settings, as `identify` chooses them
    found : on this computer
    hashes : running hash of the core after every tick [ticks]
    core : arithmetic
    """

    design: StrongDesign | StrongDesignQ31
    found: Comparison
    hashes: npt.NDArray[np.uint32]
    core: Core = STRONG.name

    @classmethod
    def of(
        cls,
        model: CompiledModel,
        recording: Recording,
        law: Law = Law.STATIONARY,
        progress: Callable[[int], None] | None = None,
        core: Core = STRONG.name,
    ) -> StrongComparison:
        """Runs a recording through both.

        Raises PvidError when there is no C compiler, the recording is too short, or fixed point does not have what the
        model needs.
        """
        if core == STRONG_FIXED.name:
            return cls._fixed(strong_design_to_identify(model, recording, law), model.p_names, progress)
        design = strong_design(model, recording, law)
        identifier = strong_native(design.strong, design.config).identifier_of(design.config)
        record = identifier.run_samples(design.samples)
        twin = StrongModelTwin(design.strong, design.config).run(design.samples, progress)
        layout = record.sums.shape[1], 0
        return cls(design, _compared(identifier, record, twin, model.p_names, layout), record.hash)

    @classmethod
    def _fixed(
        cls, design: StrongDesignQ31, names: Sequence[str], progress: Callable[[int], None] | None
    ) -> StrongComparison:
        identifier = StrongNativeQ31(design.strong_q31).started()
        record = identifier.run_samples(design.counts)
        twin = StrongTwinQ31(design.strong_q31).run(design.counts, progress)
        model = design.strong_q31.made.parameters.model
        found = _compared(identifier, record, twin, names, (model.moments, model.n_theta))
        return cls(design, found, record.hash, STRONG_FIXED.name)


def _compared(
    identifier: Stepper, record: Record, twin: Record, names: Sequence[str], layout: tuple[int, int]
) -> Comparison:
    hashes = fnv.running_hashes(twin)
    return Comparison(
        ticks=len(record.reason),
        core_hash=identifier.running_hash,
        twin_hash=int(hashes[-1]) if len(hashes) else fnv.START,
        difference=first_difference(record, twin, names, layout=layout),
    )
