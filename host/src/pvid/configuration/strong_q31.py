"""The strong form of a described mechanism in fixed point: counts, formats and settings from a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.strong import StrongFunctions
from pvid.codegen.strong_q31 import FixedStrong, StrongQ31, fixed_strong
from pvid.configuration.strong import StrongDesign, strong_design
from pvid.configuration.weak_formats_q31 import bits_of_row, start_q31
from pvid.configuration.weak_q31 import FULL_SCALE, HIGHEST_JET, finer, lsb_of
from pvid.design.bank_q31 import FULL_SCALE_LIMIT, HELD_MOST, HELD_UNITS, BankQ31, integer_bank
from pvid.design.fir import FirBank, savitzky_golay
from pvid.design.rescale_q31 import rescale_to, shift_to
from pvid.model.compiled import CompiledModel
from pvid.model.evaluation import numpy_function
from pvid.oracle.strong_described import StrongModel, StrongRows, StrongSettings, residuals
from pvid.oracle.weak.front import of_hold
from pvid.oracle.weak.functions import Float
from pvid.rig.run import Recording
from pvid.settings.enums import Law
from pvid.settings.parts import EstimatorConfigQ31
from pvid.settings.strong import StrongModelConfigQ31
from pvid.settings.weak_q31 import Rescale

_MOST_Y_BITS = 12
_LARGEST_BITS = 25  # of the largest term of a row over its noise, at most: smaller noise is set to that
_VALUE_BITS = 30  # of an entry as the rows' function returns it
_DIGITS = 8  # bits of the largest entry that its rounding leaves, at least
_GAIN_ONE = 1 << 30
_LONGER_RUN = 8.0  # of the recording, for integrals since its start: the bits that the formats of rows leave free


@dataclass(frozen=True, eq=False)
class StrongDesignQ31:
    """What a recording is identified with in fixed point.

    Attributes
    ----------
    base : window and fit, as float32 has them
    strong_q31 : functions, formats and settings
    counts : of the recording, int32 [ticks, signals]
    """

    base: StrongDesign
    strong_q31: StrongQ31
    counts: npt.NDArray[np.int32]

    @property
    def strong(self) -> StrongFunctions:
        """Functions of the strong form, named NAME_strong."""
        return self.base.strong

    @property
    def config(self) -> StrongModelConfigQ31:
        """Settings in fixed point."""
        return self.strong_q31.config


def strong_design_to_identify(
    model: CompiledModel, recording: Recording, law: Law = Law.STATIONARY, reference: Float | None = None
) -> StrongDesignQ31:
    """Formats and settings for a recording without missing samples, with the window that float32 gets; raises as
    fixed_design."""
    return fixed_design(model, recording, strong_design(model, recording, law, reference), between_counts=True)


def fixed_design(
    model: CompiledModel, recording: Recording, base: StrongDesign, *, between_counts: bool = False
) -> StrongDesignQ31:
    """What a design of the recording is in fixed point.

    Raises PvidError where fixed point does not have what the model needs.

    Parameters
    ----------
    between_counts : as of pvid.configuration.weak_q31.weak_q31_for_run; the core's errors are those of the rows alone
    """
    strong, fitted = base.strong, base.fitted
    bank = savitzky_golay(fitted.taps, fitted.degree)
    raw = _signals(strong, recording)
    lsb, full_scale = _counting(model, strong, recording.signals, between_counts)
    reaches = _reaches(strong, raw, bank, recording)
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
    top = FULL_SCALE_LIMIT if strong.integrals else max(full_scale)
    whole = integer_bank(bank, top * (HELD_MOST if any(strong.held) else 1))
    down, units_of_integrals = _integrals(made, recording.sample_rate)
    literally = base.config.estimator.law is Law.PSEUDOVELOCITY
    config = StrongModelConfigQ31(
        sample_rate=recording.sample_rate,
        weights=whole.weights,
        stride=bank.stride,
        centre=whole.centre,
        full_scale=full_scale,
        offset=(0,) * len(full_scale),
        input=_rescaled_inputs(made, whole, (*lsb, *units_of_integrals), recording.sample_rate),
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
        shared=None if between_counts else base.shared.counts(made.parameters.p_bits),
        raw=_raw(made, lsb),
        integral_down=down,
    )
    strong_q31 = StrongQ31(made, config, lsb)
    return StrongDesignQ31(base, strong_q31, _counts(strong, recording.signals, lsb))


def _signals(strong: StrongFunctions, recording: Recording) -> list[Float]:
    """Samples of each signal, of a held one its mean about the instant."""
    samples = [np.asarray(recording.signals[one.name], np.float64) for one in strong.signals]
    return [of_hold(x) if held else x for x, held in zip(samples, strong.held, strict=True)]


def _counting(
    model: CompiledModel, strong: StrongFunctions, run: Mapping[str, npt.ArrayLike], between_counts: bool
) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """Value of a count and full scale of each signal."""
    lsb = lsb_of(model, [one.name for one in strong.signals])
    largest = [float(np.max(np.abs(np.asarray(run[one.name], np.float64)))) for one in strong.signals]
    tops = [max(FULL_SCALE * one.reach, most) for one, most in zip(strong.signals, largest, strict=True)]
    if between_counts:
        lsb = tuple(
            finer(step, run[one.name], FULL_SCALE_LIMIT / (top / step)) * 2 ** _too_many(most / step)
            for one, step, top, most in zip(strong.signals, lsb, tops, largest, strict=True)
        )
    for one, step, most in zip(strong.signals, lsb, largest, strict=True):
        if _too_many(most / step):
            raise PvidError(
                f"{one.name} reaches {most / step:.3g} counts of its sensor and the fixed-point core takes 2^24: "
                "state a coarser resolution, and read so many bits less on the board"
            )
    return lsb, tuple(max(round(min(top / step, FULL_SCALE_LIMIT)), 16) for step, top in zip(lsb, tops, strict=True))


def _too_many(counts: float) -> int:
    """Bits that counts are beyond full scale."""
    return max(0, math.ceil(math.log2(counts / FULL_SCALE_LIMIT))) if counts > 0 else 0


def _counts(strong: StrongFunctions, run: Mapping[str, npt.ArrayLike], lsb: Sequence[float]) -> npt.NDArray[np.int32]:
    """The readings of every tick [ticks, signals]."""
    columns = [
        np.rint(np.asarray(run[one.name], np.float64) / step) for one, step in zip(strong.signals, lsb, strict=True)
    ]
    most = float(np.iinfo(np.int32).max)
    return np.asarray(np.clip(np.stack(columns, axis=1), -most, most), np.int32)


def _reaches(strong: StrongFunctions, raw: Sequence[Float], bank: FirBank, recording: Recording) -> list[float]:
    """Of each input of the rows, with room for more motion and a longer run."""
    functions, rate = strong.functions, recording.sample_rate
    derivatives = [bank.apply(x, rate) for x in raw]
    samples: list[Float | None] = [None] * len(functions.inputs)
    for k, one in enumerate(functions.inputs):
        place = strong.raw_places(one)
        if place is not None:
            samples[k] = np.asarray(recording.signals[strong.signals[place].name], np.float64)
    symbols = [one.symbol for one in functions.inputs]
    zero = np.zeros(len(raw[0]))
    given = [zero if one is None else one for one in samples]
    found = []
    for source in strong.sources:
        if source.channel < len(raw):
            raw_most = 0.0 if source.order or not strong.integrals else float(np.max(np.abs(raw[source.channel])))
            found.append(HIGHEST_JET * max(float(np.max(np.abs(derivatives[source.channel][source.order]))), raw_most))
        else:
            expression = functions.integrands.expressions[source.channel - len(raw)]
            rates = numpy_function(symbols, expression)(*given) * np.ones(len(zero))
            found.append(_LONGER_RUN * float(np.max(np.abs(np.cumsum(rates)))) / rate)
    return [one or 1.0 for one in found]


def _integrals(made: FixedStrong, sample_rate: float) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Shift of each integral to a count, and the value of a count; twice its reach is full scale."""
    strong = made.strong
    if made.integrands is None:
        return (), ()
    downs, units = [], []
    for k, bits in enumerate(made.integrands.result_bits):
        reach = next(
            x for x, one in zip(made.reaches, strong.sources, strict=True) if one.channel == len(strong.signals) + k
        )
        unit = 2.0**-bits / (2 * sample_rate)
        downs.append(shift_to(2 * reach / unit, math.log2(FULL_SCALE_LIMIT)))
        units.append(unit * 2.0 ** downs[-1])
    return tuple(downs), tuple(units)


def _raw(made: FixedStrong, lsb: Sequence[float]) -> dict[int, tuple[int, Rescale]]:
    """The inputs that are signals, where there are integrals."""
    strong = made.strong
    found = {}
    for k, (one, bits, reach) in enumerate(zip(strong.functions.inputs, made.input_bits, made.reaches, strict=True)):
        place = strong.raw_places(one)
        if made.integrands is not None and place is not None:
            found[k] = place, rescale_to(2 * reach / lsb[place], lsb[place] * 2.0**bits, one.meaning)
    return found


def _units(made: FixedStrong, oracle: StrongModel, rows: StrongRows, p: Float) -> tuple[float, ...]:
    """The standard deviation that each kind of row is counted in [unit of its Y]: of its noise and of its rounding.

    Raises PvidError where the rounding leaves a kind no digits.
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
        held = one.channel < len(made.strong.signals) and made.strong.held[one.channel]
        unit /= HELD_UNITS if held else 1
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
