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
from pvid.settings.weak import NONE, Source, WeakChannel, WeakDesign32, WeakJet, WeakSignal
from pvid.settings.weak_q31 import (
    Rescale,
    WeakDesignQ31,
    WeakFilterQ31,
    WeakFormatQ31,
    WeakModelQ31,
    WeakNoiseQ31,
)

Float = npt.NDArray[np.float64]

BLOCK = 4  # steps that are added together
CIRCLE = 2**23 - 1  # 1 in the table of cosines
CHANNEL_BITS = 28  # of a channel
DOWN = 22  # of a block's products, to 32 bits
_WORD = 30  # bits of a rounded sum or integral: one is spare
_BLOCK_BITS = 28  # of a block sum: a pair of differences fits a word

# Of each source: its largest integer in full scales, and its unit in counts.
_REACH = {Source.SAMPLED: 1, Source.HELD: 28, Source.JUMP: 2}


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


def shift_to(most: float, bits: float) -> int:
    """Shift right, not negative, that brings |x| <= most to 2^bits at most."""
    return max(0, math.ceil(math.log2(most) - bits)) if most > 0 else 0


def fixed_design(model: WeakModelQ31, sizes: WeakDesign32, sensing: Sensing, formats: Formats) -> WeakDesignQ31:
    """Tables and formats of a weak form for sensors that count.

    Parameters
    ----------
    sizes : the float32 design, with its filters, noise and term factors

    Raises
    ------
    PvidError
        Where a quantity does not fit, with its name.
    """
    margins = _Margins()
    for name, full in enumerate(sensing.full_scale):
        if not 16 <= full <= 2**24:
            raise PvidError(f"full scale of sample {name} is {full} counts: the fixed-point core takes 16 to {2**24}")
    if sizes.hop % BLOCK:
        raise PvidError(f"half a window has {sizes.hop} steps: the weak engine takes a multiple of {BLOCK}")
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
    integral = []
    for most in formats.integrand_most:
        once = 28.0 * sizes.hop * most
        twice = 28.0 * sizes.hop**2 * most + 8.0 * sizes.hop * most
        margins.take("a double integral", twice, 62)
        integral.append((max(1, shift_to(once, _WORD)), max(1, shift_to(twice, _WORD))))
    sum_shift = max(1, shift_to(sizes.hop * (2.0 ** (CHANNEL_BITS + 23 - DOWN) + 2), _WORD - 1e-6))
    channels = _Channels(model, sizes.hop, sum_shift, formats, tuple(integral), margins)
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
        integral=tuple(integral),
        format=tuple(channels.format(k) for k in range(len(model.channel))),
        circle=circle_of(sizes.hop),
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


def circle_of(hop: int) -> npt.NDArray[np.int32]:
    """The table of cosines of a half window [2 hop]."""
    return np.asarray(np.rint(CIRCLE * np.cos(np.pi * np.arange(2 * hop) / hop)), np.int32)


def scaled_number(x: float) -> tuple[int, int]:
    """(m, e) with m 2^e the nearest number of 30 digits."""
    if x == 0:
        return 0, 0
    m, e = math.frexp(x)
    whole = round(m * 2.0**30)
    return (whole // 2, e - 29) if abs(whole) == 2**30 else (whole, e - 30)


def rescale_to(most: float, gain: float, name: str) -> Rescale:
    """From sums of at most `most` to `gain` times them."""
    down = shift_to(most, _WORD)
    factor = gain * 2.0**down
    shift = 30 - math.floor(math.log2(factor))
    multiplier = round(factor * 2.0**shift)
    if multiplier == 2**31:
        multiplier, shift = 2**30, shift - 1
    if not 0 <= shift <= 62:
        raise PvidError(
            f"the fixed-point weak form cannot hold {name}: its unit and that of its sensor differ too much"
        )
    return Rescale(down, shift, multiplier)


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
    pair = (2 if jet.order % 2 else 4) * block.most
    place = _WORD - math.ceil(math.log2(block.most))  # where there are no weights: as many bits as x leaves free
    if weights.size:
        room = min(2.0**_WORD / float(np.abs(weights).max()), 2.0**61 / (pair * float(np.abs(weights).sum())))
        place = math.floor(math.log2(room))
    if jet.order == 0:
        place = min(place, _WORD)
    whole = np.rint(weights * 2.0**place).astype(np.int64)
    total = pair * float(np.abs(whole).sum()) + (block.most * 2.0**place if jet.order == 0 else 0.0)
    margins.take(f"the sum of {name}", total, 62)
    # A sum beyond an int32 of the jet's format saturates, as a jet beyond its reach: its upper bits are not needed.
    gain = block.unit * 2.0 ** (bits - place)
    rescale = rescale_to(min(total, 2.0**31 / gain), gain, name)
    return WeakFilterQ31(whole.astype(np.int32), place if jet.order == 0 else 0, rescale)


def _run(reach: float, rate_bits: int, bits: int, dt: float, margins: _Margins) -> Rescale:
    unit = dt / 2 * 2.0**-rate_bits
    margins.take("an integral since the start of the run", reach / unit, 62)
    return rescale_to(reach / unit, unit * 2.0**bits, "an integral since the start of the run")


class _Channels:
    """Shifts and bounds of the channels and their sums."""

    def __init__(
        self,
        model: WeakModelQ31,
        hop: int,
        sum_shift: int,
        formats: Formats,
        integral: tuple[tuple[int, int], ...],
        margins: _Margins,
    ) -> None:
        self.model, self.hop, self.sum_shift = model, hop, sum_shift
        self.formats, self.integral, self.margins = formats, integral, margins

    def edge(self, one: WeakChannel, fold: int) -> float:
        """Largest I^fold at the end of a half, as an integer."""
        if one.integrand == NONE:
            return 24.0 * self.hop**2 if fold == 2 else 24.0 * self.hop
        most = self.formats.integrand_most[one.integrand]
        size = 28.0 * self.hop * most if fold == 1 else (28.0 * self.hop + 8.0) * self.hop * most
        return size / 2.0 ** self.integral[one.integrand][fold - 1] + 1

    def most(self, k: int) -> float:
        """Largest gain times integral."""
        one = self.model.channel[k]
        if one.gain == NONE:
            return 0.0
        gain = float(self.formats.gain_most[one.gain])
        return gain * self.edge(one, one.fold) if one.fold else gain

    def value(self, k: int) -> int:
        """Shift from there to the channel, at least 1."""
        return max(1, shift_to(self.most(k), CHANNEL_BITS - 1e-6))

    def half_sum(self, k: int) -> float:
        """Largest sum of half a window."""
        size = self.hop * (self.most(k) / 2.0 ** self.value(k) + 1) * CIRCLE / 2.0**DOWN
        return size / 2.0**self.sum_shift + self.hop

    def format(self, k: int) -> WeakFormatQ31:
        """Its shifts; the sums with shifted integrals fit 30 bits."""
        one = self.model.channel[k]
        value, own = self.value(k), 0
        while True:
            plain = ramp = 0
            total = 2 * self.half_sum(k) / 2.0**own + 1
            if one.fold:
                plain = value + own - self.value(one.plain)
                total += self.edge(one, one.fold) * self.half_sum(one.plain) / 2.0**plain + 1
            if one.fold == 2:
                once, twice = self.integral[one.integrand] if one.integrand != NONE else (0, 0)
                ramp = twice - once + value + own - self.value(one.ramp)
                total += self.edge(one, 1) * self.half_sum(one.ramp) / 2.0**ramp + 1
            if plain >= 0 and ramp >= 0 and total < 2**30:
                self.margins.take("the sums of a window", total, 30)
                return WeakFormatQ31(value, own, plain, ramp)
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
            shift = self.integral[one.integrand][one.fold - 1]
            unit *= (dt / 24 if one.fold == 1 else dt**2 / 48) * 2.0 ** (shift - self.formats.integrands[one.integrand])
        form = self.format(k)
        return unit * 2.0 ** (form.value + form.own + DOWN + self.sum_shift) / CIRCLE
