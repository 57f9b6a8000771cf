"""Twin of gate_f32.c: accepted residuals, in several lanes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.f32 import GateConfig

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

_GROWTH = np.float32(9.21034)
_WIDEST = np.float32(1e3)
_SCALE_MAX = np.float32(1e30)


class Gate:
    """The gate of every lane; all share the configuration, `floor` [lanes] is their own."""

    def __init__(self, config: GateConfig, rate: np.float32, memory: np.float32, floor: Float32) -> None:
        self.limit = np.float32(config.sigmas) * np.float32(config.sigmas)
        patience = np.float32(config.patience_s)
        residuals = patience * rate
        growth = np.float32(0)
        if patience > 0:
            growth = _GROWTH / residuals if residuals > _GROWTH / _WIDEST else _WIDEST
        self.memory = memory if memory >= 1 else np.float32(1)
        self.floor = floor
        self.widening = np.float32(1) + growth
        self.judged = np.zeros(len(floor), np.float32)
        self.scale = floor.copy()
        self.usual = floor.copy()

    @property
    def is_on(self) -> bool:
        """Whether it looks at anything."""
        return bool(self.limit > 0)

    def begin_anew(self, lanes: Mask) -> None:
        """Forgets the usual size in these lanes: the next residuals are accepted, as the first ones were."""
        self.judged = np.where(lanes, np.float32(0), self.judged)

    def passes(self, square: Float32) -> Mask:
        """Which lanes let a residual of this square in [lanes]."""
        if not self.is_on:
            return np.ones(len(square), np.bool_)
        with np.errstate(all="ignore"):
            known = np.isfinite(square)
            warming_up = self.judged < self.memory
            passes = warming_up | (square <= self.limit * self.scale)
            judged = np.where(passes & warming_up, self.judged + np.float32(1), self.judged)
            taken = self.scale + (square - self.scale) / judged
            scale = np.where(passes, taken, self.scale * self.widening)
            scale = np.where(scale > self.floor, scale, self.floor)
            scale = np.where(scale < _SCALE_MAX, scale, _SCALE_MAX)
        self.judged = np.where(known, judged, self.judged)
        self.scale = np.where(known, scale, self.scale)
        return passes | ~known

    def judge(self, square: Float32) -> tuple[Mask, Mask]:
        """Which lanes let a residual of this square in, and which of them did not before [lanes]."""
        widened = self.scale > self.usual
        passes = self.passes(square)
        known = passes & np.isfinite(square)
        if not self.is_on:
            return passes, np.zeros_like(passes)
        with np.errstate(all="ignore"):
            opens = known & widened & (square > self.limit * self.usual)
        self.usual = np.where(known, self.scale, self.usual)
        return passes, opens
