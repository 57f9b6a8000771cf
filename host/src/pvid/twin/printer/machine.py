"""What printed code imports: float32 numbers and their bits, integers that wrap, structs, and copies of memory."""

from __future__ import annotations

from struct import Struct
from typing import Any

import numpy as np

f32 = np.float32
WHOLE = -1  # size of a struct

_FLOAT, _WORD = Struct("<f"), Struct("<I")


def bits(x: Any) -> int:
    """The bits of a float32."""
    return int(_WORD.unpack(_FLOAT.pack(x))[0])


def from_bits(word: int) -> Any:
    """The float32 of these bits."""
    return f32(_FLOAT.unpack(_WORD.pack(word))[0])


def signed(x: int, width: int) -> int:
    """x modulo 2^width as a signed integer."""
    half = 1 << (width - 1)
    return ((x + half) & (2 * half - 1)) - half


def quotient(a: int, b: int) -> int:
    """a / b in C: towards 0."""
    return a // b if (a < 0) == (b < 0) else -(-a // b)


def remainder(a: int, b: int) -> int:
    """a % b in C: with the sign of a."""
    return a - b * quotient(a, b)


sqrtf: Any = np.sqrt


def fabsf(x: Any) -> Any:
    """|x|."""
    return abs(x)


class Place:
    """A pointer to a field that is a number."""

    __slots__ = ("_name", "_owner")

    def __init__(self, owner: Any, name: str) -> None:
        self._owner, self._name = owner, name

    def __getitem__(self, _: int) -> Any:
        return getattr(self._owner, self._name)

    def __setitem__(self, _: int, value: Any) -> None:
        setattr(self._owner, self._name, value)


def share(*given: Any) -> None:
    """A copy word by word, to `to` from `of`: of a struct, or of `size` bytes of an array of words; 0: of nothing.

    Arguments are to, of and size, or to, to_at, of, of_at and size where the arrays are parts of larger ones.
    """
    (to, to_at, of, of_at, size) = given if len(given) == 5 else (given[0], 0, given[1], 0, given[2])
    if size == WHOLE:
        to.assign(of)
    elif size > 0:
        to[to_at : to_at + size // 4] = of[of_at : of_at + size // 4]


def clear(one: Any) -> None:
    """All bytes of an object are 0."""
    one.clear()


def assign_all(to: Any, to_at: int, of: Any, of_at: int, count: int) -> None:
    """Copies structs of an array."""
    for k in range(count):
        to[to_at + k].assign(of[of_at + k])


class Array:
    """A field with `count` entries: of one value, or of a struct."""

    def __init__(self, entry: Any, count: int) -> None:
        self.entry, self.count = entry, count

    def made(self) -> list[Any]:
        """A new one."""
        return [self.entry() for _ in range(self.count)] if isinstance(self.entry, type) else [self.entry] * self.count


class Pointer:
    """A field that points to numbers of a C type, to a struct of this name, or to `many` of them."""

    def __init__(self, to: str, many: bool = False) -> None:
        self.to, self.many = to, many


def struct(declared: type) -> Any:
    """A class with the fields that `declared` has as attributes, in their order, all 0 at first.

    Its objects have `copy`, `assign` (of all fields of another one) and `clear`.
    """
    fields = {name: value for name, value in vars(declared).items() if not name.startswith("__")}
    space: dict[str, Any] = {
        f"_{name}": None if isinstance(value, Pointer) else value for name, value in fields.items()
    }
    given, made, taken = [], [], []
    for name, value in fields.items():
        if isinstance(value, Array):
            many = isinstance(value.entry, type)
            space[f"_{name}"], space[f"_{name}_n"] = value.entry, value.count
            new = f"[_{name}() for _ in range(_{name}_n)]" if many else f"[_{name}] * _{name}_n"
            if many:
                taken += [f"for a, b in zip(self.{name}, other.{name}):", "    a.assign(b)"]
            else:
                taken.append(f"self.{name}[:] = other.{name}")
        elif isinstance(value, type):
            new = f"_{name}()"
            taken.append(f"self.{name}.assign(other.{name})")
        else:
            given.append(f"{name}=_{name}")
            made.append(f"self.{name} = {name}")
            taken.append(f"self.{name} = other.{name}")
            continue
        given.append(f"{name}=None")
        made.append(f"self.{name} = {new} if {name} is None else {name}")
    lines = [f"def __init__(self, {', '.join(given)}):", *(f"    {one}" for one in made or ["pass"])]
    lines += ["def assign(self, other):", *(f"    {one}" for one in taken or ["pass"])]
    lines += ["def copy(self):", "    new = type(self)()", "    new.assign(self)", "    return new"]
    lines += ["def clear(self):", "    self.__init__()"]
    exec("\n".join(lines), space)
    body = {name: space[name] for name in ("__init__", "assign", "copy", "clear")}
    return type(
        declared.__name__, (), {**body, "__slots__": tuple(fields), "__doc__": declared.__doc__, "__fields__": fields}
    )
