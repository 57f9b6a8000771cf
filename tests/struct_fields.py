"""Fields of structs of C by their paths."""

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


def numbers_of(struct: Any) -> list[str]:
    """Names of the fields of a record of numpy that hold numbers: no structs of their own."""
    return [name for name in struct.dtype.names or () if struct.dtype[name].names is None]
