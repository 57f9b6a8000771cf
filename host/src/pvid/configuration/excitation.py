"""The excitation of a commissioning: sines for the least standard errors within the limits of a rig, and its guards.

The simulation knows the model at its guesses alone; on the board the guards keep the limits whatever the mechanism is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.configuration.drives import Prediction, predicted_in_core
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.signals import Jet
from pvid.models.drive import Drive, Sines
from pvid.models.simulated_rig import SimulatedRig
from pvid.rig.run import Recording
from pvid.sim.simulated_run import RigSimulation

Progress = Callable[[int], None]

TONES = 8
MOST_DRIVES = 4 * 3 * 2 + 2 * TONES  # simulated in a search, of a mechanism with one input
OF_THE_BURST = ("burst_s", "ramp_s", "passes")
OF_A_DRIVE = ("limit", "slew")
OF_A_SIGNAL = ("limit", "speed")
_SOFT = 0.8  # of a limit
_WITHIN = 0.9  # of a soft limit: where the simulated motion stays
_TILTS = (0.0, 0.5, 1.0)  # amplitudes fall with this power of the frequency
_STEP = 1.6  # of an amplitude in the search
_LEAST, _HALVINGS = 0.02, 5  # scale of a drive: its logarithm is halved so often
_ENOUGH = 1e-3  # relative standard error
_TICKS_AHEAD = 2  # between a measurement and the drive that answers it
_SMOOTHING = 20.0  # resolutions per speed: noise of the rate 5 % of its limit
_PULSE_TICKS = 20
_GOLDEN = 0.38196601


@dataclass(frozen=True)
class Tone:
    """amplitude sin(2 pi (hz t + turns)): [unit of the drive], [Hz], [turns]."""

    amplitude: float
    hz: float
    turns: float


@dataclass(frozen=True)
class Guard:
    """pvid_excite_guard_f32: fields as there."""

    signal: int
    of_rate: bool
    low: float
    soft_low: float
    soft_high: float
    high: float
    response: float
    push: float
    ahead_s: float
    brake: float
    smoothing_s: float


@dataclass(frozen=True)
class DesignedDrive:
    """pvid_excite_config_f32 of an input, and its place among the samples (255: it is measured itself)."""

    name: str
    unit: str
    place: int
    limit: float
    slew: float
    tones: tuple[Tone, ...]
    guards: tuple[Guard, ...]


@dataclass(frozen=True, eq=False)
class Excitation:
    """Drives of a commissioning.

    Attributes
    ----------
    ramp_s, burst_s : of each drive [s]
    passes : over a burst
    drives : one for each input; none of a mechanism without input
    prediction : standard errors of one burst at the model's guesses; None: not designed, by rule
    recording : the simulated burst, at the model's guesses
    """

    sample_rate: float
    ramp_s: float
    burst_s: float
    passes: int
    drives: tuple[DesignedDrive, ...]
    prediction: Prediction | None
    recording: Recording = field(repr=False)

    @property
    def burst_ticks(self) -> int:
        """Samples of a burst."""
        return round(self.burst_s * self.sample_rate)


def designed(
    compiled: CompiledModel,
    limits: Mapping[str, Mapping[str, float]],
    sample_rate: float,
    *,
    samples: Sequence[str],
    search: bool = True,
    progress: Progress | None = None,
) -> Excitation:
    """The excitation of a rig.

    Raises PvidError where an input has no limit, or nothing within the limits identifies the mechanism.

    Parameters
    ----------
    limits : tables of the rig file's [excitation]; "": its own keys
    sample_rate : [Hz]
    samples : names of the samples of a tick
    search : amplitudes for the least standard errors; False: by rule, equal ones, nothing is predicted
    progress : called with the number of simulated drives
    """
    burst = limits.get("", {})
    of_drive = _drive_signals(compiled)
    _refuse_missing(compiled, limits, of_drive)
    burst_s = burst.get("burst_s", 2.0)
    ramp_s = burst.get("ramp_s", 0.1 * burst_s)
    within = _Limits(compiled, limits, sample_rate, burst_s, of_drive)
    count = 0

    def score(tones: _Tones) -> tuple[float, _Tones, Prediction]:
        nonlocal count
        count += 1
        if progress is not None:
            progress(count)
        fitting = within.scaled(tones)
        found = predicted_in_core(within.simulation(fitting))
        return (np.inf if found.failure else _score(found)), fitting, found

    tones, found = _by_rule(within), None
    if search and of_drive:
        tones, found = _best(within, score)
    tones = within.scaled(tones)
    simulation = within.simulation(tones)
    run = simulation.run(0) if of_drive else {}
    t = run.pop("t") if run else np.zeros(0)
    responses = _responses(within) if of_drive else {}
    drives = tuple(
        DesignedDrive(
            name=one.name,
            unit=one.unit,
            place=samples.index(one.name) if one.kind == "input" else 255,
            limit=limits[one.name]["limit"],
            slew=within.slew(one.name),
            tones=tones[number],
            guards=_guards(within, one.name, responses, samples),
        )
        for number, one in enumerate(of_drive)
    )
    passes = round(burst.get("passes", 2))
    return Excitation(sample_rate, ramp_s, burst_s, passes, drives, found, Recording(t, run, sample_rate))


_Tones = tuple[tuple[Tone, ...], ...]  # of each drive


def _score(found: Prediction) -> float:
    """Geometric mean of the relative errors, of which those below `_ENOUGH` are equally good."""
    return float(np.exp(np.mean(np.log(np.maximum(found.relative, _ENOUGH)))))


def _drive_signals(compiled: CompiledModel) -> list[Signal]:
    return [one for one in compiled.signals if one.kind == "input" or one.driven]


def _refuse_missing(
    compiled: CompiledModel, limits: Mapping[str, Mapping[str, float]], of_drive: Sequence[Signal]
) -> None:
    known = {one.name: one for one in compiled.signals}
    for name in limits:
        if name and name not in known:
            raise PvidError(f"excitation.{name}: {compiled.name} has no such signal; it has {listed(known)}")
        keys = OF_A_DRIVE if name and known[name] in of_drive else OF_A_SIGNAL if name else OF_THE_BURST
        for key, value in limits[name].items():
            place = f"excitation.{name}.{key}".replace("..", ".")
            if key not in keys:
                raise PvidError(f"{place} is not a key: {listed(keys)} are")
            if not value > 0:
                raise PvidError(f"{place} must be positive")
    for one in of_drive:
        if "limit" not in limits.get(one.name, {}):
            raise PvidError(
                f"the largest {one.name} of the commissioning is missing: [excitation.{one.name}] limit = "
                f"{one.reach:g}  # {one.unit}"
            )


class _Limits:
    """A mechanism with its limits: scales drives into them, by simulation at the guesses."""

    def __init__(
        self,
        compiled: CompiledModel,
        limits: Mapping[str, Mapping[str, float]],
        sample_rate: float,
        burst_s: float,
        of_drive: Sequence[Signal],
    ) -> None:
        self.compiled, self.limits, self.sample_rate, self.burst_s = compiled, limits, sample_rate, burst_s
        self.of_drive = of_drive
        self._t = np.arange(round(burst_s * sample_rate)) / sample_rate
        self._simulation: RigSimulation | None = None

    def slew(self, name: str) -> float:
        """Largest change of a drive [unit/s]; where none is given, the whole limit in ten ticks."""
        return self.limits[name].get("slew", 0.1 * self.limits[name]["limit"] * self.sample_rate)

    def simulation(self, tones: _Tones, duration: float = 0.0) -> RigSimulation:
        """With these drives."""
        drives = {one.name: _drive(of_one) for one, of_one in zip(self.of_drive, tones, strict=True)}
        return self.driven(drives, duration or self.burst_s)

    def driven(self, drives: Mapping[str, Drive], duration: float) -> RigSimulation:
        """At the guesses, from rest."""
        rig = SimulatedRig(
            model=self.compiled.name,
            truth={one.name: one.guess for one in self.compiled.unknowns},
            drive=drives,
            sample_rate=self.sample_rate,
            duration=duration,
        )
        self._simulation = self._simulation or RigSimulation.of(self.compiled, rig)
        return self._simulation.of_rig(rig)

    def scaled(self, tones: _Tones) -> _Tones:
        """The largest drives of these shapes, of which neither they nor the simulated motion leave the limits."""
        shapes = []
        for one, of_one in zip(self.of_drive, tones, strict=True):
            drive = _drive(of_one)
            peak = float(np.abs(drive.values(self._t)).max())
            rate = float(np.abs(drive.values(self._t, 1)).max())
            fit = 0.95 * min(self.limits[one.name]["limit"] / peak, self.slew(one.name) / rate)
            shapes.append(_times(of_one, fit))
        made = tuple(shapes)
        if not any(set(self.limits.get(one.name, {})) for one in self.compiled.signals if one not in self.of_drive):
            return made
        if self._excess(made) <= 1.0:
            return made
        low, high = _LEAST, 1.0  # friction: the motion may vanish where the drive is a little smaller
        for _ in range(_HALVINGS):
            middle = (low * high) ** 0.5
            fits = self._excess(tuple(_times(of_one, middle) for of_one in made)) <= 1.0
            low, high = (middle, high) if fits else (low, middle)
        return tuple(_times(of_one, low) for of_one in made)

    def _excess(self, tones: _Tones) -> float:
        """Largest value of a limited signal over what is allowed."""
        run = self.simulation(tones).run(0)
        worst = 0.0
        for one in self.compiled.signals:
            keys = self.limits.get(one.name, {})
            if one in self.of_drive:
                continue
            values = run[one.name]
            if "limit" in keys:
                worst = max(worst, float(np.abs(values).max()) / (_WITHIN * _SOFT * keys["limit"]))
            if "speed" in keys:
                width = max(1, round(self.smoothing_s(one) * self.sample_rate))
                rate = (values[width:] - values[:-width]) * (self.sample_rate / width)
                worst = max(worst, float(np.abs(rate).max(initial=0.0)) / (_WITHIN * _SOFT * keys["speed"]))
        return worst

    def smoothing_s(self, signal: Signal) -> float:
        """Of the rate of a signal [s]: what its resolution needs, at least two ticks."""
        keys = self.limits.get(signal.name, {})
        speed = keys.get("speed", 10.0 * keys.get("limit", 1.0))
        return max(2.0 / self.sample_rate, _SMOOTHING * signal.resolution / speed)


def _drive(tones: Sequence[Tone]) -> Sines:
    return Sines(tuple((one.amplitude, one.hz, 2.0 * np.pi * one.turns) for one in tones))


def _times(tones: Sequence[Tone], factor: float) -> tuple[Tone, ...]:
    return tuple(replace(one, amplitude=factor * one.amplitude) for one in tones)


def _multisine(within: _Limits, number: int, low: int, top_hz: float, tilt: float) -> tuple[Tone, ...]:
    """Whole multiples of 1 / burst_s, evenly spread in their logarithm, with Schroeder's phases; of a further drive
    other multiples."""
    base = 1.0 / within.burst_s
    highest = max(low + 2 * TONES, int(top_hz / base))
    spread = np.geomspace(low, highest, TONES)
    multiples = sorted({int(round(one)) for one in spread})
    for _ in range(1, TONES):  # low ones that fell together go to the next free one
        if len(multiples) == TONES:
            break
        multiples = sorted({*multiples, next(m for m in range(low, highest + TONES) if m not in multiples)})
    hz = base * (np.array(multiples, float) + 0.31 * number)
    weights = hz**-tilt
    power = weights**2 / np.sum(weights**2)
    turns = np.array([-np.sum((k - np.arange(k)) * power[:k]) for k in range(len(hz))]) + _GOLDEN * number
    return tuple(Tone(float(a), float(f), float(turn % 1.0)) for a, f, turn in zip(weights, hz, turns, strict=True))


def _by_rule(within: _Limits) -> _Tones:
    top = min(0.02 * within.sample_rate, 40.0 / within.burst_s)
    return tuple(_multisine(within, number, 1, top, 0.0) for number in range(len(within.of_drive)))


def _best(within: _Limits, score: Callable[[_Tones], tuple[float, _Tones, Prediction]]) -> tuple[_Tones, Prediction]:
    """The best of a list, then each amplitude in turn."""
    tops = np.geomspace(20.0 / within.burst_s, 0.05 * within.sample_rate, 4)
    number = range(len(within.of_drive))
    tried = [
        score(tuple(_multisine(within, k, low, float(top), tilt) for k in number))
        for top in tops
        for tilt in _TILTS
        for low in (1, 2)
    ]
    best = min(tried, key=lambda one: one[0])
    if not np.isfinite(best[0]):
        raise PvidError(f"no excitation within the limits identifies {within.compiled.name}: {best[2].failure}")
    for k in number:
        for place in range(TONES):
            for factor in (_STEP, 1.0 / _STEP):
                changed = list(best[1][k])
                changed[place] = replace(changed[place], amplitude=factor * changed[place].amplitude)
                other = score(tuple(tuple(changed) if j == k else best[1][j] for j in number))
                if other[0] < best[0]:
                    best = other
                    break
    return best[1], best[2]


def _responses(within: _Limits) -> dict[tuple[str, str], tuple[float, float]]:
    """(drive, signal) -> sign of its motion after a pulse of the whole drive, and half the mean acceleration of that
    motion [unit/s^2]."""
    found = {}
    for one in within.of_drive:
        limit = within.limits[one.name]["limit"]
        ticks = max(_PULSE_TICKS, round(2.0 * limit / within.slew(one.name) * within.sample_rate))
        seconds = ticks / within.sample_rate
        pulse = Sines((), offset=limit)
        still = {other.name: Sines(()) for other in within.of_drive if other is not one}
        run = within.driven({one.name: pulse, **still}, 2.0 * seconds).run(0)
        for signal in within.compiled.signals:
            moved = float(run[signal.name][ticks] - run[signal.name][0])
            found[one.name, signal.name] = (float(np.sign(moved)), abs(moved) / seconds**2)
    return found


def _guards(
    within: _Limits, drive: str, responses: Mapping[tuple[str, str], tuple[float, float]], samples: Sequence[str]
) -> tuple[Guard, ...]:
    """Of each limited signal, in the order of the limits: rates first, then values, of which the last one then has the
    last word."""
    limit = within.limits[drive]["limit"]
    reversal_s = 2.0 * limit / within.slew(drive) + _TICKS_AHEAD / within.sample_rate
    rates, values = [], []
    signals = {one.name: one for one in within.compiled.signals if one not in within.of_drive and one.name in samples}
    for name, keys in within.limits.items():
        if name not in signals:
            continue
        signal = signals[name]
        response, brake = responses[drive, signal.name]
        smoothing = within.smoothing_s(signal)
        push = 1.0 if response else 0.0
        place = samples.index(signal.name)
        if "speed" in keys:
            rates.append(_guard(place, True, keys["speed"], response, push, 0.0, 0.0, smoothing))
        if "limit" in keys:
            inertial = _is_inertial(within, signal)
            ahead = reversal_s + smoothing if inertial else 0.0
            values.append(
                _guard(place, False, keys["limit"], response, push, ahead, brake if inertial else 0.0, smoothing)
            )
    return (*rates, *values)


def _is_inertial(within: _Limits, signal: Signal) -> bool:
    """Whether the equations contain its acceleration: it then goes on while the drive reverses."""
    jets = {jet for one in within.compiled.equations for jet in one.atoms(Jet)}
    return any(jet.of == signal.jet.of and jet.order >= 2 for jet in jets)


def _guard(
    place: int, of_rate: bool, limit: float, response: float, push: float, ahead: float, brake: float, smoothing: float
) -> Guard:
    soft = _SOFT * limit
    return Guard(place, of_rate, -limit, -soft, soft, limit, response, push, ahead, brake, smoothing)
