"""Settings of the weak form for a recorded run, judged by what can be seen without the truth.

A candidate (window, test functions, decimation, smoothing) is judged by the error it must be expected to have:

    error^2 = (standard error^2 + bias^2) split

standard error: from the run's own information matrix and residuals, shared noise of neighbouring windows counted.
bias: how far the estimate moves when the smoothing filter is shortened by 30 % (Hausman's comparison): a filter that
distorts the motion is seen by nothing else. It hangs on the filter alone, so that it is looked for once a filter, at
the finest decimation, where it shows best; it counts where the shorter filter's additional noise does not explain it.
split: how far the estimates of the run's halves are apart, squared, in units of their joint covariance, per parameter
(the square of Birge's ratio): about 1 when the standard errors are honest. It counts where chance does not explain it.

Where the rig file's own settings are expected within `KEEP` of the smallest error they are kept: such differences are
mostly noise. Else, of all candidates within `CLOSE` of it, the one that costs the fewest instructions is chosen.
Forgetting is chosen by how well the estimate so far predicts the next window: first with the rig file's own settings,
to see whether the parameters drift (then all candidates forget, and the halves may differ), and at last for the choice.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from pvid.capture import Run
from pvid.differentiation import savitzky_golay
from pvid.errors import PvidError
from pvid.identify import WORST_SE
from pvid.native import Native
from pvid.rig import is_physical
from pvid.rigfile import RigFile
from pvid.setup import nominal_start, weak_config, weak_design_of, weak_drive_threshold
from pvid.weak_cost import Schedule, instructions
from pvid.weak_design import Bounds
from pvid.weak_oracle import WeakOracle, WeakSettings
from pvid.weak_windows import Windows

Float = npt.NDArray[np.float64]

# Candidates. Windows in slow modal periods; lengths of a window in decimated samples; smoothing in the default's
# 71 ms; test functions; forgetting [s].
_WINDOWS = (0.5, 0.7, 0.9, 1.1, 1.4, 1.8, 2.4)
_SAMPLES = (80, 125, 200)
_SMOOTHINGS = (0.35, 0.5, 0.72, 1.0, 1.15)
_FUNCTIONS = (6, 8, 10, 12, 14, 16)
_FORGETTING_S = (80.0, 40.0, 20.0, 10.0, 5.0, 2.5)
_DEFAULT_SMOOTHING_S = 0.071
# The filter's bias is looked for with a filter this much shorter, in windows of this many slow periods.
_SHORTER = 0.7
_REFERENCE_WINDOW = 1.1
_DEGREE = 6  # of the smoothing polynomial, as in weak_design
_MIN_TAPS = _DEGREE + 3

# Steps of `tune`, at most: the default, windows by decimation, smoothings, functions, windows again, forgetting.
STEPS = 1 + 2 * len(_WINDOWS) * len(_SAMPLES) + len(_SMOOTHINGS) + len(_FUNCTIONS) + 1

KEEP = 1.2
CLOSE = 1.1
# Windows in each half of the run, for its estimate to have a covariance worth the name.
_MIN_HALF = 4
# A shift by the filter, and a gain by forgetting, count from this many standard errors on; a distance of the halves
# from this share of what chance gives.
_SIGMAS = 3.0
_CHANCE = 0.99
# Core: the time constant of forgetting is at least 4 windows.
_MIN_FORGETTING_WINDOWS = 4


@dataclass(frozen=True)
class Settings:
    """What is tuned, as in the rig file."""

    window_s: float
    functions: int
    decimation: int
    smoothing_s: float
    forgetting_s: float = 0.0

    def applied(self, rig: RigFile) -> RigFile:
        """The rig file with these settings."""
        identifier = replace(
            rig.identifier,
            form="weak",
            window_s=self.window_s,
            test_functions=self.functions,
            decimation=self.decimation,
            smoothing_s=self.smoothing_s,
            forgetting_s=self.forgetting_s,
        )
        return replace(rig, identifier=identifier)


@dataclass(frozen=True)
class Judged:
    """A candidate and what the run says of it; se and bias are relative, for w, d1, d2.

    Attributes
    ----------
    p : its estimate
    split : squared distance of the halves' estimates per parameter, in units of their joint covariance; NaN where the
        parameters drift, and may differ
    misfit : variance of the rows' residuals over that of the encoder's noise
    colour : energy of the residuals along the test function that has most of it, over the mean; 1 when white
    delay_s, instructions : what it costs
    """

    settings: Settings
    p: Float
    se: Float
    bias: Float
    split: float
    misfit: float
    colour: float
    delay_s: float
    instructions: float

    @property
    def error(self) -> float:
        """Expected relative error, RMS over w, d1, d2."""
        count = len(self.p)
        by_chance = float(chi2.ppf(_CHANCE, count)) / count
        return math.sqrt(float(np.mean(self.se**2 + self.bias**2)) * (self.split if self.split > by_chance else 1.0))

    @property
    def identified(self) -> bool:
        """Whether w is known at all, and p is that of a pendulum."""
        return bool(self.se[0] <= WORST_SE) and is_physical(self.p[:3])


@dataclass(frozen=True)
class Forgetting:
    """A time constant [s] (0: none) and the energy of the next window's residuals, over that without forgetting."""

    forgetting_s: float
    energy: float
    better_by_sigmas: float


@dataclass(frozen=True)
class Tuned:
    """Outcome of `tune`.

    Attributes
    ----------
    rig : the rig file with the chosen settings
    chosen, default : the candidate chosen, and the rig file's own settings; None where these cannot be used
    default_refusal : why not
    candidates : all that could be judged, best first
    forgetting : what forgetting does
    reason : why `chosen` was chosen, in words
    """

    rig: RigFile
    chosen: Judged
    default: Judged | None
    default_refusal: str | None
    candidates: tuple[Judged, ...]
    forgetting: tuple[Forgetting, ...]
    reason: str


def tune(run: Run, rig: RigFile, native: Native, progress: Callable[[int], None] = lambda _: None) -> Tuned:
    """Picks the weak form's settings for a run.

    Parameters
    ----------
    run, rig
        The samples and the rig they come from; the rig's nominal is the start.
    native
        The C core: what it refuses is no candidate.
    progress
        Called with the number of steps done, of STEPS.

    Raises
    ------
    PvidError
        When the run is too short to be halved, or nothing can be identified from it.
    """
    bench = _Bench(run, rig, native, progress)
    rig = bench.rig
    bench.refuse_a_still_pivot()
    default, refusal = bench.default()
    if default is not None and default.identified and bench.look_for_drift(default.settings):
        default, refusal = bench.default()
    bench.judge_windows(Settings(bench.period, 12, 1, _DEFAULT_SMOOTHING_S))
    if default is None and bench.look_for_drift(bench.best()):
        bench.judge_windows(Settings(bench.period, 12, 1, _DEFAULT_SMOOTHING_S))
    best = bench.best()
    bench.judge_all(replace(best, smoothing_s=share * _DEFAULT_SMOOTHING_S) for share in _SMOOTHINGS)
    best = bench.best()
    bench.judge_all(replace(best, functions=functions) for functions in _FUNCTIONS)
    bench.judge_windows(bench.best())
    ranked = bench.ranked()
    best_error = ranked[0].error
    if default is not None and default.identified and default.error <= KEEP * best_error:
        chosen = default
    else:
        chosen = min((one for one in ranked if one.error <= CLOSE * best_error), key=lambda one: one.instructions)
    kept = chosen is default
    forgetting = bench.forgetting(chosen.settings)
    progress(STEPS)
    keep = _chosen_forgetting(forgetting)
    chosen = replace(chosen, settings=replace(chosen.settings, forgetting_s=keep.forgetting_s))
    return Tuned(
        rig=chosen.settings.applied(rig),
        chosen=chosen,
        default=default,
        default_refusal=refusal,
        candidates=ranked,
        forgetting=forgetting,
        reason=_reason(kept, ranked, keep),
    )


def slow_period(p: Float) -> float:
    """Period of the slow mode at rest [s], of s^4 + d1 w s^2 + d2 w^2."""
    w, d1, d2 = p[:3]
    square = w * (d1 - math.sqrt(max(d1**2 - 4 * d2, 0.0))) / 2
    return 2 * math.pi / math.sqrt(square)


def _chosen_forgetting(forgetting: tuple[Forgetting, ...]) -> Forgetting:
    useful = [one for one in forgetting[1:] if one.better_by_sigmas > _SIGMAS]
    return min(useful, key=lambda one: one.energy) if useful else forgetting[0]


def _reason(kept: bool, ranked: tuple[Judged, ...], keep: Forgetting) -> str:
    what = f"of {len(ranked)} candidates the smallest expected error is {100 * ranked[0].error:.2g} %"
    if kept:
        what += f", and the rig file's own settings come within {100 * (KEEP - 1):.0f} % of it"
    else:
        what += f"; of those within {100 * (CLOSE - 1):.0f} % of it this one costs the fewest instructions"
    if keep.forgetting_s == 0:
        return f"{what}; no forgetting predicts the next window better than remembering everything"
    return (
        f"{what}; forgetting in {keep.forgetting_s:g} s leaves {keep.energy:.2g} times the residual of the next "
        f"window, {keep.better_by_sigmas:.0f} standard errors less: the parameters drift"
    )


class _Bench:
    """Judges candidates on one run, each once."""

    def __init__(self, run: Run, rig: RigFile, native: Native, progress: Callable[[int], None]) -> None:
        if rig.identifier.form != "weak":  # its window is a differentiator's
            rig = replace(rig, identifier=replace(rig.identifier, form="weak", window_s=0.0))
        self.run, self.rig, self.native, self.progress = run, rig, native, progress
        self.bounds = Bounds()
        self.forgetting_s = 0.0
        self.start: Float | None = None
        self.period = slow_period(nominal_start(rig))
        self.biases: dict[int, Float] = {}
        self.judged: dict[Settings, Judged | None] = {}
        self.refusal = ""
        self.steps = 0

    def refuse_a_still_pivot(self) -> None:
        """PvidError where u, smoothed as well as the core can, does not stand out of the pivot sensor's noise."""
        rate = self.run.sample_rate
        taps = self.taps(math.inf)
        if len(self.run.t) <= taps:
            return  # too short, which `ranked` says
        second = savitzky_golay(taps, _DEGREE).weights[2]
        kernel = np.concatenate([second[::-1], [-2 * float(np.sum(second))], second])
        u = np.convolve(self.run.y, kernel, "valid") * rate**2 / self.rig.l1
        if float(np.std(u)) < weak_drive_threshold(self.rig, second, rate):
            raise PvidError(
                "nothing can be tuned without a drive: through the longest smoothing filter that the core holds "
                f"({1000 * taps / rate:.3g} ms) the pivot's acceleration hardly stands out of its sensor's noise"
            )

    def default(self) -> tuple[Judged | None, str | None]:
        """The rig file's own settings judged, or why they cannot be used."""
        own = self.rig.identifier
        try:
            design = weak_design_of(self.rig, self.run.sample_rate)
            settings = Settings(
                own.window,
                own.test_functions,
                design.decimation,
                design.taps / self.run.sample_rate,
                self.forgetting_s,
            )
            judged = self.judge(settings)
            if judged.identified:
                self.period = slow_period(judged.p)
            judged = replace(judged, bias=self.bias(design.taps))
        except (PvidError, np.linalg.LinAlgError) as error:
            return None, str(error)
        finally:
            self.advance()
        self.judged[settings] = judged
        return judged, None

    def decimations(self, window_s: float) -> list[int]:
        """Those that give a window about _SAMPLES samples."""
        wanted = {round(window_s * self.run.sample_rate / samples) for samples in _SAMPLES}
        return sorted({min(max(one, 1), self.bounds.decimation) for one in wanted})

    def advance(self) -> None:
        """One step more for the progress bar."""
        self.steps = min(self.steps + 1, STEPS)
        self.progress(self.steps)

    def look_for_drift(self, settings: Settings) -> bool:
        """Whether forgetting predicts better; then it applies to all that is judged from now on."""
        self.forgetting_s = _chosen_forgetting(self.forgetting(settings)).forgetting_s
        if self.forgetting_s > 0:
            self.judged.clear()
            self.biases.clear()
        return self.forgetting_s > 0

    def judge_windows(self, settings: Settings) -> None:
        """Judges the settings with every window and its decimations."""
        self.judge_all(
            replace(settings, window_s=factor * self.period, decimation=decimation)
            for factor in _WINDOWS
            for decimation in self.decimations(factor * self.period)
        )

    def judge_all(self, candidates: Iterable[Settings]) -> None:
        """Judges candidates; those that cannot be designed, or that the core refuses, are left out."""
        for candidate in candidates:
            taps = self.taps(candidate.smoothing_s)
            smoothing_s = taps / self.run.sample_rate
            window_s = float(f"{candidate.window_s:.3g}")
            settings = replace(candidate, window_s=window_s, smoothing_s=smoothing_s, forgetting_s=self.forgetting_s)
            if settings not in self.judged:
                try:
                    self.judged[settings] = replace(self.judge(settings), bias=self.bias(taps))
                except (PvidError, np.linalg.LinAlgError) as error:
                    self.judged[settings] = None
                    self.refusal = str(error)
            self.advance()

    def ranked(self) -> tuple[Judged, ...]:
        """All that could be judged and identify something, best first.

        Raises
        ------
        PvidError
            When there is none.
        """
        usable = [one for one in self.judged.values() if one is not None]
        if not usable:
            duration = len(self.run.t) / self.run.sample_rate
            shortest = (_MIN_HALF + 1) * _WINDOWS[0] * self.period  # half-overlapping windows: _MIN_HALF in each half
            if duration < shortest:
                raise PvidError(
                    f"the run of {duration:.3g} s is too short to be tuned: each half must hold {_MIN_HALF} windows of "
                    f"at least half a slow modal period ({self.period:.2g} s at the rig's nominal)"
                )
            raise PvidError(f"none of the settings tried can be used with this run: {self.refusal}")
        known = [one for one in usable if one.identified]
        if not known:
            raise PvidError(
                f"no setting identifies a pendulum from this run (w to {100 * WORST_SE:.0f} %): is the pivot driven, "
                "and are the columns phi and y what they should be?"
            )
        return tuple(sorted(known, key=lambda one: one.error))

    def best(self) -> Settings:
        """Settings of the best candidate so far."""
        return self.ranked()[0].settings

    def taps(self, smoothing_s: float) -> int:
        """Samples of a smoothing filter that the core can hold, odd."""
        most = (self.bounds.taps - 1) | 1
        taps = round(min(smoothing_s * self.run.sample_rate, most)) | 1
        return min(max(taps, _MIN_TAPS), most)

    def judge(self, settings: Settings) -> Judged:
        """What the run says of a candidate, but for the bias of its smoothing filter."""
        self.native.weak(weak_config(settings.applied(self.rig), self.run.sample_rate))  # refuses what it cannot hold
        windows, estimator = self._prepared(settings)
        count = len(windows.phi)
        half = (count - 1) // 2
        if half < _MIN_HALF:
            raise PvidError(f"the run fills {count} windows of {settings.window_s:g} s: too few")
        whole = windows.estimated(estimator)
        if not (np.isfinite(whole.p).all() and (whole.p[:3] > 0).all()):
            raise PvidError("the estimate left the region where parameters have a meaning")
        se = whole.sandwich()[:3] / whole.p[:3]
        energies = np.mean(windows.residuals(whole) ** 2, axis=0)
        first, second = slice(half), slice(count - half, None)
        design = windows.design
        schedule = Schedule.of(design.taps, design.decimation, design.window, design.functions)
        judged = Judged(
            settings=settings,
            p=whole.p,
            se=se,
            bias=np.zeros(3),
            split=_split(windows.estimated(estimator, first), windows.estimated(estimator, second))
            if settings.forgetting_s == 0
            else math.nan,
            misfit=(whole.assess().residual_sd / estimator.row_sd) ** 2,
            colour=float(energies.max() / energies.mean()),
            delay_s=design.delay / design.sample_rate + design.window_s,
            instructions=instructions(schedule, self.rig.identifier.zero)[0],
        )
        if judged.identified:
            self.start = whole.p[: len(estimator.start)]
        return judged

    def _prepared(self, settings: Settings) -> tuple[Windows, WeakSettings]:
        """The run's windows and the estimator's settings."""
        rig = settings.applied(self.rig)
        config = weak_config(rig, self.run.sample_rate)
        estimator = config.estimator
        n_core = 3 + rig.identifier.zero  # the oracle adds friction by itself
        # From an estimate of an earlier candidate one step a window is enough: the sums are the same.
        return Windows.of(self.run, weak_design_of(rig, self.run.sample_rate)), WeakSettings(
            start=estimator.start[:n_core].astype(np.float64) if self.start is None else self.start,
            row_sd=estimator.row_sd,
            start_sd=estimator.start_sd[:n_core].astype(np.float64),
            forgetting_s=rig.identifier.forgetting_s,
            iterations=config.iterations if self.start is None else 1,
            drive_min=config.drive_min,
            full_angle=rig.identifier.full_angle,
            damping=rig.identifier.damping,
        )

    def bias(self, taps: int) -> Float:
        """Relative bias of w, d1, d2 by a smoothing filter; 0 where it cannot be shortened, or noise explains all."""
        if taps not in self.biases:
            shorter = round(_SHORTER * taps) | 1
            self.biases[taps] = self._shift(taps, shorter) if _MIN_TAPS <= shorter < taps else np.zeros(3)
        return self.biases[taps]

    def _shift(self, taps: int, shorter: int) -> Float:
        rate, most = self.run.sample_rate, self.bounds.window - 1
        window_s = min(_REFERENCE_WINDOW * self.period, most * self.bounds.decimation / rate)
        decimation = math.ceil(window_s * rate / most)
        estimates, errors = [], []
        for length in (taps, shorter):
            windows, estimator = self._prepared(Settings(window_s, 12, decimation, length / rate, self.forgetting_s))
            oracle = windows.estimated(estimator)
            estimates.append(oracle.p[:3])
            errors.append(oracle.sandwich()[:3] / oracle.p[:3])
        shift = estimates[1] / estimates[0] - 1
        # The difference of the variances is itself known roughly, and may come out as nothing.
        noise = np.maximum(errors[1] ** 2 - errors[0] ** 2, errors[0] ** 2 / 4)
        return np.where(shift**2 > _SIGMAS**2 * noise, np.sqrt(np.maximum(shift**2 - noise, 0.0)), 0.0)

    def forgetting(self, settings: Settings) -> tuple[Forgetting, ...]:
        """No forgetting first, then every time constant that the core takes and that is shorter than the run."""
        windows, estimator = self._prepared(settings)
        settled = len(windows.phi) // 4
        reference = windows.innovations(replace(estimator, forgetting_s=0.0))[settled:]
        out = [Forgetting(0.0, 1.0, 0.0)]
        for forgetting_s in _FORGETTING_S:
            too_short = forgetting_s < _MIN_FORGETTING_WINDOWS * windows.design.hop_s
            if too_short or forgetting_s > len(self.run.t) / self.run.sample_rate:
                continue
            energy = windows.innovations(replace(estimator, forgetting_s=forgetting_s))[settled:]
            gain = reference - energy
            spread = float(np.std(gain)) * math.sqrt(len(gain))
            sigmas = float(np.sum(gain)) / spread if spread > 0 else 0.0
            out.append(Forgetting(forgetting_s, float(np.sum(energy) / np.sum(reference)), sigmas))
        self.advance()
        return tuple(out)


def _split(first: WeakOracle, second: WeakOracle) -> float:
    """Squared distance of two independent estimates, per parameter, in units of their joint covariance."""
    one, other = first.assess(), second.assess()
    distance = one.p - other.p
    covariance = one.covariance + other.covariance
    scale = 1 / np.sqrt(np.diag(covariance))
    scaled = distance * scale
    return float(scaled @ np.linalg.solve(covariance * np.outer(scale, scale), scaled)) / len(distance)
