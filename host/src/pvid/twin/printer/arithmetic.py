"""Numbers: literals, conversions and what is known of a result, so that it is wrapped only where C may wrap it."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np

from pvid.twin.printer import machine
from pvid.twin.printer.declared import Declared
from pvid.twin.printer.term import (
    AND,
    ATOM,
    COMPARED,
    INTEGERS,
    LARGEST_SIZE,
    OR,
    SHIFT,
    UNARY,
    Scope,
    Type,
    Value,
    nearest,
)


class Arithmetic(Declared):
    """Numbers."""

    def _integer(self, code: str, t: Type, level: int = ATOM, **known: Any) -> Value:
        low, high = self._range(t)
        return replace(Value(code, t, level, low=low, high=high), **known)

    @staticmethod
    def _range(t: Type) -> tuple[int, int]:
        if isinstance(t, tuple):
            return (t[1], t[2]) if t[0] == "enum" else (0, 0)
        if t == "_Bool":
            return 0, 1
        if t == "size_t":
            return 0, LARGEST_SIZE
        if t in INTEGERS:
            bits, signed = INTEGERS[t]
            return (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)
        return 0, 0

    def _constant_value(self, value: int, t: Type = "int32_t", code: str | None = None) -> Value:
        return Value(code or str(value), t, ATOM if value >= 0 else UNARY, low=value, high=value, const=value)

    def _of_constant(self, node: Any, _: Scope) -> Value:
        text = node.value
        if node.type == "string":
            return Value(text, ("ptr", "int8_t"))
        if node.type == "char":
            return self._constant_value(ord(eval(text)))
        if (
            "float" in node.type
            or "double" in node.type
            or (not text.startswith("0x") and re.search(r"[.eE]|\d[fF]$", text))
        ):
            return self._float_constant(text.rstrip("fFlL"))
        body = text.rstrip("uUlL")
        number = int(body, 8) if re.fullmatch(r"0[0-7]+", body) else int(body, 0)
        unsigned = "u" in text.lower().replace("0x", "")
        long = number > 0xFFFFFFFF or (number > 0x7FFFFFFF and not unsigned and not body.startswith("0x"))
        unsigned = unsigned or (body.startswith("0x") and number > 0x7FFFFFFF)
        t = ("uint64_t" if long else "uint32_t") if unsigned else ("int64_t" if long else "int32_t")
        return self._constant_value(number, t, body.lower() if body.lower().startswith("0x") else str(number))

    @staticmethod
    def _float_constant(text: str) -> Value:
        whole = nearest(text)
        code = text if float(np.float32(float(text))) == whole else repr(whole)
        code = f"{code}.0" if re.fullmatch(r"\d+", code) else f"{code}0" if code.endswith(".") else code
        return Value(f"f32({code})", "float", const=whole)

    def _converted(self, value: Value, to: Type) -> Value:
        """A number as another type."""
        if to == "float":
            if value.type == "float":
                return value
            if value.const is not None:
                return Value(f"f32({value.code})", "float", const=float(np.float32(value.const)))
            return Value(f"f32({value.code})", "float")
        if to == "_Bool":
            if value.type == "_Bool":
                return value
            if isinstance(value.const, int):
                return Value(
                    str(bool(value.const)),
                    "_Bool",
                    low=int(bool(value.const)),
                    high=int(bool(value.const)),
                    const=int(bool(value.const)),
                )
            if isinstance(value.type, tuple) and value.type[0] == "ptr":
                return Value(f"{value.code} is not None", "_Bool", COMPARED, low=0, high=1)
            return Value(f"{value.within(OR)} != 0", "_Bool", COMPARED, low=0, high=1)
        low, high = self._range(to)
        if value.type == "float":
            return self._integer(f"int({value.code})", to)
        if value.type == "_Bool" and value.const is None:
            return Value(f"int({value.code})", to, low=0, high=1)
        if isinstance(to, tuple) or (low <= value.low and value.high <= high):
            return replace(value, type=to if not isinstance(to, tuple) else "int32_t")
        bits, signed = INTEGERS[to]
        if to == "size_t":
            return (
                self._wrapped(value, 64, to) if value.low < 0 else replace(value, type=to, high=min(value.high, high))
            )
        if not signed:
            return self._wrapped(value, bits, to)
        if isinstance(value.const, int):
            return self._constant_value(machine.signed(value.const, bits), to)
        return Value(f"signed({value.code}, {bits})", to, low=low, high=high)

    def _wrapped(self, value: Value, bits: int, t: Type) -> Value:
        mask = (1 << bits) - 1
        if isinstance(value.const, int):
            return self._constant_value(value.const & mask, t)
        plain = value.plain
        low, high = self._range(t)
        return Value(
            f"{value.within(ATOM)} & {mask:#x}",
            t,
            AND,
            low=0,
            high=high,
            plain=plain or (value if t == "size_t" else None),
        )

    def _promoted(self, value: Value) -> Value:
        t = value.type
        if t == "_Bool":
            return self._converted(value, "int32_t")
        if isinstance(t, tuple) and t[0] == "enum":
            return replace(value, type="int32_t")
        if t in INTEGERS and INTEGERS[t][0] < 32:
            return replace(value, type="int32_t")
        return value

    def _fitted(self, value: Value) -> Value:
        """A result that is unsigned in C: wrapped, where it may be beyond its type."""
        if value.type in INTEGERS and not INTEGERS[value.type][1]:
            bits = INTEGERS[value.type][0]
            if value.low < 0 or value.high >= 1 << bits:
                return self._wrapped(value, bits, value.type)
            return value
        low, high = self._range(value.type)
        if value.low < low or value.high > high:  # a signed result beyond its type is an error in C
            return replace(value, low=max(value.low, low), high=min(value.high, high))
        return value

    def _truth(self, value: Value) -> Value:
        return self._converted(value, "_Bool") if value.type not in ("_Bool", "float") else value

    def _common(self, a: Type, b: Type) -> Type:
        if "float" in (a, b):
            return "float"
        (bits, signed), (other, _) = INTEGERS[a], INTEGERS[b]
        if bits == other:
            return a if not signed else b
        return a if bits > other else b

    def _shifted(self, op: str, a: Value, b: Value) -> Value:
        code = f"{a.within(SHIFT)} {op} {b.within(SHIFT + 1)}"
        known = isinstance(a.const, int) and isinstance(b.const, int)
        if op == ">>":
            low, high = a.low >> (max(b.low, 0) if a.low >= 0 else max(b.low, 0)), a.high >> max(b.low, 0)
            const = a.const >> b.const if known else None  # type: ignore[operator]
            return Value(
                code,
                a.type,
                SHIFT,
                low=min(low, a.low) if const is None else const,
                high=high if const is None else const,
                const=const,
            )
        most = min(max(b.high, 0), 64)
        const = a.const << b.const if known else None  # type: ignore[operator]
        if const is not None:
            return self._fitted(Value(code, a.type, SHIFT, low=const, high=const, const=const))
        return self._fitted(Value(code, a.type, SHIFT, low=a.low << most if a.low < 0 else 0, high=a.high << most))

    def _decayed(self, value: Value) -> Value:
        if isinstance(value.type, tuple) and value.type[0] == "arr":
            return replace(value, type=("ptr", value.type[1]), single=False)
        return value
