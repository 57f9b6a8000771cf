"""What moves p by the same in every window: no residual shows it, or hardly, and no longer run reduces it.

Gains, constants, the clock and what linearised equations neglect are the scale part of an answer's standard errors. A
recording also shows whether a signal is late or has an offset, and the answer contains what it shows; a design that no
recording of the rig was made for takes them into account with standard deviations of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel, Known, Signal
from pvid.oracle.weak.failures import attempted
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.library import Library
from pvid.oracle.weak.rows import WeakRows, ready
from pvid.oracle.weak.solve import Fit, compensated, gauss_newton
from pvid.oracle.weak.terms import DELAY, OFFSET
from pvid.oracle.weak.zero import on_their_own_scale

_STEPS_OF_KNOWN = 10
_LATE = 0.1  # of the time between samples: standard deviation of a delay that nothing is known of
_OFF = 0.5, 1e-3  # of a sensor's resolution, of an input's reach: the same of an offset


@dataclass(frozen=True)
class Cause:
    """Of an error that all windows share.

    Attributes
    ----------
    text : what it is
    moves : what p is off by for one standard deviation of it [n_p]
    """

    text: str
    moves: Float


def of_scale(library: Library) -> list[Cause]:
    """Constants, gains and the clock that have a standard deviation, in this order, and neglected terms."""
    fit, model, run = library.fit, library.model, library.run
    out = [_cause(fit, one.name, one.sd, partial(_by_known, library, one)) for one in model.knowns if one.sd]
    for one in model.signals:
        if one.gain_sd:
            out.append(_cause(fit, f"gain of {one.name}", one.gain_sd, partial(library.by_gain, one.name)))
    if model.clock_sd:
        out.append(_cause(fit, "sample rate", model.clock_sd, lambda: library.by_clock))
    part = neglected(model, run)
    return [*out, Cause("neglected terms", ready(model).parameters.positive * fit.p * part)]


def of_signals(library: Library) -> Iterator[Cause]:
    """Delays and offsets of all signals."""
    for one in library.model.signals:
        recorded = library.recorded(one.name)
        if not recorded.top:
            continue
        for text, sd, act in (("delay", delay_sd(one, recorded.rate), DELAY), ("offset", offset_sd(one), OFFSET)):
            if sd:
                term = library.act(recorded, act, 0.0)  # what puts it right
                yield _cause(library.fit, f"{text} of {one.name}", -sd, partial(library.scores.shift, term))


def delay_sd(signal: Signal, sample_rate: float) -> float:
    """Standard deviation of a signal's delay [s]."""
    return _LATE / sample_rate if signal.delay_sd is None else signal.delay_sd


def offset_sd(signal: Signal) -> float:
    """The same of its offset [its unit]."""
    own = _OFF[0] * signal.resolution if signal.kind == "sensor" else _OFF[1] * signal.reach
    return own if signal.offset_sd is None else signal.offset_sd


def neglected(model: CompiledModel, run: Mapping[str, npt.ArrayLike]) -> float:
    """Largest relative error of linearised equations on a run."""
    errors = [0.0]
    for one in model.signals:
        if one.neglected:
            x = np.asarray(run[one.name], np.float64)
            errors.append(one.neglected * float(np.nanmax(np.abs(x - np.nanmean(x)))) ** 2)
    return max(errors)


def or_nan(fit: Fit, computation: Callable[[], Float]) -> Float:
    """What is computed [n_p]; NaN where its numbers ran away."""
    found = attempted(computation)
    return np.full(len(fit.p), np.nan) if found is None else found


def _cause(fit: Fit, text: str, sd: float, slope: Callable[[], Float]) -> Cause:
    return Cause(text, sd * or_nan(fit, slope))


def _by_known(library: Library, known: Known) -> Float:
    """d p / d constant [n_p], with the weights of the fit: one standard deviation more, and p again."""
    compiled, fit = library.model, library.fit
    moved = tuple(replace(one, value=one.value + one.sd) if one is known else one for one in compiled.knowns)
    own_scale = fit.rows.compiled.parameters.positive != ready(compiled).parameters.positive
    other = on_their_own_scale(ready(replace(compiled, knowns=moved)), own_scale)
    rows = WeakRows.of(other, library.run, fit.rows.record.grid.design)
    rows = rows.only(np.isin(rows.numbers, fit.rows.numbers))
    p, prior = fit.p, fit.parameters.prior(fit.start)
    theta = rows.compiled.parameters.theta(p)
    moments = compensated(rows, [rows.white(group, theta, fit.errors) for group in rows.groups], theta)
    p, _ = gauss_newton(rows.compiled.parameters, moments, p, prior, _STEPS_OF_KNOWN)
    return np.asarray((p - fit.p) / known.sd)
