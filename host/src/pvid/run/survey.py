"""Search of a whole run for p, before the core starts: a start and a design for the weak form, whatever the guess.

The weak form's rows are summed in float64 over all windows of the run, and the least squares of these sums are searched
from several starts about the guess. Rows depend on p in three ways: by their design (window, test functions, filters
follow the modes), by their whitening, and by the constraints theta = f(p); the search renews all three until p stays.
Of the minima found the one with the smallest chi^2 is taken. There the rows are corrected for large angles and
friction, if the rig file enables it; the residuals above the encoder's noise become a white disturbance of the joints,
and rows are then weighted by both.

`fitted` returns the rig file with the outcome as its nominal, for example for a board after a first run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.weak_sizing import pass_hz_of, window_for_run
from pvid.rig.file import Nominal, RigFile
from pvid.rig.run import Run
from pvid.rig.sensor_steps import resolved
from pvid.run.rows import FEWEST, Fit, RunRows
from pvid.setup.f32 import nominal_start, weak_design_of

Float = npt.NDArray[np.float64]

# Starts: the guess with l2 and rho2 times each pair of these, itself first.
_SCALES = (1.0, 0.45, 2.2)
# Two outcomes are the same when no parameter differs by more than this; so many in agreement end the search.
_SAME = 0.02
_ENOUGH = 3
# The design is renewed until no parameter moves by more than this, and at most so often.
_MOVED = 0.1
_RENEWALS = 4
# Corrections for large angles at p, until it moves by less than this; they are kept where chi^2 falls.
_CORRECTIONS = 4
_SETTLED = 0.002
# Most windows in a correction.
_WINDOWS = 300
# Up to this chi^2 the encoder's noise explains the residuals; above it a disturbance is fitted that makes it 1.
_UNEXPLAINED = 1.3
_HALVINGS = 16
_DISTURBANCES = (1e-4, 1e4)  # range of the fit, relative to a disturbance with the effect of the encoder's noise


@dataclass(frozen=True)
class Survey:
    """Outcome of `survey`.

    Attributes
    ----------
    p : (w [1/s^2], d1, d2, c [rad])
    chi2 : residual variance of the rows over that of the encoder's noise
    disturbance : white noise of the joints' accelerations that explains the rest [rad/s^2/sqrt(Hz)]
    agreeing : starts with this result
    tried : starts tried
    """

    p: Float
    chi2: float
    disturbance: float
    agreeing: int
    tried: int


def fitted(rig: RigFile, run: Run) -> RigFile:
    """The rig file with the run's survey as its nominal, the disturbance found, and a window that the run
    holds often enough.

    The encoder's resolution is what the run shows where the rig file does not give it. All else is unchanged where the
    rig file disables the survey (`[identifier] survey = false`) or sets the strong form. If the survey finds nothing
    plausible the guess stays.
    """
    rig = resolved(rig, run)
    if not rig.identifier.form_traits.uses_windows or not rig.identifier.survey:
        return rig
    found = survey(rig, run)
    if found is not None:
        try:
            rig = with_nominal(rig, found.p)
        except PvidError:  # a length that no rig has
            found = None
    if found is not None:
        own = rig.identifier
        own = replace(
            own,
            disturbance=own.disturbance or _rounded(found.disturbance, 2),
            pass_hz=own.pass_hz or _rounded(pass_hz_of(found.p), 3),
        )
        rig = replace(rig, identifier=own)
    return sized_for(replace(rig, identifier=replace(rig.identifier, survey=False)), run)


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what diverges from a start is judged and left out
def survey(rig: RigFile, run: Run) -> Survey | None:
    """Searches a run for p; None where no start leads to plausible parameters."""
    found = _searched(rig, run)
    if found is None:
        return None
    at, fit, agreeing, tried = found
    rows = RunRows.of(at, run, weak_design_of(at, run.sample_rate)).thinned(_WINDOWS)
    asked = rig.identifier
    if (asked.full_angle or asked.damping) and asked.core_traits.corrects_angles:
        rows, fit = _corrected(rig, rows, fit)
    ratio = _disturbance(rows, fit)
    if ratio > 0:
        fit = rows.fitted(fit.p, ratio)
    density = ratio * rows.row_sd * math.sqrt(rows.design.dt)
    if not (rig.mechanism.model.is_plausible(fit.p[:4]) and math.isfinite(fit.chi2) and math.isfinite(density)):
        return None
    return Survey(fit.p[:4], fit.chi2, density, agreeing, tried)


# The rig file of the best start's design, its fit, how many starts agree with it, and how many were tried.
_Outcome = tuple[RigFile, Fit, int, int]
_SEARCHED: WeakKeyDictionary[Run, dict[RigFile, _Outcome | None]] = WeakKeyDictionary()


def _searched(rig: RigFile, run: Run) -> _Outcome | None:
    """The minimum of the linear rows; kept as long as the run is, because advice identifies a run again with settings
    changed that these rows do not depend on."""
    linear = replace(rig.identifier, core="f32", law="stationary", full_angle=False, damping=False)
    key = replace(rig, identifier=linear)
    kept = _SEARCHED.setdefault(run, {})
    if key not in kept:
        kept[key] = _search_all(key, run)
    return kept[key]


def _search_all(rig: RigFile, run: Run) -> _Outcome | None:
    if not np.isfinite(run.phi).any():
        return None
    outcomes: list[tuple[RigFile, Fit]] = []
    tried = 0
    for start in starts_about(rig):
        tried += 1
        try:
            outcome = _search(start, run)
        except (PvidError, np.linalg.LinAlgError):
            continue
        if outcome is not None:
            outcomes.append(outcome)
            if _agreeing(outcomes, _best(outcomes)[1]) >= _ENOUGH:
                break
    if not outcomes:
        return None
    at, fit = _best(outcomes)
    return at, fit, _agreeing(outcomes, fit), tried


def with_nominal(rig: RigFile, p: Float) -> RigFile:
    """The rig file with p as its nominal."""
    mechanism = rig.mechanism
    guess = [_rounded(float(x), 4) for x in mechanism.physical(p)]
    return replace(rig, nominal=Nominal(**dict(zip(mechanism.model.physical_names, guess, strict=True))))


def _rounded(x: float, digits: int) -> float:
    """To so many significant digits: a rig file stays readable, and the last bits of a recording do not matter."""
    return float(f"{x:.{digits}g}")


def sized_for(rig: RigFile, run: Run) -> RigFile:
    """With a window that the run holds often enough, where the rig file does not fix one."""
    if rig.identifier.window_s > 0:
        return rig
    window_s = window_for_run(nominal_start(rig), len(run.t) / run.sample_rate)
    return rig if window_s is None else replace(rig, identifier=replace(rig.identifier, window_s=_rounded(window_s, 3)))


def starts_about(rig: RigFile) -> Iterator[RigFile]:
    """Rig files with guesses about that of the rig file, itself first."""
    guess = rig.nominal
    for l2 in _SCALES:
        for rho2 in _SCALES:
            with suppress(PvidError):  # a length beyond those of a rig file
                yield replace(rig, nominal=replace(guess, l2=guess.l2 * l2, rho2=guess.rho2 * rho2))


def _best(outcomes: list[tuple[RigFile, Fit]]) -> tuple[RigFile, Fit]:
    return min(outcomes, key=lambda one: one[1].chi2)


def _agreeing(outcomes: list[tuple[RigFile, Fit]], fit: Fit) -> int:
    return sum(_apart(one.p, fit.p, rig.mechanism.model.n_mapped) < _SAME for rig, one in outcomes)


def _apart(p: Float, q: Float, n: int) -> float:
    """Largest difference of the logarithms of the first `n` parameters."""
    return float(np.abs(np.log(p[:n] / q[:n])).max())


def _search(rig: RigFile, run: Run) -> tuple[RigFile, Fit] | None:
    """The minimum that a start leads to, and the rig file of its design; None if it is not plausible."""
    p, model = np.append(nominal_start(rig), np.nanmean(run.phi)), rig.mechanism.model
    for _ in range(_RENEWALS):
        at = sized_for(rig, run)
        fit = RunRows.of(at, run, weak_design_of(at, run.sample_rate)).fitted(p)
        if not model.is_plausible(fit.p) or not math.isfinite(fit.chi2):
            return None
        moved, p = _apart(fit.p, p, model.n_mapped), fit.p
        if moved < _MOVED:
            break
        rig = with_nominal(rig, p)
    return at, fit


def _corrected(rig: RigFile, rows: RunRows, fit: Fit) -> tuple[RunRows, Fit]:
    """Rows corrected for large angles at p, or with friction in p, and the fit to them, where that explains more; else
    as they were."""
    linear, model = (rows, fit), rig.mechanism.model
    full_angle, damping = rig.identifier.full_angle, rig.identifier.damping
    corrected, p = rows, np.append(fit.p, [0.0, 0.0]) if damping else fit.p
    for _ in range(_CORRECTIONS):
        try:
            corrected = rows.corrected(p, full_angle).sound_only()
            if len(corrected.phi) < FEWEST:
                return linear
            better = corrected.fitted(p)
        except np.linalg.LinAlgError:
            return linear
        if not model.is_plausible(better.p):
            return linear
        moved, fit, p = _apart(better.p, p, model.n_mapped), better, better.p
        if moved < _SETTLED:
            break
    return (corrected, fit) if fit.chi2 < linear[0].judged(linear[1].p).chi2 else linear


def _disturbance(rows: RunRows, fit: Fit) -> float:
    """The disturbance, over the noise of a row, that brings chi^2 to 1; 0 where the encoder's noise suffices."""
    if not fit.chi2 > _UNEXPLAINED:
        return 0.0
    per_unit = np.trace(rows.covariance(fit.p)) / np.trace(rows.covariance_of_disturbance(fit.p))
    low, high = (math.log(share * math.sqrt(per_unit)) for share in _DISTURBANCES)
    p = fit.p
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        try:
            now = rows.fitted(p, math.exp(middle))
        except np.linalg.LinAlgError:
            high = middle
            continue
        if now.chi2 > 1:
            low = middle
        else:
            high = middle
    return math.exp(high)
