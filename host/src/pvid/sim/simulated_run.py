"""A run of a mechanism's simulated rig: drives, motion, imperfections, sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.base.replacing import refuse_foreign
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.evaluation import numpy_function
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import Servo, SimulatedRig, simulated_rig
from pvid.rig.mechanism_file import MechanismRig, channels_of, rig_path_of
from pvid.rig.run import Recording, write_recording
from pvid.sim.drives import drive_named
from pvid.sim.imperfections import Imperfections, disturbance, eccentric, with_play
from pvid.sim.motion import with_whole_equations
from pvid.sim.plant import Control, Friction, Plant, Trajectory
from pvid.sim.sensing import sensed

Float = npt.NDArray[np.float64]

_PHASE = 0.7  # of an eccentric encoder [rad]
PERFECT = Imperfections()
SOFT = Imperfections("soft")


@dataclass(frozen=True, eq=False)
class RigSimulation:
    """A rig ready to run: its model, its plant, its numbers.

    linearised : signals for whose small values the equations hold; the simulation takes these for exact
    whole : with the equations of the model's refinement, where it has its own
    """

    model: CompiledModel
    rig: SimulatedRig
    plant: Plant
    linearised: tuple[str, ...] = ()
    whole: bool = False
    _motions: dict[Any, Trajectory] = field(default_factory=dict)

    @classmethod
    def of(cls, model: CompiledModel, rig: SimulatedRig, *, whole: bool = False) -> RigSimulation:
        """Of a rig; PvidError where it does not give every unknown a value.

        whole : with the equations of the refinement, if the model has such; the rows then neglect what they neglect
        """
        whole = whole and bool(model.refinement.equations)
        missing = [name for name in model.p_names if name not in rig.truth]
        if missing:
            raise PvidError(f"the simulated rig of {model.name} gives no value of {', '.join(missing)}")
        # A simulation is exact: no gain, delay, offset or clock of it has an error, and its equations are those of
        # the model.
        linearised = () if whole else tuple(one.name for one in model.signals if one.neglected)
        exact = tuple(
            replace(
                one,
                gain_sd=0.0,
                delay_sd=0.0,
                offset_sd=0.0,
                neglected=0.0 if one.name in linearised else one.neglected,
            )
            for one in model.signals
        )
        knowns = tuple(replace(one, sd=0.0) for one in model.knowns)
        plant = Plant(with_whole_equations(model) if whole else model)
        return cls(replace(model, signals=exact, knowns=knowns, clock_sd=0.0), rig, plant, linearised, whole)

    def of_rig(self, rig: SimulatedRig) -> RigSimulation:
        """Another rig of the mechanism, with values of the same unknowns."""
        return RigSimulation(self.model, rig, self.plant, self.linearised, self.whole)

    @property
    def truth(self) -> Float:
        """Values of the unknowns [n_p]."""
        return np.array([self.rig.truth[name] for name in self.model.p_names])

    @property
    def samples(self) -> int:
        """Number."""
        return round(self.rig.duration * self.rig.sample_rate)

    def friction(self, imperfections: Imperfections = PERFECT) -> Friction:
        """The law of the plant."""
        sharp = imperfections.friction == "sharp" or not self.rig.friction_width
        return Friction(0.0, imperfections.breakaway) if sharp else Friction(self.rig.friction_width)

    def motion(self, imperfections: Imperfections = PERFECT, *, seed: int = 0, every_step: bool = False) -> Trajectory:
        """The true motion; the seed serves the disturbance alone. Remembered where there is none."""
        key = (imperfections.key, every_step)
        if imperfections.process:
            return self._moved(imperfections, seed, every_step)
        if key not in self._motions:
            self._motions[key] = self._moved(imperfections, seed, every_step)
        return self._motions[key]

    def run(self, seed: int = 0, imperfections: Imperfections = PERFECT) -> dict[str, Float]:
        """t [s] and every signal in its unit, as recorded, each [samples].

        Raises PvidError where nothing drives the mechanism and it starts at rest.
        """
        rig = self.rig
        step = 1.0 / rig.sample_rate / rig.substeps
        delays = {name: skew / step for name, skew in imperfections.skew.items()}
        _check_names(self.model, (imperfections.backlash, imperfections.eccentricity, delays, imperfections.gain))
        for name, delay in delays.items():
            if abs(delay - round(delay)) > 1e-6 or delay < 0:
                raise PvidError(f"the skew of {name} must be a multiple of the integration's step, {step:g} s")
        fine = self.motion(imperfections, seed=seed, every_step=bool(delays))
        if not rig.drive:
            self._refuse_rest(fine)
        rng = np.random.default_rng([seed, 0])
        out = {"t": np.arange(self.samples) / rig.sample_rate}
        for signal in self.model.signals:
            values = self._quantity(signal, fine)
            if delays:
                at = np.maximum(np.arange(self.samples) * rig.substeps - round(delays.get(signal.name, 0.0)), 0)
                values = values[at]
            out[signal.name] = sensed(signal, self._imperfect(signal, values, imperfections), rng)
        return out

    def _refuse_rest(self, motion: Trajectory) -> None:
        """Where no signal moves."""
        if all(np.ptp(self._quantity(one, motion)) == 0 for one in self.model.signals):
            raise PvidError(
                f"{self.model.name} has no input and starts at rest, so that nothing moves: give a release, as in "
                f"--start {self.model.signals[0].name}=0.5"
            )

    def _quantity(self, signal: Signal, motion: Trajectory) -> Float:
        """What a signal measures, at the times of the motion."""
        drive = self.rig.drive.get(signal.name)
        if drive is not None and not isinstance(drive, Servo):
            return drive.values(motion.t)
        if self.whole and signal.name in self.model.refinement.outputs:
            return self._reading(self.model.refinement.outputs[signal.name], motion)
        try:
            return motion[signal.name]
        except KeyError as error:
            raise PvidError(f"no equation of {self.model.name} contains {signal.name}") from error

    def _reading(self, output: sp.Expr, motion: Trajectory) -> Float:
        """What an output of the refinement measures, at the times of the motion."""
        constants = zip(motion.motion.constants, self._constants.tolist(), strict=True)
        value = output.xreplace(dict(self.model.refinement.shapes)).xreplace(dict(constants))
        names = sorted(value.free_symbols, key=str)
        return np.asarray(numpy_function(names, value)(*(motion[str(one)] for one in names)), np.float64)

    @property
    def _constants(self) -> Float:
        """Of the plant: the unknowns, then the knowns."""
        return self.plant.constants(self.truth, {**self.rig.truth, **self.rig.knowns})

    def _imperfect(self, signal: Signal, values: Float, imperfections: Imperfections) -> Float:
        name = signal.name
        if name in imperfections.backlash:
            values = with_play(values, imperfections.backlash[name] * signal.resolution)
        if name in imperfections.eccentricity:
            values = eccentric(values, imperfections.eccentricity[name] * signal.resolution, _PHASE)
        if name in imperfections.gain and not signal.driven:
            values = values * imperfections.gain[name]
        return values

    def _moved(self, imperfections: Imperfections, seed: int, every_step: bool) -> Trajectory:
        plant, rig = self.plant, self.rig
        servos = {name: one for name, one in rig.drive.items() if isinstance(one, Servo)}
        noise = disturbance(imperfections.process, plant.shape[2], self.samples, rig.sample_rate, seed)
        driven = {jet.of for jet in plant.motion.inputs}
        given: dict[str, Any] = {
            "substeps": rig.substeps,
            "friction": self.friction(imperfections),
            "disturbance": noise,
            "every_step": every_step,
            "gains": {name: gain for name, gain in imperfections.gain.items() if name in driven},
        }
        constants, start = self._constants, plant.start(rig.whole_start if self.whole else rig.start)
        if not servos:
            drives = {name: one for name, one in rig.drive.items() if not isinstance(one, Servo)}
            return plant.driven(constants, start, drives, rig.sample_rate, self.samples, **given)
        return plant.controlled(constants, start, self._control(servos), rig.sample_rate, self.samples, **given)

    def _control(self, servos: Mapping[str, Servo]) -> Control:
        t = np.arange(self.samples) / self.rig.sample_rate
        laws = []
        for name, one in servos.items():
            place = self.plant.motion.state(one.coordinate)
            rate = self.plant.motion.state(f"{one.coordinate}_1") if one.kd else place
            others = [(self.plant.motion.state(state), gain) for state, gain in one.others.items()]
            laws.append((name, one, place, rate, others, one.reference.values(t)))
        rest = {name: one.values(t) for name, one in self.rig.drive.items() if not isinstance(one, Servo)}

        def control(now: float, state: Float) -> dict[str, float]:
            k = round(now * self.rig.sample_rate)
            given: dict[str, Any] = {
                name: one.kp * (reference[k] - state[place])
                - one.kd * state[rate]
                - sum(gain * state[other] for other, gain in others)
                for name, one, place, rate, others, reference in laws
            }
            return given | {name: float(values[k]) for name, values in rest.items()}

        return control


def _check_names(model: CompiledModel, given: tuple[Mapping[str, float], ...]) -> None:
    known = {one.name for one in model.signals}
    for one in given:
        for name in one:
            if name not in known:
                raise PvidError(f"{name} is no signal of {model.name}; signals are {', '.join(sorted(known))}")


@cache
def simulation_of(name: str) -> RigSimulation:
    """The shipped rig of a mechanism; PvidError where there is none."""
    return RigSimulation.of(compiled_of(name), simulated_rig(name))


def rig_of_guess(
    model: CompiledModel,
    drive: str,
    low_hz: float,
    high_hz: float,
    *,
    rate: float,
    duration: float,
    share: float = 0.5,
    start: Mapping[str, float] | None = None,
) -> SimulatedRig:
    """A rig whose truth is the model's guess, with every driven signal on a drive of the list.

    Parameters
    ----------
    drive, low_hz, high_hz : name in `DRIVES`, and its band [Hz]
    rate, duration : [Hz] and [s]
    share : largest value of each drive over the reach of its signal
    start : coordinates and rates at the first sample, as in q or q_1 [SI]; 0 where none is given
    """
    driven = [one for one in model.signals if one.driven or one.kind == "input"]
    return SimulatedRig(
        model=model.name,
        truth={one.name: one.guess for one in model.unknowns},
        start=dict(start or {}),
        drive={
            one.name: drive_named(drive, share * one.reach, low_hz, high_hz, number)
            for number, one in enumerate(driven)
        },
        sample_rate=rate,
        duration=duration,
    )


def write_simulated_run(
    path: Path,
    run: Mapping[str, Float],
    simulation: RigSimulation,
    name: str = "",
    sensor: Mapping[str, Mapping[str, float]] | None = None,
) -> Path:
    """Writes a run (the suffix gives the format) and beside it its rig file, whose path is returned.

    `name` of the model in the rig file; default: that of the model. `sensor`: what the rig file states of its sensors.
    """
    model, rate = simulation.model, simulation.rig.sample_rate
    signals = {one.name: run[one.name] for one in model.signals}
    settings = rig_path_of(path)
    refuse_foreign(settings)
    write_recording(path, Recording(run["t"], signals, rate), channels_of(model))
    exact = {one.name: {"gain_sd": 0.0} for one in model.signals if one.driven or one.unit != "rad"}
    exact |= {name: {"neglected": 0.0} for name in simulation.linearised}
    exact = {one: {**(sensor or {}).get(one, {}), **exact.get(one, {})} for one in {**(sensor or {}), **exact}}
    known = {one.name: one.value for one in model.knowns if one.required} | dict(simulation.rig.knowns)
    known_sd = {one.name: 0.0 for one in simulation.plant.model.knowns if one.sd}
    rig = MechanismRig(name or model.name, rate, known=known, sensor=exact, known_sd=known_sd, clock_sd=0.0)
    rig.write(settings)
    return settings
