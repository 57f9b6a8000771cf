"""What makes a recording that a mechanism's equations do not explain fit them: a sign, or a unit; also of the time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from pvid.base.wording import listed, with_unit
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.together import with_own
from pvid.oracle.weak import work
from pvid.oracle.weak.choice import NOISE, Scored, score_of
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.failures import attempted
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.shared import neglected
from pvid.rig.clock import CLOCKS, USUAL_RATES
from pvid.rig.columns import Columns
from pvid.rig.mechanism_file import channels_of

# Residuals over what the sensors explain, above which a mistake is sought.
_MISFIT = 20.0
# Of several recordings: above it, a parameter is sought that differs; it is named if it leaves residuals below it.
_DIFFER = 2.0
# A mistake is named if it leaves less than this part of the residuals, relative to the motion ...
_PART = 1 / 30
# ... or, where the answer without it is implausible, this part: another sign gives a linear mechanism other residuals,
# another unit the same ones.
_PART_OF_SIGN, _PART_OF_UNIT = 0.3, 1.5
_FAR, _NEAR = 30.0, 10.0  # factor of a parameter's guess: a unit is doubted beyond the one, right within the other
_ALIKE = 1.05  # times the least part that is left
_EXPLAINS = 0.9  # R^2 of rows that explain a recording
_DOUBTFUL_RATES = (1e-3, 1e6)  # Hz: beyond these a unit of time is not tried
_OF_ANALYSIS = 0.25  # of the work that is allowed to a search for a design: that of the search for a mistake
_OF_TIME = 0.1  # the same for the unit of the time
# By unit: what a column may be in instead.
_UNITS = {
    "rad": ("deg", "rev"),
    "rad/s": ("rpm", "deg/s"),
    "m": ("mm", "cm"),
    "m/s": ("mm/s", "km/h"),
    **{unit: (f"m{unit}",) for unit in ("A", "V", "N", "N*m")},
}


class _Mistake(NamedTuple):
    """Part of the residuals that is left without it, the largest factor of a parameter's guess then; in words, and what
    to type."""

    left: float
    distance: float
    said: str
    typed: str


def advised(answer: Analysis) -> Analysis:
    """The answer with its advice: a column that is wrong, else what to type for the terms that seem to lack."""
    found = advice_on(answer)
    if not found and answer.found.named is not None and answer.identified:
        from pvid.identification.additions import to_type

        found = tuple(to_type(answer))
    return replace(answer, advice=found)


@np.errstate(all="ignore")  # what diverges is judged and left out
def advice_on(answer: Analysis) -> tuple[str, ...]:
    """A sentence with what to type, or none; some tenths of a second, where the answer is bad alone.

    Each signal in turn has the other sign or another usual unit, then all of one unit have that, with the design of the
    answer.
    """
    with work.limited(_OF_TIME * answer.found.allowance):
        unit = _unit_of_time(answer)
    of_time = () if unit is None else (f"t seems to be in {_named(unit)}, not s: --columns t=t:{unit}",)
    if unit is not None and _unusual(answer, unit) < _unusual(answer):
        return of_time
    if answer.recording.origins and answer.found.chi2 > _DIFFER and (own := _of_own(answer)) is not None:
        return (own,)
    near = _own_distance(answer).least < _FAR and not _is_beyond_equations(answer)
    if answer.identified and answer.found.chi2 < _MISFIT and near:
        return ()
    run = answer.recording.run
    for one in answer.model.signals:
        if one.kind == "input" and np.nanmax(run[one.name]) == np.nanmin(run[one.name]):
            value = float(np.nanmin(run[one.name]))
            shown = with_unit(value, one.unit, 3) if value else "0"
            return (f"{one.name} is {shown} in every sample: is it the column of the drive?",)
    with work.limited(_OF_ANALYSIS * answer.found.allowance):
        mistakes = list(_tried(answer)) or list(_turned(answer))
    least = min((one.left for one in mistakes), default=0.0)
    # A linear mechanism moves alike in any unit, and with the other sign of its input and of its sensor.
    alike = [one for one in mistakes if one.left <= _ALIKE * least]
    nearest = min((one.distance for one in alike), default=0.0)
    alike = [one for one in alike if one.distance <= _ALIKE * nearest][:2]
    if not alike:
        return of_time
    other = [f" (or {one.typed.partition('=')[0]}: --columns {one.typed})" for one in alike[1:]]
    return (f"{alike[0].said}: --columns {alike[0].typed}" + "".join(other),)


def _unit_of_time(answer: Analysis) -> str | None:
    """In which the parameters come near their guesses; None where they are near as it is, or in no unit.

    Residuals contain nothing of it: another unit of time gives a linear mechanism other parameters and the same motion.
    """
    if _own_distance(answer).least < _FAR:
        return None
    design = answer.found.design
    low, high = _DOUBTFUL_RATES
    for unit in sorted(CLOCKS, key=lambda unit: _unusual(answer, unit)):
        if not low < answer.recording.sample_rate * CLOCKS[unit] < high or work.is_spent():
            continue
        scale = _scale(answer, "t", unit)
        other = replace(design, sample_rate=design.sample_rate / scale, window_s=design.window_s * scale)
        one = _score(answer, design=other)
        if one is not None and one.known and _distance(answer, one.p, one.error, one.chi2).most < _NEAR:
            return unit
    return None


def _unusual(answer: Analysis, unit: str = "") -> float:
    """By which factor the sample rate is outside the usual ones, if the time is in this unit; else as it stands."""
    rate, (low, high) = answer.recording.sample_rate * CLOCKS.get(unit, 1.0), USUAL_RATES
    return max(low / rate, rate / high, 1.0)


def _named(unit: str) -> str:
    number, _, ticks = unit.partition("/")
    return f"ticks of {ticks} Hz" if ticks else number


class _Factors(NamedTuple):
    """The largest factor between a positive parameter and its guess: that of the values that two standard errors
    allow which is nearest to the guess, of the values themselves, and that of the farthest. One that may be 0
    beside others is at no distance where the sensors explain the residuals."""

    least: float
    own: float
    most: float


def _own_distance(answer: Analysis) -> _Factors:
    return _distance(answer, answer.found.p, answer.found.se, answer.found.chi2)


def _distance(answer: Analysis, p: Float, se: Float, chi2: float) -> _Factors:
    positive, guess = np.array([(one.positive, one.guess) for one in answer.model.unknowns]).T
    se = np.where(np.isnan(se), 0.0, se)
    ends = p - 2 * se, p + 2 * se
    sized = (positive > 0) & (ends[0] > 0)
    compared = sized if chi2 < NOISE and sized.any() else positive > 0

    def largest(*tried: Float) -> float:
        ratios = (np.array(tried) / guess)[:, compared]
        return float(np.max(np.where(ratios > 0, np.maximum(ratios, 1 / ratios), np.inf), initial=1.0))

    return _Factors(largest(np.clip(guess, *ends)), largest(p), largest(*ends))


def _is_beyond_equations(answer: Analysis) -> bool:
    """Whether a signal is so large that linearised equations mean nothing: they fit it in any unit."""
    return neglected(answer.model, answer.recording.run) > 1


def _turned(answer: Analysis) -> Iterator[_Mistake]:
    """The same of a drive with the other sign, which makes another mechanism of it: by designs of its own."""
    if max(answer.found.r2.values(), default=0.0) > _EXPLAINS:
        return
    for signal in answer.model.signals:
        if (signal.driven or signal.kind == "input") and not work.is_spent():
            signals = {**answer.recording.signals, signal.name: -answer.recording.signals[signal.name]}
            turned = replace(answer.recording, signals=signals)
            again = attempted(partial(analysed, turned, answer.model, answer.weights))
            if again is None or not again.identified:
                continue
            if (factors := _own_distance(again)).most > _NEAR:
                continue
            if min(again.found.r2.values()) > _EXPLAINS:
                said, unit, _ = next(_mistakes(signal, signals[signal.name]))
                yield _Mistake(again.found.chi2, factors.own, said, f"{signal.name}={signal.name}:{unit}")


def _tried(answer: Analysis) -> Iterator[_Mistake]:
    """Mistakes that explain the run."""
    model, signals, before = answer.model, answer.recording.run, _score(answer)
    far = (
        before is None
        or _distance(answer, before.p, before.error, before.chi2).least > _FAR
        or _is_beyond_equations(answer)
    )
    for names, said, unit, most in _every_mistake(answer):
        typed = ",".join(f"{name}={name}:{unit}" for name in names)
        scale = _scale(answer, names[0], unit)
        # Noise is scaled with its signal: a signal that is small beside its noise fits any equations.
        scaled = model if abs(scale) == 1 else _with_noise(model, names, abs(scale))
        other = {**signals, **{name: scale * signals[name] for name in names}}
        one = _score(answer, scaled, other)
        if one is None or not one.known or (factors := _distance(answer, one.p, one.error, one.chi2)).most > _NEAR:
            continue
        left = one.chi2 / before.chi2 if before is not None else 0.0
        implausible = far or (scale < 0 and before is not None and not before.known)
        if left < (most if implausible else _PART):
            yield _Mistake(left, factors.own, said, typed)


def _every_mistake(answer: Analysis) -> Iterator[tuple[list[str], str, str, float]]:
    """Signals, what they seem to be, what to type behind each column, and the part of the residuals that may be left:
    of each signal by itself, inputs first, then of all that have one unit."""
    of_unit: dict[str, list[str]] = {}
    for one in sorted(answer.model.signals, key=lambda one: one.kind != "input"):
        of_unit.setdefault(one.unit, []).append(one.name)
        for said, unit, most in _mistakes(one, answer.recording.run[one.name]):
            yield [one.name], said, unit, most
    for si, names in of_unit.items():
        for unit in _UNITS.get(si, ()) if len(names) > 1 else ():
            yield names, f"{listed(names)} seem to be in {unit}, not {si}", unit, _PART_OF_UNIT


def _of_own(answer: Analysis) -> str | None:
    """Of several recordings: which parameter explains them if each has its own; the one that leaves least."""
    model, before = answer.model, _score(answer)
    if before is None or not answer.recording.origins:
        return None
    names = [one.name for one in answer.recording.origins]
    own = set(model.together.names) if model.together is not None else set()
    left = {}
    for name in model.alone.p_names:
        if name not in own:
            one = _score(answer, with_own(model.alone, own | {name}, names))
            if one is not None and one.known:
                left[name] = one.chi2 / before.chi2
    best = min(left, key=lambda name: left[name], default="")
    if not best or left[best] > max(_PART, min(0.5, _DIFFER / before.chi2)):
        return None
    return f"the recordings differ in {best}: --own {best} gives each its own"


def _score(
    answer: Analysis,
    model: CompiledModel | None = None,
    run: Mapping[str, Float] | None = None,
    design: WeakDesign | None = None,
) -> Scored | None:
    """The estimate from the guesses on by the weights of the sensors, with another model, run or design."""
    of_run = answer.recording.run if run is None else run
    return score_of(ready(model or answer.model), of_run, design or answer.found.design, None, False)


def _scale(answer: Analysis, name: str, unit: str) -> float:
    """What a column in this unit is multiplied by."""
    return float(Columns.parse(f"{name}={name}:{unit}", channels_of(answer.model))[name].in_si(np.ones(1))[0])


def _with_noise(model: CompiledModel, names: Sequence[str], scale: float) -> CompiledModel:
    """With the resolution and the noise of signals so many times as large."""

    def scaled(own: Signal) -> Signal:
        noise = own.noise if own.resolution else scale * own.noise
        return replace(own, resolution=scale * own.resolution, noise=noise)

    return replace(model, signals=tuple(scaled(one) if one.name in names else one for one in model.signals))


def _mistakes(signal: Signal, values: Float) -> Iterator[tuple[str, str, float]]:
    """What a signal seems to be, what to type behind its column, and the part of the residuals that may be left."""
    yield f"{signal.name} seems to have the opposite sign", "-1", _PART_OF_SIGN
    if signal.resolution and np.array_equal(values, np.rint(values)):
        typed = f"{signal.resolution:.9g}"
        yield f"{signal.name} seems to be in counts, not {signal.unit or 'the unit 1'}", typed, _PART_OF_UNIT
    for unit in _UNITS.get(signal.unit, ()):
        yield f"{signal.name} seems to be in {unit}, not {signal.unit}", unit, _PART_OF_UNIT
