"""Tables of the weak identifier for a rig, from a design of the float64 oracle and the rows of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Signal
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.errors import inflation
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.parameters import Parameters
from pvid.oracle.weak.rows import EquationError, WeakRows
from pvid.oracle.weak.solve import Fit
from pvid.settings.parts import EstimatorConfig, GateConfig, TrustConfig
from pvid.settings.weak import WeakConfig, WeakDesign32, WeakFilter, WeakModel, WeakNoise

HIGHEST_POWER = 8  # n of sin^n
LONGEST_HOP = 16384  # steps of half a window
_STEPS_OF_A_BLOCK = 8  # half a window is a whole number of blocks

# An entry whose share is below this part of the noise at every harmonic is left out.
_SHARE = 1e-6


# The information of a rig at rest is 0.1 to 1 times that of its sensors' noise. At a poor start that of a rig in motion
# is less than at the truth: with 16, one of 80 runs of the standard rig with 12 bits stays at its start.
_NOISE_MARGIN = 4.0

# Limits of the samples: times the largest value of a run; times the standard deviation of a sensor's noise.
_RANGE = 1.5
_STILL = 4.0
_RAN_DOWN = 1e-6  # of the low end of its range: a positive parameter that may be 0 starts no lower


def for_core(design: WeakDesign) -> WeakDesign:
    """The nearest design that the core has: half windows of whole blocks, block sums before a decimation, kinds of
    rows one by one, signs averaged.

    A soft sign stays one, and a decided one. The core does not locate reversals.
    """
    block = _STEPS_OF_A_BLOCK
    least = -(-2 * (design.highest + 1) // block) * block
    hop = max(round(design.hop / block) * block, least)
    found = replace(design, window_s=2 * hop * design.dt, joint=False, comb=design.decimation > 1)
    return replace(found, reversals="averaged") if design.reversals == "located" else found


def design_tables(
    model: WeakModel, rows: WeakRows, p: Float, errors: Sequence[EquationError] | None = None
) -> WeakDesign32:
    """The tables of a design.

    Parameters
    ----------
    model : of the mechanism that the rows are of
    rows : of a recorded or simulated run, with the design: their noise depends on the motion
    p : parameters near those of the rig [n_p]
    errors : of the equations themselves, of each kind; None by default
    """
    design = rows.record.grid.design
    _check(design, rows)
    found = list(errors or [EquationError()] * rows.kinds)
    return WeakDesign32(
        model=model,
        functions=design.functions,
        power=design.power,
        decimation=design.decimation,
        hop=design.hop,
        filter=tuple(_filter(design.weights(one.order)) for one in model.jet),
        compensator=tuple(_filter(design.step_weights(one.order)) for one in model.jet),
        circle=circle_of(design.hop),
        noise=tuple(entry for kind in range(rows.kinds) for entry in _noise(rows, kind, p)),
        error_order=np.array([one.order for one in found], np.uint8),
        error_variance=_as_float32([one.variance for one in found], "variance of the equations' own error"),
        sign_width=np.full(model.signs, design.soft if design.reversals == "soft" else 0.0, np.float32),
        overlap=float(np.float32(overlap_of(rows, p, found))),
        sign_doubt=_as_float32([one.limit for one in rows.record.signs])
        if design.reversals == "decided" and rows.record.signs
        else None,
    )


def circle_of(hop: int) -> npt.NDArray[np.float32]:
    """sin(pi j / hop), a turn and a quarter [5 hop / 2]: the cosine of a place is the sine a quarter turn behind it."""
    return _as_float32(np.sin(np.pi * np.arange(5 * hop // 2) / hop))


def _check(design: WeakDesign, rows: WeakRows) -> None:
    name = rows.compiled.model.name
    if design.hop % _STEPS_OF_A_BLOCK or design.joint or design.reversals == "located":
        raise PvidError(f"{name}: this design is none of the identifier's: see for_core")
    top = rows.compiled.channels.top
    if not top + 2 <= design.power <= HIGHEST_POWER:
        raise PvidError(
            f"{name}: a power of {design.power} for rows of order {top}: the core has at least 2 more than the order "
            f"and at most {HIGHEST_POWER}"
        )


def _filter(weights: Float) -> WeakFilter:
    return WeakFilter(_as_float32(weights[len(weights) // 2 + 1 :]))


def _noise(rows: WeakRows, kind: int, p: Float) -> list[WeakNoise]:
    """Entries that matter at some harmonic at p."""
    theta = np.append(rows.compiled.parameters.theta(p)[kind], -1.0)
    _refuse_beyond_float32(theta, "coefficient")
    count = len(theta)
    shares = rows.noise.of_harmonics(kind)[:, :count, :count]
    rates = rows.functions.rates[rows.functions.highest :] ** 2
    powers = rates[np.newaxis, :] ** np.arange(len(shares))[:, np.newaxis]
    sized = np.abs(shares * np.outer(theta, theta))
    whole = np.einsum("jab,jh->h", shares * np.outer(theta, theta), powers)
    entries = []
    for a in range(count):
        for b in range(a, count):
            for power in range(len(shares)):
                factor = float(shares[power, a, b]) * (1 if a == b else 2)
                share = 2 * sized[power, a, b] * powers[power]
                if factor and np.any(share > _SHARE * whole):
                    entries.append(WeakNoise(kind, power, a, b, np.float32(factor)))
    return entries


def overlap_of(rows: WeakRows, p: Float, errors: Sequence[EquationError]) -> float:
    """Inflation of variances because windows that overlap by half share noise, measured with the motion of a run."""
    theta = rows.compiled.parameters.theta(p)
    white = [rows.white((kind,), theta, errors) for kind in range(rows.kinds)]
    return inflation(Fit(p, rows, white, list(errors), p, True))


def config_of(
    design: WeakDesign32,
    sample_rate: float,
    parameters: Parameters,
    start: Float | None = None,
    run: Mapping[str, npt.ArrayLike] | None = None,
) -> WeakConfig:
    """Settings ready for the identifier: the guesses, their standard deviations and bounds, defaults of trust and gate.

    Parameters
    ----------
    start : of p; None: the guesses
    run : name of each signal -> samples [n], from which limits of the samples follow; None: there are none
    """
    unknowns = parameters.model.unknowns
    least = np.array([_RAN_DOWN * one.low if one.positive else -np.inf for one in unknowns])
    p = np.maximum(parameters.checked(start), least)
    # The prior of the oracle, in units of p.
    unit = parameters.unit(p)
    start_sd = np.abs(unit) / np.sqrt(parameters.prior(p))
    anchored = [one in parameters.model.anchors for one in parameters.model.p]
    start_sd = np.where(anchored, parameters.sd, start_sd)  # the size of a step: what is known is model.h's
    following = parameters.model.following
    hop_s = design.hop * design.decimation / sample_rate
    return WeakConfig(
        sample_rate=sample_rate,
        design=design,
        estimator=EstimatorConfig(
            start=_as_float32(p, "start"),
            start_sd=_as_float32(start_sd, "standard deviation of the start"),
            lower=_as_float32(_within_float32([min(one.low, x) for one, x in zip(unknowns, p, strict=True)])),
            upper=_as_float32(_within_float32([max(one.high, x) for one, x in zip(unknowns, p, strict=True)])),
            row_sd=1.0,
            forgetting_s=following.forgetting_s,
            noise_margin=_NOISE_MARGIN,
            dead_zone=following.dead_zone,
        ),
        range=None if run is None else _as_float32(_ranges(design.model, parameters.model, run), "range of a sample"),
        drive_min=None if run is None else drive_min_of(design, parameters.model),
        trust=TrustConfig(),
        gate=GateConfig(following.outlier_gate, following.patience_s(hop_s)),
    )


def _ranges(model: WeakModel, compiled: CompiledModel, run: Mapping[str, npt.ArrayLike]) -> list[float]:
    """Largest absolute value of each sample that is no fault: the reach of its signal, or more where the run has it."""
    return [
        max(compiled.signal(name).reach, _RANGE * float(np.nanmax(np.abs(np.asarray(run[name], np.float64)))))
        for name in model.sample_names
    ]


def drive_min_of(design: WeakDesign32, compiled: CompiledModel) -> npt.NDArray[np.float32] | None:
    """Standard deviation in half a window below which a sample stands still, one each; 0: it may.

    Of a sensor of the mechanism its resolution: it is stuck, unplugged, or the mechanism rests. Of a measured drive,
    which the run may hold, more than its noise where the rows need its derivatives.
    """
    model = design.model
    derived = {model.signal[one.signal].sample for one in model.jet if one.order}
    least = [_still(compiled.signal(name), place in derived) for place, name in enumerate(model.sample_names)]
    return _as_float32(least) if any(least) else None


def _still(signal: Signal, derived: bool) -> float:
    if signal.kind == "input":
        return 0.0
    if signal.driven:
        return _STILL * signal.sd if derived else 0.0
    return signal.resolution


def _within_float32(bounds: list[float]) -> Float:
    """Bounds of which finite ones stay finite in float32."""
    given, most = np.array(bounds), float(np.finfo(np.float32).max)
    return np.where(np.isfinite(given), np.clip(given, -most, most), given)


def _refuse_beyond_float32(values: Float, what: str) -> None:
    """PvidError where a finite value is infinite in float32: of `what`, in the singular."""
    beyond = values[np.isfinite(values) & (np.abs(values) > np.finfo(np.float32).max)]
    if beyond.size:
        raise PvidError(f"a {what} of {beyond[0]:.2g} is beyond float32: the equations do not fit the run")


def _as_float32(values: object, what: str = "setting") -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """Read-only; refused as by _refuse_beyond_float32."""
    given = np.asarray(values, np.float64)
    _refuse_beyond_float32(given, what)
    out = np.ascontiguousarray(given, np.float32)
    out.setflags(write=False)
    return out
