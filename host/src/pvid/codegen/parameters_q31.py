"""theta and C of a model for the fixed-point estimator: int64 of fixed formats from the bounds of p, C and twin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pvid.base.errors import PvidError
from pvid.codegen import c_q31, numpy_q31
from pvid.codegen.formats import bits_of
from pvid.codegen.functions import Function, ModelFunctions
from pvid.codegen.intervals import Interval, bounds_of
from pvid.codegen.twin_file import namespace
from pvid.twin.q31.integer import Int, integers, round_shift
from pvid.twin.q31.model import ModelQ31
from pvid.twin.q31.scaled import Scaled, scaled

_BITS = 58  # of theta and of C: they fit 2^60
_LARGEST = 1 << 60
_LEFT = 30  # shift to the left, at most
_FORMAT_MAX = 200


@dataclass(frozen=True)
class ParametersQ31:
    """Formats and functions of p.

    Attributes
    ----------
    p_bits, theta_bits, c_bits : formats
    model : the twin
    functions : what is generated
    """

    p_bits: tuple[int, ...]
    theta_bits: tuple[int, ...]
    c_bits: tuple[int, ...]
    model: ModelQ31
    functions: ModelFunctions


def fixed_of(x: Scaled, bits: Sequence[int]) -> Int:
    """Numbers [n, ...] as integers of these formats, saturated at 2^60."""
    shift = -(x.e + integers(bits).reshape(-1, *[1] * (x.e.ndim - 1)))
    left = np.minimum(np.maximum(-shift, 0), _LEFT)
    up = np.where(-shift > _LEFT, np.sign(x.m) * _LARGEST, x.m << left)
    return np.where(shift >= 0, round_shift(x.m, np.maximum(shift, 0)), up)


def fixed_parameters(functions: ModelFunctions, bounds: Sequence[Interval]) -> ParametersQ31:
    """Formats from the bounds of p.

    Raises
    ------
    PvidError
        Where theta or C may be infinite within the bounds, with its name.
    """
    p_bits = tuple(bits_of(one) for one in bounds)
    theta_bits = _bits(functions, functions.theta, bounds)
    c_bits = _bits(functions, functions.jacobian, bounds)
    parts = [
        "import numpy as np\nimport numpy.typing as npt\n\nfrom pvid.twin.q31 import elementary as elementary_q31\n"
        "from pvid.twin.q31.scaled import Scaled\n",
        numpy_q31.scaled_function("theta", functions.theta.program, "theta"),
        numpy_q31.scaled_function("jacobian", functions.jacobian.program, "C"),
    ]
    space = namespace("\n\n".join(parts), functions.name)

    def numbers(p: Int) -> Scaled:
        return scaled(p, -integers(p_bits).reshape(-1, *[1] * (p.ndim - 1)))

    def theta(p: Int) -> Int:
        return fixed_of(space["theta"](numbers(p)), theta_bits)

    def jacobian(p: Int) -> Int:
        return fixed_of(space["jacobian"](numbers(p)), c_bits)

    model = ModelQ31(
        n_theta=len(theta_bits),
        n_p=len(p_bits),
        positive=tuple(one.positive for one in functions.model.unknowns),
        c_row=functions.c_row,
        c_column=functions.c_column,
        theta=theta,
        jacobian=jacobian,
        formats=lambda _: (list(theta_bits), list(c_bits)),
        kind_end=tuple(one.theta.stop for one in functions.kinds),
    )
    return ParametersQ31(p_bits, theta_bits, c_bits, model, functions)


def _bits(functions: ModelFunctions, function: Function, bounds: Sequence[Interval]) -> tuple[int, ...]:
    c_q31.require_scaled(function.program, f"{functions.name}, {function.name}")
    found = bounds_of(function.program, bounds, f"{functions.name}, {function.name}")
    out = []
    for place, label in zip(function.program.results, function.labels, strict=True):
        size = max(map(abs, found[place]))
        if not size < math.inf:
            raise PvidError(f"{functions.name}: {label} may be infinite within the bounds of its parameters")
        out.append(_FORMAT_MAX if size == 0 else min(_BITS - math.frexp(size)[1], _FORMAT_MAX))
    return tuple(out)


_C = """\
static const int8_t {prefix}_p_bits[{n_p}] = {{{p_bits}}};
static const int16_t {prefix}_theta_bits[{n_theta}] = {{{theta_bits}}};
static const int16_t {prefix}_c_bits[{n_c}] = {{{c_bits}}};
static const uint8_t {prefix}_kind_end[{n_kinds}] = {{{kind_end}}};
static const uint8_t {prefix}_c_row[{n_c}] = {{{c_row}}};
static const uint8_t {prefix}_c_column[{n_c}] = {{{c_column}}};

/* x as an integer of this format, saturated at 2^60. */
static int64_t {prefix}_fixed(pvid_scaled_q31 x, int32_t bits)
{{
    const int32_t shift = -(x.e + bits);
    if (shift >= 0) {{
        return pvid_round_shift_q31(x.m, (uint32_t)shift);
    }}
    if (shift < -30) {{
        return (x.m > 0) ? ((int64_t)1 << 60) : ((x.m < 0) ? -((int64_t)1 << 60) : 0);
    }}
    return x.m * ((int64_t)1 << (uint32_t)-shift);
}}

static void {prefix}_numbers(const int32_t p[], pvid_scaled_q31 x[])
{{
    for (size_t i = 0; i < {n_p}u; i++) {{
        x[i] = pvid_scaled_of_q31(p[i], -(int32_t){prefix}_p_bits[i]);
    }}
}}

static void {prefix}_theta_fixed(const int32_t p[], int64_t theta[])
{{
    pvid_scaled_q31 x[{n_p}];
    pvid_scaled_q31 found[{n_theta}];
    {prefix}_numbers(p, x);
    {prefix}_theta_q31(x, found);
    for (size_t i = 0; i < {n_theta}u; i++) {{
        theta[i] = {prefix}_fixed(found[i], {prefix}_theta_bits[i]);
    }}
}}

static void {prefix}_jacobian_fixed(const int32_t p[], int64_t c[])
{{
    pvid_scaled_q31 x[{n_p}];
    pvid_scaled_q31 found[{n_c}];
    {prefix}_numbers(p, x);
    {prefix}_jacobian_q31(x, found);
    for (size_t i = 0; i < {n_c}u; i++) {{
        c[i] = {prefix}_fixed(found[i], {prefix}_c_bits[i]);
    }}
}}

/* Those of the configuration's p_bits, which must be {prefix}_p_bits. */
static void {prefix}_formats(const int8_t p_bits[], int16_t theta_bits[], int16_t c_bits[])
{{
    (void)p_bits;
    for (size_t i = 0; i < {n_theta}u; i++) {{
        theta_bits[i] = {prefix}_theta_bits[i];
    }}
    for (size_t i = 0; i < {n_c}u; i++) {{
        c_bits[i] = {prefix}_c_bits[i];
    }}
}}

static const pvid_model_q31 {prefix}_model_q31 = {{
    .n_theta = {n_theta},
    .n_p = {n_p},
    .n_kinds = {n_kinds},
    .n_c = {n_c},
    .positive = {positive}u,
    .kind_end = {prefix}_kind_end,
    .c_row = {prefix}_c_row,
    .c_column = {prefix}_c_column,
    .theta = {prefix}_theta_fixed,
    .jacobian = {prefix}_jacobian_fixed,
    .formats = {prefix}_formats,
}};
"""


def c_parameters(made: ParametersQ31, prefix: str) -> str:
    """PREFIX_model_q31 and its functions."""
    functions = made.functions
    generated = [
        c_q31.scaled_function(f"static void {prefix}_{name}_q31(const pvid_scaled_q31 in[], pvid_scaled_q31 out[])", x)
        for name, x in (("theta", functions.theta.program), ("jacobian", functions.jacobian.program))
    ]

    def listed(values: Sequence[int]) -> str:
        return ", ".join(map(str, values))

    own = _C.format(
        prefix=prefix,
        n_p=len(made.p_bits),
        n_theta=len(made.theta_bits),
        n_c=len(made.c_bits),
        n_kinds=len(functions.kinds),
        kind_end=listed([one.theta.stop for one in functions.kinds]),
        p_bits=listed(made.p_bits),
        theta_bits=listed(made.theta_bits),
        c_bits=listed(made.c_bits),
        c_row=listed(functions.c_row),
        c_column=listed(functions.c_column),
        positive=sum(1 << k for k, one in enumerate(functions.model.unknowns) if one.positive),
    )
    return "\n\n".join([*generated, own])
