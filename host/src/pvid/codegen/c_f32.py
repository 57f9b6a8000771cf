"""C99 float32 of a list of operations."""

from __future__ import annotations

from collections.abc import Sequence

from pvid.codegen.literals import c_literal
from pvid.codegen.operations import Program
from pvid.codegen.statements import Language, call_of, statements, uses_arguments

_CALLS = {
    "sin": "pvid_sin_f32({})",
    "cos": "pvid_cos_f32({})",
    "sign": "pvid_sign_f32({})",
    "soft_sign": "pvid_soft_sign_f32({}, {})",
    "abs": "pvid_magnitude_f32({})",
    "sqrt": "sqrtf({})",
    "neg": "-{}",
}


def function(signature: str, program: Program) -> str:
    """A definition that computes out[] from in[]."""
    language = Language(
        statement=lambda name, text: f"const float {name} = {text};",
        argument=lambda place: f"in[{place}]",
        literal=lambda place: c_literal(program.literal(place)),
        operation=lambda place, operands: call_of(program, place, operands, _CALLS),
    )
    lines, results = statements(program, language)
    if not uses_arguments(program):
        lines.append("(void)in;")
    return definition(signature, [*lines, *(f"out[{k}] = {text};" for k, text in enumerate(results))])


def definition(signature: str, lines: Sequence[str]) -> str:
    """A function of these statements."""
    body = "\n".join(f"    {line}" for line in lines)
    return f"{signature}\n{{\n{body}\n}}"
