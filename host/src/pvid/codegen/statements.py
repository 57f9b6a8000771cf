"""One statement for each operation of a list: what the printers share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

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


def uses_arguments(program: Program) -> bool:
    """Whether any input is read."""
    return any(isinstance(value, Argument) for value in program.values)
