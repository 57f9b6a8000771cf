"""How well parameters predict a recording: its blocks are simulated by the full equations, from starts that are fitted.

A block has four windows of the weak form. What is simulated in it follows from the recorded inputs, the parameters and
the start alone: an error of the parameters or of the equations grows in it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.identification.refinement.fit import Cut, Prior, Problem, Refined, Stretch, refined
from pvid.identification.refinement.problem import prior_about, problem_of
from pvid.identification.sensor_prediction import SensorPrediction
from pvid.model.compiled import CompiledModel
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]

WINDOWS = 4  # in a block
SHORTEST = 30  # samples of a block
_BLOCKS = 6  # at least
_PASSES = 6  # of the search for the starts
_TRIED = 8  # blocks in which the growth of an error of the start is computed
_GROWN = 20.0  # by which it grows in the second half of a block at most: twice the cube of 2


@dataclass(frozen=True, eq=False)
class Validation:
    """A recording under given parameters.

    Attributes
    ----------
    sensors : how well each is predicted
    block_s, blocks : length [s] and number of the blocks
    t, measured, simulated : of the samples in them [n], block after block; by sensor [n] each
    fitted : by name: parameters of which the recording has its own values, fitted to it beside the starts
    """

    sensors: tuple[SensorPrediction, ...]
    block_s: float
    blocks: int
    t: Float
    measured: Mapping[str, Float]
    simulated: Mapping[str, Float]
    fitted: Mapping[str, float] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """A sentence."""
        own = [f"its own {name} of {value:.4g}" for name, value in self.fitted.items()]
        with_own = f", with {listed(own)}" if own else ""
        return f"predicts {listed(self.sensors)}, in {self.blocks} blocks of {self.block_s:.3g} s{with_own}"

    def __str__(self) -> str:
        return self.text

    __repr__ = __str__

    def as_json(self) -> dict[str, Any]:
        """The object of `validate --json`."""
        sensors = {one.name: one.as_json() for one in self.sensors}
        own = {"fitted": dict(self.fitted)} if self.fitted else {}
        return {"sensors": sensors, "block_s": self.block_s, "blocks": self.blocks} | own


class Motion:
    """The full equations on a recording, for any parameters.

    Parameters
    ----------
    problem : of the recording
    r : parameters and settings; those that p does not have stay
    """

    def __init__(self, problem: Problem, r: Float) -> None:
        self.model, self.problem, self._r = problem.kernel.made.model, problem, r

    @classmethod
    def near(cls, model: CompiledModel, signals: Mapping[str, Float], rate: float, p: Float) -> Motion:
        """From signals by name [n], NaN where a sample is missing, sampled at `rate` [Hz].

        Raises PvidError where the equations cannot be simulated: an input is a derivative that no recorded signal
        gives, or the recording is too short.

        Parameters
        ----------
        p : parameters near those that will be simulated [n_p]: the integration's step and the width of the signs are
            theirs
        """
        return cls(*problem_of(model, signals, rate, p))

    @property
    def sd(self) -> Float:
        """Standard deviation of a sample of each sensor [sensors]; 0: not known."""
        return self.problem.measured.sd

    def r_of(self, p: Float) -> Float:
        """Parameters and settings of the simulation."""
        r = self.problem.kernel.start(p)
        widths = self.problem.kernel.widths
        r[widths] = self._r[widths]
        return r

    def within(self, parts: Sequence[Stretch], sd: Float | None = None) -> Problem:
        """The problem on parts of the recording alone."""
        measured = self.problem.measured
        known = self.problem.stretches
        both = [(max(a, c), min(b, d)) for a, b in known for c, d in parts]
        chosen = [(a, b) for a, b in both if b - a > 1]
        scaled = np.where(measured.sd > 0, measured.sd, 1.0) if sd is None else sd
        kernel = self.problem.kernel
        return Problem(kernel, replace(measured, stretches=chosen, sd=scaled), self.problem.budget)

    def block(self, window_s: float, parts: int = 1) -> int:
        """Samples of a block, of this window of the weak form; at most those of each of so many parts of the run.

        Fewer where the motion is unstable, as that of a ball which a controller holds on a beam: an error of the start
        grows there beyond all motion. A motion that integrates an error three times has a growth of 8.
        """
        rate, longest = self.problem.measured.rate, self.problem.longest
        most = int(np.clip(round(WINDOWS * window_s * rate), SHORTEST, max(SHORTEST + 1, longest // parts)))
        samples = SHORTEST
        while samples < most and self._growth(min(2 * samples, most)) < _GROWN:
            samples = min(2 * samples, most)
        return samples

    def _growth(self, samples: int) -> float:
        """The factor by which an error of the start grows in the second half of usual blocks of so many samples."""
        problem = self.problem
        cut = problem.cut(samples)
        cut = Cut(cut.first[:: -(-len(cut.first) // _TRIED)].copy(), cut.samples)
        found = problem.block(self._r, cut, problem.first_starts(cut, self._r), problem.used(cut), move=False)
        if found is None:
            return np.inf
        early, late = (np.abs(part).max(axis=(1, 2)) for part in np.array_split(found.jacobian, 2, axis=1))
        return float(np.median(np.where(early > 0, late / np.where(early > 0, early, 1.0), 1.0).max(axis=1)))

    def simulated(self, r: Float, problem: Problem, samples: int, most: int | None = None) -> tuple[Cut, Float]:
        """Blocks and readings in them [blocks, samples, sensors], from starts that fit the measured ones.

        Parameters
        ----------
        samples : of a block
        most : samples that are simulated in all; None: all
        """
        cut = problem.cut(samples)
        if most is not None and len(cut.first) * cut.samples > most:
            every = -(-len(cut.first) * cut.samples // most)
            cut = Cut(cut.first[::every].copy(), cut.samples)
        nothing = Prior(r, np.ones(problem.n), np.zeros(problem.n, np.bool_))
        return cut, problem.simulated(r, cut, problem.with_starts(nothing, cut, _PASSES).starts)

    def fitted(self, r: Float, problem: Problem, samples: int, names: Collection[str]) -> Float:
        """r with these parameters fitted to the recording, in blocks of so many samples; r where it runs away."""
        parameters = problem.kernel.made.parameters
        free = np.array([one.name in names for one in parameters])
        prior = replace(prior_about(problem, r), free=free)
        found = refined(problem, prior, (max(SHORTEST, samples // WINDOWS), samples))
        return found.r if np.isfinite(found.sum_of_squares) else r

    def compared(self, measured: Float, simulated: Float) -> tuple[SensorPrediction, ...]:
        """Of each sensor, from readings [blocks, samples, sensors]."""
        names = self.problem.kernel.made.outputs
        return tuple(
            _of_sensor(self.model, name, measured[..., k], simulated[..., k], self.sd[k])
            for k, name in enumerate(names)
        )

    def validation(self, t: Float, measured: Float, simulated: Float) -> Validation:
        """Of readings in blocks [blocks, samples, sensors] at the times t [blocks, samples] in s; the blocks are put in
        the order of their times."""
        order = np.argsort(t[:, 0], kind="stable")
        t, measured, simulated = t[order], measured[order], simulated[order]
        names = self.problem.kernel.made.outputs
        blocks, samples = t.shape
        return Validation(
            self.compared(measured, simulated),
            samples / self.problem.measured.rate,
            blocks,
            t.ravel(),
            {name: measured[..., k].ravel() for k, name in enumerate(names)},
            {name: simulated[..., k].ravel() for k, name in enumerate(names)},
        )


def validated(
    model: CompiledModel, recording: Recording, p: Float, window_s: float, own: Collection[str] = ()
) -> Validation:
    """How well p predicts a recording, all of it that can be simulated.

    Raises PvidError where the equations cannot be simulated on it, or the motion runs away.

    Parameters
    ----------
    p : all parameters of the model [n_p]
    window_s : of the weak form that gave p [s]
    own : names of those that are fitted to the recording, from p on
    """
    rate = recording.sample_rate
    with np.errstate(all="ignore"):
        motion = Motion.near(model, recording.run, rate, p)
        problem = motion.within([(0, len(recording))])
        if not problem.measured.stretches or problem.longest < _BLOCKS * SHORTEST:
            raise PvidError(f"the recording is too short to predict it in {_BLOCKS} blocks of {SHORTEST} samples")
        r, samples = motion.r_of(p), motion.block(window_s, _BLOCKS)
        if own:
            r = motion.fitted(r, problem, samples, own)
        cut, simulated = motion.simulated(r, problem, samples)
    measured = cut.rows(problem.measured.z)
    if not np.isfinite(simulated).all():
        raise PvidError(
            f"the motion of {model.name} runs away with these parameters: they are not those of this recording"
        )
    fitted = {one.name: float(r[k]) for k, one in enumerate(problem.kernel.made.parameters) if one.name in own}
    return replace(motion.validation(recording.t[cut.places], measured, simulated), fitted=fitted)


def of_fit(problem: Problem, found: Refined) -> Validation:
    """What a refinement fits, over its blocks; times are those since the recording began."""
    measured = found.cut.rows(problem.measured.z)
    simulated = problem.simulated(found.r, found.cut, found.starts).reshape(measured.shape)
    return Motion(problem, found.r).validation(found.cut.places / problem.measured.rate, measured, simulated)


def simulation_of(model: CompiledModel, recording: Recording, p: Float) -> dict[str, Float]:
    """What p predicts of a recording's longest stretch, simulated as a whole from the start that fits it best.

    Raises PvidError where the equations cannot be simulated on it, or the motion runs away.

    Returns
    -------
    "t" [s], and of each sensor its readings [n].
    """
    recording = recording.whole()
    with np.errstate(all="ignore"):
        motion = Motion.near(model, recording.signals, recording.sample_rate, p)
        problem = motion.within([(0, len(recording))])
        cut, simulated = motion.simulated(motion.r_of(p), problem, problem.longest)
    if not np.isfinite(simulated).all():
        raise PvidError(
            f"the motion of {model.name} runs away over the whole recording: `validate` simulates it in blocks"
        )
    first, names = int(cut.first[0]), problem.kernel.made.outputs
    t = recording.t[first : first + cut.samples]
    return {"t": t} | {name: simulated[0, :, k] for k, name in enumerate(names)}


def p_of(model: CompiledModel, values: Mapping[str, float | None]) -> Float:
    """Parameters by name as an array [n_p]. Raises PvidError where one has no value."""
    model.refuse_robot("a simulation")
    missing = [name for name in model.p_names if values.get(name) is None]
    if missing:
        raise PvidError(f"{listed(missing)} of {model.name} has no value there: without it no motion can be predicted")
    return np.array([values[name] for name in model.p_names], np.float64)


def predicted(
    model: CompiledModel, recording: Recording, values: Mapping[str, float | None], window_s: float | None
) -> Validation:
    """The same with values by name, as an answer has them. Parameters of which an answer from several recordings has a
    value for each, `m[A]` and `m[B]`, are fitted.

    Raises PvidError also where a parameter has no value.

    Parameters
    ----------
    window_s : None: a twentieth of the recording
    """
    model.refuse_robot("a simulation")
    model = model.alone
    of_each = {name: [value for key, value in values.items() if key.startswith(f"{name}[")] for name in model.p_names}
    own = {name: [one for one in each if one is not None] for name, each in of_each.items() if each}
    known = {name: values.get(name) for name in model.p_names if name not in own}
    missing = [name for name, value in known.items() if value is None] + [
        name for name, each in own.items() if not each
    ]
    if missing:
        raise PvidError(f"{listed(missing)} of {model.name} has no value there: without it no motion can be predicted")
    p = np.array([np.mean(own[name]) if name in own else known[name] for name in model.p_names], np.float64)
    return validated(model, recording, p, window_s or len(recording) / recording.sample_rate / 20, list(own))


def _of_sensor(model: CompiledModel, name: str, measured: Float, simulated: Float, sd: float) -> SensorPrediction:
    """From samples and their simulation, both [blocks, samples]."""
    error = measured - simulated
    rms = float(np.sqrt(np.nanmean(np.square(error))))
    motion = float(np.sqrt(np.nanmean(np.square(measured - np.nanmean(measured, axis=1, keepdims=True)))))
    of_motion = rms / motion if motion > 0 else np.inf
    return SensorPrediction(name, model.signal(name).unit, rms, of_motion, rms / sd if sd > 0 else None)
