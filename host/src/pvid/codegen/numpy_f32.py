"""The float32 twin of c_f32: the same list as element-wise numpy."""

from __future__ import annotations

from pvid.codegen.c_functions import Language, call_of, python_literal, statements
from pvid.codegen.operations import Program

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
    language = Language(
        statement=lambda one, text: f"{one} = {text}",
        argument=lambda place: f"_in[{place}]",
        literal=lambda place: python_literal(program.literal(place)),
        operation=lambda place, operands: call_of(program, place, operands, _CALLS),
    )
    lines, results = statements(program, language)
    return "\n".join(
        [
            f"def {name}(_in: Float32) -> Float32:",
            f'    """{summary}"""',
            f"    _out = np.empty(({len(program.results)}, *_in.shape[1:]), np.float32)",
            '    with np.errstate(all="ignore"):',
            *(f"        {line}" for line in lines),
            *(f"        _out[{k}] = {text}" for k, text in enumerate(results)),
            "    return _out",
        ]
    )
