"""Twin of the counters of the weak engine's front end, in either arithmetic."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.weak import Source, WeakDesign32
from pvid.settings.weak_q31 import WeakDesignQ31


@dataclass(frozen=True)
class FrontTicks:
    """The work of the ticks of a stretch. Ticks count from its first sample.

    Attributes
    ----------
    half : of the longest compensator [steps]
    decimation : D
    held : a signal needs the next sample
    lost : outputs before those of the first step
    apart : ticks from a step's jets to its channels
    """

    half: int
    decimation: int
    held: bool
    lost: int
    apart: int

    @classmethod
    def of(cls, design: WeakDesign32 | WeakDesignQ31, half: int, apart: int = 0) -> FrontTicks:
        """Those of a design with compensators of so many steps to either side."""
        sources = {one.source for one in design.model.signal}
        lost = 1 if design.decimation > 1 else max(2 - half, 0) if sources != {Source.SAMPLED} else 0
        return cls(half, design.decimation, Source.HELD in sources, lost, apart)

    @property
    def first(self) -> int:
        """Sample to whose instant the first step refers."""
        return self.decimation * (self.lost + self.half)

    @property
    def free_ticks(self) -> int:
        """Ticks of a step that add harmonics or run stages, with those that do so at every tick."""
        return max(self.decimation - 1 - self.apart, 1)

    def tick_of(self, step: int) -> int:
        """Tick that takes the jets of a step to the channels."""
        return self.decimation * (self.lost + 2 * self.half + 1 + step) - 1 + self.held + self.apart

    def steps(self, ticks: int) -> int:
        """Steps whose jets have been taken after a stretch of so many ticks."""
        return max(0, (ticks - 1 - self.tick_of(0)) // self.decimation + 1)

    def ends(self, ticks: int) -> npt.NDArray[np.bool_]:
        """Which ticks end a step [ticks]."""
        place = np.arange(1, ticks + 1) - self.held
        return np.asarray((place > 0) & (place % self.decimation == 0))

    def free(self, ticks: int) -> npt.NDArray[np.bool_]:
        """Which ticks add harmonics or run stages [ticks]."""
        used = self.ends(ticks)
        if self.apart:
            used[self.tick_of(0) :: self.decimation] = True
        return np.asarray((self.decimation == 1) | ~used)
