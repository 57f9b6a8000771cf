"""The problems of one recording under a mechanism: with and without optional extras, late inputs, averaged samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.refine import LOG_SD, SKEW, WIDTH_SD, RefinedParameter, is_driven_by_derivatives, width_name
from pvid.identification.refinement.fit import Budget, Inputs, Measured, Prior, Problem, Refined
from pvid.identification.refinement.inputs import LateInputs, inputs_of, is_late, without_jumps
from pvid.identification.refinement.kernel import PlayedKernel, kernel_of, play_of
from pvid.identification.refinement.problem import begins_of, known_stretches
from pvid.model.compiled import CompiledModel
from pvid.model.signals import sgn

Float = npt.NDArray[np.float64]
Values = Mapping[str, float]  # of parameters and settings, by name

# Of one refinement for each sample, and for each beyond those of a long recording, which shows earlier where it leads:
# about four seconds for a thousand. Of 60 pendulums with imperfections none that was right took more than 0.85 of it.
_WORK, _WORK_BEYOND, _LONG = 12_000, 1_500, 10_000
_PERIODS = 2.0  # of the slowest oscillation in a whole block; windows of the weak form where nothing oscillates
_A_PERIOD = 60  # averaged samples in a period of the fastest motion
_OSCILLATES = 0.1  # part of an eigenvalue that is imaginary
_SIGN_COARSE = 8  # steps in a smooth one where a dry friction that is tried may reverse
_WIDEST = 0.3  # of the sign of such a friction: share of the joint's largest speed
_WIDER = 3.0  # times LOG_SD: what is known of a positive unknown before
_EXTRA = 5.0  # times its standard deviation in the model: the same of an extra
_PLAY = 0.05  # of a sensor's motion: its play
_FAR = 5.0  # times the guess's fastest motion: an estimate that is beyond is none


class Problems:
    """Problems differ in the optional extras, and share a budget.

    Parameters
    ----------
    signals : of the recording, with pvid.rig.run.NUMBER of several
    starts : p, the likeliest first; the second one a guess
    window_s : of the weak form

    Attributes
    ----------
    budget : of all searches
    breaks : times at which a differentiated signal jumps [s] from the first sample on
    first : names of the parameters that the weak form has
    groups : names of further parameters, which are freed together, in turn
    options : names of optional extras that are tried together, in turn
    rubbing : of them those with dry friction
    """

    def __init__(
        self, model: CompiledModel, signals: Mapping[str, Float], rate: float, starts: Sequence[Float], window_s: float
    ) -> None:
        self._model, self._window_s, self._rate = model, window_s, rate
        self._base = kernel_of(model)
        made = self._base.made
        likely = [p for p in starts if self._base.possible(self._base.start(p))]
        if not likely:
            raise PvidError(f"no mechanism can have the guesses of {model.name}")
        self._p = likely[0]
        slow, fast = self._modes_hz(self._p)
        if fast > _FAR * (of_guess := self._modes_hz(likely[-1] if len(likely) < 2 else likely[1]))[1]:
            self._p, (slow, fast) = likely[min(1, len(likely) - 1)], of_guess
        self._fast = fast
        self.breaks: tuple[float, ...] = ()
        self._mean = 1
        if is_driven_by_derivatives(model):
            if not 2 * fast < rate:
                raise PvidError(f"{rate:g} samples a second are too few for a mode of {fast:.3g} Hz")
            signals, jumps = without_jumps(model, made, signals, rate, slow)
            self.breaks = tuple(one / rate for one in jumps)
            if all(is_late(model, jet) for jet in made.inputs):
                self._mean = max(1, int(rate / (_A_PERIOD * fast)))
        self._slow = slow
        self._signals, self._begins = signals, begins_of(signals, self._mean)
        samples = len(next(iter(signals.values())))
        whole = _WORK * min(samples, _LONG) + _WORK_BEYOND * max(samples - _LONG, 0)
        self.budget = Budget(whole, whole)
        self._problems: dict[tuple[str, ...], Problem] = {}
        self.first = [one.name for one in made.parameters if one.place >= 0]
        own = [one.name for one in made.parameters if one.place < 0 and not one.sign]
        rest = tuple(name for name in own if name != SKEW)
        self.groups = [group for group in dict.fromkeys([tuple(own), rest, (SKEW,) * (SKEW in own)]) if group]
        self._widths = _widths_of(model)
        extras = [one for one in model.refinement.extras if one.optional]
        chosen = [tuple(one.name for one in extras if one.optional == option) for option in model.options]
        self.rubbing = tuple(name for names in chosen if any(map(self.width_of, names)) for name in names)
        smooth = [names for names in chosen if not set(names) & set(self.rubbing)]
        rubbing = [names for names in chosen if set(names) & set(self.rubbing)]
        self._plays = {play_of(model, name): k for k, name in enumerate(made.outputs) if _can_play(model, name)}
        self.options = [*((name,) for name in self._plays), *smooth, *rubbing]

    @property
    def has_own_equations(self) -> bool:
        """Whether the full equations are others than those of the weak form's rows."""
        return bool(self._model.refinement.equations)

    @property
    def largest_speed(self) -> float:
        """Of the sensor that moves most, as the motion that is fastest would have it [unit of a sensor/s]."""
        spread = max(float(np.nanstd(self._signals[name])) for name in self._base.made.outputs)
        return 2 * np.pi * self._fast * spread

    def problem(self, optional: tuple[str, ...] = ()) -> Problem:
        """With these extras. Raises PvidError where the inputs are known nowhere."""
        optional = tuple(sorted(optional))
        if optional not in self._problems:
            plays = [name for name in optional if name in self._plays]
            if plays:
                inner = self.problem(tuple(name for name in optional if name not in plays))
                kernel = inner.kernel
                for name in plays:
                    output = self._plays[name]
                    spread = float(np.nanstd(inner.measured.z[:, output]))
                    kernel = PlayedKernel(kernel, output, _PLAY * spread)
                made = Problem(kernel, inner.measured, self.budget)
            else:
                made = self._made(optional)
            self._problems[optional] = made
        return self._problems[optional]

    def _made(self, optional: tuple[str, ...]) -> Problem:
        model, mean = self._model, self._mean
        kernel = kernel_of(model, optional, self._begins)
        made, rate = kernel.made, self._rate / mean
        samples = len(self._signals[made.outputs[0]]) // mean
        coarse = _SIGN_COARSE if optional and not self._base.widths else None
        sub, coarse, _ = kernel.steps(samples, rate, kernel.start(self._p), coarse)
        z, grown = averages(np.stack([self._signals[name] for name in made.outputs], -1)[: samples * mean], mean)
        inputs: Inputs
        if is_driven_by_derivatives(model):
            inputs = LateInputs(model, made, self._signals, self._rate, sub, mean, self._slow)
        else:
            fixed = inputs_of(model, made, self._signals, rate, sub)
            inputs = lambda _: fixed  # noqa: E731
        sd = np.array([model.signal(name).sd for name in made.outputs]) / np.sqrt(mean)
        known = known_stretches(inputs(0.0)[0], sub)
        return Problem(kernel, Measured(z, sd, inputs, rate, sub, grown, coarse, known), self.budget)

    # ---- parameters

    def values_of_p(self, p: Float) -> dict[str, float]:
        """Parameters by name from p [n_p]."""
        return dict(zip(self._model.p_names, map(float, p), strict=True))

    def values(self, problem: Problem, found: Refined) -> dict[str, float]:
        """Parameters and settings of an outcome by name."""
        made = problem.kernel.made
        names = [*(one.name for one in made.parameters), *made.settings]
        return dict(zip(names, map(float, found.r), strict=True)) | self.values_of_p(found.r[made.places_of_p])

    def r(self, problem: Problem, values: Values) -> Float:
        """r and its settings from values by name, those of the weak form among them; extras are 0 otherwise, and signs
        of frictions that are tried have their widest."""
        kernel = problem.kernel
        names = [one.name for one in kernel.made.parameters]
        p = np.array([values[name] for name in self._model.p_names])
        r, measured = kernel.start(p), problem.measured
        _, _, sharp = kernel.steps(len(measured.z), measured.rate, r, measured.coarse)
        r[kernel.widths] = sharp[kernel.widths]
        for k, name in enumerate(names):
            r[k] = values.get(name, r[k])
        return self.with_width(problem, r, _WIDEST)

    def with_width(self, problem: Problem, r: Float, share: float) -> Float:
        """r with this width of the signs of frictions that are tried."""
        out = r.copy()
        own = {self._base.made.parameters[place].name for place in self._base.widths}
        parameters = problem.kernel.made.parameters
        out[[k for k in problem.kernel.widths if parameters[k].name not in own]] = share * self.largest_speed
        return out

    def is_sharp(self, problem: Problem) -> bool:
        """Whether the signs are those of the model alone, whose width is that of a step."""
        return bool(self._base.widths) and len(problem.kernel.widths) == len(self._base.widths)

    def prior(self, problem: Problem, r: Float, free: Sequence[str] | None = None) -> Prior:
        """About r, wide; of these parameters, or of all but the widths of signs."""
        parameters = problem.kernel.made.parameters
        searched = np.array([one.name in free if free is not None else not one.sign for one in parameters])
        return Prior(r, np.array([self._sd(one) for one in parameters]), searched)

    def _sd(self, one: RefinedParameter) -> float:
        if one.log:
            return _WIDER * (WIDTH_SD if one.sign else LOG_SD)
        known = one.place < 0 and one.name != SKEW and one.name not in self._plays
        return one.prior_sd * (_EXTRA if known else 1.0)

    def prior_at(self, problem: Problem, found: Refined) -> Prior:
        """About an outcome; of the parameters that were searched and determined."""
        prior = self.prior(problem, found.r)
        return Prior(found.r, prior.sd, np.diag(found.covariance) > 0)

    # ---- friction

    def frictions(self, problem: Problem) -> list[str]:
        """Extras that damp the motion: they cannot be negative."""
        kernel = problem.kernel
        r = self.r(problem, self.values_of_p(self._p))

        def damping(r: Float) -> float:
            return -float(np.trace(kernel.slopes_at_rest(r)))

        out = []
        for k, one in enumerate(kernel.made.parameters):
            if one.place < 0 and not one.sign and one.name not in (SKEW, *self._plays):
                more = r.copy()
                more[k] += one.prior_sd
                if damping(more) > damping(r) + 1e-9 * abs(damping(r)):
                    out.append(one.name)
        return out

    def width_of(self, name: str) -> str:
        """Name of the width of the sign that an extra is the factor of; empty where there is none."""
        return self._widths.get(name, "")

    # ---- lengths

    def lengths(self, r: Float, problem: Problem, shares: Sequence[float]) -> list[int]:
        """Of blocks [samples], from that of a whole one at r."""
        made = problem.kernel.made
        slow = self._modes_hz(r[made.places_of_p])[0]
        return [max(8, round(share * _PERIODS / slow * problem.measured.rate)) for share in shares]

    def _modes_hz(self, p: Float) -> tuple[float, float]:
        """Frequencies of the slowest oscillation and of the fastest motion about rest [Hz]; inf where it is none."""
        kernel = self._base
        slopes = kernel.slopes_at_rest(kernel.without_signs(kernel.start(p)))
        if not np.isfinite(slopes).all():
            return 1 / self._window_s, np.inf
        found = np.linalg.eigvals(slopes)
        size = np.abs(found) / (2 * np.pi)
        swings = size[np.abs(found.imag) > _OSCILLATES * np.abs(found)]
        return float(swings.min(initial=np.inf)) if len(swings) else 1 / self._window_s, float(size.max())


def averages(x: Float, mean: int) -> tuple[Float, float]:
    """Averages of so many samples [samples, signals] with their droop undone to second order, and the variance of one
    over that of an average."""
    if mean == 1:
        return x, 1.0
    c = (mean * mean - 1) / (24 * mean * mean)
    found = x.reshape(-1, mean, x.shape[1]).mean(1)
    found[1:-1] = (1 + 2 * c) * found[1:-1] - c * (found[2:] + found[:-2])
    return found, (1 + 2 * c) ** 2 + 2 * c * c


def _can_play(model: CompiledModel, sensor: str) -> bool:
    """Whether a sensor is one of a position that mechanical parts may connect to the motion."""
    return model.signal(sensor).unit in ("rad", "m")


def _widths_of(model: CompiledModel) -> dict[str, str]:
    """Of each extra that is the factor of a sign the name of its width."""
    signs = {
        one.name: {found for equation in model.refinement.equations for found in equation.diff(one.symbol).atoms(sgn)}
        for one in model.refinement.extras
    }
    return {name: width_name(min(found, key=str).args[0]) for name, found in signs.items() if found}
