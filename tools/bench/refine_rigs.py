"""Both stages in C, as on a board, on the random rigs of a campaign: which stage answers, and how well."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.campaign.judge import NAMES, SUFFICES, Judgement
from bench.campaign.population import shipped
from bench.campaign.truth import SimulatedRig, simulate_rig
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.identification.analysis import analysed
from pvid.identification.answer import Value
from pvid.identification.core import identify_in_c
from pvid.identification.core_refined import refined_in_c
from pvid.identification.reading import read_all

HEADER = (
    "condition",
    "rigs",
    "data suffice",
    "refined",
    "weak form alone",
    "none",
    "no steps",
    "answered",
    "wrong, no warning",
    "error %: refined",
    "of the same, weak",
)
# What the equations of a condition need.
_OPTIONS = {"dry": {"dry_friction": True}, "nonvert": {"slant": True}}


@dataclass(frozen=True)
class Outcome:
    """Of a rig.

    Attributes
    ----------
    suffices : its data
    refined, weak : judgements of the stages' last estimates; None where there is none
    steps : the sample rate has room for the steps of the second stage
    warned : of the weak form
    """

    condition: str
    suffices: bool
    refined: Judgement | None
    weak: Judgement | None
    steps: bool
    warned: bool

    @property
    def published(self) -> Judgement | None:
        """Of the stage whose estimate is the one to use."""
        return self.refined if self.refined is not None else self.weak

    @property
    def wrong(self) -> bool:
        """Without a warning, which a refined estimate never has."""
        one = self.published
        return one is not None and bool(one.wrong) and (self.refined is not None or not self.warned)


def _judged(values: Mapping[str, Value], rig: SimulatedRig) -> Judgement | None:
    found = [values[name] for name in NAMES]
    p, se = ([getattr(one, name) for one in found] for name in ("value", "se"))
    return None if None in p or None in se else Judgement.of(p, se, rig.p)


def outcome_of(simulated: SimulatedRig) -> Outcome:
    """Identifies a rig as `identify --core f32 --refine` does, with the options that its condition needs."""
    run, condition = simulated.run, simulated.rig.condition
    file = replace(simulated.file, refine=_OPTIONS.get(condition, {}))
    recording, model = read_all(file, [lambda _: run.recording], (), None)
    suffices = bool((simulated.bound[:2] < SUFFICES).all())
    try:
        weak = identify_in_c(analysed(recording, model), "f32")
    except PvidError:
        return Outcome(condition, suffices, None, None, True, False)
    refined, steps = None, True
    try:
        both = refined_in_c(weak)
        refined = _judged(both.values, simulated) if both.adopted and both.identified else None
    except PvidError:  # too few samples a second
        steps = False
    of_weak = _judged(weak.values, simulated) if weak.identified else None
    return Outcome(condition, suffices, refined, of_weak, steps, weak.verdict.warning is not None)


def outcomes_of(rigs: int, seed: int, progress: Callable[[], None]) -> list[Outcome]:
    """Of the first rigs of a seed."""
    native, population, found = Native(), shipped(), []
    for index in range(rigs):
        found.append(outcome_of(simulate_rig(native, population, seed, index)))
        progress()
    return found


def _median(judgements: Sequence[Judgement | None]) -> str:
    errors = [100 * float(one.relative.max()) for one in judgements if one is not None]
    return f"{np.median(errors):.2g}" if errors else "-"


def _row(name: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    """Cells as in HEADER; from the fourth on, of rigs whose data suffice."""
    good = [one for one in outcomes if one.suffices]
    refined = [one for one in good if one.refined is not None]
    weak = [one for one in good if one.refined is None and one.weak is not None]
    answered = sum(one.published is not None and bool(one.published.answers) for one in good)
    return (
        name,
        *map(str, (len(outcomes), len(good), len(refined), len(weak), len(good) - len(refined) - len(weak))),
        str(sum(not one.steps for one in good)),
        str(answered),
        str(sum(one.wrong for one in good)),
        _median([one.refined for one in refined]),
        _median([one.weak for one in refined]),
    )


def table_of(outcomes: Sequence[Outcome]) -> list[tuple[str, ...]]:
    """A row a condition, and one for all."""
    conditions = sorted({one.condition for one in outcomes})
    return [
        *(_row(name, [one for one in outcomes if one.condition == name]) for name in conditions),
        _row("all", outcomes),
    ]
