"""Fixed-point tables and formats of a weak-form design, with the proof that no input overflows (pvid/weak_q31.h).

Every quantity is an integer with a fixed power of two, chosen from the largest value that any input within the
sensors' full scale can give it (interval analysis): no product, sum or integral can exceed its type, whatever the
samples. Working units: angles in fractions of the encoder's LSB, times in decimated samples dt, so that w and u are
numbers of 1/dt^2 and integrals need no factor.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.shaped_rounding import bits_for, shaped, slow_factor
from pvid.design.weak import WeakDesign
from pvid.settings.tables import WeakTablesQ31

Float = npt.NDArray[np.float64]
Int16 = npt.NDArray[np.int16]
Int32 = npt.NDArray[np.int32]

# A test function of 12 bits times a term of 20: the product fits the 32 bits that a small core multiplies.
CHI_BITS = 11
TERM_BITS = 21
U_BITS = 18
SMOOTH_BITS = 31  # after the point, of the smoothing weights
HIGH_BITS = 13
# A column of a window: full scale, and the size expected of it.
COLUMN_BITS = 31
EXPECTED_BITS = 25
GRAM_BITS = 30

TERMS = 15
HIGH_TERMS = 2
# Terms by the places of weak/window_q31.h. The products with I2(u phi) and I2(phi) need more bits than one term has:
# _HIGH holds what lies beyond it, so few bits that their products need no shift.
UIUF_HIGH, UIF_HIGH, UF, F, UIUF, UIF, UIU, UI1, U, UT, CHI_UF, CHI_F, CHI_U, CHI_1, Y = range(TERMS)
# Part of full scale that a term is expected to reach: angle and drive an eighth each, and a motion to and fro leaves a
# twentieth of the double integral of a constant.
_EXPECTED = tuple(
    0.125**factors * (0.05 if integral else 1.0)
    for factors, integral in (
        *((3, True), (2, True), (2, False), (1, False), (3, True), (2, True), (2, True), (1, False), (1, False)),
        *((1, False), (2, False), (1, False), (1, False), (0, False), (1, False)),
    )
)
# The integrals come in units of dt^2/12.
_TWELFTHS = (UIUF_HIGH, UIF_HIGH, UIUF, UIF, UIU, UI1)
# Which order of chi multiplies a term: its place in the table [W][3][K].
_ORDER = (*(1,) * 10, *(0,) * 4, 2)
# Which terms add up to the columns N1..N8, Y, a, b.
COLUMN_TERMS = (
    (UF,),
    (F,),
    (UIUF_HIGH, UIUF),
    (UIF_HIGH, UIF, CHI_UF),
    (CHI_F,),
    (UIU,),
    (UI1, CHI_U),
    (CHI_1,),
    (Y,),
    (U,),
    (UT,),
)
COLUMNS = len(COLUMN_TERMS)


def _shift_to(largest: float, bits: int) -> int:
    """Shift right, not negative, that brings |x| <= largest into `bits` bits."""
    return max(0, -bits_for(largest, bits))


def _integer_weights(weights: Float, reach: int, factor: float, most_bits: int = 62) -> tuple[Int32, int]:
    """weights * factor as integers of the finest format in which weight times `reach` fits 31 bits, and the format."""
    scaled = weights * factor
    largest = float(np.abs(scaled).max())
    bits = min(bits_for(largest * reach, 32), bits_for(largest, 31), most_bits)
    return np.rint(scaled * 2.0**bits).astype(np.int32), bits


def weak_tables_q31(
    design: WeakDesign, phi_lsb: float, y_lsb: float, phi_range: float, y_range: float, acceleration_range: float
) -> WeakTablesQ31:
    """Tables for sensors that count in phi_lsb [rad] and y_lsb [m], within +-phi_range [rad] and +-y_range [m].

    The pivot's acceleration is taken in up to acceleration_range [m/s^2]: a jump of y within full scale would show as
    a thousand times that, and a sample beyond it is refused.

    Raises
    ------
    PvidError
        Where a range is less than one count, or too many counts for 32 bits.
    """
    phi_max, y_max = (round(r / lsb) for r, lsb in ((phi_range, phi_lsb), (y_range, y_lsb)))
    for name, counts in (("phi_range", phi_max), ("y_range", y_max)):
        if not 16 <= counts <= 2**24:
            raise PvidError(f"{name} is {counts} counts of the sensor and the fixed-point core takes 16 to {2**24}")
    margins: dict[str, float] = {}

    def fits(name: str, largest: float, bits: int) -> None:
        margin = bits - 1 - math.log2(largest) if largest > 0 else float(bits)
        if margin < 0:
            raise PvidError(f"the fixed-point core cannot hold {name}: {-margin:.2f} bits are missing")
        margins[name] = margin

    dt = design.dt
    window, functions = design.window, design.functions
    steps = np.arange(window - 1)
    # front end: exact sums of counts
    smooth, smooth_bits = _integer_weights(design.smooth, 4 * phi_max, 1.0, SMOOTH_BITS)
    second, second_bits = _integer_weights(design.second, 4 * y_max, y_lsb / design.l1 * design.sample_rate**2 * dt**2)
    f_sum = phi_max * (2.0**smooth_bits + 4 * float(np.abs(smooth).sum()))
    u_sum = 4.0 * y_max * float(np.abs(second).sum())
    fits("smoothing sum", f_sum, 63)
    fits("second-derivative sum", u_sum, 63)
    phi_shift = smooth_bits - bits_for(f_sum / 2.0**smooth_bits, TERM_BITS)
    if phi_shift < 0:
        raise PvidError("phi_range is so few counts that F would need bits that the smoothing weights do not have")
    f_max = f_sum / 2.0**phi_shift + 1
    u_range = acceleration_range / design.l1 * dt**2
    u_bits = bits_for(u_range, U_BITS)
    u_shift = second_bits - u_bits
    if u_shift < 0:
        raise PvidError("y_lsb is too coarse for the acceleration range: the weights have too few bits for U")
    u_max = round(u_range * 2.0**u_bits)
    # terms
    uf_shift = _shift_to(u_max * f_max, TERM_BITS)
    uf_max = u_max * f_max / 2.0**uf_shift + 1
    now_max = np.array([u_max * f_max, f_max, u_max])  # what is integrated is not rounded before
    twelve = 6.0 * steps**2 + 2  # |3 * 4 I2 - 2 f| for |f| <= 1
    fits("double integral", float((now_max * twelve[-1]).max()), 63)
    integral_shift = tuple(_shift_to(m * twelve[-1], 32) for m in now_max)
    integral_max = [m * twelve / 2.0**s + 1 for m, s in zip(now_max, integral_shift, strict=True)]
    t = np.abs(steps - (window - 1) / 2)
    raw = [u_max * integral_max[0], u_max * integral_max[1], u_max * integral_max[2], u_max * twelve, u_max * t]
    high_shift = tuple(_shift_to(float(r.max()), HIGH_BITS) for r in raw[:2])
    high_max = [r / 2.0**s + 1 for r, s in zip(raw, high_shift, strict=False)]
    rest = [np.full(window - 1, 2.0 ** (s - 1)) for s in high_shift]
    product_shift = tuple(_shift_to(float(r.max()), TERM_BITS) for r in (*rest, *raw[2:]))
    product_max = [r / 2.0**s + 1 for r, s in zip((*rest, *raw[2:]), product_shift, strict=True)]
    one = np.ones(window - 1)
    term_max: list[Float] = [
        *high_max,
        uf_max * one,
        f_max * one,
        *product_max[:4],
        u_max * one,
        product_max[4],
        uf_max * one,
        f_max * one,
        u_max * one,
        2.0 ** (TERM_BITS - 2) * one,
        f_max * one,
    ]
    uf_bits = u_bits - uf_shift
    uiuf_bits = 2 * u_bits - integral_shift[0]
    uif_bits = u_bits - integral_shift[1]
    term_bits = [
        uiuf_bits - high_shift[0],
        uif_bits - high_shift[1],
        uf_bits,
        0,
        uiuf_bits - product_shift[0],
        uif_bits - product_shift[1],
        2 * u_bits - integral_shift[2] - product_shift[2],
        u_bits - product_shift[3],
        u_bits,
        u_bits - product_shift[4],
        uf_bits,
        0,
        u_bits,
        TERM_BITS - 2,
        0,
    ]
    for k, term in enumerate(term_max):
        fits(f"term {k}", float(term.max()), TERM_BITS)
    # test functions, in units in which the residual filter is chi4 + d1 w chi2 + d2 w^2 chi0 with w in 1/dt^2
    unit = np.array([dt**-4, dt**-2, 1.0])[None, :, None]
    chi, chi_bits = _integer_chi(design.chi * unit)
    products = [np.abs(chi[:-1, _ORDER[k], :].astype(np.float64)) * term_max[k][:, None] for k in range(TERMS)]
    total = max(float(product.sum(axis=0).max()) for product in products[HIGH_TERMS:])
    sum_shift = max(1, _shift_to(total, 32))
    for k, product in enumerate(products):
        fits(f"product {k}", float(product.max()) + 2.0 ** (sum_shift - 1), 32)
    # columns
    shifts = [0 if k < HIGH_TERMS else sum_shift for k in range(TERMS)]
    sum_max = [float((p / 2.0**s + 1).sum(axis=0).max()) for p, s in zip(products, shifts, strict=True)]
    for k, sum_largest in enumerate(sum_max):
        fits(f"sum {k}", sum_largest, 32)
    sum_bits = [term_bits[k] + chi_bits[_ORDER[k]] - shifts[k] for k in range(TERMS)]
    twelfth = [12.0 if k in _TWELFTHS else 1.0 for k in range(TERMS)]
    column_bits = []
    multiplier = np.zeros(TERMS, np.int32)
    shift = [0] * TERMS
    for parts in COLUMN_TERMS:
        largest = sum(sum_max[k] / twelfth[k] / 2.0 ** sum_bits[k] for k in parts)
        expected = sum(sum_max[k] * _EXPECTED[k] / twelfth[k] / 2.0 ** sum_bits[k] for k in parts)
        bits = min(bits_for(largest, COLUMN_BITS), bits_for(expected, EXPECTED_BITS))
        column_bits.append(bits)
        for k in parts:
            part, exponent = math.frexp(1 / twelfth[k])  # 0.5 <= part < 1
            multiplier[k] = min(round(part * 2.0**31), 2**31 - 1)
            shift[k] = 31 - exponent + sum_bits[k] - bits
            if not 0 <= shift[k] <= 62:
                raise PvidError(f"the fixed-point core cannot align term {k} with its column")
    gram, gram_bits = _integer_gram(design.gram, dt)
    return WeakTablesQ31(
        taps=design.taps,
        decimation=design.decimation,
        window=window,
        functions=functions,
        lag=design.lag,
        phi_max=phi_max,
        y_max=y_max,
        smooth=smooth,
        second=second,
        smooth_bits=smooth_bits,
        u_max=u_max,
        phi_shift=phi_shift,
        u_shift=u_shift,
        uf_shift=uf_shift,
        integral_shift=integral_shift,
        product_shift=product_shift,
        high_shift=high_shift,
        sum_shift=sum_shift,
        chi=chi,
        multiplier=multiplier,
        shift=tuple(shift),
        gram=gram,
        gram_bits=gram_bits,
        column_bits=tuple(column_bits),
        u_bits=u_bits,
        f_unit=phi_lsb * 2.0 ** (phi_shift - smooth_bits),
        dt=dt,
        overlap=design.overlap,
        margins=margins,
    )


def _integer_chi(chi: Float) -> tuple[Int16, tuple[int, ...]]:
    """chi [W, 3, K] as integers of CHI_BITS, one format an order.

    The rounding errors of a function are chosen such that what moves slowly does not see them: 12 bits are then worth
    16 and more.
    """
    bits = tuple(bits_for(float(np.abs(chi[:, order]).max()) * _ROOM, CHI_BITS) for order in range(3))
    factor = _factor_of_slow_signals(len(chi))
    out = np.zeros(chi.shape, np.int16)
    for order, b in enumerate(bits):
        for k in range(chi.shape[2]):
            out[1:-1, order, k] = shaped(chi[1:-1, order, k] * 2.0**b, factor)
    return out, bits


# Shaping may move an entry by a few units beyond the largest one.
_ROOM = 1.0 + 2.0 ** (3 - CHI_BITS)


def _slow_signals(window: int) -> Float:
    """Motion as test functions see it: up to 16 periods a window, fewer weighing more. [window, signals].

    Motion times drive has sums of their frequencies: in a window of 1.3 slow periods up to some 11 periods. With 12 at
    most, of which those beyond 5 weigh little, a window of 2 s had four times the noise of its rows.
    """
    x = np.arange(window) / (window - 1)
    periods = np.arange(0.0, min(16.0, window / 10), 0.25)
    angle = 2 * np.pi * x[:, None] * periods
    weight = 1 / (1 + (periods / 8) ** 4)
    return np.concatenate([np.cos(angle) * weight, np.sin(angle[:, 1:]) * weight[1:]], axis=1)


# Of the errors themselves beside their part along slow signals: keeps them below two units.
_OWN_WEIGHT = 1e-4


@lru_cache(maxsize=64)
def _factor_of_slow_signals(window: int) -> Float:
    return slow_factor(_slow_signals(window)[1:-1], _OWN_WEIGHT)


def _integer_gram(gram: Float, dt: float) -> tuple[Int32, tuple[int, ...]]:
    """The six Gram tables [6, K (K + 1) / 2] in the units of w in 1/dt^2, one format each."""
    unit = [dt ** -(8 - orders) for orders in (8, 6, 4, 4, 2, 0)]
    scaled = gram * np.array(unit)[:, None]
    bits = tuple(bits_for(float(np.abs(table).max()), GRAM_BITS) for table in scaled)
    integers = [np.rint(table * 2.0**b) for table, b in zip(scaled, bits, strict=True)]
    return np.stack(integers).astype(np.int32), bits
