"""Every scalar of a configuration as C sees it, by name: for tests that change one at a time."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any


@dataclass
class Field:
    """One scalar of a ctypes structure: `name` with its path (estimator.start[2]), and where it stands."""

    name: str
    holder: Any
    key: str | int

    @property
    def value(self) -> Any:
        """What it holds."""
        return self.holder[self.key] if isinstance(self.key, int) else getattr(self.holder, self.key)

    @value.setter
    def value(self, value: Any) -> None:
        if isinstance(self.key, int):
            self.holder[self.key] = value
        else:
            setattr(self.holder, self.key, value)

    @property
    def group(self) -> str:
        """The name without the place in an array."""
        return self.name.partition("[")[0]

    @property
    def place(self) -> int:
        """The place in an array, 0 outside one."""
        return self.key if isinstance(self.key, int) else 0


def fields_of(struct: Any, prefix: str = "") -> Iterator[Field]:
    """All scalars, those of the structures within and of those pointed to as well; other pointers as they are."""
    for key, *_ in struct._fields_:
        value, name = getattr(struct, key), f"{prefix}{key}"
        if isinstance(value, ctypes.Structure):
            yield from fields_of(value, f"{name}.")
        elif isinstance(value, ctypes.Array):
            yield from (Field(f"{name}[{i}]", value, i) for i in range(len(value)))
        elif hasattr(value, "contents") and isinstance(value.contents, ctypes.Structure):
            yield from fields_of(value.contents, f"{name}.")
        else:
            yield Field(name, struct, key)
