"""Settings of the weak form for a recorded run: the defaults, unless others predict held-out data better.

The reference is the result of `identify` with the given rig file. Candidates are tried group by group: the
equations (full angles, friction), the window, the test functions, the pass band, the decimation. One replaces another
only if the core publishes an estimate with it and

    it predicts the held-out data (pvid.run.held_back) significantly better, or
    it predicts them equally well, its standard errors are clearly smaller, and it removes no warning.

Forgetting is chosen last, by the prediction of the next window. The chosen settings are rounded, written and identified
once more: the rig file reproduces the result.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.design.weak_sizing import HOST, pass_hz_of
from pvid.oracle.weak import VALID_ANGLE
from pvid.rig.file import Identifier, Nominal, RigFile
from pvid.rig.run import Run
from pvid.rig.sensor_steps import resolution_note, resolved
from pvid.run.held_back import HeldBack, sigmas
from pvid.run.identify import Identification, identify, largest_angle
from pvid.run.survey import fitted, sized_for
from pvid.setup.f32 import weak_design_of

Float = npt.NDArray[np.float64]

# Candidates: factors on what was best before, and numbers of test functions.
_WINDOWS = (0.6, 0.8, 1.25, 1.6)
_FUNCTIONS = (8, 10, 12, 14, 16)
_PASS_BANDS = (0.6, 1.6)
_DECIMATIONS = (0.5, 1.6)
_FROM_MODES = {"window_s": 0.0, "test_functions": 0, "decimation": 0, "smoothing_s": 0.0, "pass_hz": 0.0}
_FORGETTING_S = (80.0, 40.0, 20.0, 10.0, 5.0, 2.5)
_MIN_FORGETTING_WINDOWS = 4  # of the core
_EQUATIONS = 4
# Steps of `tune`, at most: survey and the rig file's own settings, sizes from the modes, the groups, forgetting.
STEPS = 3 + _EQUATIONS + len(_WINDOWS) + len(_FUNCTIONS) + len(_PASS_BANDS) + len(_DECIMATIONS) + 1

# Settings predict the windows held back better if their energy is lower by this many standard errors and by this share;
# they predict equally well if it is higher by at most so many standard errors.
_SIGMAS = 3.0
_GAIN = 0.1
_AS_WELL = 1.0
# Standard errors are clearly smaller below this share.
_SMALLER = 0.7
# Linear equations bias w by this times the square of the largest angle (theory; the standard rig).
_LINEAR_BIAS = 0.36
# Digits of the numbers in the written rig file; the second, or all digits, if the estimate changes with the first.
_DIGITS = (4, 7)


@dataclass(frozen=True, eq=False)
class Judged:
    """Settings and their result on the run.

    Attributes
    ----------
    what : their difference from the settings before, in words
    rig : the rig file with these settings
    answer : the identification; None if the core refuses the settings
    refusal : the reason of a refusal
    residuals : energy of the windows held back; None if no window could be held back
    """

    what: str
    rig: RigFile
    answer: Identification | None
    refusal: str | None
    residuals: Float | None

    @property
    def identified(self) -> bool:
        """Whether the core published an estimate."""
        return self.answer is not None and self.answer.identified

    @property
    def error(self) -> float:
        """Expected relative error, RMS over the mapped parameters: standard errors, and the bias of linear equations;
        infinite if the run is not identified."""
        if self.answer is None or not self.answer.identified:
            return math.inf
        relative = [self.answer.se[name] / self.answer.value[name] for name in self.answer.model.mapped_names]
        bias = 0.0 if self.rig.identifier.full_angle else _LINEAR_BIAS * self.answer.largest_angle**2
        return math.hypot(math.sqrt(sum(one**2 for one in relative) / len(relative)), bias)

    def agrees_with(self, other: Judged) -> bool:
        """Whether both estimates agree within a standard error, and both or none have a warning."""
        if self.answer is None or other.answer is None or self.identified != other.identified:
            return False
        names = self.answer.model.mapped_names
        near = [abs(self.answer.value[x] - other.answer.value[x]) <= other.answer.se[x] for x in names]
        return not self.identified or (all(near) and self.warned == other.warned)

    @property
    def warned(self) -> bool:
        """Whether the estimate has a warning."""
        return self.answer is not None and self.answer.warning is not None

    def residual_over(self, other: Judged) -> float:
        """Energy of the windows held back over that with other settings; NaN if one of them is unknown."""
        if self.residuals is None or other.residuals is None:
            return math.nan
        return float(np.sum(self.residuals) / np.sum(other.residuals))

    def better_than(self, other: Judged) -> bool:
        """Whether these settings replace others."""
        if not self.identified or self.residuals is None:
            return False
        if other.residuals is None:
            return not other.identified
        off = sigmas(self.residuals, other.residuals)
        if not other.identified:
            return off < _AS_WELL
        if off < -_SIGMAS and self.residual_over(other) < 1 - _GAIN:
            return True
        return off < _AS_WELL and self.error < _SMALLER * other.error and (self.warned or not other.warned)


@dataclass(frozen=True)
class Forgetting:
    """A time constant [s] (0: none) and the energy of the next window's residuals, over that without forgetting."""

    forgetting_s: float
    energy: float
    better_by_sigmas: float


@dataclass(frozen=True, eq=False)
class Tuned:
    """Outcome of `tune`.

    Attributes
    ----------
    rig : the rig file with the chosen settings
    answer : what the core makes of the run with it
    chosen, default : the settings chosen, and the rig file's own with what the survey of the run adds
    candidates : all that were tried, in that order
    forgetting : what forgetting does
    notes : what was found beside the settings, a sentence each
    reason : why `chosen` was chosen, in words
    """

    rig: RigFile
    answer: Identification
    chosen: Judged
    default: Judged
    candidates: tuple[Judged, ...]
    forgetting: tuple[Forgetting, ...]
    notes: tuple[str, ...]
    reason: str


def tune(run: Run, rig: RigFile, native: Native, progress: Callable[[int], None] = lambda _: None) -> Tuned:
    """Picks the weak form's settings for a run.

    Parameters
    ----------
    run, rig
        The samples and the rig they come from.
    native
        The C core.
    progress
        Called with the number of steps done, of STEPS.

    Raises
    ------
    PvidError
        When nothing can be identified from the run, with the rig file's own settings or others.
    """
    given, rig = rig, resolved(rig, run)
    rig = replace(rig, identifier=rig.identifier.in_weak_form())
    bench = _Bench(run, rig, native, progress)
    default = bench.default()
    chosen = default
    if bench.held_back is not None:
        for group in (bench.from_modes, bench.equations, _windows, _functions, _pass_bands, _decimations):
            chosen = bench.best_of(group(chosen.rig), chosen)
        if chosen is not default and not chosen.better_than(default):
            chosen = default
    if chosen.answer is None or not chosen.identified:
        raise PvidError(bench.untunable_reason(default))
    forgetting = bench.forgetting(chosen.rig)
    keep = _chosen_forgetting(forgetting)
    if keep.forgetting_s > 0:
        forgetful = bench.judged("forgetting", _with(chosen.rig, forgetting_s=keep.forgetting_s))
        keep = keep if forgetful.identified else forgetting[0]
        chosen = forgetful if forgetful.identified else chosen
    progress(STEPS)
    assert chosen.answer is not None
    return Tuned(
        rig=_with(chosen.rig, core=rig.identifier.core),
        answer=chosen.answer,
        chosen=chosen,
        default=default,
        candidates=tuple(bench.tried),
        forgetting=forgetting,
        notes=resolution_note(given, rig),
        reason=_reason(chosen, default, bench, keep),
    )


# ---- candidates


def _with(rig: RigFile, **identifier: Any) -> RigFile:
    return replace(rig, identifier=replace(rig.identifier, **identifier))


def _windows(rig: RigFile) -> Iterator[tuple[str, RigFile]]:
    own = rig.identifier
    for factor in _WINDOWS:
        window_s = factor * own.window_s
        functions = min(max(round(factor * own.test_functions), _FUNCTIONS[0]), HOST.functions)
        # the filters stay: they belong to the fast mode
        yield f"window_s x {factor:g}", _with(rig, window_s=window_s, test_functions=functions, decimation=0)


def _functions(rig: RigFile) -> Iterator[tuple[str, RigFile]]:
    for functions in _FUNCTIONS:
        yield f"test_functions = {functions}", _with(rig, test_functions=functions)


def _pass_bands(rig: RigFile) -> Iterator[tuple[str, RigFile]]:
    for factor in _PASS_BANDS:
        yield f"pass_hz x {factor:g}", _with(rig, pass_hz=factor * rig.identifier.pass_hz, smoothing_s=0.0)


def _decimations(rig: RigFile) -> Iterator[tuple[str, RigFile]]:
    for factor in _DECIMATIONS:
        decimation = min(max(1, round(factor * rig.identifier.decimation)), HOST.decimation)
        yield f"decimation = {decimation}", _with(rig, decimation=decimation, smoothing_s=0.0)


def _written(rig: RigFile, sample_rate: float, digits: int) -> RigFile:
    """The rig file with all that it leaves open, rounded to so many digits."""
    nominal = Nominal(**{name: _rounded(x, digits) for name, x in asdict(rig.nominal).items()})
    rig = replace(rig, nominal=nominal)
    design = weak_design_of(rig, sample_rate)
    return _with(
        rig,
        window_s=_rounded(design.window_s, digits),
        test_functions=design.functions,
        decimation=design.decimation,
        smoothing_s=_rounded(design.taps / sample_rate, digits),
        pass_hz=_rounded(rig.identifier.pass_hz or pass_hz_of(design.nominal), digits),
        disturbance=_rounded(rig.identifier.disturbance, digits),
        survey=False,
    )


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


# ---- their judgement


class _Bench:
    """Judges settings on one run, each once."""

    def __init__(self, run: Run, rig: RigFile, native: Native, progress: Callable[[int], None]) -> None:
        rig = _with(rig, core=rig.identifier.core_traits.in_c)
        self.run, self.given, self.native, self.progress = run, rig, native, progress
        self.held_back: HeldBack | None = None
        self.not_held_back = ""
        self.tried: list[Judged] = []
        self.seen: set[Identifier] = set()
        self.steps = 0
        self.surveyed = fitted(_with(rig, survey=True), run)

    def advance(self) -> None:
        """One step more for the progress bar."""
        self.steps = min(self.steps + 1, STEPS)
        self.progress(self.steps)

    def default(self) -> Judged:
        """The rig file as it is, written out; with as many digits as it takes to keep its answer."""
        rig = self.surveyed if self.given.identifier.survey else fitted(self.given, self.run)
        self.advance()
        try:
            self.held_back = HeldBack(self.run, self.surveyed)
        except (PvidError, np.linalg.LinAlgError) as error:
            self.not_held_back = str(error)
        as_it_is = self.judged("as given", rig)
        default = as_it_is
        for digits in _DIGITS if as_it_is.answer is not None else ():
            written = self.judged("as given", _written(rig, self.run.sample_rate, digits))
            if written.agrees_with(as_it_is):
                default = written
                break
        self.tried = [default]
        self.seen.add(default.rig.identifier)
        self.advance()
        return default

    def from_modes(self, rig: RigFile) -> Iterator[tuple[str, RigFile]]:
        """The surveyed rig file with sizes that follow from the modes (the default of a rig file)."""
        yield "sizes from the modes", sized_for(_with(self.surveyed, **_FROM_MODES), self.run)

    def equations(self, rig: RigFile) -> Iterator[tuple[str, RigFile]]:
        """With and without sines and friction, each with its own survey.

        Linear equations are tried only if the angles are small enough for the correction.
        """
        if not rig.identifier.core_traits.corrects_angles:
            return
        small = largest_angle(self.run, None) <= VALID_ANGLE
        for full_angle in (True, False) if small else (True,):
            for damping in (False, True) if rig.identifier.zero else (False,):
                asked = {"full_angle": full_angle, "damping": damping}
                if all(getattr(rig.identifier, name) == value for name, value in asked.items()):
                    continue
                found = fitted(_with(self.given, survey=True, **asked), self.run)
                what = ", ".join(f"{name} = {str(value).lower()}" for name, value in asked.items())
                with_them = replace(rig, nominal=found.nominal)
                yield what, _with(with_them, disturbance=found.identifier.disturbance, **asked)

    def judged(self, what: str, rig: RigFile) -> Judged:
        """The identification with these settings, and their prediction of the windows held back."""
        residuals = None
        try:
            if self.held_back is not None:
                residuals = self.held_back.residuals(rig)
        except (PvidError, np.linalg.LinAlgError):
            pass  # it cannot be judged, but identify may answer
        try:
            return Judged(what, rig, identify(self.run, rig, self.native, points=1), None, residuals)
        except PvidError as error:
            return Judged(what, rig, None, str(error), residuals)

    def best_of(self, candidates: Iterator[tuple[str, RigFile]], best: Judged) -> Judged:
        """The best of `candidates` and `best`."""
        for what, candidate in candidates:
            self.advance()
            try:
                rig = _written(candidate, self.run.sample_rate, _DIGITS[0])
            except (PvidError, np.linalg.LinAlgError):
                continue  # sizes that the core does not hold
            if rig.identifier in self.seen:
                continue
            self.seen.add(rig.identifier)
            judged = self.judged(what, rig)
            self.tried.append(judged)
            if judged.better_than(best):
                best = judged
        return best

    def forgetting(self, rig: RigFile) -> tuple[Forgetting, ...]:
        """No forgetting first, then every time constant that the core takes and that is shorter than the run."""
        out = [Forgetting(0.0, 1.0, 0.0)]
        if self.held_back is None:
            return tuple(out)
        try:
            reference = self.held_back.innovations(rig, 0.0)
        except PvidError:  # its equations lead to no plausible parameters
            return tuple(out)
        hop_s = weak_design_of(rig, self.run.sample_rate).hop_s
        for forgetting_s in _FORGETTING_S:
            if _MIN_FORGETTING_WINDOWS * hop_s <= forgetting_s < len(self.run.t) / self.run.sample_rate:
                energies = self.held_back.innovations(rig, forgetting_s)
                share = float(np.sum(energies) / np.sum(reference))
                out.append(Forgetting(forgetting_s, share, -sigmas(energies, reference)))
        return tuple(out)

    def untunable_reason(self, default: Judged) -> str:
        """Why nothing is identified, in words."""
        own = default.refusal or (default.answer.verdict if default.answer is not None else "")
        if self.held_back is None:
            return f"nothing is identified from this run ({own}), so nothing can be tuned: {self.not_held_back}"
        return (
            f"none of {len(self.tried)} settings identifies the mechanism from this run (the rig file's own: {own}): "
            "is the pivot driven, and are the columns phi and y correct?"
        )


def _chosen_forgetting(forgetting: tuple[Forgetting, ...]) -> Forgetting:
    useful = [one for one in forgetting[1:] if one.better_by_sigmas > _SIGMAS and one.energy < 1 - _GAIN]
    return min(useful, key=lambda one: one.energy) if useful else forgetting[0]


def _reason(chosen: Judged, default: Judged, bench: _Bench, keep: Forgetting) -> str:
    if bench.held_back is None:
        what = f"the rig file's own settings: {bench.not_held_back}"
    elif chosen.rig.identifier == _with(default.rig, forgetting_s=chosen.rig.identifier.forgetting_s).identifier:
        what = f"the rig file's own settings: none of {len(bench.tried) - 1} others is better by more than chance"
    elif not default.identified:
        what = "the rig file's settings identify nothing, these do"
    else:
        what = (
            f"of {len(bench.tried)} settings these leave {chosen.residual_over(default):.3g} times the held-out "
            f"residuals of the rig file's settings, with {chosen.error / default.error:.2g} times the standard errors"
        )
    if keep.forgetting_s == 0:
        return f"{what}; no forgetting predicts the next window better than remembering everything"
    return (
        f"{what}; forgetting in {keep.forgetting_s:g} s leaves {keep.energy:.2g} times the residual of the next "
        f"window, {keep.better_by_sigmas:.0f} standard errors less: the parameters drift"
    )
