"""Settings of the fixed-point weak identifier for a rig: formats of its rows from those of a run, start and bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypedDict

import numpy as np

from pvid.base.errors import PvidError
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.parameters import Parameters
from pvid.oracle.weak.rows import EquationError, WeakRows
from pvid.settings.parts import GateConfig
from pvid.settings.q31 import EstimatorConfigQ31, GateConfigQ31
from pvid.settings.weak import WeakDesign32
from pvid.settings.weak_q31 import WeakConfigQ31, WeakDesignQ31

PATIENCE_MAX = 2**30  # groups of rows, of gate_q31.h
FORGETTING_MIN, FORGETTING_MAX = 4, 2**24  # likewise, of estimator_q31.h
_NOISE_MARGIN = 16  # as in float32
_ROW_BITS = 28  # of an entry of a row
_MARGIN_BITS = 3  # that the entries of a run leave free
_MOST_Y_BITS = 12
_LEAST_Y_BITS = 0  # a row's noise is one standard deviation: rounding by one of them is too much
_MEAN_BITS = 24  # of the mean of a column in standard deviations: its block of 26 bits then rounds to a quarter of one


def row_formats(rows: WeakRows, p: Float, errors: Sequence[EquationError] | None = None) -> tuple[tuple[int, ...], int]:
    """n_bits of all kinds and y_bits, from the white rows of a run at p.

    Raises PvidError where rows are so large beside their noise that fixed point has no digit for it.

    Parameters
    ----------
    errors : of the equations themselves, of each kind; None by default
    """
    theta = rows.compiled.parameters.theta(p)
    found = list(errors or [EquationError()] * rows.kinds)
    n_bits: list[int] = []
    largest = 1.0
    for kind in range(rows.kinds):
        white = rows.white((kind,), theta, found)
        entries = np.abs(white.regressors).max(axis=(0, 2))
        terms = entries * np.abs(theta[kind])
        largest = max(largest, float(np.abs(white.known).max()), float(terms.max()))
        n_bits += [bits_of_row(float(one)) for one in entries]
    y_bits = min(bits_of_row(largest), _MOST_Y_BITS)
    if y_bits < _LEAST_Y_BITS:
        raise PvidError(
            f"{rows.compiled.model.name}: the residual Y - N theta is {largest:.3g} of its standard deviations large,"
            " too much for the rows of the fixed-point core"
        )
    return tuple(n_bits), y_bits


def with_noisy_means(sizes: WeakDesign32, rows: WeakRows, p: Float) -> WeakDesign32:
    """With an error of each equation that is large enough for the block of a column in fixed point.

    Where only derivatives of a row have noise, as in J x'' + b x' = u, its mean (h = 0) has none. The weight of the
    mean of u would be so large that the entries of the other harmonics lose their digits beside it.
    """
    theta = rows.compiled.parameters.theta(p)
    means = np.abs([one[:, 0] for one in rows.record.sums(rows.functions)])
    variance = sizes.error_variance.copy()
    for kind, plan in enumerate(rows.compiled.channels.rows):
        own = np.append(theta[kind], -1.0)
        largest = max(
            (
                abs(one.factor * own[one.column]) * float(np.nanmax(means[one.channel]))
                for one in plan.terms
                if not one.order and one.column < len(own)
            ),
            default=0.0,
        )
        least = (largest / 2.0**_MEAN_BITS) ** 2 / (2 * sizes.hop)
        known = sum(
            float(one.factor) * own[one.a] * own[one.b] for one in sizes.noise if one.kind == kind and not one.power
        )
        if not sizes.error_order[kind]:
            variance[kind] = max(variance[kind], np.float32(least - known))
    return replace(sizes, error_variance=variance)


def bits_of_row(largest: float) -> int:
    """The format of an entry of a row that is this large in a run: three bits are left free."""
    return max(min(_ROW_BITS - _MARGIN_BITS - math.frexp(largest)[1], 64), -64) if largest > 0 else 0


def config_of_q31(
    design: WeakDesignQ31,
    parameters: Parameters,
    formats: tuple[Sequence[int], int],
    p_bits: Sequence[int],
    offset: Sequence[int],
    sample_rate: float,
    start: Float | None = None,
    overlap: float = 1.0,
) -> WeakConfigQ31:
    """Settings ready for the identifier: the guesses, their standard deviations and bounds.

    Parameters
    ----------
    formats : as of row_formats
    overlap : inflation of variances because windows share samples, as in float32
    """
    following = parameters.model.following
    windows_hz = sample_rate / (design.hop * design.decimation)
    n_bits, y_bits = formats
    return WeakConfigQ31(
        design=design,
        estimator=EstimatorConfigQ31(
            **start_q31(parameters, p_bits, start),
            n_bits=tuple(n_bits),
            y_bits=y_bits,
            row_sd=2 ** (8 + y_bits),
            correlation=max(round(overlap * 2**16), 2**16),
            noise_margin=_NOISE_MARGIN << 16,
            forgetting_groups=forgetting_groups_q31(following.forgetting_s, windows_hz),
            dead_zone=round(following.dead_zone * 2**16),
        ),
        offset=tuple(offset),
        gate=gate_config_q31(GateConfig(following.outlier_gate, following.patience_s(1 / windows_hz)), windows_hz),
    )


class StartQ31(TypedDict):
    """Of an estimator, in the formats p_bits."""

    start: tuple[int, ...]
    start_sd: tuple[int, ...]
    lower: tuple[int, ...]
    upper: tuple[int, ...]
    p_bits: tuple[int, ...]


def start_q31(parameters: Parameters, p_bits: Sequence[int], start: Float | None = None) -> StartQ31:
    """The guesses, or `start`, their standard deviations and bounds."""
    p = parameters.checked(start)
    unknowns = parameters.model.unknowns
    start_sd = np.abs(parameters.unit(p)) / np.sqrt(parameters.prior(p))
    lower = [min(one.low, value) for one, value in zip(unknowns, p, strict=True)]
    upper = [max(one.high, value) for one, value in zip(unknowns, p, strict=True)]

    def whole(values: Sequence[float] | Float, least: int = -(2**31)) -> tuple[int, ...]:
        return tuple(
            max(min(round(float(x) * 2.0**bits), 2**31 - 1), least) for x, bits in zip(values, p_bits, strict=True)
        )

    positive = [1 if one.positive else -(2**31) for one in unknowns]
    low = tuple(max(x, least) for x, least in zip(whole(lower), positive, strict=True))
    return {
        "start": tuple(max(x, y) for x, y in zip(whole(p), low, strict=True)),
        "start_sd": whole(start_sd, 1),
        "lower": low,
        "upper": whole(upper),
        "p_bits": tuple(p_bits),
    }


def forgetting_groups_q31(forgetting_s: float, groups_hz: float) -> int:
    """The time constant of forgetting in rows or windows, which come at groups_hz; 0: none."""
    groups = round(forgetting_s * groups_hz)
    if forgetting_s > 0 and not FORGETTING_MIN <= groups <= FORGETTING_MAX:
        wrong = "short" if groups < FORGETTING_MIN else "long"
        raise PvidError(
            f"[identifier] forgetting_s = {forgetting_s:g} is too {wrong} for core q31, which forgets within 4 to 2^24 "
            f"rows or windows ({FORGETTING_MIN / groups_hz:.4g} to {FORGETTING_MAX / groups_hz:.4g} s here); 0: never"
        )
    return groups


def gate_config_q31(gate: GateConfig, groups_hz: float) -> GateConfigQ31:
    """The gate of the float core in integers, for rows or windows that come at groups_hz."""
    patience = gate.patience_s * groups_hz
    if patience > PATIENCE_MAX:
        raise PvidError(
            f"[identifier] outlier_patience_s = {gate.patience_s:g} is too long for core q31, which counts up to 2^30 "
            f"rows or windows ({PATIENCE_MAX / groups_hz:.4g} s here); 0: never"
        )
    return GateConfigQ31(round(gate.sigmas * 2**16), max(round(patience), 1) if patience > 0 else 0)
