"""Settings of the weak form for a recorded run, judged by what can be seen without the truth.

A candidate (window, test functions, decimation, smoothing) is judged by the error it must be expected to have:

    error^2 = (standard error^2 + bias^2) max(1, split)

standard error: from the run's own information matrix and residuals, shared noise of neighbouring windows counted.
bias: how far the estimate moves when the smoothing filter is shortened by 30 %, beyond what the shorter filter's
additional noise explains (Hausman's comparison), where that is more than the standard error: a filter that distorts
the motion is seen by nothing else.
split: how far the estimates of the run's halves are apart, squared, in units of their joint covariance, per parameter
(the square of Birge's ratio): 1 when the standard errors are honest.

Where the rig file's own settings are expected within `CLOSE` of the smallest error they are kept; else, of all that
come so close, the candidate that costs the fewest instructions is chosen. Forgetting is chosen last, by how well the
estimate so far predicts the next window.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.capture import Run
from pvid.design_report import Y_NOISE_LSB
from pvid.differentiation import savitzky_golay
from pvid.errors import PvidError
from pvid.identify import WORST_SE
from pvid.native import Native
from pvid.rigfile import RigFile
from pvid.setup import nominal_start, weak_config, weak_design_of
from pvid.weak_cost import Schedule, instructions
from pvid.weak_design import Bounds, WeakDesign
from pvid.weak_oracle import WeakOracle, WeakSettings, columns, frames, front_end, sample_sd

Float = npt.NDArray[np.float64]

# Candidates. Windows in slow modal periods; lengths of a window in decimated samples; smoothing in the default's
# 71 ms; test functions; forgetting [s].
_WINDOWS = (0.5, 0.7, 0.9, 1.1, 1.4, 1.8, 2.4)
_SAMPLES = (80, 125, 200)
_SMOOTHINGS = (0.35, 0.5, 0.72, 1.0, 1.15)
_FUNCTIONS = (6, 8, 10, 12, 14, 16)
_FORGETTING_S = (80.0, 40.0, 20.0, 10.0, 5.0)
_DEFAULT_SMOOTHING_S = 0.071
_SHORTER = 0.7
_DEGREE = 6  # of the smoothing polynomial, as in weak_design
_MIN_TAPS = _DEGREE + 3

# Steps of `tune`, at most: the default, windows by decimation, smoothings, functions, windows again, forgetting.
STEPS = 1 + 2 * len(_WINDOWS) * len(_SAMPLES) + len(_SMOOTHINGS) + len(_FUNCTIONS) + 1

CLOSE = 1.2
# A pivot whose u has less rms than this, in units of its sensor's noise, counts as still; noise that passes for a
# drive biases w with confidence.
_DRIVEN = 10.0
# Windows in each half of the run, for its estimate to have a covariance worth the name.
_MIN_HALF = 4
# Forgetting must predict better than remembering by this many standard errors of the difference.
_FORGETTING_SIGMAS = 3.0
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
    split : squared distance of the halves' estimates per parameter, in units of their joint covariance
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
        return math.sqrt(float(np.mean(self.se**2 + self.bias**2)) * max(1.0, self.split))

    @property
    def identified(self) -> bool:
        """Whether w is known at all."""
        return bool(self.se[0] <= WORST_SE)


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
    period = slow_period(default.p if default is not None and default.identified else nominal_start(rig))
    bench.judge_all(
        Settings(factor * period, 12, decimation, _DEFAULT_SMOOTHING_S)
        for factor in _WINDOWS
        for decimation in bench.decimations(factor * period)
    )
    best = bench.best()
    bench.judge_all(replace(best, smoothing_s=share * _DEFAULT_SMOOTHING_S) for share in _SMOOTHINGS)
    best = bench.best()
    bench.judge_all(replace(best, functions=functions) for functions in _FUNCTIONS)
    best = bench.best()
    bench.judge_all(
        replace(best, window_s=factor * period, decimation=decimation)
        for factor in _WINDOWS
        for decimation in bench.decimations(factor * period)
    )
    ranked = bench.ranked()
    close = [one for one in ranked if one.error <= CLOSE * ranked[0].error]
    chosen = default if default in close else min(close, key=lambda one: one.instructions)
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
        reason=_reason(len(close), chosen is default, ranked, keep),
    )


def slow_period(p: Float) -> float:
    """Period of the slow mode at rest [s], of s^4 + d1 w s^2 + d2 w^2."""
    w, d1, d2 = p[:3]
    square = w * (d1 - math.sqrt(max(d1**2 - 4 * d2, 0.0))) / 2
    return 2 * math.pi / math.sqrt(square)


def _chosen_forgetting(forgetting: tuple[Forgetting, ...]) -> Forgetting:
    useful = [one for one in forgetting[1:] if one.better_by_sigmas > _FORGETTING_SIGMAS]
    return min(useful, key=lambda one: one.energy) if useful else forgetting[0]


def _reason(close: int, own: bool, ranked: tuple[Judged, ...], keep: Forgetting) -> str:
    why = "the rig file's own settings are one of them" if own else "this one costs the fewest instructions of them"
    what = (
        f"of {len(ranked)} candidates the smallest expected error is {100 * ranked[0].error:.2g} %; {close} come "
        f"within {100 * (CLOSE - 1):.0f} % of it, and {why}"
    )
    if keep.forgetting_s == 0:
        return f"{what}; no forgetting predicts the next window better than remembering everything"
    return (
        f"{what}; forgetting in {keep.forgetting_s:g} s leaves {keep.energy:.2g} times the residual of the next "
        f"window, {keep.better_by_sigmas:.0f} standard errors less: the parameters drift"
    )


@dataclass(frozen=True)
class _Windows:
    """A run as a design sees it: windows of columns [windows, 11, K], angle and u [windows, W]."""

    design: WeakDesign
    columns: Float
    phi: Float
    u: Float

    @classmethod
    def of(cls, run: Run, design: WeakDesign) -> _Windows:
        smooth, u = front_end(run.phi, run.y, design)
        phi_frames, u_frames = frames(smooth, design), frames(u, design)
        return cls(design, columns(phi_frames, u_frames, design), phi_frames, u_frames)

    def estimated(self, settings: WeakSettings, part: slice = slice(None)) -> WeakOracle:
        """The estimator after the windows of a part of the run."""
        oracle = WeakOracle(self.design, settings)
        for one, phi, u in zip(self.columns[part], self.phi[part], self.u[part], strict=True):
            oracle.window(one, phi, u)
        return oracle

    def residuals(self, oracle: WeakOracle) -> Float:
        """Residuals of all rows at the estimator's p [windows, K]."""
        rows = []
        for one, phi, u in zip(self.columns, self.phi, self.u, strict=True):
            x, _ = oracle.rows(one, phi, u)
            rows.append(x[0] - oracle.theta() @ x[1:])
        return np.array(rows)

    def innovations(self, settings: WeakSettings) -> Float:
        """Energy of each window's residuals at the estimate from those before it [windows]."""
        oracle = WeakOracle(self.design, settings)
        energies = []
        for one, phi, u in zip(self.columns, self.phi, self.u, strict=True):
            x, _ = oracle.rows(one, phi, u)
            e = x[0] - oracle.theta() @ x[1:]
            energies.append(float(e @ e))
            oracle.window(one, phi, u)
        return np.array(energies)


class _Bench:
    """Judges candidates on one run, each once."""

    def __init__(self, run: Run, rig: RigFile, native: Native, progress: Callable[[int], None]) -> None:
        if rig.identifier.form != "weak":  # its window is a differentiator's
            rig = replace(rig, identifier=replace(rig.identifier, form="weak", window_s=0.0))
        self.run, self.rig, self.native, self.progress = run, rig, native, progress
        self.bounds = Bounds()
        self.start: Float | None = None
        self.judged: dict[Settings, Judged | None] = {}
        self.steps = 0

    def refuse_a_still_pivot(self) -> None:
        """PvidError where u, smoothed as well as the core can, does not stand out of the pivot sensor's noise."""
        run, rig = self.run, self.rig
        taps = self.taps(math.inf)
        if len(run.t) <= taps:
            return  # too short, which `ranked` says
        second = savitzky_golay(taps, _DEGREE).weights[2]
        gain = math.sqrt(2 * float(np.sum(second**2)) + 4 * float(np.sum(second)) ** 2)
        per_metre = run.sample_rate**2 / rig.l1
        noise = sample_sd(rig.sensor.y_lsb, Y_NOISE_LSB) * gain * per_metre
        centre = -2 * float(np.sum(second))
        u = per_metre * np.convolve(run.y, np.concatenate([second[::-1], [centre], second]), "valid")
        if float(np.std(u)) < _DRIVEN * noise or not np.ptp(run.y) > 0:
            raise PvidError(
                "nothing can be tuned without a drive: the pivot stands still, its acceleration is no more than "
                f"{_DRIVEN:g} times what the noise of its sensor makes of a still one"
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
            )
            judged = self.judge(settings)
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

    def judge_all(self, candidates: Iterable[Settings]) -> None:
        """Judges candidates; those that cannot be designed, or that the core refuses, are left out."""
        for candidate in candidates:
            smoothing_s = self.taps(candidate.smoothing_s) / self.run.sample_rate
            settings = replace(candidate, window_s=float(f"{candidate.window_s:.3g}"), smoothing_s=smoothing_s)
            if settings not in self.judged:
                try:
                    self.judged[settings] = self.judge(settings)
                except (PvidError, np.linalg.LinAlgError):
                    self.judged[settings] = None
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
            period = slow_period(nominal_start(self.rig))
            raise PvidError(
                f"the run of {duration:.3g} s is too short to be tuned: each half must hold {_MIN_HALF} windows of "
                f"about a slow modal period ({period:.2g} s at the rig's nominal)"
            )
        known = [one for one in usable if one.identified]
        if not known:
            raise PvidError(
                "no setting identifies w from this run (standard error above "
                f"{100 * WORST_SE:.0f} %): is the pivot driven, and are the columns phi and y what they should be?"
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
        """What the run says of a candidate."""
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
            bias=self._bias(settings, whole.p[:3], se),
            split=_split(windows.estimated(estimator, first), windows.estimated(estimator, second)),
            misfit=(whole.assess().residual_sd / estimator.row_sd) ** 2,
            colour=float(energies.max() / energies.mean()),
            delay_s=design.delay / design.sample_rate + design.window_s,
            instructions=instructions(schedule, self.rig.identifier.zero)[0],
        )
        if judged.identified:
            self.start = whole.p[: len(estimator.start)]
        return judged

    def _prepared(self, settings: Settings) -> tuple[_Windows, WeakSettings]:
        """The run's windows and the estimator's settings; refuses what the core would refuse."""
        rig = settings.applied(self.rig)
        config = weak_config(rig, self.run.sample_rate)
        self.native.weak(config)
        estimator = config.estimator
        # From an estimate of an earlier candidate one step a window is enough: the sums are the same.
        return _Windows.of(self.run, weak_design_of(rig, self.run.sample_rate)), WeakSettings(
            start=estimator.start.astype(np.float64) if self.start is None else self.start,
            row_sd=estimator.row_sd,
            start_sd=estimator.start_sd.astype(np.float64),
            forgetting_s=rig.identifier.forgetting_s,
            iterations=config.iterations if self.start is None else 1,
            drive_min=config.drive_min,
            full_angle=rig.identifier.full_angle,
            damping=rig.identifier.damping,
        )

    def _bias(self, settings: Settings, p: Float, se: Float) -> Float:
        """Relative bias of w, d1, d2 by the smoothing filter; 0 where that cannot be shortened, or is below se."""
        taps = self.taps(settings.smoothing_s)
        shorter = round(_SHORTER * taps) | 1
        if shorter < _MIN_TAPS or shorter >= taps:
            return np.zeros(3)
        windows, estimator = self._prepared(replace(settings, smoothing_s=shorter / self.run.sample_rate))
        other = windows.estimated(estimator)
        shift = (other.p[:3] - p) / p
        noise = np.maximum((other.sandwich()[:3] / p) ** 2 - se**2, 0.0)
        bias = np.sqrt(np.maximum(shift**2 - noise, 0.0))
        return np.where(bias > se, bias, 0.0)

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
