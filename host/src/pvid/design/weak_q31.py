"""Formats of the fixed-point weak form of any mechanism, with the proof that no input overflows (pvid/weak_q31.h).

From the full scale of the sensors, and the bounds of the generated values, follow bounds of everything else; each
quantity gets the finest format in which its bound fits its type, so that no sum or product can exceed it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.rescale_q31 import rescale_to, shift_to
from pvid.settings.weak import NONE, Source, WeakChannel, WeakDesign32, WeakJet, WeakSignal
from pvid.settings.weak_q31 import Rescale, WeakDesignQ31, WeakFilterQ31, WeakFormatQ31, WeakModelQ31, WeakNoiseQ31

Float = npt.NDArray[np.float64]

BLOCK = 4  # steps that are added together
CHANNEL_BITS = 28  # of a channel
CIRCLE, FINE_CIRCLE = 2**15 - 1, 2**23 - 1  # largest cosine in the table
DOWN, FINE_DOWN = 14, 22  # of a block's products, to 32 bits
UPPER = 32  # bits that the upper half of a product is short of
_WORD = 30  # bits of a sum: one is spare
_BLOCK_BITS = 28  # of a block sum: a pair of differences fits a word
_FEW_COUNTS = 2.0**12  # of a sample times the root of D, with which a cosine of 16 bits is exact enough
_AMPLITUDES = 256  # of the cosine, among which there is one whose rounding is good-natured

# Of each source: its largest integer in full scales, and its unit in counts.
_REACH = {Source.SAMPLED: 1, Source.HELD: 28, Source.JUMP: 2, Source.LAST: 1}


@dataclass(frozen=True)
class Sensing:
    """What the formats follow from beside the model.

    Attributes
    ----------
    lsb : value of a count of each sample [samples]
    full_scale : largest count about the offset [samples]
    sample_rate : [Hz]
    """

    lsb: tuple[float, ...]
    full_scale: tuple[int, ...]
    sample_rate: float


@dataclass(frozen=True)
class Formats:
    """Of the generated functions: bits after the point, and the largest integer.

    Attributes
    ----------
    jets, runs : bits of each
    run_reach : largest value of each run
    rates, arguments : bits of the results of `prepare`
    gains, integrands : bits of the results of `values`
    gain_most, integrand_most : their largest integers
    """

    jets: tuple[int, ...]
    runs: tuple[int, ...]
    run_reach: tuple[float, ...]
    rates: tuple[int, ...]
    arguments: tuple[int, ...]
    gains: tuple[int, ...]
    integrands: tuple[int, ...]
    gain_most: tuple[int, ...]
    integrand_most: tuple[int, ...]


class _Margins(dict[str, float]):
    def take(self, name: str, most: float, bits: int) -> None:
        """Notes the spare bits of a quantity below 2^bits, or refuses it."""
        spare = bits - math.log2(most) if most > 0 else float(bits)
        if spare < 0:
            raise PvidError(f"the fixed-point weak form cannot hold {name}: {-spare:.2f} bits are missing")
        self[name] = min(spare, self.get(name, spare))


def most_counts(signals: Sequence[WeakSignal], samples: int, decimation: int) -> list[int]:
    """Largest full scale of each sample whose block sums fit a word [samples]."""
    found = [2**24] * samples
    for one in signals:
        room = math.floor((2**31 - 1) / (_REACH[one.source] * decimation**2))
        found[one.sample] = min(found[one.sample], room)
    return found


def fixed_design(model: WeakModelQ31, sizes: WeakDesign32, sensing: Sensing, formats: Formats) -> WeakDesignQ31:
    """Tables and formats of a weak form for sensors that count.

    Raises PvidError where a quantity does not fit, with its name.

    Parameters
    ----------
    sizes : the float32 design, with its filters, noise and term factors
    """
    margins = _Margins()
    for name, full in enumerate(sensing.full_scale):
        if not 16 <= full <= 2**24:
            raise PvidError(f"full scale of sample {name} is {full} counts: the fixed-point core takes 16 to {2**24}")
    if sizes.hop % BLOCK:
        raise PvidError(f"half a window has {sizes.hop} steps: the weak identifier takes a multiple of {BLOCK}")
    dt = sizes.decimation / sensing.sample_rate
    blocks = tuple(_Block(model, place, sizes.decimation, sensing, margins) for place in range(len(model.signal)))
    filters = tuple(
        _filter(blocks[jet.signal], jet, np.asarray(one.weights, np.float64), bits, margins)
        for jet, one, bits in zip(model.jet, sizes.compensator, formats.jets, strict=True)
    )
    runs = tuple(
        _run(reach, rate, bits, dt, margins)
        for reach, rate, bits in zip(formats.run_reach, formats.rates, formats.runs, strict=True)
    )
    widths = tuple(round(width * 2.0**bits) for width, bits in zip(sizes.sign_width, formats.arguments, strict=True))
    if any(width > 0 and whole < 1 for width, whole in zip(sizes.sign_width, widths, strict=True)):
        raise PvidError("the width of a soft sign is below the resolution of its velocity")
    integral = tuple(_Integral.of(most, sizes.hop, margins) for most in formats.integrand_most)
    # a second derivative has no large slow part
    slow = {model.signal[jet.signal].sample for jet in model.jet if jet.order < 2}
    fine = any(sensing.full_scale[one] * math.sqrt(sizes.decimation) > _FEW_COUNTS for one in slow)
    circle = circle_of(sizes.hop, sizes.functions // 2 + sizes.power // 2, fine)
    # products of four steps have 31 bits
    sum_shift = max(1, shift_to(sizes.hop * (2.0**29 + 2), _WORD - 1e-6))
    channels = _Channels(
        model, sizes.hop, sum_shift, formats, integral, (float(circle[0]), FINE_DOWN if fine else DOWN), margins
    )
    units = tuple(channels.unit(k, dt) for k in range(len(model.channel)))
    omega = math.pi / (sizes.hop * dt)
    terms = zip(sizes.model.term, model.term, strict=True)
    return WeakDesignQ31(
        model=model,
        functions=sizes.functions,
        power=sizes.power,
        decimation=sizes.decimation,
        hop=sizes.hop,
        sum_shift=sum_shift,
        full_scale=sensing.full_scale,
        down=tuple(one.down for one in blocks),
        filter=filters,
        run=runs,
        sign_width=widths,
        integral=tuple((one.down, one.twice) for one in integral),
        format=tuple(channels.format(k) for k in range(len(model.channel))),
        fine=fine,
        circle=circle,
        factor=tuple(
            scaled_number(float(theirs.factor) * units[mine.channel] * omega**mine.order) for theirs, mine in terms
        ),
        noise=tuple(
            WeakNoiseQ31(one.kind, one.power, one.a, one.b, scaled_number(float(one.factor) * omega ** (2 * one.power)))
            for one in sorted(sizes.noise, key=lambda one: (one.kind, one.power, one.a, one.b))
        ),
        error_order=tuple(int(one) for one in sizes.error_order),
        error_variance=tuple(
            scaled_number(float(one) * omega ** (2 * int(order)))
            for one, order in zip(sizes.error_variance, sizes.error_order, strict=True)
        ),
        units=units,
        margins=dict(margins),
    )


def circle_of(hop: int, highest: int, fine: bool) -> npt.NDArray[np.int32]:
    """The table of cosines of a half window [2 hop + 3 hop/2 + 3 highest], which goes on behind the circle.

    A sum at harmonic h takes every h-th entry, and the errors of these let other frequencies of the signal into it. The
    amplitude is the largest, or of those of 16 bits the one that lets in least of the slow ones, which the motion has.
    """
    turn = 2 * hop
    place = np.outer(np.arange(1, highest + 1), np.arange(turn)) % turn
    cosine = np.cos(np.pi * np.arange(turn) / hop)
    best, chosen = np.inf, cosine
    largest, tried = (FINE_CIRCLE, 1) if fine else (CIRCLE, _AMPLITUDES)
    for amplitude in range(largest, largest - tried, -1):
        whole = np.rint(amplitude * cosine)
        let_in = np.fft.rfft((whole / amplitude - cosine)[place])[:, : 2 * highest]
        total = float(np.sum(np.abs(let_in) ** 2))
        if total < best:
            best, chosen = total, whole
    n = turn + 3 * (hop // 2) + 3 * highest
    return np.asarray(chosen[np.arange(n) % turn], np.int32)


def scaled_number(x: float) -> tuple[int, int]:
    """(m, e) with m 2^e the nearest number of 30 digits."""
    if x == 0:
        return 0, 0
    m, e = math.frexp(x)
    whole = round(m * 2.0**30)
    return (whole // 2, e - 29) if abs(whole) == 2**30 else (whole, e - 30)


class _Block:
    """Block sums of a signal, shifted: bounds and unit."""

    def __init__(self, model: WeakModelQ31, place: int, decimation: int, sensing: Sensing, margins: _Margins) -> None:
        signal = model.signal[place]
        most = _REACH[signal.source] * sensing.full_scale[signal.sample] * decimation**2
        margins.take(f"the sums of {decimation} samples of signal {place}", most, 31)
        self.down = shift_to(most, _BLOCK_BITS)
        self.most = most / 2.0**self.down + 1
        self.unit = sensing.lsb[signal.sample] * 2.0**self.down / decimation**2
        if signal.source == Source.HELD:
            self.unit /= 24
        elif signal.source == Source.JUMP:
            self.unit /= 12 * sensing.sample_rate


def _filter(block: _Block, jet: WeakJet, weights: Float, bits: int, margins: _Margins) -> WeakFilterQ31:
    name = f"jet {jet.order} of signal {jet.signal}"
    pair = 4 * block.most
    whole = np.concatenate([[1.0 if jet.order == 0 else 0.0], weights])
    spans = np.array([block.most] + [pair] * weights.size)
    gained = whole * block.unit * 2.0**bits  # to the jet's format
    total, largest = float(np.abs(gained) @ spans), float(np.abs(gained).max())
    down = min(62, math.floor(_WORD - math.log2(largest)), math.floor(61 - math.log2(total)))
    if down < 0:
        raise PvidError(
            f"the fixed-point weak form cannot hold {name}: its unit and that of its sensor differ too much"
        )
    # Beyond an int32 of the jet's format the sum saturates, as a jet beyond its reach.
    rounded = np.rint(gained * 2.0**down)
    margins.take(f"the sum of {name}", total * 2.0**down, 62)
    return WeakFilterQ31(int(weights.size), down, rounded.astype(np.int32))


def _run(reach: float, rate_bits: int, bits: int, dt: float, margins: _Margins) -> Rescale:
    unit = dt / 2 * 2.0**-rate_bits
    margins.take("an integral since the start of the run", reach / unit, 62)
    return rescale_to(reach / unit, unit * 2.0**bits, "an integral since the start of the run")


@dataclass(frozen=True)
class _Integral:
    """An integrand's shifts, and the largest integers of its integrals."""

    down: int
    twice: int
    of_once: float
    of_twice: float

    @classmethod
    def of(cls, most: int, hop: int, margins: _Margins) -> _Integral:
        # a step adds 140 integrands to I^1 [dt/120], and two of these and 72 integrands to I^2 [dt^2/240]
        down = shift_to((280.0 * hop + 72.0) * most, 31 - 1e-3)
        left = most / 2.0**down + 1
        once = 140.0 * hop * left
        margins.take("an integral", 2 * once + 72 * left, 31)
        all_rises = (140.0 * hop * (hop + 1) + 72.0 * hop) * left
        twice = max(1, shift_to(all_rises, 31 - 1e-3))
        whole = all_rises / 2.0**twice + hop
        margins.take("a double integral", whole, 31)
        return cls(down, twice, once, whole)


def _off(shift: int) -> float:
    """Largest error of the upper half of a product that is shifted."""
    return 2.0 ** max(UPPER - shift, 0)


class _Channels:
    """Shifts and bounds of the channels and their sums.

    The unit of an integral is that of its integrand, or 1, times dt/24 or dt^2/48 (of 1: dt/2) times a power of two.
    """

    def __init__(
        self,
        model: WeakModelQ31,
        hop: int,
        sum_shift: int,
        formats: Formats,
        integral: tuple[_Integral, ...],
        cosine: tuple[float, int],
        margins: _Margins,
    ) -> None:
        self.model, self.hop, self.sum_shift = model, hop, sum_shift
        self.formats, self.integral, self.margins = formats, integral, margins
        self.one, self.down = cosine  # 1, and the shift of the products

    def edge(self, one: WeakChannel, fold: int) -> float:
        """Largest I^fold at the end of a half, as an integer."""
        if one.integrand == NONE:
            once = 2.0 * self.hop if one.fold == 1 else 24.0 * self.hop
            return once * (self.hop if fold == 2 else 1) * 2.0 ** self.lift(one)
        own = self.integral[one.integrand]
        return own.of_once if fold == 1 else own.of_twice

    def lift(self, one: WeakChannel) -> int:
        """Of the integral of 1."""
        if not one.fold or one.integrand != NONE:
            return 0
        return 31 - (2 * self.hop if one.fold == 1 else 24 * self.hop**2).bit_length()

    def power(self, one: WeakChannel, fold: int) -> int:
        """Of two in the unit of I^fold at the end of a half."""
        if one.integrand == NONE:
            return -self.lift(one)
        own = self.integral[one.integrand]
        return own.down if fold == 1 else own.down + own.twice

    def exponent(self, k: int) -> int:
        """Of two in the unit of the channel."""
        one = self.model.channel[k]
        if not one.fold:
            return self.value(k)
        return self.value(k) + UPPER + self.power(one, one.fold)

    def most(self, k: int) -> float:
        """Largest integer before the last shift."""
        one = self.model.channel[k]
        if one.gain == NONE:
            return 0.0
        gain = float(self.formats.gain_most[one.gain])
        if not one.fold:
            return gain
        return gain * self.edge(one, one.fold) / 2.0**UPPER + 1

    def value(self, k: int) -> int:
        """Shift from there to the channel."""
        return max(1, shift_to(self.most(k), CHANNEL_BITS - 1e-6))

    def half_sum(self, k: int) -> float:
        """Largest sum of half a window."""
        size = self.hop * (self.most(k) / 2.0 ** self.value(k) + 1) * 2  # the cosine times 2^-DOWN is below 2
        return size / 2.0**self.sum_shift + self.hop

    def format(self, k: int) -> WeakFormatQ31:
        """Its shifts; the sums with shifted integrals fit 30 bits."""
        one = self.model.channel[k]
        own = 0
        while True:
            plain = ramp = 0
            total = 2 * self.half_sum(k) / 2.0**own + 1
            if one.fold:
                plain = self.exponent(k) + own - self.power(one, one.fold) - self.exponent(one.plain)
                total += self.edge(one, one.fold) * self.half_sum(one.plain) / 2.0**plain + _off(plain)
            if one.fold == 2:
                ramp = self.exponent(k) + own - self.power(one, 1) - self.exponent(one.ramp)
                total += self.edge(one, 1) * self.half_sum(one.ramp) / 2.0**ramp + _off(ramp)
            if (plain >= 2 or not one.fold) and (ramp >= 2 or one.fold < 2) and total < 2**30:
                self.margins.take("the sums of a window", total, 30)
                return WeakFormatQ31(self.value(k), self.lift(one), own, plain, ramp)
            own += 1

    def unit(self, k: int, dt: float) -> float:
        """Value of one unit of S_h."""
        one = self.model.channel[k]
        if one.gain == NONE:
            return 1.0
        unit = 2.0 ** -self.formats.gains[one.gain]
        if one.fold and one.integrand == NONE:
            unit *= dt / 2 if one.fold == 1 else dt**2 / 48
        elif one.fold:
            unit *= (dt / 120 if one.fold == 1 else dt**2 / 240) * 2.0 ** -self.formats.integrands[one.integrand]
        power = self.exponent(k) + self.format(k).own + self.down + self.sum_shift
        return unit * 2.0**power / self.one
