"""C99 integers of a list of operations: int32 with formats, and numbers of any size with 30 digits."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from pvid.base.errors import PvidError
from pvid.codegen.c_f32 import definition
from pvid.codegen.formats import FixedProgram, nearest
from pvid.codegen.operations import Program
from pvid.codegen.statements import Language, fixed_call_of, statements, uses_arguments

_CALLS = {
    "*": "pvid_fixed_product_q31({}, {}, {})",
    "/": "pvid_fixed_quotient_q31({}, {}, {})",
    "sin": "pvid_sin_q31({}, {})",
    "cos": "pvid_cos_q31({}, {})",
    "soft_sign": "pvid_soft_sign_q31({}, {})",
    "shift": "pvid_fixed_shift_q31({}, {})",
    "sign": "pvid_sign_q31({})",
    "abs": "pvid_fixed_magnitude_q31({})",
    "neg": "-{}",
}


def fixed_function(signature: str, made: FixedProgram, limits: Sequence[int]) -> str:
    """A definition that refuses inputs beyond their limits, else computes the results."""
    program = made.program
    language = Language(
        statement=lambda name, text: f"const int32_t {name} = {text};",
        argument=lambda place: f"in[{place}]",
        literal=lambda place: str(made.integer(place)),
        operation=lambda place, operands: fixed_call_of(made, place, operands, _CALLS),
    )
    lines, results = statements(program, language)
    checks = [
        f"static const int32_t limits[{len(limits)}] = {{{', '.join(map(str, limits))}}};",
        f"if (!pvid_within_limits_q31(in, limits, {len(limits)})) {{",
        "    return false;",
        "}",
    ]
    return definition(
        signature, [*checks, *lines, *(f"out[{k}] = {one};" for k, one in enumerate(results)), "return true;"]
    )


_SCALED = {
    "+": "pvid_scaled_plus_q31({}, {})",
    "-": "pvid_scaled_minus_q31({}, {})",
    "*": "pvid_scaled_times_q31({}, {})",
    "/": "pvid_scaled_quotient_q31({}, {})",
    "neg": "pvid_scaled_negated_q31({})",
    "sin": "pvid_scaled_sin_q31({})",
    "cos": "pvid_scaled_cos_q31({})",
    "sign": "pvid_scaled_sign_q31({})",
    "abs": "pvid_scaled_magnitude_q31({})",
}


def scaled_literal(value: Fraction) -> tuple[int, int]:
    """m, e with m 2^e the nearest number of 30 digits: 2^29 <= |m| < 2^30, or 0, 0."""
    if value == 0:
        return 0, 0
    size = abs(value)
    exponent = size.numerator.bit_length() - size.denominator.bit_length() - 30
    while nearest(size / Fraction(2) ** exponent) >= 2**30:
        exponent += 1
    while nearest(size / Fraction(2) ** exponent) < 2**29:
        exponent -= 1
    return nearest(value / Fraction(2) ** exponent), exponent


def require_scaled(program: Program, where: str) -> None:
    """Refuses what numbers of any size have no operation for.

    Raises
    ------
    PvidError
        For a square root and a soft sign.
    """
    missing = sorted(program.kinds - set(_SCALED))
    if missing:
        words = {"sqrt": "a square root", "soft_sign": "a soft sign"}
        raise PvidError(f"{where}: {words[missing[0]]} has no fixed-point form")


def scaled_function(signature: str, program: Program) -> str:
    """The same with numbers of any size."""

    def literal(place: int) -> str:
        m, e = scaled_literal(program.literal(place))
        return f"{{{m}, {e}}}"

    language = Language(
        statement=lambda name, text: f"const pvid_scaled_q31 {name} = {text};",
        argument=lambda place: f"in[{place}]",
        literal=literal,
        operation=lambda place, operands: _SCALED[program.kind(place)].format(*operands),
        names_literals=True,
    )
    lines, results = statements(program, language)
    if not uses_arguments(program):
        lines.append("(void)in;")
    return definition(signature, [*lines, *(f"out[{k}] = {text};" for k, text in enumerate(results))])
