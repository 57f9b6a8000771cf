"""The float32 twin of c_f32: the same list as element-wise numpy."""

from __future__ import annotations

from pvid.codegen.literals import python_literal
from pvid.codegen.names import temporary_prefix
from pvid.codegen.operations import Argument, Literal, Program

_CALLS = {
    "sin": "elementary.sine({})",
    "cos": "elementary.cosine({})",
    "sign": "elementary.sign({})",
    "soft_sign": "elementary.soft_sign({}, {})",
    "abs": "elementary.magnitude({})",
    "sqrt": "np.sqrt({})",
    "neg": "-{}",
}


def function(name: str, program: Program, summary: str) -> str:
    """A definition; of float32 [inputs, ...] it makes [results, ...]."""
    prefix = temporary_prefix(program.arguments)
    names: list[str] = []
    lines: list[str] = []
    for place, value in enumerate(program.values):
        if isinstance(value, Literal):
            names.append(python_literal(value.value))
        elif isinstance(value, Argument):
            argument = program.arguments[value.place]
            lines.append(f"{argument} = _in[{value.place}]")
            names.append(argument)
        else:
            operands = [names[one] for one in value.operands]
            call = _CALLS.get(value.kind, f"{{}} {value.kind} {{}}").format(*operands)
            lines.append(f"{prefix}{place} = {call}")
            names.append(f"{prefix}{place}")
    lines += [f"_out[{k}] = {names[place]}" for k, place in enumerate(program.results)]
    return "\n".join(
        [
            f"def {name}(_in: Float32) -> Float32:",
            f'    """{summary}"""',
            f"    _out = np.empty(({len(program.results)}, *_in.shape[1:]), np.float32)",
            '    with np.errstate(all="ignore"):',
            *(f"        {line}" for line in lines),
            "    return _out",
        ]
    )
