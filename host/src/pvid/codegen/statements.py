"""One statement for each operation of a list: what the printers share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pvid.codegen.formats import FixedProgram, angle_of, shift_of, width_of
from pvid.codegen.names import temporary_prefix
from pvid.codegen.operations import Argument, Literal, Program


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
    prefix = temporary_prefix(program.arguments)
    texts: list[str] = []
    lines: list[str] = []
    for place, value in enumerate(program.values):
        name = f"{prefix}{place}"
        if isinstance(value, Argument):
            name = program.arguments[value.place]
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
