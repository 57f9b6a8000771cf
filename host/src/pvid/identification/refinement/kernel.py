"""The refinement's functions of a model in float64 C on this computer: blocks of a run and their derivatives."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.recent import Recent
from pvid.codegen.refine import RefinedParameter, signs_of, width_of, without_optional
from pvid.identification.refinement.kernel_text import printed
from pvid.model.compiled import CompiledModel
from pvid.sim.compiled_plant import loaded

Float = npt.NDArray[np.float64]

_STEP = 0.1  # of a step times the fastest eigenvalue: the error of RK4 is below 1e-7 of a period
_MOST_SUB = 16
_SIGN_SUB = (16, 64)  # steps a sample where there are signs, whose width follows from these: a wide one biases
_STEPS = 1e6  # of the run: inputs at each are kept
_SHARPEST, _WIDEST = 1e-9, 1e6  # widths of signs
_MOVED = 0.1  # of the logarithm of a sign's width: its derivative is a difference


def play_of(model: CompiledModel, sensor: str) -> str:
    """Name of the play of a sensor: play, and where several are fitted the sensor's behind it."""
    several = sum(one.kind == "sensor" and not one.driven for one in model.signals) > 1
    return f"play_{sensor}" if several else "play"


@dataclass(frozen=True, eq=False)
class Drive:
    """What moves a run.

    Attributes
    ----------
    sub : steps a sample, of h [s]
    u, du : inputs and their rates at begin, middle and end of each step [steps, 3, inputs]
    coarse : steps, an even number or 1, that are taken as one where no friction reverses
    """

    sub: int
    h: float
    u: Float
    du: Float
    coarse: int = 1


class RefinedKernel:
    """Blocks of a run of a model.

    Attributes
    ----------
    made : the functions; the widths of signs are the last parameters, knowns are settings
    widths : places of those of the signs in r
    states : numbers in a start: q and, of order 2, v
    columns : derivatives by these, by the motion's parameters (and the skew) and by the rest of r
    """

    def __init__(self, model: CompiledModel) -> None:
        made, code = printed(model)
        self._library = loaded(code)
        widths = tuple(width_of(model, one) for one in signs_of(model))
        self.widths = list(range(len(made.parameters), len(made.parameters) + len(widths)))
        self.made = replace(made, parameters=(*made.parameters, *widths), settings=made.settings[len(widths) :])
        self.states = self.made.order * len(self.made.coordinates)
        self.columns = self.states + len(self.made.parameters)

    def start(self, p: Float) -> Float:
        """r, with settings, from p of the weak form."""
        known = {one.name: one.value for one in self.made.model.knowns}
        r = [p[one.place] if one.place >= 0 else 0.0 for one in self.made.parameters]
        return np.array(r + [known.get(name, 1.0) for name in self.made.settings])

    def slopes_at_rest(self, r: Float) -> Float:
        """dx'/dx [states, states] at a state and inputs of 0; where there is none, as of an empty tank, at half of what
        the sensors reach."""
        u = np.zeros(len(self.made.inputs))
        reach = {one.name: one.reach for one in self.made.model.signals}
        half = np.zeros(self.states)
        of_coordinates = np.array([reach.get(name, 2.0) / 2 for name in self.made.coordinates])
        half[: len(of_coordinates)] = np.where(np.isfinite(of_coordinates), of_coordinates, 1.0)
        with np.errstate(all="ignore"):
            found = self.slopes(r, np.zeros(self.states), u)
            return found if np.isfinite(found).all() else self.slopes(r, half, u)

    def without_signs(self, r: Float) -> Float:
        """r with signs so wide that they do nothing."""
        out = r.copy()
        out[self.widths] = _WIDEST
        return out

    def steps(self, samples: int, rate: float, r: Float, coarse: int | None = None) -> tuple[int, int, Float]:
        """Steps a sample, those of them that are one where no friction reverses (`coarse`; from the number of samples
        by default), and r with widths of the signs: the jump of the rate within a step that a friction's reversal
        makes, with which RK4 stays stable and smooth.
        """
        if samples < 1:
            raise PvidError("the recording is too short for the refinement")
        r = self.without_signs(r)
        smooth = min(max(1, int(np.ceil(self._fastest(r) / rate / _STEP))), _MOST_SUB)
        fine = int(np.clip(_STEPS / samples, *_SIGN_SUB))
        coarse = (coarse or max(2, fine // smooth // 2 * 2)) if self.widths else 1
        sub = smooth * coarse
        for place in self.widths:
            sharp = r.copy()
            sharp[place] = _SHARPEST
            r[place] = max(self._fastest(sharp) * _SHARPEST / rate / sub, _SHARPEST)
        return sub, coarse, r

    def _fastest(self, r: Float) -> float:
        """Largest eigenvalue at rest [1/s]."""
        return float(np.abs(np.linalg.eigvals(self.slopes_at_rest(r))).max())

    def number_of(self, first: npt.NDArray[np.int32]) -> npt.NDArray[np.intp]:
        """Of the recording that holds each block, 0 where there is one."""
        return np.zeros(len(first), np.intp)

    def blocks(
        self,
        r: Float,
        first: npt.NDArray[np.int32],
        samples: int,
        drive: Drive,
        starts: Float,
        derivatives: bool | Literal["starts"] = True,
    ) -> tuple[Float, Float | None, Float]:
        """Readings, derivatives, ends.

        Parameters
        ----------
        r : parameters and settings
        first : sample of each block's start [blocks]
        samples : of each block
        starts : [blocks, states]
        derivatives : "starts": those by the starts alone; other columns mean nothing

        Returns
        -------
        z [blocks, samples, outputs], its derivatives by starts and steps of r [blocks, samples, outputs, columns] (or
        None), ends [blocks, states]
        """
        made, n = self.made, len(first)
        z = np.empty((n, samples, len(made.outputs)))
        jacobian = np.empty((*z.shape, self.columns - len(self.widths))) if derivatives else None
        ends = np.empty((n, self.states))
        self._library.refine_blocks(
            _pointer(r),
            n,
            np.ascontiguousarray(first, np.int32).ctypes.data_as(ctypes.c_void_p),
            samples,
            drive.sub,
            drive.coarse,
            ctypes.c_double(drive.h),
            _pointer(drive.u),
            _pointer(drive.du),
            _pointer(starts),
            _pointer(z),
            None if jacobian is None else _pointer(jacobian),
            derivatives == "starts",
            _pointer(ends),
        )
        if derivatives == "starts":
            return z, jacobian, ends
        if jacobian is not None and "chart" in made.functions:
            moving = made.moving - made.skew
            part = slice(self.states, self.states + moving)
            jacobian[..., part] = jacobian[..., part] @ self.chart(r)
        if jacobian is not None and self.widths:
            near = np.tile(r, (len(self.widths), 1))
            near[range(len(near)), self.widths] *= np.exp(_MOVED)
            moved = [self.blocks(one, first, samples, drive, starts, False)[0] for one in near]
            jacobian = np.concatenate([jacobian, (np.stack(moved, -1) - z[..., None]) / _MOVED], -1)
        return z, jacobian, ends

    def derivatives(self, r: Float, q: Float, v: Float, u: Float) -> dict[str, Float]:
        """a, K, D, U, B at one instant, flat."""
        out = {key: np.empty(max(n, 1)) for key, n in self.made.functions["jacobian"].written}
        given = [np.ascontiguousarray(one, np.float64) for one in (r, q, v, u)]
        self._library.refine_derivatives(*map(_pointer, given), *map(_pointer, out.values()))
        return out

    def slopes(self, r: Float, state: Float, u: Float) -> Float:
        """dx'/dx [states, states] at a state, which has v behind q."""
        n = len(self.made.coordinates)
        found = self.derivatives(r, state[:n], state[n:] if self.made.order == 2 else np.zeros(1), u)
        below = found["K"].reshape(n, n)
        if self.made.order == 1:
            return below
        return np.block([[np.zeros((n, n)), np.eye(n)], [below, found["D"].reshape(n, n)]])

    def chart(self, r: Float) -> Float:
        """d(steps of the motion's parameters)/d(steps of r) [moving, moving], the skew left out."""
        moving = self.made.moving - self.made.skew
        rows = np.eye(moving)
        if "chart" in self.made.functions:
            for row in rows:
                self._library.refine_chart(_pointer(r), row.ctypes.data_as(ctypes.c_void_p))
        return rows

    def possible(self, r: Float) -> bool:
        """Whether a mechanism can have these parameters."""
        return bool(self._library.refine_region(_pointer(r)))


class PlayedKernel(RefinedKernel):
    """A kernel with one more parameter behind the others: half the play between the mechanism and a sensor of it, or
    half the sensor's hysteresis.

    Parameters
    ----------
    inner : without it
    output : number of the sensor among the outputs
    prior_sd : how large it may be, in the sensor's unit
    """

    def __init__(self, inner: RefinedKernel, output: int = 0, prior_sd: float = 1.0) -> None:
        self._inner, self._library, self.states, self._output = inner, inner._library, inner.states, output
        own = RefinedParameter(
            play_of(inner.made.model, inner.made.outputs[output]),
            inner.made.model.signal(inner.made.outputs[output]).unit,
            False,
            -1,
            prior_sd,
        )
        self.made = replace(inner.made, parameters=(*inner.made.parameters, own))
        self._place, self.widths = len(inner.made.parameters), inner.widths
        self.columns = inner.columns + 1

    def blocks(
        self,
        r: Float,
        first: npt.NDArray[np.int32],
        samples: int,
        drive: Drive,
        starts: Float,
        derivatives: bool | Literal["starts"] = True,
    ) -> tuple[Float, Float | None, Float]:
        """As of RefinedKernel; ends are those of the motion."""
        z, inner, ends = self._inner.blocks(self._without(r), first, samples, drive, starts, derivatives)
        jacobian = None if inner is None else np.concatenate([inner, np.zeros((*z.shape, 1))], -1)
        self._library.refine_play(
            len(first),
            samples,
            self._output,
            ctypes.c_double(float(r[self._place])),
            _pointer(z),
            None if jacobian is None else _pointer(jacobian),
            0 if jacobian is None else jacobian.shape[-1],
            0 if jacobian is None else jacobian.shape[-1] - 1,
        )
        return z, jacobian, ends

    def number_of(self, first: npt.NDArray[np.int32]) -> npt.NDArray[np.intp]:
        """As of RefinedKernel."""
        return self._inner.number_of(first)

    def _without(self, r: Float) -> Float:
        return np.delete(r, self._place)

    def derivatives(self, r: Float, q: Float, v: Float, u: Float) -> dict[str, Float]:
        """As of RefinedKernel."""
        return self._inner.derivatives(self._without(r), q, v, u)

    def chart(self, r: Float) -> Float:
        """As of RefinedKernel."""
        return self._inner.chart(self._without(r))

    def possible(self, r: Float) -> bool:
        """Whether a mechanism can have these parameters."""
        return bool(r[self._place] >= 0) and self._inner.possible(self._without(r))


class TogetherKernel(RefinedKernel):
    """A kernel of several recordings, with the parameters of all: blocks of each have its own.

    Parameters
    ----------
    inner : of one recording
    model : with the parameters of all
    begins : first sample of each recording
    """

    def __init__(self, inner: RefinedKernel, model: CompiledModel, begins: Sequence[int]) -> None:
        self._inner, self._library, self._begins, self.states = inner, inner._library, begins, inner.states
        own = inner.made
        parameters: list[RefinedParameter] = []
        self._places: list[list[int]] = [[] for _ in model.places]  # of each recording, in `parameters`
        for one in own.parameters:
            of_p = [one.place] if one.place < 0 else list(dict.fromkeys(places[one.place] for places in model.places))
            for at in self._places:
                at.append(len(parameters))
            for k, place in enumerate(of_p):
                name = one.name if place < 0 else model.p_names[place]
                parameters.append(replace(one, name=name, place=place))
                if len(of_p) > 1:
                    self._places[k][-1] = len(parameters) - 1
        extra = len(parameters) - len(own.parameters)
        # every own parameter is one of the motion or of the readings; both stand in the order of `inner`
        moving = self._places[-1][own.moving - 1] + 1 if own.moving else 0
        self.made = replace(own, model=model, parameters=tuple(parameters), moving=moving)
        self.widths = [one + extra for one in inner.widths]
        self.columns = inner.columns + extra

    def blocks(
        self,
        r: Float,
        first: npt.NDArray[np.int32],
        samples: int,
        drive: Drive,
        starts: Float,
        derivatives: bool | Literal["starts"] = True,
    ) -> tuple[Float, Float | None, Float]:
        """As of RefinedKernel."""
        z = np.empty((len(first), samples, len(self.made.outputs)))
        jacobian = np.zeros((*z.shape, self.columns)) if derivatives else None
        ends = np.empty((len(first), self.states))
        number = self.number_of(first)
        for k in np.unique(number).tolist():
            own = np.flatnonzero(number == k)
            begun = np.ascontiguousarray(starts[own])
            z[own], inner, ends[own] = self._inner.blocks(
                self._of(r, k), first[own], samples, drive, begun, derivatives
            )
            if jacobian is not None and inner is not None:
                columns = [*range(self.states), *(self.states + place for place in self._places[k])]
                given = np.array(columns[: self.states] if derivatives == "starts" else columns)
                jacobian[own[:, None], :, :, given] = np.moveaxis(inner[..., : len(given)], 3, 1)
        return z, jacobian, ends

    def number_of(self, first: npt.NDArray[np.int32]) -> npt.NDArray[np.intp]:
        """As of RefinedKernel."""
        return np.asarray(np.searchsorted(self._begins, first, side="right") - 1)

    def _of(self, r: Float, k: int) -> Float:
        """Parameters and settings of one recording."""
        return np.concatenate([r[self._places[k]], r[len(self.made.parameters) :]])

    def derivatives(self, r: Float, q: Float, v: Float, u: Float) -> dict[str, Float]:
        """As of RefinedKernel, of the first recording."""
        return self._inner.derivatives(self._of(r, 0), q, v, u)

    def chart(self, r: Float) -> Float:
        """As of RefinedKernel, of the first recording."""
        return self._inner.chart(self._of(r, 0))

    def possible(self, r: Float) -> bool:
        """Whether a mechanism can have these parameters, of each recording."""
        return all(self._inner.possible(self._of(r, k)) for k in range(len(self._places)))


def _pointer(array: Float) -> ctypes.c_void_p:
    assert array.dtype == np.float64 and array.flags.c_contiguous
    return array.ctypes.data_as(ctypes.c_void_p)


_made = Recent(RefinedKernel, 32)


def kernel_of(model: CompiledModel, optional: tuple[str, ...] = (), begins: Sequence[int] = ()) -> RefinedKernel:
    """The kernel of a compiled model with these of its optional extras.

    Parameters
    ----------
    begins : first sample of each recording, of a model of several; without them no block can be simulated
    """
    if model.together is not None:
        return TogetherKernel(kernel_of(model.alone, optional), model, begins)
    return _made(without_optional(model, optional))
