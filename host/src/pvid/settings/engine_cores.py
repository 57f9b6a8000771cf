"""The weak engine in float32 and in fixed point: what differs by name alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pvid.settings.enums import Core


@dataclass(frozen=True)
class EngineCore:
    """An arithmetic of the engine.

    Attributes
    ----------
    name : f32 or q31
    words : what a user calls it
    replay : source of host/native that steps the engine through a recording
    without : ends of the names of sources that the engine does without
    """

    name: Core
    words: str
    replay: str
    without: tuple[str, ...]


FLOAT = EngineCore("f32", "float32", "replay_fourier", ("_q31", "_strong_f32", "_weak_f32"))
FIXED = EngineCore("q31", "fixed point", "replay_fourier_q31", ("_f32", "_strong_q31", "_weak_q31", "fingerprint_q31"))
ENGINE_CORES: Mapping[str, EngineCore] = {one.name: one for one in (FLOAT, FIXED)}
