"""Fields of structs of C by their paths."""

from __future__ import annotations

from typing import Any


def set_field(struct: Any, path: str, value: Any) -> None:
    """Sets one, as in "estimator.start.0"."""
    *parts, last = path.split(".")
    for one in parts:
        struct = struct[int(one)] if one.isdigit() else getattr(struct, one)
    if last.isdigit():
        struct[int(last)] = value
    else:
        setattr(struct, last, value)
