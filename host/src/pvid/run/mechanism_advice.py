"""What makes a recording that a mechanism's equations do not explain fit them: a sign, or a unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pvid.model.compiled import Signal
from pvid.oracle.weak.choice import score_of
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import ready
from pvid.run.mechanism import MechanismAnswer

# Residuals over what the sensors explain, above which a mistake is sought.
_MISFIT = 20.0
# A mistake is named if the run then leaves less than this part of them, and determines every parameter.
_PART = 1 / 30
# By unit: what a column may be in instead, and its factor.
_UNITS = {
    "rad": (("deg", np.pi / 180), ("rev", 2 * np.pi)),
    "rad/s": (("deg/s", np.pi / 180),),
    "m": (("mm", 1e-3), ("cm", 1e-2)),
    **{unit: ((f"m{unit}", 1e-3),) for unit in ("A", "V", "N")},
}


@np.errstate(all="ignore")  # what diverges is judged and left out
def advice_on(answer: MechanismAnswer) -> tuple[str, ...]:
    """A sentence with what to type, or none; some tenths of a second, where the answer is bad alone.

    Each signal in turn has the other sign or another usual unit, with the design of the answer.
    """
    if answer.identified and answer.found.chi2 < _MISFIT:
        return ()
    run = answer.recording.signals
    idle = [one for one in answer.model.signals if one.kind == "input" and not np.any(run[one.name])]
    if idle:
        return (f"{idle[0].name} is 0 in every sample: is it the column of the drive?",)
    found = min(_tried(answer), default=None)
    return () if found is None else (found[1],)


def _tried(answer: MechanismAnswer) -> Iterator[tuple[float, str]]:
    """chi^2 and sentence of what explains the run."""
    model, signals, design = ready(answer.model), answer.recording.signals, answer.found.design
    before = score_of(model, signals, design, None, False)
    most = np.inf if before is None or not before.known else _PART * before.chi2
    for signal in answer.model.signals:
        if signal.name not in signals:
            continue
        for factor, said, unit in _mistakes(signal):
            changed: dict[str, Float] = {**signals, signal.name: factor * np.asarray(signals[signal.name], np.float64)}
            one = score_of(model, changed, design, None, False)
            if one is not None and one.known and one.chi2 < min(most, _MISFIT):
                yield one.chi2, f"{said}: --columns {signal.name}={signal.name}:{unit}"


def _mistakes(signal: Signal) -> Iterator[tuple[float, str, str]]:
    """Factor, sentence, and what to type behind the column."""
    yield -1.0, f"{signal.name} seems to have the opposite sign", "-1"
    for unit, factor in _UNITS.get(signal.unit, ()):
        typed = unit if "/" not in unit else f"{factor:.9g}"
        yield factor, f"{signal.name} seems to be in {unit}, not {signal.unit}", typed
