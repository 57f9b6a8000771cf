"""The design of a weak form for a model and a run: the one with the least predicted errors.

The score of a design is the geometric mean over the parameters of predicted s.e. x sqrt(max(1, chi^2)), both from the
run. Measured: where chi^2 is about 1 the score is the true error; where it is large the best by score is within 20 % of
the best by truth.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.oracle.weak import work
from pvid.oracle.weak.assessment import ALMOST_0, Assessed
from pvid.oracle.weak.attenuation import other_line
from pvid.oracle.weak.blur import blur_of, rates_of_drives, shift_of
from pvid.oracle.weak.design import Reversals, WeakDesign
from pvid.oracle.weak.failures import FAILURES
from pvid.oracle.weak.front import samples_of, segments_of
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.gate import gated
from pvid.oracle.weak.rows import Compiled, WeakRows
from pvid.oracle.weak.solve import COMPARED, PASSES_COMPARED
from pvid.oracle.weak.starts import starts_about

_FEWEST_WINDOWS = 18
_SHORT_RUN = 10  # windows of a run that has no more: its halves are not compared
_SEARCHED = 1  # lengths of window, the longest ones, with other starts than the guesses
_SHORTEST_STEPS = 40  # of a window
_LENGTHS = 6
_OF_MEMORY = 0.45  # of a drift, the longest window: the core needs four half windows
_FUNCTIONS = (12, 24, 40)
_FEW_FUNCTIONS = (5, 8)  # of runs with motion that the equations do not explain: it is above the drive's frequencies
_RATES = ((11, 2), (15, 2), (31, 4), (41, 4), (61, 6), (101, 6))
_FLAT_RATES = ((11, 4), (21, 6), (41, 8), (81, 8), (141, 8))  # for a drive that is measured: see pvid.oracle.weak.blur

# Where the equations err, scores differ by less than this factor for no reason, and a reversal of the motion is blurred
# over the samples of a rate.
_ALIKE = 1.05

# Times chi^2 of separate whitening, or 1: a joint covariance that leaves more is not that of the noise. 1.0 to 1.2 in
# sixteen simulated runs, 2.5 where an encoder moves by few steps.
_JOINT = 1.5

# chi^2 that is the sensors'; above which the equations' own errors are estimated when designs are compared.
NOISE, MODEL_ERROR = 2.0, 5.0

# Of a parameter, to which it has fallen where it may be 0; and its standard error where it is sure.
_NONE, _SURE = 0.01, 0.3

# Part of a row that the equations explain, below which they are those of another mechanism, or of other signals: what
# smoothing and the number of functions trade, noise against motion, is not what is wrong. In nine recordings of real
# machines that have an answer the best length of window explains 0.78 and more of each row.
_NOTHING = 0.2
_SURELY_0 = 0.01  # standard error over the guess of a parameter that may be 0, where the sensors explain what is left


@dataclass(frozen=True)
class Scored:
    """A design with its score, and p there.

    error : predicted, of each parameter [n_p]
    known : every parameter has a value that means something, within the range of the model, or may be 0
    near_0 : one of them may be 0, and the search for it may have lost its way: not few of them are near 0, or what is
        left is no noise, or errors are a part of the guess
    r2 : of the row kind that is explained least
    """

    design: WeakDesign
    score: float
    p: Float
    chi2: float
    error: Float
    known: bool
    near_0: bool = False
    r2: float = 1.0

    @property
    def is_hopeless(self) -> bool:
        """Whether no other design can cure what this one leaves."""
        return self.chi2 > MODEL_ERROR and self.r2 < _NOTHING


_KEPT = 4096
_scores: dict[tuple[object, ...], tuple[Scored | None, float]] = {}  # with the work of it


def score_of(
    model: Compiled,
    run: Mapping[str, npt.ArrayLike],
    design: WeakDesign,
    start: Float | None,
    errors: bool,
    fewest: int = 1,
    digest: bytes = b"",
) -> Scored | None:
    """None where the design does not fit the run, or has not the fewest windows that are wanted.

    Kept for the last few thousand arguments: both cores, a comparison and a second command ask for the same scores.

    Parameters
    ----------
    digest : of the run, where it is known
    """
    begun = None if start is None else tuple(np.asarray(start, np.float64).tolist())
    key = (model.number, digest or digest_of(run), design, begun, errors, fewest)
    if key in _scores:  # an answer does not depend on what was kept
        found, units = _scores[key]
        work.spend(units)
        return found
    before = work.left()
    found = _scored(model, run, design, start, errors, fewest)
    _scores[key] = found, before - work.left()
    while len(_scores) > _KEPT:
        del _scores[next(iter(_scores))]
    return found


def digest_of(run: Mapping[str, npt.ArrayLike]) -> bytes:
    """Of the samples of a run and the names of its signals."""
    samples = hashlib.blake2b()
    for name in sorted(run):
        samples.update(name.encode())
        samples.update(np.ascontiguousarray(run[name], np.float64).data)
    return samples.digest()


def _scored(
    model: Compiled,
    run: Mapping[str, npt.ArrayLike],
    design: WeakDesign,
    start: Float | None,
    errors: bool,
    fewest: int,
) -> Scored | None:
    try:
        rows = WeakRows.of(model, run, design)
        if rows.windows < fewest:
            return None
        fit = gated(rows, start, equation_error=errors, passes=PASSES_COMPARED, settled=COMPARED)
        own = Assessed.of(fit)
        other = other_line(fit)
        blurred = shift_of(fit, run, design)
    except FAILURES:
        return None
    small, of_small, found = own.small, own.se, own.found
    size = np.where(small, fit.parameters.guess, np.where(fit.parameters.positive, np.abs(fit.p), fit.parameters.sd))
    predicted = np.where(small, of_small, found.predicted)
    apart = np.zeros(len(fit.p)) if other is None else other - fit.p
    relative = np.hypot(np.hypot(np.hypot(predicted, apart), blurred) / size, blur_of(model, run, design))
    if not np.all(np.isfinite(relative)) or not np.all(relative > 0):
        return None
    p = np.where(small, np.maximum(fit.p, ALMOST_0 * of_small), fit.p)
    score = float(np.exp(np.mean(np.log(relative))))
    few = own.known and 2 * np.count_nonzero(small) < np.count_nonzero(fit.parameters.positive)
    sure = few and found.chi2 < NOISE and bool(np.all(relative[small] < _SURELY_0))
    near_0 = bool(small.any()) and not sure
    return Scored(design, score, p, found.chi2, relative * size, own.known, near_0, min(found.r2))


def power_of(model: Compiled) -> int:
    """n of sin^n: even, 2 above the highest order, 6 at least."""
    return max(6, 2 * ((model.channels.top + 3) // 2), 8 if model.channels.top >= 4 else 6)


def basis_of(model: Compiled, sample_rate: float) -> WeakDesign:
    """What the search for a design begins with."""
    return WeakDesign(sample_rate, 64 / sample_rate, 12, power_of(model), rate_taps=21, rate_degree=3)


def lengths(samples: float, sample_rate: float, fewest: int = _FEWEST_WINDOWS) -> list[float]:
    """Windows to try [s], the longest first."""
    longest = 2 * samples / sample_rate / (fewest + 1)
    shortest = _SHORTEST_STEPS / sample_rate
    if longest < shortest:
        return []
    count = min(_LENGTHS, 1 + int(np.log2(max(longest / shortest, 1.0))))
    return [float(f"{longest / 2**k:.2g}") for k in range(count)]


def _unbroken(parts: Sequence[int], fewest: int) -> float:
    """Samples of a run without a gap in which the fewest windows are as long as in segments of so many samples."""
    if len(parts) == 1:
        return parts[0]
    tried = [2 * part / (k + 1) for part in parts for k in range(1, fewest + 1)]
    fitting = [length for length in tried if sum(max(int(2 * one / length + 1e-9) - 1, 0) for one in parts) >= fewest]
    return max(fitting, default=0.0) * (fewest + 1) / 2


def chosen(
    model: Compiled,
    run: Mapping[str, npt.ArrayLike],
    sample_rate: float,
    start: Float | None = None,
    equation_error: bool = True,
) -> WeakDesign:
    """The design of least score, one choice after the other: length, smoothing of rates, number of functions.

    Parameters
    ----------
    equation_error : estimate the error of each equation where the sensors do not explain the residuals
    """
    return ranked(model, run, sample_rate, start, equation_error)[0].design


def ranked(
    model: Compiled,
    run: Mapping[str, npt.ArrayLike],
    sample_rate: float,
    start: Float | None = None,
    equation_error: bool = True,
    reversals: Reversals = "located",
) -> list[Scored]:
    """All designs tried, the best first.

    Parameters
    ----------
    equation_error : as in `chosen`
    reversals : how signs are summed; "averaged" and "decided": of the weak form in C, which whitens the kinds of rows
        one by one
    """
    found = _ranked(model, run, sample_rate, start, equation_error, reversals, (_FEWEST_WINDOWS, _SHORT_RUN))
    # A logarithm that ran down may have lost its way in windows that are too short.
    if found[0].near_0 and not found[0].is_hopeless:
        found += _ranked(model, run, sample_rate, start, equation_error, reversals, (_SHORT_RUN,))
        found.sort(key=_order)
    best = next((one for one in found if _contradicts(one, found[0])), found[0])
    return [best, *(one for one in found if one is not best)]


def _contradicts(one: Scored, other: Scored) -> bool:
    """Whether a parameter that may be 0 in a design, whose residuals are no noise, is sure in one that explains more:
    a part that the equations miss may make a mechanism of fewer bodies fit some windows best."""
    if not other.near_0 or other.chi2 < MODEL_ERROR or one.near_0 or not one.known or one.chi2 > other.chi2:
        return False
    return bool(np.any((np.abs(other.p) < _NONE * one.p) & (one.error < _SURE * one.p)))


def _ranked(
    model: Compiled,
    run: Mapping[str, npt.ArrayLike],
    sample_rate: float,
    start: Float | None,
    equation_error: bool,
    reversals: Reversals,
    at_least: Sequence[int],
) -> list[Scored]:
    """The same with windows of which the run has at least so many; fewer only where those lead nowhere."""
    plain = {name: x for name, x in run.items()}
    digest = digest_of(run)
    parts = [part.stop - part.start for part in segments_of(samples_of(model.bare, plain))]
    rates = any(jet.order for jet in model.channels.needed)
    basis = replace(basis_of(model, sample_rate), reversals=reversals)
    tried: list[Scored] = []
    errors = False
    fewest = at_least[0]

    def attempt(designs: Iterable[WeakDesign]) -> None:
        for design in designs:
            best = min(tried, key=_order, default=None)
            if best and work.is_spent():
                return
            found = score_of(model, run, design, best.p if best else start, errors, fewest - 2, digest)
            if found is not None:
                tried.append(found)

    windows: list[float] = []
    for fewest in at_least:
        whole = _unbroken(parts, fewest)
        if model.bare.drifts:
            most = max(_OF_MEMORY * model.bare.drift_s * sample_rate, 1.001 * _SHORTEST_STEPS)
            whole = min(whole, most * (fewest + 1) / 2)
        longer = lengths(whole, sample_rate, fewest)
        windows = sorted({*windows, *longer}, reverse=True)
        attempt(made(basis, window_s=one) for one in longer)
        if not any(one.known and not one.near_0 for one in tried):  # a logarithm that ran down may have lost its way
            tried += _searched(model, run, [made(basis, window_s=one) for one in longer[:_SEARCHED]], start, fewest - 2)
        if any(one.known for one in tried):
            break
    if not tried:
        longest = max(parts, default=0)
        many = f"the run of {longest} samples ({longest / sample_rate:.3g} s)"
        needed = math.ceil(_SHORTEST_STEPS * (at_least[-1] + 1) / 2)
        gap = "" if len(parts) < 2 else " without a gap"
        short = f"{many} is too short for {model.model.name}"
        if longest >= needed:
            raise PvidError(f"{short}, or moves in too little of that: record more samples{gap}")
        raise PvidError(f"{short}: record more samples{gap}, at least {needed} ({needed / sample_rate:.3g} s)")
    best = min(tried, key=_order)
    if best.chi2 > MODEL_ERROR and equation_error:
        errors, of_sensors = True, tried[:]
        tried.clear()
        attempt([best.design])
        attempt(made(basis, window_s=one) for one in windows)
        if not tried:  # with errors of the equations the search runs away everywhere
            errors = False
            tried += of_sensors
        best = min(tried, key=_order)
        if best.is_hopeless:
            return sorted(tried, key=_order)
    if rates:
        filters = _RATES + (_FLAT_RATES if rates_of_drives(model) else ())
        attempt(made(best.design, rate_taps=taps, rate_degree=degree) for taps, degree in filters)
        best = _least_smoothed(tried) if errors and model.channels.signs else min(tried, key=_order)
    place = windows.index(best.design.window_s)
    near = windows[max(place - 1, 0) : place + 2]
    attempt(
        made(best.design, window_s=length, functions=count)
        for length in near
        for count in ((*_FEW_FUNCTIONS, *_FUNCTIONS) if errors else _FUNCTIONS)
        if (length, count) != (best.design.window_s, best.design.functions)
    )
    if len(model.model.rows) > 1 and reversals == "located":
        best = min(tried, key=_order)
        attempt(made(best.design, joint=True, functions=count) for count in {best.design.functions, _FUNCTIONS[-1]})
        tried = [one for one in tried if not one.design.joint or one.chi2 <= _JOINT * max(best.chi2, 1.0)]
    ordered = sorted(tried, key=_order)
    if rates and errors and model.channels.signs:
        ordered.insert(0, ordered.pop(ordered.index(_least_smoothed(tried))))
    return ordered


def _least_smoothed(tried: Sequence[Scored]) -> Scored:
    """The best, or one like it that differs in the filter of the rates alone and has a shorter one."""
    best = min(tried, key=_order)

    def is_alike(one: Scored) -> bool:
        same = replace(one.design, rate_taps=best.design.rate_taps, rate_degree=best.design.rate_degree)
        return same == best.design and one.known == best.known and one.score <= _ALIKE * best.score

    return min(filter(is_alike, tried), key=lambda one: one.design.rate_taps)


def ranked_for_core(model: Compiled, tried: Sequence[Scored]) -> list[Scored] | None:
    """What `ranked` finds with averaged signs, from what it has found with located ones, all else at its default; None
    where signs make a difference."""
    if model.channels.signs:
        return None
    alone = [one for one in tried if not one.design.joint]
    return [replace(one, design=replace(one.design, reversals="averaged")) for one in alone]


def _order(one: Scored) -> tuple[bool, float]:
    return not one.known, one.score


def _searched(
    model: Compiled, run: Mapping[str, npt.ArrayLike], designs: Iterable[WeakDesign], start: Float | None, fewest: int
) -> list[Scored]:
    """Of each design the minimum of least chi^2 that other starts than the guesses lead to, if any is plausible."""
    starts = list(starts_about(model.parameters, model.parameters.checked(start)))
    out = []
    for design in designs:
        tried = [score_of(model, run, design, other, False, fewest) for other in starts if not work.is_spent()]
        known = [one for one in tried if one is not None and one.known]
        if known:
            out.append(min(known, key=lambda one: one.chi2))
    return out


def made(design: WeakDesign, **changes: float) -> WeakDesign:
    """A changed design; one that is impossible gets fewer functions."""
    while True:
        try:
            return replace(design, **changes)  # type: ignore[arg-type]
        except PvidError:
            count = int(changes.get("functions", design.functions)) - 2
            if count < 2:
                raise
            changes["functions"] = count
