"""The weak form of a compiled mechanism in C: its library, and an identifier that is stepped through runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.core.headers import Placed
from pvid.core.model_library import ModelSources
from pvid.core.native import Native, Publisher
from pvid.settings.enums import Reason, Stage
from pvid.settings.record import Record
from pvid.settings.refine import RefineConfig
from pvid.settings.weak import Float32, WeakConfig


class WeakNative(Native):
    """A library of pvid.core.model_library.

    Parameters
    ----------
    name : of the mechanism, in C
    path : of the library
    sources : what it was made of
    """

    def __init__(self, name: str, path: Path, sources: ModelSources) -> None:
        super().__init__(path)
        self.sources = sources
        self.model: Any = self.headers.ffi.addressof(self.library, f"{name}_weak_f32")

    def identifier_of(self, config: WeakConfig) -> WeakIdentifier:
        """An initialised identifier."""
        return WeakIdentifier(self, config)

    def refined_of(self, config: WeakConfig, refine: RefineConfig) -> RefinedIdentifier:
        """An initialised identifier with its second stage; the library has it."""
        return RefinedIdentifier(self, config, refine)

    def values(self, inputs: npt.ArrayLike) -> Float32:
        """The generated function: gains, then integrands [vectors, results] from inputs [vectors, inputs]."""
        given = np.ascontiguousarray(inputs, np.float32)
        out = np.zeros((len(given), int(self.model.gains + self.model.integrands)), np.float32)
        pointer = self.headers.pointer
        self.library.pvid_replay_function_f32(
            self.model.values, len(given), given.shape[1], out.shape[1], pointer(given), pointer(out)
        )
        return out


class WeakIdentifier(Publisher):
    """The identifier: samples of every tick in the units of the model."""

    def __init__(self, native: WeakNative, config: WeakConfig, **given: Any) -> None:
        self._model = native.model
        self.sources = native.sources
        self.config = config
        super().__init__(native, "weak", "f32", config, replay="weak", **given)

    def initialise(self) -> Any:
        """Runs init on the present configuration, with the library's model."""
        self._filled.designs["design"].model = self._model
        return super().initialise()

    def run_samples(
        self, samples: npt.ArrayLike, *, sums: bool = True, hashes: bool = True, estimate_every: int = 0
    ) -> Record:
        """Steps through samples [ticks, samples], converted to float32 as a board would read them."""
        given = np.ascontiguousarray(samples, np.float32)
        return self._recorded(len(given), [given], sums, hashes, estimate_every)


@dataclass(frozen=True)
class RefinedRecord:
    """One entry a tick along the first axis.

    Attributes
    ----------
    reason : of the weak form, uint8 [ticks]
    told : reason of the refinement's last block, uint8 [ticks]
    busy : whether the weak form was, uint8 [ticks]
    weak_p, weak_se : estimates of the weak form, trusted or not, where they are new [ticks, p]; NaN at all others
    r, se : published parameters and standard errors of the refinement [ticks, parameters]; 0 where there is none
    hash : running hash of both stages, uint32 [ticks]
    """

    reason: npt.NDArray[np.uint8]
    told: npt.NDArray[np.uint8]
    busy: npt.NDArray[np.uint8]
    weak_p: Float32
    weak_se: Float32
    r: Float32
    se: Float32
    hash: npt.NDArray[np.uint32]


class RefinedIdentifier(WeakIdentifier):
    """The identifier with its second stage, which `refinement` is in C."""

    def __init__(self, native: WeakNative, config: WeakConfig, refine: RefineConfig) -> None:
        ffi, library = native.headers.ffi, native.library
        self.refinement = ffi.new("pvid_refine_f32 *")
        self.refine_filled = native.headers.filled("pvid_refine_config_f32", refine)
        settings = ffi.addressof(self.refine_filled.struct)
        stage = ffi.addressof(library, next(one for one in dir(library) if one.startswith("pvid_refiner_f32")))
        self._second = ffi.new("pvid_weak_refine_f32 *", [stage, self.refinement, settings])
        super().__init__(native, config, also=(refine,), refine=self._second)

    @property
    def placed(self) -> list[Placed]:
        """Its objects in C memory: of both stages."""
        return [*super().placed, self.native.headers.placed(self.refinement)]

    @property
    def told(self) -> Reason:
        """Reason of the refinement's last block."""
        return Reason(self.native.library.pvid_refine_reason_f32(self.refinement))

    @property
    def refined(self) -> npt.NDArray[np.void] | None:
        """The published estimate of the refinement; None: there is none."""
        number = int(self.refinement.mark.number[0])
        return self.native.headers.viewed(self.refinement.estimate) if number else None

    @property
    def best(self) -> tuple[Stage, npt.NDArray[np.void]]:
        """Whose estimate is published, and the estimate."""
        library, estimate = self.native.library, self.native.headers.ffi.new("pvid_estimate_f32 *")
        stage = library.pvid_refine_best_f32(self.refinement, library.pvid_weak_estimate_f32(self.state), estimate)
        return Stage(stage), self.native.headers.viewed(estimate[0]).copy()

    def run_both(self, samples: npt.ArrayLike) -> RefinedRecord:
        """Steps through samples [ticks, samples]."""
        headers = self.native.headers
        given = np.ascontiguousarray(samples, np.float32)
        p, n = len(self.refinement.weak_se), len(self.refinement.r)
        record = RefinedRecord(
            reason=np.zeros(len(given), np.uint8),
            told=np.zeros(len(given), np.uint8),
            busy=np.zeros(len(given), np.uint8),
            weak_p=np.full((len(given), p), np.nan, np.float32),
            weak_se=np.full((len(given), p), np.nan, np.float32),
            r=np.zeros((len(given), n), np.float32),
            se=np.zeros((len(given), n), np.float32),
            hash=np.zeros(len(given), np.uint32),
        )
        arrays = (
            given, record.reason, record.told, record.busy, record.weak_p, record.weak_se, record.r, record.se,
            self._hash, record.hash,
        )  # fmt: skip
        self.native.library.pvid_replay_both_stages_f32(self.state, len(given), *map(headers.pointer, arrays))
        return record
