"""Guesses of a model's unknowns that follow from guesses of its outputs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.model.compiled import CompiledModel, Unknown
from pvid.model.evaluation import numpy_function

Float = npt.NDArray[np.float64]

_PULL = 1e-4  # towards the guess before: what the outputs leave open stays
_FAR = 1e-3  # relative: an output that is farther from its guess is that of no mechanism
_EXACT = 1e-15  # of the last steps, which nothing pulls
_WIDEST = 10.0  # of a logarithm: a factor of 22 000


def unknowns_of(model: CompiledModel, outputs: Mapping[str, float], fixed: Collection[str]) -> tuple[Unknown, ...]:
    """The unknowns of a model with the guesses nearest to theirs at which its outputs have these values.

    Raises PvidError where no values of the unknowns give these outputs.

    Parameters
    ----------
    outputs : by name
    fixed : unknowns whose guesses stay
    """
    wanted = np.array([*outputs.values()])
    expressions = [model.with_knowns(one.value) for name in outputs for one in model.outputs if one.name == name]
    value_of = numpy_function(model.p, expressions)
    free = np.array([one.name not in fixed for one in model.unknowns])
    positive = np.array([one.positive for one in model.unknowns])
    guess, sd = (np.array([getattr(one, name) for one in model.unknowns]) for name in ("guess", "sd"))
    scale = np.where(wanted != 0, np.abs(wanted), 1.0)

    def p_of(x: Float) -> Float:
        step = np.zeros(len(guess))
        step[free] = x
        return np.where(positive, guess * np.exp(np.where(positive, step, 0.0)), guess + sd * step)

    def off(x: Float) -> Float:
        """Of the outputs, relative [outputs]."""
        with np.errstate(all="ignore"):
            found = np.array([np.real(one) for one in value_of(*p_of(x))], np.float64)
        return np.where(np.isfinite(found), found / scale - wanted / scale, 1e3)

    start = np.zeros(int(free.sum()))
    bounds = (-_WIDEST, _WIDEST)
    found = least_squares(lambda x: np.concatenate([off(x), _PULL * x]), start, x_scale="jac", bounds=bounds)
    found = least_squares(off, found.x, x_scale="jac", bounds=bounds, xtol=_EXACT, ftol=_EXACT, gtol=_EXACT)
    if not len(start) or not np.abs(off(found.x)).max() < _FAR:
        given = listed(f"{name} = {value:g}" for name, value in outputs.items())
        raise PvidError(f"nominal: no {model.title} has {given}, with the constants of this rig")
    p = p_of(found.x)
    return tuple(
        replace(one, guess=float(value), sd=2 * float(value) if one.positive else one.sd)
        for one, value in zip(model.unknowns, p, strict=True)
    )
