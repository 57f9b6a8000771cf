"""C99 functions of lists of operations: float32, int32 with formats, numbers of any size with 30 digits.

Each operation is one statement.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from pvid.base.errors import PvidError
from pvid.codegen.formats import FixedProgram, angle_of, nearest, shift_of, width_of
from pvid.design.c_tables import float_literal
from pvid.model.operations import Argument, Literal, Program


@dataclass(frozen=True)
class Language:
    """How a printer writes.

    Attributes
    ----------
    statement : of a name and the text of its value
    argument : text of the input at a place
    literal : text of the literal at a place of the list
    operation : text of the operation at a place of the list, from its operands' texts
    names_literals : a literal gets a statement of its own
    """

    statement: Callable[[str, str], str]
    argument: Callable[[int], str]
    literal: Callable[[int], str]
    operation: Callable[[int, list[str]], str]
    names_literals: bool = False


def statements(program: Program, language: Language) -> tuple[list[str], list[str]]:
    """The statements, and the text of each result."""
    texts: list[str] = []
    lines: list[str] = []
    for place, (name, value) in enumerate(zip(names_of(program), program.values, strict=True)):
        if isinstance(value, Argument):
            text = language.argument(value.place)
        elif isinstance(value, Literal):
            text = language.literal(place)
            if not language.names_literals:
                texts.append(text)
                continue
        else:
            text = language.operation(place, [texts[one] for one in value.operands])
        lines.append(language.statement(name, text))
        texts.append(name)
    return lines, [texts[place] for place in program.results]


def names_of(program: Program) -> list[str]:
    """Of each value, in its statement."""
    prefix = temporary_prefix(program.arguments)
    return [
        program.arguments[value.place] if isinstance(value, Argument) else f"{prefix}{place}"
        for place, value in enumerate(program.values)
    ]


def call_of(program: Program, place: int, operands: list[str], calls: Mapping[str, str]) -> str:
    """An operation: the pattern of its kind, or the operator between its operands."""
    kind = program.kind(place)
    return calls.get(kind, f"{{}} {kind} {{}}").format(*operands)


def fixed_call_of(made: FixedProgram, place: int, operands: list[str], calls: Mapping[str, str]) -> str:
    """The same in int32: operands are shifted to the format of a sum, and the shifts of the others are arguments."""
    kind = made.program.kind(place)
    shifts: tuple[int, ...] = ()
    if kind in "+-":
        operands = [_shifted(one, by, calls) for one, by in zip(operands, made.alignment(place), strict=True)]
    elif kind in "*/":
        shifts = (shift_of(made, place),)
    elif kind in ("sin", "cos"):
        by, bits = angle_of(made, place)
        operands, shifts = [_shifted(operands[0], by, calls)], (bits,)
    elif kind == "soft_sign":
        operands, shifts = operands[:1], (width_of(made, place),)
    return calls.get(kind, f"{{}} {kind} {{}}").format(*operands, *shifts)


def _shifted(text: str, by: int, calls: Mapping[str, str]) -> str:
    return calls["shift"].format(text, by) if by else text


def uses_arguments(program: Program) -> bool:
    """Whether any input is read."""
    return any(isinstance(value, Argument) for value in program.values)


def temporary_prefix(names: Iterable[str]) -> str:
    """A letter (or more) such that no name is it and a number."""
    given = list(names)
    letters: list[str] = [*"vwabcdefghjkmnpqrst", "value", "value_of_list"]
    return next(one for one in letters if not any(re.fullmatch(rf"{one}\d+", name) for name in given))


def float32_of(value: Fraction) -> np.float32:
    """The nearest float32, rounded once.

    Raises PvidError where it is beyond the range of float32, or rounds to 0 and is not 0.
    """
    try:
        near = np.float32(float(value))
    except OverflowError:
        near = np.float32(np.inf)
    if not np.isfinite(near) or (near == 0 and value != 0):
        raise PvidError(f"the constant {float(value):.9g} is beyond the range of float32: choose other units")
    candidates = [near, np.nextafter(near, np.float32(np.inf)), np.nextafter(near, np.float32(-np.inf))]
    return min(candidates, key=lambda one: abs(Fraction(float(one)) - value))


def c_literal(value: Fraction) -> str:
    """As in 0.25f."""
    return float_literal(float32_of(value))


def check_literals(program: Program) -> None:
    """PvidError for a constant of the list that float32 does not have."""
    for one in program.values:
        if isinstance(one, Literal):
            float32_of(one.value)


FLOAT_CALLS = {
    "sin": "pvid_sin_f32({})",
    "cos": "pvid_cos_f32({})",
    "sign": "pvid_sign_f32({})",
    "soft_sign": "pvid_soft_sign_f32({}, {})",
    "abs": "pvid_magnitude_f32({})",
    "sqrt": "sqrtf({})",
    "neg": "-{}",
}


def float_function(signature: str, program: Program) -> str:
    """A definition that computes out[] from in[]."""
    language = Language(
        statement=lambda name, text: f"const float {name} = {text};",
        argument=lambda place: f"in[{place}]",
        literal=lambda place: c_literal(program.literal(place)),
        operation=lambda place, operands: call_of(program, place, operands, FLOAT_CALLS),
    )
    lines, results = statements(program, language)
    if not uses_arguments(program):
        lines.append("(void)in;")
    return definition(signature, [*lines, *(f"out[{k}] = {text};" for k, text in enumerate(results))])


def definition(signature: str, lines: Sequence[str]) -> str:
    """A function of these statements."""
    body = "\n".join(f"    {line}" for line in lines)
    return f"{signature}\n{{\n{body}\n}}"


_FIXED = {
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
        operation=lambda place, operands: fixed_call_of(made, place, operands, _FIXED),
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
    """Refuses what numbers of any size have no operation for. Raises PvidError for a square root and a soft sign."""
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
