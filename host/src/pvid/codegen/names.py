"""Names of a model's symbols that are names in C, C++ and Python."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Sequence

_RESERVED = frozenset(
    """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char class compl concept const const_cast
    constexpr continue co_await co_return co_yield decltype default delete do double dynamic_cast else enum explicit
    export extern false float for friend goto if import inline int long module mutable namespace new noexcept not not_eq
    nullptr operator or or_eq private protected public register reinterpret_cast requires restrict return short signed
    sizeof static static_assert static_cast struct switch template this thread_local throw true try typedef typeid
    typename union unsigned using virtual void volatile wchar_t while xor xor_eq
    int8_t int16_t int32_t int64_t uint8_t uint16_t uint32_t uint64_t size_t NULL INT32_C INT64_C
    in out limits np elementary elementary_q31 Scaled
    """.split()
) | set(keyword.kwlist)
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def identifiers(names: Sequence[str]) -> list[str]:
    """One for each name, no two alike: the name itself where it is one, else the letters of it.

    A name that is reserved ends in an underscore; 2 and more are numbered.
    """
    taken: set[str] = set()
    found = []
    for name in names:
        base = re.sub(r"\W+|^(?=\d)", "_", name, flags=re.ASCII).strip("_") or "symbol"
        base = base if _NAME.fullmatch(base) else f"s_{base}"
        if base in _RESERVED or base.startswith("pvid_"):
            base += "_"
        one, number = base, 2
        while one in taken:
            one, number = f"{base}_{number}", number + 1
        taken.add(one)
        found.append(one)
    return found


def temporary_prefix(names: Iterable[str]) -> str:
    """A letter (or more) such that no name is it and a number."""
    given = list(names)
    letters: list[str] = [*"vwabcdefghjkmnpqrst", "value", "value_of_list"]
    return next(one for one in letters if not any(re.fullmatch(rf"{one}\d+", name) for name in given))
