"""What an expression of C is in Python: its code, its type, what is known of its value; the levels of operators."""

from __future__ import annotations

import keyword
import re
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from pvid.twin.printer import machine

# A name of INTEGERS, "float", "_Bool", "void"; ("enum", low, high), ("ptr", type), ("arr", type, length, its code),
# ("struct", name), ("fn", node, name).
Type = Any

INTEGERS = {
    "int8_t": (8, True), "uint8_t": (8, False), "int16_t": (16, True), "uint16_t": (16, False), "int32_t": (32, True),
    "uint32_t": (32, False), "int64_t": (64, True), "uint64_t": (64, False), "size_t": (64, False),
    "ptrdiff_t": (64, True), "uintptr_t": (64, False),
}  # fmt: skip
STANDARD = {
    "int": "int32_t",
    "unsigned int": "uint32_t",
    "unsigned": "uint32_t",
    "char": "int8_t",
    "unsigned char": "uint8_t",
}
LARGEST_SIZE = (1 << 32) - 1  # a size or an index: less, on every processor
ATOM, UNARY, PRODUCT, SUM, SHIFT, AND, XOR, OR, COMPARED, NOT, BOTH, EITHER, CHOICE = range(13, 0, -1)
LEVELS = {
    "*": PRODUCT,
    "/": PRODUCT,
    "%": PRODUCT,
    "+": SUM,
    "-": SUM,
    "<<": SHIFT,
    ">>": SHIFT,
    "&": AND,
    "^": XOR,
    "|": OR,
}
# Names that printed code needs for something else; fields have the methods of structs.
TAKEN = {
    *keyword.kwlist,
    *(name for name in vars(machine) if not name.startswith("_")),
    "range",
    "int",
    "abs",
    "copy",
    "assign",
}
NATIVE = {"sqrtf": "float", "fabsf": "float"}
NUMBERS = re.compile(r"^-?(?:0x[0-9a-fA-F]+|\d+)$")


@dataclass(frozen=True)
class Value:
    """An expression.

    code : in Python; of a pointer and of an array its list, of a pointer to one struct (`single`) the struct
    at : offset of a pointer or an array, in numbers or structs; "*": `code` is a call that returns list and offset
    level : of the outermost operator
    low, high : of an integer
    const : value of a constant
    fresh : a struct that nobody else has
    slot : variable, field, parameter or result that it is
    plain : of a difference of sizes that is wrapped: it without that
    """

    code: str
    type: Type
    level: int = ATOM
    at: str = "0"
    single: bool = False
    low: int = 0
    high: int = 0
    const: int | float | None = None
    fresh: bool = False
    slot: Any = None
    plain: Value | None = None

    def within(self, level: int) -> str:
        """As an operand of an operator of this level."""
        return self.code if self.level >= level else f"({self.code})"


@dataclass
class Function:
    node: Any
    key: str
    file: str
    line: int


@dataclass
class Scope:
    """Names of a block: C name -> Python name, type, slot, boxed."""

    names: dict[str, tuple[str, Type, Any, bool]] = field(default_factory=dict)

    def inner(self) -> Scope:
        return Scope(dict(self.names))


def is_pointer(value: Value) -> bool:
    return isinstance(value.type, tuple) and value.type[0] in ("ptr", "arr")


def is_number(value: Value) -> bool:
    return not isinstance(value.type, tuple) or value.type[0] == "enum"


def nearest(text: str) -> float:
    """The float32 next to a decimal number, as a double: rounded once."""
    exact, near = Fraction(text), np.float32(float(text))
    with np.errstate(over="ignore"):
        close = [np.nextafter(near, end) for end in (np.float32(-np.inf), np.float32(np.inf))]
    finite = [one for one in (near, *close) if np.isfinite(one)]
    return float(min(finite, key=lambda one: (abs(Fraction(float(one)) - exact), int(one.view(np.uint32)) & 1)))


def bounds(op: str, a: Value, b: Value) -> tuple[int, int]:
    if op == "+":
        return a.low + b.low, a.high + b.high
    if op == "-":
        return a.low - b.high, a.high - b.low
    if op == "*":
        ends = [x * y for x in (a.low, a.high) for y in (b.low, b.high)]
        return min(ends), max(ends)
    if a.low >= 0 and b.low >= 0:
        if op == "&":
            return 0, min(a.high, b.high)
        return 0, (1 << max(a.high.bit_length(), b.high.bit_length())) - 1
    if op == "&" and (a.low >= 0 or b.low >= 0):
        return 0, a.high if a.low >= 0 else b.high
    return min(a.low, b.low, -(1 << 63)), max(a.high, b.high, (1 << 63) - 1)


def moved(at: str, by: str) -> str:
    """The sum of two offsets."""
    if by == "0":
        return at
    return by if at == "0" else f"{at} + {by}"


def operand(code: str) -> str:
    return code if re.fullmatch(r"[\w.]+", code) else f"({code})"


def slice_of(at: str, count: str) -> str:
    if at == "0":
        return f":{count}"
    if NUMBERS.match(at) and NUMBERS.match(count):
        return f"{at}:{int(at) + int(count)}"
    return f"{at} : {at} + {count}"


def with_comment(line: str, said: str) -> str:
    said = " ".join(said.split())
    return f"{line}  # {said}" if said and len(line) + len(said) + 4 <= 120 else line


def docstring(said: str, depth: int) -> list[str]:
    if not said:
        return []
    pad = "    " * depth
    lines = said.replace("\\", "\\\\").replace('"""', "'''").split("\n")
    end = " " if lines[-1].endswith('"') else ""
    if len(lines) == 1:
        return [f'{pad}"""{lines[0]}{end}"""']
    return [f'{pad}"""{lines[0]}', *(f"{pad}{one}".rstrip() for one in lines[1:]), f'{pad}"""']


def short(file: str) -> str:
    parts = Path(file).parts
    return "/".join(parts[-2:])
