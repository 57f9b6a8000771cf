"""The refinement in C, stepped through runs behind the published estimates of a weak form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.settings.enums import Status
from pvid.settings.refine import RefineConfig

Float32 = npt.NDArray[np.float32]

_SHAPE = ("order", "coordinates", "inputs", "outputs", "moving", "parameters", "skew", "p")


@dataclass(frozen=True)
class RefineRecord:
    """One entry a tick along the first axis.

    Attributes
    ----------
    reason : uint8 [ticks]
    hash : running hash, uint32 [ticks]
    r, se : published parameters and standard errors [ticks, parameters]; 0 where there is no published estimate
    """

    reason: npt.NDArray[np.uint8]
    hash: npt.NDArray[np.uint32]
    r: Float32
    se: Float32


class RefineNative:
    """An initialised refinement in C memory; its state persists between calls of `run`.

    Raises PvidError when init refuses the configuration.
    """

    def __init__(self, native: Native, config: RefineConfig) -> None:
        self.native = native
        samples = 1 + max(one.sample for one in config.signal)
        headers = native.headers
        shape = np.zeros(8, np.uint32)
        native.library.pvid_replay_refine_shape(headers.pointer(shape))
        self.shape = dict(zip(_SHAPE, shape.tolist(), strict=True))
        self._filled = headers.filled("pvid_refine_config_f32", config)
        self.state: Any = headers.ffi.new("pvid_refine_f32 *")
        self._hash = np.array([0x811C9DC5], np.uint32)
        address = headers.ffi.addressof(self._filled.struct)
        status = Status(native.library.pvid_refine_init_f32(self.state, address, samples, headers.ffi.NULL))
        if status is not Status.OK:
            raise PvidError(f"the core refused the settings of the refinement: {status.text}")

    def run(self, samples: npt.ArrayLike, weak_p: npt.ArrayLike, weak_se: npt.ArrayLike) -> RefineRecord:
        """Steps through samples [ticks, samples] with the weak form's estimates at the ticks at which they are new
        [ticks, p], NaN at all others."""
        pointer = self.native.headers.pointer
        given = [np.ascontiguousarray(x, np.float32) for x in (samples, weak_p, weak_se)]
        ticks, entries, n = len(given[0]), given[0].shape[1], self.shape["parameters"]
        record = RefineRecord(
            reason=np.zeros(ticks, np.uint8),
            hash=np.zeros(ticks, np.uint32),
            r=np.zeros((ticks, n), np.float32),
            se=np.zeros((ticks, n), np.float32),
        )
        self.native.library.pvid_replay_refine_f32(
            self.state, ticks, entries, *map(pointer, given), pointer(self._hash), pointer(record.reason),
            pointer(record.hash), pointer(record.r), pointer(record.se),
        )  # fmt: skip
        return record
