"""Settings of the refinement in float32 behind the weak identifier, of any mechanism that it takes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.codegen.refine import RefineFunctions, check_outputs, is_measured, refine_functions, ring_of, signs_of
from pvid.codegen.weak import weak_model_of
from pvid.configuration.weak import Run, simulated_run_of
from pvid.design.refine import refine_config
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.evaluation import numpy_function
from pvid.model.signals import Integral, Jet, jets
from pvid.models.simulated_rig import simulated_rig
from pvid.settings.refine import BIG_STEP, RefineConfig, RefineRig, RefineSignal
from pvid.settings.weak import Source, WeakConfig
from pvid.sim.simulated_run import RigSimulation

Float = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]
State = tuple[Float32, Float32]  # q, v

_STILL = 0.04  # h |lambda| up to which Adams-Bashforth is stable for a decay
_LEAST = 4.0  # periods of the fastest motion in a block
_STATES = 40  # of the run that are looked at
_WITH_SIGNS, _WITHOUT = 0.75, 0.95  # part of them for which the step is short enough
_A_PERIOD = 48.0  # steps in a period
_SHARP, _SOFT = 1e-6, 1e6  # widths of signs
_ROUNDED = 1e-4  # likewise, of a state that float32 rounds
_NEWTON = 4
_LEAST_WIDTH = 1e-6  # of a sign, over its largest argument
_LEAST_OF_CORE = 1e-9  # of ranges, limits and widths
_STEP_FREE, _STEP_FINE = 0.02, 0.001  # limits of a block's last step, in prior_sd
_REVERSAL = 4.0  # of the noise of a sample: the error is a small part of the jump
_HALF_TURN = 32767 / 4  # resolutions: an output that turns is kept in quarters of one
_RICCATI = 2000  # big steps until the filter's gain is steady
# Ranges over what the run has of them; of second derivatives, whose steps of 16 bits are then still below the noise; of
# integrals, which may go on.
_MARGIN, _MARGIN_OF_RATES, _MORE = 1.5, 4.0, 6.0


def refine_design(
    compiled: CompiledModel,
    config: WeakConfig,
    run: Mapping[str, npt.ArrayLike],
    p: npt.ArrayLike | None = None,
    soft_signs: Mapping[str, float] | None = None,
) -> RefineConfig:
    """Settings of the refinement for a rig, behind its weak form.

    Raises PvidError where the refinement in C does not have what the model needs: the reason in a sentence.

    Parameters
    ----------
    config : of the weak form
    run : of the rig: name of each signal -> samples
    p : parameters near those of the rig; None: those that the weak form starts at
    soft_signs : argument of a sign -> width of the soft sign in its place
    """
    before = [one.name for one in compiled.signals if one.edge == "before"]
    if before:
        raise PvidError(
            f"{compiled.name}: the recording has {listed(before)} before the jumps of the inputs, and the second stage"
            " in C reads samples behind them"
        )
    made = refine_functions(compiled, soft_signs)
    check_outputs(made)
    near = config.estimator.start if p is None else p
    settings = refine_settings(made, run, config.sample_rate, near, 4 * config.hop_s)
    own = made.model.refinement.equations
    return settings if own else replace(settings, se_max=config.trust.se_max)


def refine_for_simulated_rig(
    compiled: CompiledModel, config: WeakConfig, soft_signs: Mapping[str, float] | None = None
) -> RefineConfig:
    """The same for the shipped rig of a mechanism."""
    run, _, p = simulated_run_of(compiled)
    return refine_design(compiled, config, run, p, soft_signs)


def full_motion_of(compiled: CompiledModel, duration: float | None = None) -> Run:
    """A run of the shipped rig of a mechanism with the equations of its refinement; duration [s], None: the rig's."""
    rig = simulated_rig(compiled.name)
    return RigSimulation.of(compiled, replace(rig, duration=duration or rig.duration), whole=True).run()


def refine_settings(
    made: RefineFunctions, run: Mapping[str, npt.ArrayLike], rate: float, p: npt.ArrayLike, block_s: float
) -> RefineConfig:
    """From a run of the rig.

    Raises PvidError where the refinement in C does not have an input of the model, or samples are too slow for the
    motion.

    Parameters
    ----------
    run : name of each signal -> samples
    rate : [Hz]
    p : parameters near those of the rig, as the weak form has them
    block_s : length of a block: about two periods of the slowest motion
    """
    model = made.model
    weak = weak_model_of(model)
    names, sources = weak.sample_names, {one.sample: one.source for one in weak.signal if one.source is Source.HELD}
    inputs = [_input(made, jet) for jet in made.inputs]
    turning = {name for name, turns in zip(made.outputs, made.turning, strict=True) if turns}
    samples = [*inputs, *((name, 0, 1.0) for name in made.outputs)]
    signal = []
    for name, order, scale in samples:
        if name not in names:
            raise PvidError(f"{model.name}: its input {name} is no sample")
        x = np.asarray(run[name], float)
        place = names.index(name)
        margin = {-1: _MORE, 2: _MARGIN_OF_RATES}.get(order, _MARGIN)
        range_ = margin * abs(scale) * _largest(x, order, rate, block_s) or model.signal(name).reach
        if name in turning:
            range_ = _HALF_TURN * _step_of(model.signal(name))
        source = Source.SAMPLED if order == -1 else sources.get(place, Source.SAMPLED)
        signal.append(RefineSignal(place, order, scale, range_, source))
    states, r = list(_states(made, run, rate)), r_of(made, p)
    if not states:
        raise PvidError(f"{model.name}: the run is too short for the second stage, or its samples are missing")
    if made.runge_kutta and model.refinement.equations:  # whose motion is not that of the weak form's windows
        block_s = min(block_s, _slow_s(made, r))
    rig = RefineRig(
        sample_rate=rate,
        slow_hz=2.0 / block_s,
        fast_hz=max(_fastest_hz(made, r, states), _LEAST / block_s),
        signal=tuple(signal),
        sample_sd=tuple(model.signal(name).sd for name in made.outputs),
        prior_sd=tuple(one.prior_sd for one in made.parameters),
        state_limit=_state_limit(made, run, rate),
    )
    rig = _with_steps(rig, made, _jumps(made, r, states), block_s)
    settings = refine_config(rig, model.following.forgetting_s, model.following.outlier_gate)
    if settings.width is not None:
        settings = replace(settings, width=np.maximum(settings.width, _least_widths(made, r, states)))
    if made.observer:
        settings = _with_observer(settings, made, r, states)
    return settings if model.refinement.equations else replace(settings, distance=0.0)


def _with_steps(rig: RefineRig, made: RefineFunctions, jumps: Sequence[float], block_s: float) -> RefineRig:
    """With what the steps of the motion depend on."""
    return replace(
        rig,
        runge_kutta=made.runge_kutta,
        ring=ring_of(made),
        fine_s=_fine_s(made, jumps, block_s),
        jumps=jumps,
        step_fine=_step_fine(made),
    )


def _input(made: RefineFunctions, jet: Jet) -> tuple[str, int, float]:
    """Sample, order (-1: its integral) and factor of an input."""
    model = made.model
    value = model.with_knowns(model.opaque.get(jet, jet))
    order = 0
    if len(integrals := value.atoms(Integral)) == 1:
        (integral,) = integrals
        inside, folds = integral.args
        if folds == 1 and sp.simplify(value / integral).is_number:
            value, order = sp.simplify(value / integral) * inside, -1
    found = [one for one in value.atoms(Jet) if one.order in (0, 2)]
    scale = sp.simplify(value / found[0]) if len(found) == 1 else None
    if scale is None or not scale.is_number or value.has(Integral) or (order and found[0].order):
        raise PvidError(
            f"{model.name} has the input {model.opaque.get(jet, jet)}; those of the refinement in C are samples, their "
            "second rates and their integrals"
        )
    return found[0].of, order or found[0].order, float(scale)


def _largest(x: Float, order: int, rate: float, block_s: float) -> float:
    """Absolute value of a signal of this order."""
    if order == -1:
        x = np.cumsum(np.nan_to_num(x)) / rate
    return float(np.nanmax(np.abs(_curvature(x, rate, block_s) if order == 2 else x)))


def _curvature(x: Float, rate: float, block_s: float) -> Float:
    """Second derivative of means of a four hundredth of a block: of what is twenty times as fast as the slowest motion
    a few per cent are missing."""
    step = max(1, round(block_s * rate / 400))
    mean = x[: len(x) // step * step].reshape(-1, step).mean(1)
    return np.asarray(np.diff(mean, 2) * (rate / step) ** 2)


def _fastest_hz(made: RefineFunctions, r: Float, states: Sequence[State]) -> float:
    """Of the motion, as an oscillation that needs as short a step: at most of the run's states.

    In the others a soft sign changes, or a large motion is at its fastest for a moment. (With a step for three quarters
    of the rotary pendulum's states hardly a block fits; with one for 85 % its estimates are 2 times the bound off.)
    """
    found = []
    for q, v in states:
        rates = np.linalg.eigvals(_slopes(made, r, q, v))
        if made.runge_kutta:
            found.append(np.abs(rates).max() / (2 * np.pi))
        else:
            found.append(max(np.abs(rates.imag).max() / (2 * np.pi), np.abs(rates.real).max() / _STILL / _A_PERIOD))
    return float(np.quantile(found, _WITH_SIGNS if signs_of(made.model) else _WITHOUT))


def _slow_s(made: RefineFunctions, r: Float) -> float:
    """Two periods of the slowest oscillation at rest; inf: there is none, or no derivative, as of an empty tank."""
    slopes = _slopes(made, r, *_at_rest(made))
    rates = np.abs(np.linalg.eigvals(slopes).imag) if np.isfinite(slopes).all() else np.zeros(1)
    return 4 * math.pi / float(rates[rates > 0].min()) if rates.any() else math.inf


def _at_rest(made: RefineFunctions) -> State:
    n = len(made.coordinates)
    return np.zeros(n, np.float32), np.zeros(n if made.order == 2 else 0, np.float32)


def r_of(made: RefineFunctions, p: npt.ArrayLike) -> Float:
    """r of parameters of the weak form."""
    given = np.asarray(p, float)
    return np.array([given[x.place] if x.place >= 0 else _SHARP if x.sign else 0.0 for x in made.parameters])


def _slopes(made: RefineFunctions, r: Float, q: Float32, v: Float32) -> Float:
    """Derivatives of the rates of all states by the states."""
    n = len(made.coordinates)
    found = _values_at(made, "jacobian", r, q, v)
    K = found["K"].reshape(n, n)
    if made.order == 1:
        return K
    D = found["D"].reshape(n, n) if "D" in found else np.zeros((n, n))
    return np.block([[np.zeros((n, n)), np.eye(n)], [K, D]])


def _values_at(made: RefineFunctions, name: str, r: Float, q: Float32, v: Float32) -> dict[str, Float]:
    """What a function writes without inputs; computed in float32, as in the core."""
    single = r.astype(np.float32)
    m = made.functions["constants"].values(r=single)["m"]
    found = made.functions[name].values(r=single, m=m, q=q, v=v, u=np.zeros(len(made.inputs), np.float32))
    return {key: one.astype(np.float64) for key, one in found.items()}


def _with_observer(settings: RefineConfig, made: RefineFunctions, r: Float, states: Sequence[State]) -> RefineConfig:
    """With the gain of the steady Kalman filter of the linearised motion, without its frictions, for the noise of the
    inputs' sensors; rows have the noise of its innovations.

    A row is the mean of the residuals over a big step: a reading in its middle.
    """
    model = made.model
    n, step = len(made.coordinates), BIG_STEP * settings.ratio / settings.sample_rate
    smooth = np.where([bool(one.sign) for one in made.parameters], _SOFT, r)
    slopes = np.mean([_slopes(made, smooth, q, v) for q, v in states], 0)
    by_u = np.mean([_values_at(made, "jacobian", smooth, q, v)["U"].reshape(n, -1) for q, v in states], 0)
    read = [_values_at(made, "output_jacobian", smooth, q, v)["Zq"] for q, v in states]
    reading = np.mean(read, 0).reshape(len(made.outputs), n)
    sd = np.array([model.signal(one.of).sd if is_measured(model, one) else 0.0 for one in made.inputs])
    density = (by_u * sd**2) @ by_u.T / settings.sample_rate
    over, noise = _transition(slopes, density, step / 2)
    rows = np.diag(np.asarray(settings.sd, float) ** 2)
    p = np.zeros((n, n))
    for _ in range(_RICCATI):
        p = over @ p @ over.T + noise
        innovation = reading @ p @ reading.T + rows
        gain = p @ reading.T @ np.linalg.inv(innovation)
        p = over @ (p - gain @ reading @ p) @ over.T + noise
    white = np.sqrt(np.diag(innovation))
    observer = (over @ gain * white / white[0]).T
    return replace(settings, sd=white.astype(np.float32), observer=observer.ravel().astype(np.float32))


def _transition(slopes: Float, density: Float, step: float) -> tuple[Float, Float]:
    """What the states become over a step, and the covariance that white noise of this density adds (van Loan)."""
    from scipy.linalg import expm  # here: it takes a tenth of a second

    n = len(slopes)
    block = np.block([[-slopes, density], [np.zeros((n, n)), slopes.T]]) * step
    whole = expm(block)
    over = whole[n:, n:].T
    return over, np.asarray(over @ whole[:n, n:])


def _jumps(made: RefineFunctions, r: Float, states: Sequence[State]) -> tuple[float, ...]:
    """By how much the rate of each sign's argument jumps at its reversal, for the signs whose widths are refined; a
    friction that starts at 0 is as large there as it may be."""
    r = np.where(
        [one.place < 0 and not one.sign for one in made.parameters], [one.prior_sd for one in made.parameters], r
    )
    arguments = {str(one): made.model.with_knowns(one) for one in signs_of(made.model)}

    def jump(place: int, state: State) -> float:
        still, reach = _reversal(made, arguments[made.parameters[place].sign], state[0])
        sharp, soft = r.copy(), r.copy()
        sharp[place], soft[place] = max(_SHARP, _ROUNDED * reach), _SOFT
        change = _slopes(made, sharp, still, state[1]) - _slopes(made, soft, still, state[1])  # of rank 1
        return 2 * float(sharp[place]) * abs(float(np.trace(change)))

    found = []
    for place in (k for k, one in enumerate(made.parameters) if one.sign):
        own = jump(place, states[len(states) // 2])
        found.append(own or max(jump(place, one) for one in states))  # the friction of a load that is lifted there
    return tuple(found)


def _reversal(made: RefineFunctions, argument: sp.Expr, q: Float32) -> tuple[Float32, float]:
    """The nearest state at which a sign's argument is 0, without inputs, and the largest coordinate in the argument
    there: all rates are 0, or those of a moving belt."""
    names = [Jet(name) for name in made.coordinates]
    used = np.array([one in {Jet(str(jet)) for jet in jets(argument)} for one in names])
    still = np.where(used | [name.endswith("_1") for name in made.coordinates], 0.0, q).astype(np.float64)
    symbols = [sp.Symbol(str(one), real=True) for one in names]
    own = {one: sp.Symbol(str(one), real=True) for one in argument.free_symbols}
    whole = argument.xreplace(own)
    whole = whole.xreplace(dict.fromkeys(whole.free_symbols - set(symbols), sp.Integer(0)))
    value = numpy_function(symbols, [whole, *(sp.diff(whole, one) for one in symbols)])
    for _ in range(_NEWTON):
        at, *slope = map(float, value(*still))
        if at != 0 and any(slope):
            still -= at * np.array(slope) / np.dot(slope, slope)
    return still.astype(np.float32), float(np.abs(still[used]).max(initial=0.0))


def _least_widths(made: RefineFunctions, r: Float, states: Sequence[State]) -> Float32:
    """Widths of signs below which float32 does not compute them at the largest argument of the run."""
    largest = np.max([np.abs(_values_at(made, "signs", r, q, v)["g"]) for q, v in states], axis=0)
    names = [str(one) for one in signs_of(made.model)]
    widths = [float(largest[names.index(one.sign)]) for one in made.parameters if one.sign]
    return np.maximum(_LEAST_WIDTH * np.array(widths), _LEAST_OF_CORE).astype(np.float32)


def _step_fine(made: RefineFunctions) -> float | None:
    """Limit of a block's last step behind the second block, with signs.

    Where hidden coordinates begin anew in each block, few blocks have a finer one: with it a pendulum with dry friction
    is published half as long, with larger errors.
    """
    if not signs_of(made.model):
        return None
    return _STEP_FREE if made.hidden and not made.observer else _STEP_FINE


def _fine_s(made: RefineFunctions, jumps: Sequence[float], block_s: float) -> float:
    """Longest step at the reversal of a friction: an error of its part of the jump, kept for half a block, is small
    beside the noise of a sample."""
    sd = {name: made.model.signal(name).sd for name in made.outputs}
    allowed = {Jet(name): one for name, one in sd.items()}  # of a measured speed
    allowed |= {Jet(name, 1): one / (block_s / 2) for name, one in sd.items()}
    least = min(sd.values()) / (block_s / 2)
    arguments = {str(one): one for one in signs_of(made.model)}
    signs = [arguments[one.sign] for one in made.parameters if one.sign]
    longest = [
        _REVERSAL * min(allowed.get(jet, least) for jet in jets(argument)) / jump
        for argument, jump in zip(signs, jumps, strict=True)
        if jump > 0
    ]
    return min(longest, default=math.inf)


def _values(made: RefineFunctions, run: Mapping[str, npt.ArrayLike], rate: float) -> dict[str, Float]:
    """What the sensors of the run measure and its rates, name_1, at some of the samples."""
    n = len(next(iter(run.values())))  # type: ignore[arg-type]
    step = max(n // _STATES, 1)
    at, half = np.arange(step, n - step, step), max(step // 8, 1)
    found = {}
    for name in made.outputs:
        x = np.asarray(run[name], float)
        found[name], found[f"{name}_1"] = x[at], (x[at + half] - x[at - half]) * rate / (2 * half)
    return found


def _states(made: RefineFunctions, run: Mapping[str, npt.ArrayLike], rate: float) -> Iterator[State]:
    """q and v of the run; what is not measured is 0."""
    values = _values(made, run, rate)
    none = np.zeros(len(values[made.outputs[0]]))
    q = np.array([values.get(name, none) for name in made.coordinates], np.float32)
    v = np.array([values.get(f"{name}_1", none) for name in made.coordinates], np.float32)
    for k in range(len(none)):
        if np.isfinite(q[:, k]).all() and np.isfinite(v[:, k]).all():
            yield q[:, k], v[:, k] if made.order == 2 else v[:0, k]


def _state_limit(made: RefineFunctions, run: Mapping[str, npt.ArrayLike], rate: float) -> tuple[float, ...]:
    """Twenty times the largest measured coordinate and rate; of a hidden one as of the largest."""
    most_of = {name: float(np.nanmax(np.abs(np.asarray(run[name], float)))) for name in made.outputs}
    largest = {name: one or made.model.signal(name).reach for name, one in most_of.items()}
    most = max(largest.values())
    if made.order == 2:
        places = [20.0 * largest.get(name, most) for name in made.coordinates]
        return (*places, *(one * rate for one in places))
    turns = [name for name, one in zip(made.outputs, made.turning, strict=True) if one]
    turn = max((2 * _HALF_TURN * _step_of(made.model.signal(name)) for name in turns), default=0.0)
    rates = {f"{name}_1": one * rate for name, one in largest.items()}
    hidden = {name: most * rate if name.endswith("_1") else max(most, turn) for name in made.coordinates}
    limits = {**hidden, **rates, **largest, **{name: max(largest[name], turn) for name in turns}}
    return tuple(20.0 * limits[name] for name in made.coordinates)


def _step_of(signal: Signal) -> float:
    """Resolution of a sensor."""
    return signal.resolution or signal.sd
