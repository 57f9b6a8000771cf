"""C99 float32 of a list of operations."""

from __future__ import annotations

from pvid.codegen.literals import c_literal
from pvid.codegen.names import temporary_prefix
from pvid.codegen.operations import Argument, Literal, Program

_CALLS = {
    "sin": "pvid_sin_f32({})",
    "cos": "pvid_cos_f32({})",
    "sign": "pvid_sign_f32({})",
    "soft_sign": "pvid_soft_sign_f32({}, {})",
    "abs": "pvid_magnitude_f32({})",
    "sqrt": "sqrtf({})",
    "neg": "-{}",
}


def body(program: Program) -> list[str]:
    """Statements that compute out[] from in[]."""
    prefix = temporary_prefix(program.arguments)
    names: list[str] = []
    lines: list[str] = []
    for place, value in enumerate(program.values):
        if isinstance(value, Literal):
            names.append(c_literal(value.value))
        elif isinstance(value, Argument):
            name = program.arguments[value.place]
            lines.append(f"const float {name} = in[{value.place}];")
            names.append(name)
        else:
            operands = [names[one] for one in value.operands]
            call = _CALLS.get(value.kind, f"{{}} {value.kind} {{}}").format(*operands)
            lines.append(f"const float {prefix}{place} = {call};")
            names.append(f"{prefix}{place}")
    if not any(isinstance(value, Argument) for value in program.values):
        lines.append("(void)in;")
    lines += [f"out[{k}] = {names[place]};" for k, place in enumerate(program.results)]
    return lines


def function(signature: str, program: Program) -> str:
    """A definition."""
    lines = "\n".join(f"    {line}" for line in body(program))
    return f"{signature}\n{{\n{lines}\n}}"
