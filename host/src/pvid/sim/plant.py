"""The plant of a mechanism: its equations, integrated in C by RK4."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel
from pvid.models.drive import Drive
from pvid.sim.compiled_plant import loaded
from pvid.sim.motion import Motion, motion_of
from pvid.sim.plant_code import plant_code

Float = npt.NDArray[np.float64]
Control = Callable[[float, Float], Mapping[str, float]]

_INSIDE = 1e-6  # of a step: where a drive is read at its ends, on this side of an edge that lies there
_PART = 2000  # samples whose smooth inputs are in memory at a time


@dataclass(frozen=True)
class Friction:
    """The law of sgn.

    Attributes
    ----------
    width : tanh(v / width); 0: sharp, reversals are located and a friction that exceeds the other forces sticks
    breakaway : sharp: the friction that holds at rest over the one that slides, >= 1
    """

    width: float = 0.0
    breakaway: float = 1.0

    def __post_init__(self) -> None:
        if not (self.width >= 0.0 and self.breakaway >= 1.0):
            raise PvidError("a friction needs a width >= 0 and a breakaway >= 1")


SHARP = Friction()


@dataclass(frozen=True, eq=False)
class Trajectory:
    """What a simulation gives at its times t [n, s].

    Attributes
    ----------
    states : [n, nx], as in Motion.states
    highest : derivatives [n, N], as in Motion.highest; at a jump of an input those after it
    inputs : [n, nu], as in Motion.inputs, as recorded: without `gains`
    """

    motion: Motion
    t: Float
    states: Float
    highest: Float
    inputs: Float

    def __getitem__(self, name: str) -> Float:
        """A jet [n] by its name, as in phi or phi_1."""
        for symbols, values in (
            (self.motion.states, self.states),
            (self.motion.highest, self.highest),
            (self.motion.inputs, self.inputs),
        ):
            for place, symbol in enumerate(symbols):
                if str(symbol) == name:
                    return np.asarray(values[:, place])
        raise KeyError(name)


class Plant:
    """The plant of a model.

    Raises PvidError when the equations do not determine a motion, or there is no C compiler.
    """

    def __init__(self, model: CompiledModel) -> None:
        self.model = model
        self.motion = motion_of(model)
        self._held = [model.signal(jet.of).hold == "zoh" for jet in self.motion.inputs]
        self._run = loaded(plant_code(self.motion)).plant_run
        self._known = np.array([one.value for one in model.knowns], dtype=np.float64)

    @property
    def smooth(self) -> bool:
        """Whether an input changes within a sample."""
        return not all(self._held)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of states, of inputs and of highest derivatives."""
        return len(self.motion.states), len(self.motion.inputs), len(self.motion.highest)

    def constants(self, p: Float, knowns: Mapping[str, float] | None = None) -> Float:
        """The unknowns [n_p] followed by the knowns, with other values for some of these."""
        known = self._known.copy()
        for place, one in enumerate(self.model.knowns):
            known[place] = (knowns or {}).get(one.name, known[place])
        return np.concatenate([np.asarray(p, dtype=np.float64), known])

    def start(self, values: Mapping[str, float]) -> Float:
        """A state [nx] from values by jet; 0 where none is given."""
        state = np.zeros(len(self.motion.states))
        for name, value in values.items():
            state[self.motion.state(name)] = value
        return state

    def driven(
        self,
        constants: Float,
        start: Float,
        drives: Mapping[str, Drive],
        rate: float,
        samples: int,
        *,
        substeps: int = 10,
        friction: Friction = SHARP,
        disturbance: Float | None = None,
        every_step: bool = False,
        gains: Mapping[str, float] | None = None,
    ) -> Trajectory:
        """The motion under drives.

        Parameters
        ----------
        constants : as `constants` gives them
        start : state [nx]
        drives : by name of the driven signal; a held one is read at the samples, a smooth one within each step as well
        rate, samples : [Hz] and number
        disturbance : added to the equations [samples, N], held
        every_step : the trajectory at every step of the integration, not at the samples alone
        gains : factor of the drive by name: what acts is the factor times the drive
        """
        inputs = self.motion.inputs
        missing = [jet.of for jet in inputs if jet.of not in drives]
        if missing:
            raise PvidError(f"{self.model.name} needs a drive of {', '.join(sorted(set(missing)))}")
        smooth = self.smooth
        gain = self._gain(gains)
        state, modes, fresh = np.array(start, dtype=np.float64), self.modes(), True
        pieces, driven = [], []
        for first in range(0, samples, _PART if smooth else samples):
            n = min(_PART if smooth else samples, samples - first)
            values = self.inputs(drives, first, n, rate, substeps)
            part = None if disturbance is None else np.ascontiguousarray(disturbance[first : first + n])
            acting = values * gain
            pieces.append(
                self.advance(state, modes, fresh, acting, constants, rate, n, substeps, friction, part, every_step)
            )
            at = values[:, :, 0] if smooth else np.repeat(values[:, None], substeps, 1)
            kept = at if every_step else at[:, :1]
            driven.append(kept.reshape(kept.shape[0] * kept.shape[1], len(inputs)))
            fresh = False
        return self._trajectory(np.concatenate(pieces), np.concatenate(driven), rate * (substeps if every_step else 1))

    def controlled(
        self,
        constants: Float,
        start: Float,
        control: Control,
        rate: float,
        samples: int,
        *,
        substeps: int = 10,
        friction: Friction = SHARP,
        disturbance: Float | None = None,
        every_step: bool = False,
        gains: Mapping[str, float] | None = None,
    ) -> Trajectory:
        """The motion under held inputs that a controller sets at each sample from the time [s] and the state [nx]; its
        inputs are those that it sets. As `driven` for the rest."""
        inputs = self.motion.inputs
        if self.smooth:
            raise PvidError(f"{self.model.name} has inputs that are not held between samples: no controller sets them")
        gain = self._gain(gains)
        state, modes = np.array(start, dtype=np.float64), self.modes()
        pieces, driven = [], np.empty((samples, len(inputs)))
        for k in range(samples):
            given = control(k / rate, state)
            driven[k] = [given[jet.of] for jet in inputs]
            part = None if disturbance is None else disturbance[k : k + 1]
            acting = driven[k : k + 1] * gain
            pieces.append(
                self.advance(state, modes, k == 0, acting, constants, rate, 1, substeps, friction, part, every_step)
            )
        many = substeps if every_step else 1
        return self._trajectory(np.concatenate(pieces), np.repeat(driven, many, 0), rate * many)

    def advance(
        self,
        state: Float,
        modes: npt.NDArray[np.int32],
        fresh: bool,
        inputs: Float,
        constants: Float,
        rate: float,
        samples: int,
        substeps: int,
        friction: Friction,
        disturbance: Float | None = None,
        every_step: bool = False,
    ) -> Float:
        """plant_run of integrator.c: states and highest derivatives [samples, nx + N]; state and modes are advanced.

        inputs : held ones [samples, nu], or smooth ones [samples, substeps, 3, nu]
        """
        nx, nu, n = self.shape
        smooth = inputs.ndim == 4
        assert inputs.shape == ((samples, substeps, 3, nu) if smooth else (samples, nu))
        out = np.empty((samples * (substeps if every_step else 1), nx + n))
        fault = self._run(
            _pointer(state),
            _pointer(modes),
            int(fresh),
            _pointer(np.ascontiguousarray(inputs)),
            int(smooth),
            None if disturbance is None else _pointer(np.ascontiguousarray(disturbance)),
            _pointer(constants),
            ctypes.c_double(friction.width),
            ctypes.c_double(friction.breakaway),
            ctypes.c_double(1.0 / rate / substeps),
            substeps,
            samples,
            int(every_step),
            _pointer(out),
        )
        if fault:
            raise PvidError(f"{self.model.name}: the equations do not determine the motion somewhere on the way")
        if not np.isfinite(out).all():
            raise PvidError(f"{self.model.name}: the simulated motion grows without bound: choose a weaker drive")
        return out

    def _gain(self, gains: Mapping[str, float] | None) -> Float:
        return np.array([(gains or {}).get(jet.of, 1.0) for jet in self.motion.inputs])

    def modes(self) -> npt.NDArray[np.int32]:
        """Of the frictions, before a start."""
        return np.zeros(max(len(self.motion.signs), 1), dtype=np.int32)

    def inputs(self, drives: Mapping[str, Drive], first: int, samples: int, rate: float, substeps: int) -> Float:
        """What drives give `advance` from the sample `first` on: [samples, nu] where all inputs are held, else
        [samples, substeps, 3, nu]."""
        smooth = self.smooth
        at = np.arange(first, first + samples) / rate
        step = 1.0 / rate / substeps
        within = (np.arange(substeps)[:, None] + np.array([_INSIDE, 0.5, 1.0 - _INSIDE])) * step
        fine = at[:, None, None] + within
        columns = []
        for jet, held in zip(self.motion.inputs, self._held, strict=True):
            drive = drives[jet.of]
            if not smooth:
                columns.append(drive.values(at))
            elif held:
                columns.append(np.broadcast_to(drive.values(at)[:, None, None], fine.shape))
            else:
                columns.append(drive.values(fine.reshape(-1), jet.order).reshape(fine.shape))
        shape = fine.shape if smooth else at.shape
        return np.stack(columns, -1) if columns else np.empty((*shape, 0))

    def _trajectory(self, out: Float, inputs: Float, rate: float) -> Trajectory:
        nx = self.shape[0]
        return Trajectory(self.motion, np.arange(len(out)) / rate, out[:, :nx], out[:, nx:], inputs)


def _pointer(array: Float | npt.NDArray[np.int32]) -> ctypes.c_void_p:
    """Without its type, which takes as long as a step of the plant."""
    return ctypes.c_void_p(array.ctypes.data)
