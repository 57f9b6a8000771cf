"""Finds likely mistakes in a run that is not identified, or identified with a warning, and options that correct them.

Magnitudes show mistakes of units. For other mistakes the run is identified again with the suspected mistake corrected
(pvid.run.trial), which takes some tenths of a second; a trial counts if it identifies the run, or if its chi^2 is much
smaller. A mistake is corrected before the search continues: two mistakes give two sentences, one mistake gives one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pvid.base.errors import PvidError
from pvid.rig.file import RigFile, Unset
from pvid.rig.run import Run
from pvid.rig.sensor_steps import resolution_of
from pvid.rig.turns import joined
from pvid.run.excitation import excitation_of
from pvid.run.identify import VALID_ANGLE, Identification
from pvid.run.trial import Trial, dominant_hz, trial_of
from pvid.settings.enums import Reason
from pvid.setup.f32 import nominal_start
from pvid.setup.ranges_q31 import pivot_acceleration, reach

GRAVITY = 9.81  # m/s^2
_MOST_GRAVITY = 1.02 * 9.83  # nowhere on Earth is more
_TILTED = 0.5  # least g*, relative to gravity and to the rig file's: a plane tilted by more than 60 degrees is rare

_LOWEST_RATE = 25.0  # Hz
_LIKELY_RATES = (50.0, 20_000.0)
_LONGEST_ROD = 3.0  # m
_LIKELY_RODS = (0.03, 2.0)  # m
_MOST_ACCELERATION = 3.0  # of the pivot [gravity], rms
_LIKELY_ACCELERATION = (0.005, 2.0)
_WIDE_SWING = 1.0  # rad: a larger swing may be degrees that are read as radians
_USUAL_SWING = 0.75 * VALID_ANGLE  # largest swing that is assumed in order to guess the counts per turn
_FULL_TURN = 2 * math.pi
_FAR_REST = 1.5  # rad
_LSB_OFF = 0.3
_MANY_STEPS = 30.0
_WHOLE_BITS = 0.01  # a turn of 2 pi is off by 0.16

_FADING = 2.5  # rms of the swing in the first fifth of a run, over that in the last

_SKEWED = 5.0  # standard errors of a skew of the sensors that is told, if it is
_SKEW_TOLD = 0.1  # ticks, at least

_MOST_SAMPLES = 200_000  # of a run, for trials
_BETTER = 0.5  # largest chi^2 of a trial that counts, relative to that without it
_MOST_ROUNDS = 4
_GRAVITY_VARIES = 0.003  # from its mean over the Earth
_CLOCK_OFF = 0.3  # least relative error of the clock that is sought: smaller errors do not prevent an estimate


@dataclass(frozen=True)
class Case:
    """A run and its rig, as given or with mistakes corrected."""

    run: Run
    rig: RigFile

    @cached_property
    def trial(self) -> Trial | None:
        """Its quick identification."""
        return trial_of(self.run, self.rig)

    @property
    def is_explained(self) -> bool:
        """Whether the trial answers without a doubt."""
        return _is_good(self.trial) and _answers(self.trial)


@dataclass(frozen=True)
class Cure:
    """A sentence that names a mistake and the option that corrects it, and the case without the mistake."""

    sentence: str
    case: Case


def advice(run: Run, rig: RigFile, result: Identification) -> tuple[str, ...]:
    """Sentences that name likely mistakes; () for a run that is identified without a warning and whose sensors and
    scales are plausible.

    Parameters
    ----------
    run, rig
        As given to `identify`.
    result
        What it returned.
    """
    case = Case(_shortened(run), rig)
    if result.beyond_words is not None and not result.identified:
        return (_wider_ranges(result),)
    if (skew := _skew_of(result)) is not None:
        delay = rig.sensor.y_delay + skew
        return (f"phi and y are not sampled at one instant: do so, or use --set sensor.y_delay={delay:.3g}",)
    if _is_good(result):
        degrees = _angle_in_degrees(case)
        if degrees:
            return (degrees[0].sentence,)
    found, case = _put_right(case, _is_good(result))
    corrected = bool(found)
    if not found or (not _is_good(result) and not case.is_explained):  # there is more to it
        found += _remaining(case, result)
    if corrected and case.trial is not None and case.is_explained:
        found += _clock_of(case.trial.value.get("g", GRAVITY), 0.0, rig)
    elif result.identified:
        found += _clock_of(result.value.get("g", GRAVITY), result.se.get("g", 0.0), rig)
    return tuple(found)


def _skew_of(result: Identification) -> float | None:
    """How much later y is sampled than phi [s], by the refinement; None: not at all, or unknown."""
    refined = result.refinement
    if refined is None or not refined.adopted or "tau" not in refined.outcome.extras:
        return None
    tau, se = refined.outcome.extras["tau"]  # how much later phi is sampled than y
    least = _SKEW_TOLD / refined.outcome.problem.measured.rate
    return -float(tau) if abs(tau) > max(_SKEWED * se, least) else None


def suspected_unit(run: Run, rig: RigFile) -> str | None:
    """The mistake of a unit that magnitudes alone show, without a trial; None: there is none."""
    for cures in _by_magnitude(Case(_shortened(run), rig), tries=False):
        if cures:
            return cures[0].sentence.partition(": use ")[0].partition(" (it swings")[0]
    return None


def advice_on_refusal(run: Run, rig: RigFile) -> tuple[str, ...]:
    """Sentences for a run whose settings were refused."""
    return tuple(_put_right(Case(_shortened(run), rig))[0])


def behind(advices: tuple[str, ...], error: PvidError) -> PvidError:
    """An error message with the mistakes before the refusal that they cause."""
    return PvidError(f"{'; '.join(advices)} (as it is: {error})" if advices else str(error))


def _put_right(case: Case, good: bool = False) -> tuple[list[str], Case]:
    """The mistakes found, and the case without them; good: it is identified without a warning, by which units and
    equations are right."""
    found: list[str] = []
    for search in (_step_of,) if good else (_unit_mistake, _exchanged, _step_of, _equation_mistake):
        for _ in range(_MOST_ROUNDS):
            cure = search(case)
            if cure is None or cure.sentence in found:
                break
            found.append(cure.sentence)
            case = cure.case
    return found, case


# ---- trials


def _shortened(run: Run) -> Run:
    if len(run.t) <= _MOST_SAMPLES:
        return run
    first = slice(_MOST_SAMPLES)
    return replace(run, t=run.t[first], phi=run.phi[first], y=run.y[first])


def _is_good(result: Identification | Trial | None) -> bool:
    return result is not None and result.identified and result.warning is None


def _answers(trial: Trial | None) -> bool:
    """Whether a trial is identified with physical parameters."""
    return trial is not None and trial.identified and all(name in trial.value for name in trial.model.physical_names)


def _is_better(trial: Trial | None, now: Trial | None) -> bool:
    """Whether a trial identifies the run and `now` does not, or has a much smaller chi^2."""
    if trial is None or not _answers(trial):
        return False
    if now is None or not now.identified:
        return True
    return trial.chi2 < _BETTER * now.chi2


# ---- units


def _by_magnitude(case: Case, tries: bool = True) -> Iterator[list[Cure]]:
    """Mistakes of units that magnitudes show, each with the units that it may be; tries: trials decide where magnitudes
    do not."""
    yield _time_unit(case)
    yield _angle_in_counts(case)
    yield _angle_in_degrees(case, tries)
    yield _far_rest(case) if tries else []
    yield _rod_units(case)
    yield _height_units(case)


def _unit_mistake(case: Case) -> Cure | None:
    """The first mistake of a unit that magnitudes show; of several units the first that identifies the run."""
    for cures in _by_magnitude(case):
        if len(cures) > 1:
            return next((cure for cure in cures if _answers(cure.case.trial)), cures[0])
        if cures:
            return cures[0]
    return None


def _time_unit(case: Case) -> list[Cure]:
    run = case.run
    if run.sample_rate >= _LOWEST_RATE:
        return []
    for unit, words, factor in (("ms", "milliseconds", 1e3), ("us", "microseconds", 1e6), ("ns", "nanoseconds", 1e9)):
        rate = run.sample_rate * factor
        if _LIKELY_RATES[0] <= rate <= _LIKELY_RATES[1]:
            right = replace(run, t=run.t / factor, sample_rate=rate)
            return [
                Cure(
                    f"t looks like {words} (in seconds the sample rate is {run.sample_rate:.3g} Hz): "
                    f"use --columns t=t:{unit}",
                    Case(right, case.rig),
                )
            ]
    return []


def _swing(run: Run) -> tuple[float, float]:
    """Median of phi and the largest distance from it [rad]."""
    phi = run.phi[np.isfinite(run.phi)]
    rest = float(np.median(phi)) if len(phi) else 0.0
    return rest, float(np.abs(phi - rest).max(initial=0.0))


def _angle_in_counts(case: Case) -> list[Cure]:
    phi = case.run.phi[np.isfinite(case.run.phi)]
    _, swing = _swing(case.run)
    if swing < _MANY_STEPS or (phi != np.rint(phi)).any():
        return []
    counts = next((n for n in (2**bits for bits in range(9, 21)) if _FULL_TURN * swing / n < _USUAL_SWING), 2**20)
    right = replace(case.run, phi=joined(case.run.phi * _FULL_TURN / counts)[0])
    lsb = replace(case.rig.sensor, phi_lsb=_FULL_TURN / counts)
    return [
        Cure(
            f"phi looks like counts of the encoder (whole numbers, {2 * swing:.0f} of them): use --columns "
            f"phi=phi:rev/N with N the counts of a turn, 4096 for 12 bits",
            Case(right, replace(case.rig, sensor=lsb)),
        )
    ]


def _angle_in_degrees(case: Case, tries: bool = True) -> list[Cure]:
    """Detected by the swing, if it is a whole turn or a trial in degrees is better; or by the encoder's step."""
    run = case.run
    _, swing = _swing(run)
    by_step = _steps_in_degrees(case)
    if swing < _WIDE_SWING and not by_step:
        return []
    in_degrees = Case(replace(run, phi=joined(np.radians(run.phi))[0]), case.rig)
    if swing < _FULL_TURN and not by_step and not (tries and _is_better(in_degrees.trial, case.trial)):
        return []
    return [
        Cure(
            f"phi looks like degrees (it swings by {swing:.3g} to a side): use --columns phi=phi:deg",
            in_degrees,
        )
    ]


def _steps_in_degrees(case: Case) -> bool:
    step = resolution_of(case.run.phi)
    return step is not None and _is_step_in_degrees(step, case.rig.sensor.phi_lsb)


def _is_step_in_degrees(step: float, lsb: float) -> bool:
    """Whether an encoder's step equals the rig file's phi_lsb in degrees; without one, 360 over a power of two."""
    if not isinstance(lsb, Unset):
        return lsb > 0 and abs(math.degrees(lsb) / step - 1) < 0.1
    bits = math.log2(360.0 / step)
    return bits > 6 and abs(bits - round(bits)) < _WHOLE_BITS


def _far_rest(case: Case) -> list[Cure]:
    rest, swing = _swing(case.run)
    if abs(rest - case.rig.sensor.phi_zero) < max(_FAR_REST, 2 * swing):
        return []
    turned = abs(math.remainder(rest, _FULL_TURN)) > math.pi / 2
    half = " (a half turn: is it counted from where link 2 points the other way?)" if turned else ""
    sensor = replace(case.rig.sensor, phi_zero=float(f"{rest:.3g}"))
    return [
        Cure(
            f"phi rests at {rest:.4g} rad{half}: use --set sensor.phi_zero={rest:.3g}",
            Case(case.run, replace(case.rig, sensor=sensor)),
        )
    ]


def _rod_units(case: Case) -> list[Cure]:
    rig = case.rig
    if rig.l1 <= _LONGEST_ROD:
        return []
    cures = []
    for words, factor in (("centimetres", 0.01), ("millimetres", 0.001)):
        l1 = rig.l1 * factor
        if _LIKELY_RODS[0] <= l1 <= _LIKELY_RODS[1]:
            guess = replace(rig.nominal, l2=rig.nominal.l2 * factor, rho2=rig.nominal.rho2 * factor)
            cures.append(
                Cure(
                    f"l1 = {rig.l1:g} m looks like {words}: use --set l1={l1:g}",
                    Case(case.run, replace(rig, l1=l1, nominal=guess)),
                )
            )
    return cures


def _height_units(case: Case) -> list[Cure]:
    run = case.run
    acceleration = np.sort(np.abs(pivot_acceleration(run)))[: int(0.999 * len(run.y))]
    rms = float(np.sqrt(np.mean(acceleration**2))) / GRAVITY if len(acceleration) else 0.0
    largest = reach(run.y)
    if rms < _MOST_ACCELERATION or largest < case.rig.l1:
        return []
    cures = []
    for unit, words, factor in (("mm", "millimetres", 1e-3), ("cm", "centimetres", 1e-2), ("um", "micrometres", 1e-6)):
        if _LIKELY_ACCELERATION[0] <= rms * factor <= _LIKELY_ACCELERATION[1]:
            cures.append(
                Cure(
                    f"y looks like {words} (largest |y| is {largest:.3g}, l1 is {case.rig.l1:g} m): "
                    f"use --columns y=y:{unit}",
                    Case(replace(run, y=run.y * factor), case.rig),
                )
            )
    return cures


# ---- sensors


def _exchanged(case: Case) -> Cure | None:
    """phi and y exchanged: the run is identified only after exchanging them back."""
    if case.trial is not None and case.trial.identified:
        return None
    sensor = case.rig.sensor
    steps = [resolution_of(values) for values in (case.run.y, case.run.phi)]
    try:
        lsb = replace(sensor, phi_lsb=steps[0] or sensor.phi_lsb, y_lsb=steps[1] or sensor.y_lsb)
        right = Case(replace(case.run, phi=case.run.y, y=case.run.phi), replace(case.rig, sensor=lsb))
    except PvidError:
        return None
    if not right.is_explained:
        return None
    return Cure(
        "phi and y are exchanged, it seems (the other way round the run is explained): use --columns phi=y,y=phi",
        right,
    )


def _step_of(case: Case) -> Cure | None:
    return next(iter(_steps(case)), None)


def _steps(case: Case) -> list[Cure]:
    """Resolutions of the rig file that differ from those of the run."""
    sensor, cures = case.rig.sensor, []
    for name, values, given, unit in (
        ("phi_lsb", case.run.phi, sensor.phi_lsb, "rad"),
        ("y_lsb", case.run.y, sensor.y_lsb, "m"),
    ):
        step = None if isinstance(given, Unset) else resolution_of(values)
        if step is None or abs(math.log(max(given, 1e-12) / step)) <= math.log(1 + _LSB_OFF):
            continue
        right = replace(sensor, **{name: float(f"{step:.4g}")})
        cures.append(
            Cure(
                f"{name[:-4]} moves in steps of {step:.4g} {unit}, and {name} is {given:.4g}: "
                f"use --set sensor.{name}={step:.4g}",
                Case(case.run, replace(case.rig, sensor=right)),
            )
        )
    return cures


# ---- equations


def _equation_mistake(case: Case) -> Cure | None:
    """The sign of y, or the clock, with which a run is identified that is not identified as it is."""
    if case.trial is not None and case.trial.identified:
        return None
    turned = Cure(
        "y is counted downwards, it seems (with its sign turned the run is explained): use --columns y=y:-m",
        Case(replace(case.run, y=-case.run.y), case.rig),
    )
    return turned if _is_better(turned.case.trial, case.trial) else _clock(case)


def _at_rate(case: Case, factor: float) -> Case:
    run = replace(case.run, t=case.run.t / factor, sample_rate=case.run.sample_rate * factor)
    return Case(run, replace(case.rig, sample_rate=None))


def _clock(case: Case) -> Cure | None:
    """A clock that runs too slow or too fast. Any clock fits a run, with another gravity: the first trial moves the
    dominant frequency of phi to the nominal slow mode; from its gravity follows the right clock."""
    modes = case.rig.mechanism.model.modes_hz(nominal_start(case.rig))
    slow = (modes or (math.sqrt(GRAVITY / case.rig.l1) / _FULL_TURN,))[0]
    tried = slow / dominant_hz(case.run)
    if abs(math.log(tried)) < math.log(1 + _CLOCK_OFF):
        return None
    trial = _at_rate(case, tried).trial
    if trial is None or not _answers(trial):
        return None
    factor = tried * math.sqrt(GRAVITY / trial.value["g"])
    right = _at_rate(case, factor)
    if abs(math.log(factor)) < math.log(1 + _CLOCK_OFF) or not _answers(right.trial):
        return None
    rate = case.run.sample_rate
    return Cure(
        f"t seems {_size(factor)} (gravity is 9.8 m/s^2 with {rate * factor:.3g} samples a second, not {rate:.4g}): "
        f"if so, use --columns t=t:{_short(1 / factor)}",
        right,
    )


def _size(ratio: float) -> str:
    """Words for a quantity that is `ratio` times its right value."""
    return f"{_short(ratio)} times too large" if ratio > 1 else f"{_short(1 / ratio)} times too small"


def _short(ratio: float) -> str:
    """In the fewest of up to three digits that gravity, 0.3 % different from place to place, tells apart."""
    tried = (float(f"{ratio:.{digits}g}") for digits in (1, 2))
    return f"{next((short for short in tried if abs(short / ratio - 1) < _GRAVITY_VARIES), ratio):.3g}"


def _clock_of(g: float, se: float, rig: RigFile) -> tuple[str, ...]:
    """Sentence for an estimate with a gravity above the Earth's, or much below that and the rig file's."""
    error = 3 * se
    if g - error > _MOST_GRAVITY:
        unless = ""
    elif g + error < _TILTED * min(GRAVITY, rig.nominal.g):
        unless = f"unless the plane is tilted by {math.degrees(math.acos(min(g / GRAVITY, 1.0))):.0f} degrees, "
    else:
        return ()
    ratio = g / GRAVITY
    return (
        f"g* = {g:.3g} m/s^2 is {_short(ratio)} times gravity: {unless}t is {_size(1 / math.sqrt(ratio))} (if so, use "
        f"--columns t=t:{_short(math.sqrt(ratio))}), or y is {_size(ratio)} (--columns y=y:{_short(1 / ratio)})",
    )


# ---- what remains


def _wider_ranges(result: Identification) -> str:
    assert result.beyond is not None
    names = [name for name in ("phi", "y") if getattr(result.beyond, name)]
    return (
        f"{result.beyond_words}: raise {' and '.join(f'{name}_range' for name in names)} in the rig file, "
        f"or omit the key to derive it from the run"
    )


def _remaining(case: Case, result: Identification) -> Iterator[str]:
    """Sentences for a run in which no further mistake was found."""
    if _is_good(result):
        return
    if result.form == "strong" and _is_good(case.trial):
        yield "the strong form needs an encoder of 20 bits and more: use --form weak, which explains this run"
        return
    if result.law != "stationary" and _is_good(case.trial):
        yield "equation (5) does not arrive from this guess: use --law stationary, which explains this run"
        return
    if result.core == "q31" and not result.identified and _answers(case.trial):
        yield "fixed point does not resolve this run: use --core f32, which answers it"
        return
    excitation, angle = excitation_of(case.run, case.rig), _swing(case.run)[1]
    if excitation.weak is not None:
        yield excitation.weak
    elif angle > VALID_ANGLE:
        yield (
            f"angles reach {angle:.2g} rad, too far for the equations of the weak form: release the "
            f"pendulum from a smaller angle, or drive it less near its modes"
        )
    elif result.identified:
        return
    elif excitation.fading > _FADING:
        yield (
            f"the swing decays (to {100 / excitation.fading:.0f} % of its start): friction in the joints "
            f"leaves too little motion: reduce it, drive the pivot harder, or, if it is dry, set dry_friction = true "
            f"under [refine] in the rig file and use --core f32 --refine"
        )
    elif result.status == Reason.HELD_UNCERTAIN.text:
        yield "the standard errors are too large: record longer, drive the pivot harder, or use a finer encoder"
    else:
        yield (
            "the run does not follow the equations of a pendulum on a moving pivot with any of the tested units, "
            "signs and clocks: is phi the angle of link 2 relative to link 1, is y the pivot's height, are both "
            "sampled at the same time, and is the motion free of impacts and dry friction?"
        )
