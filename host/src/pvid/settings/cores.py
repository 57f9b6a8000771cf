"""The weak form in float32 and in fixed point, the strong form of any model, and robots: what differs by name alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pvid.settings.enums import Core


@dataclass(frozen=True)
class CoreBuild:
    """A form and an arithmetic of the C core, as libraries of a mechanism are built.

    Attributes
    ----------
    name : f32 or q31
    words : what a user calls it
    replay : source of host/native that steps the identifier through a recording; None: it is generated
    without : ends of the names of sources that it does without
    room : of the core, beside those that every form has
    """

    name: Core
    words: str
    replay: str | None
    without: tuple[str, ...]
    room: str = "weak"


FLOAT = CoreBuild("f32", "float32", "replay_weak", ("_q31",))
FIXED = CoreBuild("q31", "fixed point", "replay_weak_q31", ("_f32",))
STRONG = CoreBuild("f32", "float32", None, ("_q31", "_weak_f32", "_refine_f32"), "strong")
STRONG_FIXED = CoreBuild("q31", "fixed point", None, ("_f32", "_weak_q31"), "strong")
ROBOT = CoreBuild("f32", "float32", None, ("_q31", "_weak_f32", "_refine_f32"), "robot")
STRONG_CORES: Mapping[str, CoreBuild] = {one.name: one for one in (STRONG, STRONG_FIXED)}
CORES: Mapping[str, CoreBuild] = {one.name: one for one in (FLOAT, FIXED)}
