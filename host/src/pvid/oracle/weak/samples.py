"""What a run's samples and a model show by themselves: a sensor that clips, an encoder that toggles at rest or whose
counts repeat, a sample rate that is too low for the fastest mode, guesses that are all off by one factor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.base.wording import listed, with_unit
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.evaluation import numpy_function
from pvid.model.signals import Jet, order_of
from pvid.oracle.weak.errors import chi2_of_sensors
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.solve import Fit
from pvid.oracle.weak.terms import Act, Candidate
from pvid.oracle.weak.verdict import Reason
from pvid.rig.gaps import at_its_ends
from pvid.sim.motion import motion_of

_MISFIT = 20.0  # chi^2 from which an input is doubted
_CLIPPED = 2e-3  # of the samples at the limit, from which a sensor clips
_HELD = 3  # samples at the limit, at least
_BEYOND = 10.0  # resolutions by which the motion before the limit would have gone beyond it
_MOVES = 0.02  # of its range, by which another signal moves meanwhile
_APPROACH, _APART = 3, 4.0  # samples before the limit, at least, and resolutions from it
_BRAKES = 5.0  # times as far away three times as long before: 3 to 4 at a steady speed, 9 and more braked by friction

_BLOCK = 50  # samples of a standstill
_TOGGLES = 0.1  # of the samples of a block that differ from the one before
_RESTS = 0.2  # of the run

# The spectrum of the counts' error above this part of the sample rate: mean square over twice the squared mean. Noise
# has 0.9 to 1.4 there, as have 14 simulated mechanisms; one tone of 40 to 100 counts has 3 to 11, of 250 up to 3.
_ABOVE_MOTION, _LINES = 0.2, 2.0
_FEW_COUNTS = 300  # of the whole motion: with more the error of a count is small

_FASTEST = 1.0  # rate of the fastest mode at the estimate, over the sample rate: above, it passes within a sample
_FAST_GUESS = 0.3  # the same at the guesses, which must agree
_EXPLAINED = 0.5  # R^2 of every equation, from which on another rate is advised
_RULE = 20.0  # samples in the shortest time constant that are recommended
_PART_OF_SAMPLE = 0.45  # a delay below it may come of such a mode
_SENSITIVE = 0.3  # d log rate / d log of a parameter of the highest derivatives that the mode contains

_FACTOR, _SPREAD = 8.0, 2.0  # common to the parameters of an equation, and between them


def of_samples(
    model: CompiledModel, run: Mapping[str, npt.ArrayLike], sample_rate: float, fit: Fit, r2: float
) -> list[Reason]:
    """Of all checks.

    Parameters
    ----------
    run : name of each signal -> samples [n]; NaN where one is missing
    sample_rate : [Hz]
    fit : the estimate
    r2 : the least of the row kinds: where it is small, a time constant is that of no mechanism
    """
    samples = {one.name: np.asarray(run[one.name], np.float64) for one in model.signals}
    out = too_slow(model, samples, sample_rate, fit, r2 > _EXPLAINED)
    for one in model.signals:
        if one.kind == "sensor":
            x = samples[one.name]
            out += clipped(model, one, samples) + toggling(model, one, x) + repeating(one, x)
        elif chi2_of_sensors(fit) > _MISFIT:
            out += clipped(model, one, samples)
    return out + far_guesses(model, fit)


def explains(reasons: Iterable[Reason], best: Candidate, sample_rate: float) -> bool:
    """Whether samples that clip, or a rate that is too low, are the cause of the best candidate: the motion within a
    sample looks like a delay of a part of it, or like any law, but not like a longer delay."""
    names = {one.name for one in reasons if one.alarm}
    late = (
        isinstance(best.kind, Act) and best.kind.measure == "time" and abs(best.number) >= _PART_OF_SAMPLE / sample_rate
    )
    return "clipped" in names or "rate" in names and not late


def clipped(model: CompiledModel, signal: Signal, samples: Mapping[str, Float]) -> list[Reason]:
    """A sensor stands at its largest or smallest value, reached at speed, while something else moves.

    A motion that turns there, or that friction brakes and holds, comes to it slowly. What settles there, as a current
    after a step of its voltage, does so while every other signal stands too. An input may well be limited to that
    value: of one that comes to it steadily this is a note.
    """
    x = samples[signal.name]
    reach = float(np.nanmax(x) - np.nanmin(x))
    inertial = any(order_of(one, [signal.name]) > 1 for one in model.equations)
    others = [y for name, y in samples.items() if name != signal.name]
    rises = np.abs(np.diff(x))
    step = max(signal.resolution, 1e-6 * reach, float(np.min(rises[rises > 1e-6 * reach], initial=reach)))
    for limit, side, firsts, ends in at_its_ends(x):
        count = 0
        for first, end in zip(firsts, ends, strict=True):
            if end - first < _HELD or first < _APPROACH:
                continue
            before = x[max(first - 10 * (end - first) - _APPROACH, 0) : first - _APPROACH + 1]
            far = np.flatnonzero(np.abs(limit - before) >= _APART * step)
            back = int(len(before) - 1 - far[-1]) + _APPROACH if len(far) else len(before) + _APPROACH - 1
            speed = abs(limit - x[first - back]) / back
            if signal.driven and np.any(np.diff(x[first - _APPROACH : first]) == 0):
                continue
            if inertial and abs(limit - x[max(first - 3 * back, 0)]) > _BRAKES * abs(limit - x[first - back]):
                continue
            moving = inertial or any(np.ptp(y[first:end]) > _MOVES * float(np.nanmax(y) - np.nanmin(y)) for y in others)
            if moving and speed * (end - first) / 2 > _BEYOND * step:
                count += int(end - first)
        if count > _CLIPPED * len(x):
            value = with_unit(limit, signal.unit, 4)
            text = (
                f"{signal.name} stands at its {side} value, {value}, in {100 * count / len(x):.2g} % of the samples, "
                "and reaches it at speed: "
            )
            if signal.kind == "input":
                text += f"does what records it clip, or does {signal.name} itself end there?"
                return [Reason("clipped", text, alarm=False)]
            text += (
                "the sensor clips, or the mechanism meets a stop. Keep the motion below it, or leave these parts of "
                "the run out."
            )
            return [Reason("clipped", text)]
    return []


def toggling(model: CompiledModel, signal: Signal, x: Float) -> list[Reason]:
    """An encoder whose rate has a friction rests between two steps: each of its steps is a reversal."""
    signs = {jet for row in model.rows for part in row.regressors for psi in part.values() for jet in _in_signs(psi)}
    blocks = x[: len(x) // _BLOCK * _BLOCK].reshape(-1, _BLOCK)
    if Jet(signal.name, 1) not in signs or not signal.resolution or not len(blocks):
        return []
    narrow = np.ptp(blocks, axis=1) < 1.5 * signal.resolution
    busy = np.mean(np.diff(blocks, axis=1) != 0, axis=1) > _TOGGLES
    share = float(np.mean(narrow & busy))
    if share < _RESTS:
        return []
    text = (
        f"{signal.name} toggles between two values in {100 * share:.2g} % of the run: the mechanism rests there, and "
        "these samples contain nothing of it. Leave them out."
    )
    return [Reason("resting", text, alarm=False)]


def repeating(signal: Signal, x: Float) -> list[Reason]:
    """Few counts of a motion that repeats: their error repeats with it, as lines at its harmonics.

    The noise of a count is taken as independent of the motion. As lines it is alike in all windows and looks like it.
    """
    second = np.diff(x, 2)
    counts = float(np.nanmax(x) - np.nanmin(x)) / signal.resolution if signal.resolution else np.inf
    if not 0 < counts < _FEW_COUNTS or len(second) < _BLOCK or not np.isfinite(second).all():
        return []
    power = np.abs(np.fft.rfft(second * np.hanning(len(second)))) ** 2
    power = power[round(2 * _ABOVE_MOTION * (len(power) - 1)) :]
    if np.mean(power**2) < 2 * _LINES * np.mean(power) ** 2:
        return []
    text = (
        f"{signal.name} moves over {counts:.0f} counts, whose error repeats with the motion: it looks like motion, and "
        "the standard errors do not cover it. Drive with several frequencies or a larger amplitude, or read finer "
        "counts."
    )
    return [Reason("counts", text)]


def _in_signs(psi: sp.Expr) -> set[Jet]:
    return {jet for one in sp.sympify(psi).atoms(sp.Function) if type(one).__name__ == "sgn" for jet in one.atoms(Jet)}


def too_slow(
    model: CompiledModel, samples: Mapping[str, Float], rate: float, fit: Fit, is_explained: bool
) -> list[Reason]:
    """The fastest mode of the equations passes within a sample: parameters of its highest derivative are lost. Of
    several recordings with own parameters, the modes are those of the first."""
    p = fit.p[list(model.places[0])]
    model = model.alone
    try:
        modes = _Modes(model, samples)
    except PvidError:  # no simulation, no modes
        return []
    guess = np.array([one.guess for one in model.unknowns])
    fastest, of_guess = modes.fastest(p), modes.fastest(guess)
    if not _FASTEST * rate < fastest < np.inf or of_guess < _FAST_GUESS * rate:
        return []
    lost = [
        one.name
        for k, one in enumerate(model.unknowns)
        if one.symbol in modes.inertias and abs(np.log(modes.fastest(_moved(p, k)) / fastest) / 0.1) > _SENSITIVE
    ]
    if not lost:
        return []
    fastest = max(min(fastest, of_guess), _FASTEST * rate)  # what passes within a sample has no time constant here
    wanted = float(f"{_RULE * fastest:.1g}")
    many, verb = ("their", "are") if len(lost) > 1 else ("its", "is")
    text = (
        f"{listed(lost)} {verb} hardly identifiable at {rate:.4g} Hz: {many} time constant is "
        f"{with_unit(1 / fastest, 's', 2)} or less, and a sample takes {with_unit(1 / rate, 's', 2)}."
    )
    text += f" Sample at {wanted:.6g} Hz." if is_explained else ""
    return [Reason("rate", text)]


def _moved(p: Float, k: int) -> Float:
    out = p.copy()
    out[k] *= np.exp(0.1)
    return out


class _Modes:
    """Eigenvalues of the equations, linear about rest at the mean of the run, signs held."""

    def __init__(self, model: CompiledModel, samples: Mapping[str, Float]) -> None:
        motion = motion_of(model)
        self.inertias = motion.matrix.free_symbols
        at: dict[sp.Symbol, float] = {one: 0.0 for one in (*motion.states, *motion.inputs)}
        at |= {Jet(name): float(np.nanmean(x)) for name, x in samples.items() if Jet(name) in at}
        held = dict.fromkeys(motion.signs, sp.Integer(0)) | {one.symbol: sp.Float(one.value) for one in model.knowns}
        matrix, right = (one.xreplace(held) for one in (motion.matrix, motion.right))
        place = {symbol: sp.Float(value) for symbol, value in at.items()}
        slopes = right.jacobian(motion.states) if motion.states else sp.zeros(len(motion.highest), 0)
        self._highest = [motion.highest.index(one) if one in motion.highest else -1 for one in motion.rates]
        self._states = [motion.states.index(one) if one in motion.states else -1 for one in motion.rates]
        p = list(model.p)
        self._matrix = numpy_function(p, matrix.xreplace(place))
        self._slopes = numpy_function(p, slopes.xreplace(place))

    def fastest(self, p: Float) -> float:
        """Largest rate of a mode [1/s] at p [n_p]; 0 where there is no state, NaN where the equations are singular."""
        slopes = np.asarray(self._slopes(*p), np.float64)
        if not slopes.shape[1]:
            return 0.0
        try:
            highest = np.linalg.solve(np.asarray(self._matrix(*p), np.float64), slopes)
            whole = np.zeros((slopes.shape[1],) * 2)
            for row, (of_highest, of_state) in enumerate(zip(self._highest, self._states, strict=True)):
                if of_highest >= 0:
                    whole[row] = highest[of_highest]
                elif of_state >= 0:
                    whole[row, of_state] = 1.0
            return float(np.max(np.abs(np.linalg.eigvals(whole))))
        except np.linalg.LinAlgError:
            return float("nan")


def far_guesses(model: CompiledModel, fit: Fit) -> list[Reason]:
    """All parameters of an equation are off their guesses by about one factor, that of a signal's unit."""
    ratio = {one.symbol: value / one.guess for one, value in zip(model.unknowns, fit.p, strict=True) if one.positive}
    for row in model.rows:
        own = sorted(ratio.keys() & {one for theta in row.theta for one in theta.free_symbols}, key=str)
        factors = np.array([ratio[one] for one in own])
        if len(own) < 2 or not np.all(factors > 0):
            continue
        mean = float(np.exp(np.mean(np.log(factors))))
        if max(mean, 1 / mean) < _FACTOR or np.max(factors / mean) > _SPREAD or np.min(factors / mean) < 1 / _SPREAD:
            continue
        given = [
            one.name
            for one in model.signals
            if any(sp.sympify(psi).has(one.jet) for psi in row.known.values()) and one.driven
        ]
        signal = given[0] if given else "a signal of this equation"
        text = f"{listed(own)} are all about {mean:.2g} times their guesses: is {signal} in another unit, or in counts?"
        return [Reason("guesses", text, alarm=False)]
    return []
