"""The strong form of a described mechanism in fixed point: counts, formats and settings from a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.strong import StrongFunctions
from pvid.codegen.strong_q31 import FixedStrong, FixedStrongEngine, fixed_strong
from pvid.configuration.strong import StrongDesign, strong_design
from pvid.configuration.weak_q31 import FULL_SCALE, HIGHEST_JET, finer, lsb_of
from pvid.design.bank_q31 import FULL_SCALE_LIMIT, HELD_MOST, HELD_UNITS, BankQ31, integer_bank
from pvid.design.fir import FirBank, savitzky_golay
from pvid.design.rescale_q31 import rescale_to
from pvid.model.compiled import CompiledModel
from pvid.oracle.strong_described import StrongModel, StrongRows, StrongSettings, residuals
from pvid.oracle.weak.front import of_hold
from pvid.oracle.weak.functions import Float
from pvid.rig.run import Recording
from pvid.settings.enums import Law
from pvid.settings.parts import EstimatorConfigQ31
from pvid.settings.strong import StrongModelConfigQ31
from pvid.settings.weak_q31 import Rescale
from pvid.setup.weak_q31 import bits_of_row, start_q31

_MOST_Y_BITS = 12
_LARGEST_BITS = 25  # of the largest term of a row over its noise, at most: smaller noise is set to that
_VALUE_BITS = 30  # of an entry as the rows' function returns it
_DIGITS = 8  # bits of the largest entry that its rounding leaves, at least
_GAIN_ONE = 1 << 30


@dataclass(frozen=True, eq=False)
class StrongDesignQ31:
    """What a recording is identified with in fixed point.

    Attributes
    ----------
    base : window and fit, as float32 has them
    engine : functions, formats and settings
    counts : of the recording, int32 [ticks, signals]
    """

    base: StrongDesign
    engine: FixedStrongEngine
    counts: npt.NDArray[np.int32]


def strong_design_to_identify(model: CompiledModel, recording: Recording, law: Law = Law.STATIONARY) -> StrongDesignQ31:
    """Formats and settings for a recording without missing samples, with the window that float32 gets; raises as
    fixed_design."""
    return fixed_design(model, recording, strong_design(model, recording, law), between_counts=True)


def fixed_design(
    model: CompiledModel, recording: Recording, base: StrongDesign, *, between_counts: bool = False
) -> StrongDesignQ31:
    """What a design of the recording is in fixed point.

    Parameters
    ----------
    between_counts : as of pvid.configuration.weak_q31.fixed_engine

    Raises
    ------
    PvidError
        Where fixed point does not have what the model needs.
    """
    strong, fitted = base.strong, base.fitted
    bank = savitzky_golay(fitted.taps, fitted.degree)
    raw = _signals(strong, recording)
    lsb, full_scale = _counting(model, strong, recording.signals, between_counts)
    values = _inputs(strong, raw, bank, recording.sample_rate)
    reaches = [HIGHEST_JET * float(np.max(np.abs(one))) or 1.0 for one in values]
    oracle = StrongModel(model)
    parameters = oracle.parameters
    bounds = [
        (min(one.low, x), max(one.high, x))
        for one, x in zip(parameters.model.unknowns, parameters.checked(None), strict=True)
    ]
    made = fixed_strong(strong, reaches, bounds)
    rows = oracle.rows(recording.signals, recording.sample_rate, StrongSettings(fitted.taps, fitted.degree, 1))
    units = _units(made, oracle, rows, fitted.p)
    n_bits, y_bits = _formats(oracle, rows, fitted.p, units)
    whole = integer_bank(bank, max(full_scale) * (HELD_MOST if any(strong.held) else 1))
    literally = base.config.estimator.law is Law.PSEUDOVELOCITY
    config = StrongModelConfigQ31(
        sample_rate=recording.sample_rate,
        weights=whole.weights,
        stride=bank.stride,
        centre=whole.centre,
        full_scale=full_scale,
        offset=(0,) * len(full_scale),
        input=_rescaled_inputs(made, whole, lsb, recording.sample_rate),
        entry=_rescaled_entries(made, units, n_bits, y_bits),
        rows_per_second=max(round(recording.sample_rate), 1),
        estimator=EstimatorConfigQ31(
            **start_q31(parameters, made.parameters.p_bits),
            n_bits=n_bits,
            y_bits=y_bits,
            row_sd=2 ** (8 + y_bits),
            gain=0 if literally else _GAIN_ONE,
            correlation=round(base.config.estimator.correlation * 2**16),
            divider=base.config.estimator.divider,
        ),
    )
    engine = FixedStrongEngine(made, config, lsb)
    return StrongDesignQ31(base, engine, _counts(strong, recording.signals, lsb))


def _signals(strong: StrongFunctions, recording: Recording) -> list[Float]:
    """Samples of each signal, of a held one its mean about the instant."""
    samples = [np.asarray(recording.signals[one.name], np.float64) for one in strong.signals]
    return [of_hold(x) if held else x for x, held in zip(samples, strong.held, strict=True)]


def _counting(
    model: CompiledModel, strong: StrongFunctions, run: Mapping[str, npt.ArrayLike], between_counts: bool
) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """Value of a count and full scale of each signal."""
    lsb = lsb_of(model, [one.name for one in strong.signals])
    tops = [max(FULL_SCALE * one.reach, float(np.max(np.abs(np.asarray(run[one.name]))))) for one in strong.signals]
    if between_counts:
        lsb = tuple(
            finer(step, run[one.name], FULL_SCALE_LIMIT / (top / step))
            for one, step, top in zip(strong.signals, lsb, tops, strict=True)
        )
    return lsb, tuple(max(round(min(top / step, FULL_SCALE_LIMIT)), 16) for step, top in zip(lsb, tops, strict=True))


def _counts(strong: StrongFunctions, run: Mapping[str, npt.ArrayLike], lsb: Sequence[float]) -> npt.NDArray[np.int32]:
    """The readings of every tick [ticks, signals]."""
    columns = [
        np.rint(np.asarray(run[one.name], np.float64) / step) for one, step in zip(strong.signals, lsb, strict=True)
    ]
    most = float(np.iinfo(np.int32).max)
    return np.asarray(np.clip(np.stack(columns, axis=1), -most, most), np.int32)


def _inputs(strong: StrongFunctions, raw: Sequence[Float], bank: FirBank, sample_rate: float) -> list[Float]:
    """Each input of the rows [instants]; those that are integrals are 0."""
    derivatives = [bank.apply(x, sample_rate) for x in raw]
    return [derivatives[one.channel][one.order] if one.channel < len(raw) else np.zeros(1) for one in strong.sources]


def _units(made: FixedStrong, oracle: StrongModel, rows: StrongRows, p: Float) -> tuple[float, ...]:
    """The standard deviation that each kind of row is counted in [unit of its Y]: of its noise and of its rounding.

    Raises
    ------
    PvidError
        Where the rounding leaves a kind no digits.
    """
    found = []
    parameters = oracle.parameters
    for kind, e, n, y, theta in zip(
        made.strong.functions.kinds,
        residuals(parameters, rows, p),
        rows.regressors,
        rows.known,
        parameters.theta(p),
        strict=True,
    ):
        terms = np.append(np.abs(n * theta).max(axis=0), np.abs(y).max())
        steps = 2.0 ** -np.array(made.row.result_bits[kind.columns.start : kind.known + 1], np.float64)
        rounding = float(np.linalg.norm(steps * np.append(theta, 1.0)))
        largest = float(terms.max())
        if rounding > largest * 2.0**-_DIGITS:
            raise PvidError(
                f"{oracle.model.name}: {kind.name} loses its digits in fixed point, beside larger values that are added"
            )
        found.append(max(float(np.std(e)), rounding, largest * 2.0**-_LARGEST_BITS))
    return tuple(found)


def _formats(oracle: StrongModel, rows: StrongRows, p: Float, units: Sequence[float]) -> tuple[tuple[int, ...], int]:
    """n_bits of all kinds and y_bits of rows in these units."""
    n_bits: list[int] = []
    largest = 1.0
    for n, y, theta, unit in zip(rows.regressors, rows.known, oracle.parameters.theta(p), units, strict=True):
        entries = np.abs(n).max(axis=0) / unit
        largest = max(largest, float(np.abs(y).max()) / unit, float((entries * np.abs(theta)).max()))
        n_bits += [bits_of_row(float(one)) for one in entries]
    return tuple(n_bits), min(bits_of_row(largest), _MOST_Y_BITS)


def _rescaled_inputs(made: FixedStrong, bank: BankQ31, lsb: Sequence[float], sample_rate: float) -> tuple[Rescale, ...]:
    found = []
    for given, one, reach, bits in zip(
        made.strong.functions.inputs, made.strong.sources, made.reaches, made.input_bits, strict=True
    ):
        unit = lsb[one.channel] * sample_rate**one.order / 2.0 ** bank.bits[one.order]
        unit /= HELD_UNITS if made.strong.held[one.channel] else 1
        found.append(rescale_to(2 * reach / unit, unit * 2.0**bits, given.meaning))
    return tuple(found)


def _rescaled_entries(
    made: FixedStrong, units: Sequence[float], n_bits: Sequence[int], y_bits: int
) -> tuple[Rescale, ...]:
    found = []
    for kind, unit in zip(made.strong.functions.kinds, units, strict=True):
        formats = [*n_bits[kind.theta.start : kind.theta.stop], y_bits]
        own = made.row.result_bits[kind.columns.start : kind.known + 1]
        found += [
            rescale_to(2.0**_VALUE_BITS, 2.0 ** (wanted - bits) / unit, f"a row of {kind.name}")
            for wanted, bits in zip(formats, own, strict=True)
        ]
    return tuple(found)
