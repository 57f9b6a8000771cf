"""Settings of the refinement in float32 behind the weak engine, of any mechanism that it takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.codegen import files_refine
from pvid.codegen.build import Options, refine_functions
from pvid.codegen.refine import RefineFunctions, signs_of
from pvid.codegen.refine_twin import GeneratedRefine
from pvid.codegen.weak_twin import weak_model_of
from pvid.design.refine import refine_config
from pvid.model.compiled import CompiledModel
from pvid.model.signals import Jet
from pvid.models.registry import DEFAULT
from pvid.run.engine_design import Run, simulated_run_of
from pvid.settings.refine import RefineConfig, RefineRig, RefineSignal
from pvid.settings.weak import Source, WeakConfig
from pvid.sim.pendulum import simulate, standard_sensors

Float = npt.NDArray[np.float64]

_STILL = 0.04  # h |lambda| up to which Adams-Bashforth is stable for a decay
_LEAST = 4.0  # periods of the fastest motion in a block
_STATES = 40  # of the run that are looked at
_WITH_SIGNS, _WITHOUT = 0.75, 0.95  # part of them for which the step is short enough
_A_PERIOD = 48.0  # steps in a period
_MARGIN = 1.5  # ranges over what the run has of them


def refine_design(
    compiled: CompiledModel,
    config: WeakConfig,
    run: Mapping[str, npt.ArrayLike],
    p: npt.ArrayLike | None = None,
    soft_signs: Mapping[str, float] | None = None,
) -> RefineConfig:
    """Settings of the refinement for a rig, behind its weak form.

    Parameters
    ----------
    config : of the weak form
    run : of the rig: name of each signal -> samples
    p : parameters near those of the rig; None: those that the weak form starts at
    soft_signs : argument of a sign -> width of the soft sign in its place

    Raises
    ------
    PvidError
        Where the refinement in C does not have what the model needs: the reason in a sentence.
    """
    widths = dict(soft_signs or {})
    made = refine_functions(compiled, Options(soft_signs=widths))
    files_refine.check_outputs(made)
    sharp = [str(one) for one in signs_of(made.model) if str(one) not in widths]
    if sharp:
        raise PvidError(
            f"{compiled.name} has a sharp friction, sgn({sharp[0]}), within whose reversal the refinement in C makes "
            f"too few steps: `model build --soft-sign {sharp[0]}=WIDTH` makes it a soft one"
        )
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


def full_motion_of(compiled: CompiledModel) -> Run:
    """A run of the shipped rig of a mechanism with the equations of its refinement: of the pendulum the full ones, the
    other mechanisms have no others."""
    return full_pendulum() if compiled.name == DEFAULT else simulated_run_of(compiled)[0]


def full_pendulum(duration: float = 40.0) -> dict[str, Float]:
    """The standard rig with its full equations and an encoder of 14 bits: name of each signal -> samples."""
    found = simulate(sensors=standard_sensors(14), truth="full", duration=duration, seed=1).run
    return {"phi": found.phi, "y": found.y}


def refine_settings(
    made: RefineFunctions, run: Mapping[str, npt.ArrayLike], rate: float, p: npt.ArrayLike, block_s: float
) -> RefineConfig:
    """From a run of the rig.

    Parameters
    ----------
    run : name of each signal -> samples
    rate : [Hz]
    p : parameters near those of the rig, as the weak form has them
    block_s : length of a block: about two periods of the slowest motion

    Raises
    ------
    PvidError
        Where the refinement in C does not have an input of the model, or samples are too slow for the motion.
    """
    model = made.model
    engine = weak_model_of(model)
    names, sources = engine.sample_names, {one.sample: one.source for one in engine.signal if one.source is Source.HELD}
    inputs = [_input(made, jet) for jet in made.inputs]
    samples = [*inputs, *((name, 0, 1.0) for name in made.outputs)]
    signal = []
    for name, order, scale in samples:
        if name not in names:
            raise PvidError(f"{model.name}: its input {name} is no sample")
        x = np.asarray(run[name], float)
        largest = np.nanmax(np.abs(x)) if order == 0 else np.nanmax(np.abs(_curvature(x, rate, block_s)))
        place = names.index(name)
        range_ = _MARGIN * float(abs(scale) * largest)
        signal.append(RefineSignal(place, order, scale, range_, sources.get(place, Source.SAMPLED)))
    rig = RefineRig(
        sample_rate=rate,
        slow_hz=2.0 / block_s,
        fast_hz=max(fastest_hz(made, p, run, rate), _LEAST / block_s),
        signal=tuple(signal),
        sample_sd=tuple(model.signal(name).sd for name in made.outputs),
        prior_sd=tuple(one.prior_sd for one in made.parameters),
        gain_sd=(0.0,) * len(made.parameters),
        state_limit=_state_limit(made, run, rate),
    )
    settings = refine_config(rig, model.following.forgetting_s, model.following.outlier_gate)
    return settings if model.refinement.equations else replace(settings, distance=0.0)


def _input(made: RefineFunctions, jet: Jet) -> tuple[str, int, float]:
    """Sample, order of the derivative and factor of an input."""
    model = made.model
    value = model.with_knowns(model.opaque.get(jet, jet))
    found = [one for one in value.atoms(Jet) if one.order in (0, 2)]
    scale = sp.simplify(value / found[0]) if len(found) == 1 else None
    if scale is None or not scale.is_number:
        raise PvidError(
            f"{model.name} has the input {value}; those of the refinement in C are samples and their second rates"
        )
    return found[0].of, found[0].order, float(scale)


def _curvature(x: Float, rate: float, block_s: float) -> Float:
    """Second derivative of means of a hundredth of a block."""
    step = max(1, round(block_s * rate / 100))
    mean = x[: len(x) // step * step].reshape(-1, step).mean(1)
    return np.asarray(np.diff(mean, 2) * (rate / step) ** 2)


def fastest_hz(made: RefineFunctions, p: npt.ArrayLike, run: Mapping[str, npt.ArrayLike], rate: float) -> float:
    """Of the motion, as an oscillation that needs as short a step: at most of the run's states.

    In the others a soft sign changes, or a large motion is at its fastest for a moment. (With a step for three quarters
    of the rotary pendulum's states hardly a block fits; with one for 85 % its estimates are 2 times the bound off.)
    """
    model, n = GeneratedRefine(made), len(made.coordinates)
    m = model.constants(model.from_p(np.asarray(p, np.float32)))
    u = np.zeros(len(made.inputs), np.float32)
    found = []
    for q, v in _states(made, run, rate):
        slopes = model.jacobian(m, q, v, u)
        K = np.asarray(slopes.K, float)
        if made.order == 2:
            K = np.block([[np.zeros((n, n)), np.eye(n)], [K, np.asarray(slopes.D, float)]])
        rates = np.linalg.eigvals(K)
        found.append(max(np.abs(rates.imag).max() / (2 * np.pi), np.abs(rates.real).max() / _STILL / _A_PERIOD))
    return float(np.quantile(found, _WITH_SIGNS if signs_of(made.model) else _WITHOUT))


def _states(
    made: RefineFunctions, run: Mapping[str, npt.ArrayLike], rate: float
) -> Iterator[tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]]:
    """q and v of the run; what is not measured is 0."""
    n = len(next(iter(run.values())))  # type: ignore[arg-type]
    step = max(n // _STATES, 1)
    measured = {name: np.asarray(run[name], float) for name in made.outputs}
    at = np.arange(step, n - step, step)
    none = np.zeros(len(at))
    q = np.array([measured[name][at] if name in measured else none for name in made.coordinates], np.float32)
    half = max(step // 8, 1)
    slope = {name: (x[at + half] - x[at - half]) * rate / (2 * half) for name, x in measured.items()}
    v = np.array([slope.get(name, none) for name in made.coordinates], np.float32)
    for k in range(len(at)):
        if np.isfinite(q[:, k]).all() and np.isfinite(v[:, k]).all():
            yield q[:, k], v[:, k] if made.order == 2 else v[:0, k]


def _state_limit(made: RefineFunctions, run: Mapping[str, npt.ArrayLike], rate: float) -> tuple[float, ...]:
    """Twenty times the largest measured coordinate and rate; of a hidden one as of the largest."""
    largest = {name: float(np.nanmax(np.abs(np.asarray(run[name], float)))) for name in made.outputs}
    most = max(largest.values())
    places = [20.0 * largest.get(name, most) for name in made.coordinates]
    return tuple(places) if made.order == 1 else (*places, *(one * rate for one in places))
