"""The twins of c_q31: the same lists as element-wise numpy integers."""

from __future__ import annotations

from collections.abc import Sequence

from pvid.codegen.c_functions import Language, fixed_call_of, scaled_literal, statements
from pvid.codegen.formats import FixedProgram
from pvid.codegen.operations import Program

_CALLS = {
    "*": "elementary_q31.product({}, {}, {})",
    "/": "elementary_q31.quotient({}, {}, {})",
    "sin": "elementary_q31.sine({}, {})",
    "cos": "elementary_q31.cosine({}, {})",
    "soft_sign": "elementary_q31.soft_sign({}, {})",
    "shift": "elementary_q31.shift({}, {})",
    "sign": "elementary_q31.sign({})",
    "abs": "elementary_q31.magnitude({})",
    "neg": "-{}",
}


def fixed_function(name: str, made: FixedProgram, limits: Sequence[int], summary: str) -> str:
    """A definition; it makes [results, ...] and whether the inputs are within their limits of [inputs, ...]."""
    program = made.program
    language = Language(
        statement=lambda one, text: f"{one} = {text}",
        argument=lambda place: f"_in[{place}]",
        literal=lambda place: str(made.integer(place)),
        operation=lambda place, operands: fixed_call_of(made, place, operands, _CALLS),
    )
    lines, results = statements(program, language)
    return "\n".join(
        [
            f"def {name}(_in: Int) -> tuple[Int, npt.NDArray[np.bool_]]:",
            f'    """{summary}"""',
            f"    _out = np.empty(({len(program.results)}, *_in.shape[1:]), np.int64)",
            *(f"    {line}" for line in lines),
            *(f"    _out[{k}] = {text}" for k, text in enumerate(results)),
            f"    return _out, elementary_q31.within(_in, {list(limits)!r})",
        ]
    )


_SCALED = {
    "+": "{}.plus({})",
    "-": "{}.minus({})",
    "*": "{}.times({})",
    "/": "elementary_q31.scaled_quotient({}, {})",
    "neg": "elementary_q31.negated({})",
    "sin": "elementary_q31.scaled_sine({})",
    "cos": "elementary_q31.scaled_cosine({})",
    "sign": "elementary_q31.scaled_sign({})",
    "abs": "elementary_q31.scaled_magnitude({})",
}


def scaled_function(name: str, program: Program, summary: str) -> str:
    """A definition; of m and e int64 [inputs, ...] it makes the same [results, ...]."""

    def literal(place: int) -> str:
        m, e = scaled_literal(program.literal(place))
        return f"elementary_q31.constant({m}, {e}, Scaled(_in.m[0], _in.e[0]))"

    language = Language(
        statement=lambda one, text: f"{one} = {text}",
        argument=lambda place: f"Scaled(_in.m[{place}], _in.e[{place}])",
        literal=literal,
        operation=lambda place, operands: _SCALED[program.kind(place)].format(*operands),
        names_literals=True,
    )
    lines, results = statements(program, language)
    return "\n".join(
        [
            f"def {name}(_in: Scaled) -> Scaled:",
            f'    """{summary}"""',
            *(f"    {line}" for line in lines),
            f"    _out = [{', '.join(results)}]",
            "    return Scaled(np.stack([one.m for one in _out]), np.stack([one.e for one in _out]))",
        ]
    )
