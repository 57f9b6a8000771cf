"""The refinement's functions of a model in float64 C on this computer: blocks of a run and their derivatives."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from importlib.resources import files

import numpy as np
import numpy.typing as npt

from pvid.base.recent import Recent
from pvid.codegen.files_refine import DOUBLE, function
from pvid.codegen.refine import (
    RefinedParameter,
    RefineFunctions,
    has_skew,
    refine_functions_of,
    signs_of,
    width_of,
    without_optional,
)
from pvid.model.compiled import CompiledModel
from pvid.sim.compiled_plant import loaded

Float = npt.NDArray[np.float64]

PLAY = "play"  # the parameter of PlayedKernel
_MOVED = 0.1  # of the logarithm of a sign's width: its derivative is a difference


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
        made = refine_functions_of(model, None, has_skew(model))
        self._library = loaded(_code(made, any(one.edge == "before" for one in model.signals)))
        widths = tuple(width_of(model, one) for one in signs_of(model))
        self.widths = list(range(len(made.parameters), len(made.parameters) + len(widths)))
        self.made = replace(made, parameters=(*made.parameters, *widths), settings=made.settings[len(widths) :])
        self.states = self.made.order * len(self.made.coordinates)
        self.columns = self.states + len(self.made.parameters)

    def blocks(
        self,
        r: Float,
        first: npt.NDArray[np.int32],
        samples: int,
        sub: int,
        h: float,
        u: Float,
        du: Float,
        starts: Float,
        derivatives: bool = True,
        coarse: int = 1,
    ) -> tuple[Float, Float | None, Float]:
        """Readings, derivatives, ends.

        Parameters
        ----------
        r : parameters and settings
        first : sample of each block's start [blocks]
        samples : of each block
        sub : steps a sample, of h [s]
        u, du : inputs and their rates at begin, middle and end of each step [steps, 3, inputs]
        starts : [blocks, states]
        coarse : steps, an even number or 1, that are taken as one where no friction reverses

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
            sub,
            coarse,
            ctypes.c_double(h),
            _pointer(u),
            _pointer(du),
            _pointer(starts),
            _pointer(z),
            None if jacobian is None else _pointer(jacobian),
            _pointer(ends),
        )
        if jacobian is not None and "chart" in made.functions:
            moving = made.moving - made.skew
            part = slice(self.states, self.states + moving)
            jacobian[..., part] = jacobian[..., part] @ self.chart(r)
        if jacobian is not None and self.widths:
            near = np.tile(r, (len(self.widths), 1))
            near[range(len(near)), self.widths] *= np.exp(_MOVED)
            given = first, samples, sub, h, u, du, starts, False, coarse
            moved = [self.blocks(one, *given)[0] for one in near]
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
    """A kernel with one more parameter behind the others: half the play between the mechanism and its sensor, or half
    the sensor's hysteresis."""

    def __init__(self, inner: RefinedKernel, unit: str) -> None:
        self._inner, self._library, self.states = inner, inner._library, inner.states
        own = RefinedParameter(PLAY, unit, False, -1, 1.0)
        self.made = replace(inner.made, parameters=(*inner.made.parameters, own))
        self._place, self.widths = len(inner.made.parameters), inner.widths
        self.columns = inner.columns + 1

    def blocks(
        self,
        r: Float,
        first: npt.NDArray[np.int32],
        samples: int,
        sub: int,
        h: float,
        u: Float,
        du: Float,
        starts: Float,
        derivatives: bool = True,
        coarse: int = 1,
    ) -> tuple[Float, Float | None, Float]:
        """As of RefinedKernel; ends are those of the motion."""
        z, inner, ends = self._inner.blocks(
            self._without(r), first, samples, sub, h, u, du, starts, derivatives, coarse
        )
        jacobian = None if inner is None else np.concatenate([inner, np.zeros((*z.shape, 1))], -1)
        self._library.refine_play(
            len(first),
            samples,
            ctypes.c_double(float(r[self._place])),
            _pointer(z),
            None if jacobian is None else _pointer(jacobian),
            self.columns,
            self.columns - 1,
        )
        return z, jacobian, ends

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


def _pointer(array: Float) -> ctypes.c_void_p:
    assert array.dtype == np.float64 and array.flags.c_contiguous
    return array.ctypes.data_as(ctypes.c_void_p)


def _code(made: RefineFunctions, read_before: bool) -> str:
    counts = {
        "N": len(made.coordinates),
        "ORDER": made.order,
        "NU": len(made.inputs),
        "NZ": len(made.outputs),
        "NM": made.moving - made.skew,
        "NT": len(made.parameters) - made.moving,
        "SKEW": int(made.skew),
        "NS": dict(made.functions["signs"].written)["g"] if "signs" in made.functions else 0,
        "WIDTHS": len(made.parameters),
        "READ_BEFORE": int(read_before),
        "NUMBER_OF_CONSTANTS": len(made.constants),
    }
    jacobian = [key for key, _ in made.functions["jacobian"].written]
    arrays = ", ".join(f"double *{key}" for key in jacobian)
    export = [
        f"void refine_derivatives(const double *r, const double *q, const double *v, const double *u, {arrays}) "
        f"{{ double m[NUMBER_OF_CONSTANTS + 1]; pvid_refine_constants(r, m); "
        f"pvid_refine_jacobian(m, q, v, u, {', '.join(jacobian)}); }}",
    ]
    export += ["int refine_region(const double *r) { return pvid_refine_region(r); }"]
    if "chart" in made.functions:
        export.append("void refine_chart(const double *r, double *row) { pvid_refine_chart(r, row); }")
    return "\n".join(
        [
            "#include <math.h>\n#include <stdbool.h>",
            *(f"#define {name} {value}" for name, value in counts.items()),
            *(function(one, DOUBLE) for one in made.functions.values()),
            (files("pvid.run") / "refinement.c").read_text(encoding="utf-8"),
            *export,
        ]
    )


_made = Recent(RefinedKernel, 32)


def kernel_of(model: CompiledModel, optional: tuple[str, ...] = ()) -> RefinedKernel:
    """The kernel of a compiled model with these of its optional extras."""
    return _made(without_optional(model, optional))
