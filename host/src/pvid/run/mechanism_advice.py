"""What makes a recording that a mechanism's equations do not explain fit them: a sign, or a unit; also of the time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pvid.model.compiled import Signal
from pvid.oracle.weak.choice import score_of
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import ready
from pvid.rig.columns import Columns
from pvid.rig.mechanism_file import channels_of
from pvid.run.mechanism import MechanismAnswer

# Residuals over what the sensors explain, above which a mistake is sought.
_MISFIT = 20.0
# A mistake is named if the run then leaves less than this part of them, and determines every parameter.
_PART = 1 / 30
_TIMES = ("ms", "us")
_FAR, _NEAR = 30.0, 10.0  # factor of a parameter's guess: the time is doubted beyond the one, right within the other
# By unit: what a column may be in instead, and what to type for it.
_UNITS = {
    "rad": {"deg": "deg", "rev": "rev"},
    "rad/s": {"deg/s": f"{np.pi / 180:.9g}"},
    "m": {"mm": "mm", "cm": "cm"},
    **{unit: {f"m{unit}": f"m{unit}"} for unit in ("A", "V", "N")},
}


def advised(answer: MechanismAnswer) -> MechanismAnswer:
    """The answer with its advice."""
    return replace(answer, advice=advice_on(answer))


@np.errstate(all="ignore")  # what diverges is judged and left out
def advice_on(answer: MechanismAnswer) -> tuple[str, ...]:
    """A sentence with what to type, or none; some tenths of a second, where the answer is bad alone.

    Each signal in turn has the other sign or another usual unit, with the design of the answer.
    """
    if (unit := _unit_of_time(answer)) is not None:
        return (f"t seems to be in {unit}, not s: --columns t=t:{unit}",)
    if answer.identified and answer.found.chi2 < _MISFIT:
        return ()
    run = answer.recording.signals
    idle = [one for one in answer.model.signals if one.kind == "input" and not np.any(run[one.name])]
    if idle:
        return (f"{idle[0].name} is 0 in every sample: is it the column of the drive?",)
    found = min(_tried(answer), default=None)
    return () if found is None else (found[1],)


def _unit_of_time(answer: MechanismAnswer) -> str | None:
    """In which the parameters come near their guesses; None where they are near as it is, or in no unit. Residuals do
    not tell: another unit of time gives a linear mechanism other parameters and the same motion."""
    if _distance(answer, answer.found.p) < _FAR:
        return None
    model, signals, design = ready(answer.model), answer.recording.signals, answer.found.design
    for unit in _TIMES:
        scale = float(Columns.parse(f"t=t:{unit}", channels_of(answer.model))["t"].in_si(np.ones(1))[0])
        other = replace(design, sample_rate=design.sample_rate / scale, window_s=design.window_s * scale)
        one = score_of(model, signals, other, None, False)
        if one is not None and one.known and _distance(answer, one.p) < _NEAR:
            return unit
    return None


def _distance(answer: MechanismAnswer, p: Float) -> float:
    """The largest factor between a positive parameter and its guess."""
    of = [value / one.guess for value, one in zip(p, answer.model.unknowns, strict=True) if one.positive]
    return max((max(ratio, 1 / ratio) if ratio > 0 else np.inf for ratio in of), default=1.0)


def _tried(answer: MechanismAnswer) -> Iterator[tuple[float, str]]:
    """chi^2 and sentence of what explains the run."""
    model, signals, design = ready(answer.model), answer.recording.signals, answer.found.design
    before = score_of(model, signals, design, None, False)
    most = np.inf if before is None or not before.known else _PART * before.chi2
    channels = channels_of(answer.model)
    for signal in answer.model.signals:
        name = signal.name
        if name not in signals:
            continue
        for said, unit in _mistakes(signal):
            typed = f"{name}={name}:{unit}"
            changed = {**signals, name: Columns.parse(typed, channels)[name].in_si(signals[name])}
            one = score_of(model, changed, design, None, False)
            if one is not None and one.known and one.chi2 < min(most, _MISFIT):
                yield one.chi2, f"{said}: --columns {typed}"


def _mistakes(signal: Signal) -> Iterator[tuple[str, str]]:
    """What is said of a signal, and what to type behind its column."""
    yield f"{signal.name} seems to have the opposite sign", "-1"
    for unit, typed in _UNITS.get(signal.unit, {}).items():
        yield f"{signal.name} seems to be in {unit}, not {signal.unit}", typed
