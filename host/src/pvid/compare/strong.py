"""The strong form of a described mechanism in C against its twin on a recording, bit for bit, after every tick."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.codegen.strong_library import strong_native
from pvid.codegen.strong_twin import StrongModelTwin
from pvid.compare.bits import Comparison, first_difference
from pvid.configuration.strong import StrongDesign, strong_design
from pvid.model.compiled import CompiledModel
from pvid.rig.run import Recording
from pvid.settings.enums import Law
from pvid.twin import fnv


@dataclass(frozen=True, eq=False)
class StrongComparison:
    """A recording through the core and its twin.

    Attributes
    ----------
    design : window and settings, as `identify` chooses them
    found : on this computer
    hashes : running hash of the core after every tick [ticks]
    """

    design: StrongDesign
    found: Comparison
    hashes: npt.NDArray[np.uint32]

    @classmethod
    def of(
        cls,
        model: CompiledModel,
        recording: Recording,
        law: Law = Law.STATIONARY,
        progress: Callable[[int], None] | None = None,
    ) -> StrongComparison:
        """Runs a recording through both.

        Raises
        ------
        PvidError
            When there is no C compiler, or the recording is too short.
        """
        design = strong_design(model, recording, law)
        identifier = strong_native(design.strong, design.config).identifier_of(design.config)
        record = identifier.run_samples(design.samples)
        twin = StrongModelTwin(design.strong, design.config).run(design.samples, progress)
        hashes = fnv.running_hashes(twin)
        found = Comparison(
            ticks=len(record.reason),
            core_hash=identifier.running_hash,
            twin_hash=int(hashes[-1]) if len(hashes) else fnv.START,
            difference=first_difference(record, twin, model.p_names, layout=(record.sums.shape[1], 0)),
        )
        return cls(design, found, record.hash)
