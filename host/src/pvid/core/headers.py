"""The C core's public headers as cffi reads them: its structs, enumerations and functions."""

from __future__ import annotations

import hashlib
import io
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cffi
import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.core.sources import IS_CLONE, PACKAGE, ROOT, cache_folder, keep_text, kept_text

HEADERS = "pvid.i"  # the preprocessed headers, beside the library that the build makes with them

Tables = dict[str, npt.NDArray[Any]]
Placed = tuple[Any, int]  # a struct of C as a numpy record, and the address that it had

# Fields of a configuration that the identifier sets, and a field with another name in Python.
_FILLED_LATER = ("angle", "model", "update_rate_hz", "refine")
_NAMES = {"sample_rate_hz": "sample_rate"}
_INLINE = re.compile(r"^static inline [^{;]*\{[^}]*\}\n", re.MULTILINE)


def default_library() -> Path:
    """Where the build leaves the shared library; PVID_NATIVE_LIBRARY overrides it."""
    named = os.environ.get("PVID_NATIVE_LIBRARY")
    return Path(named) if named else _built()


def _built() -> Path:
    folder = ROOT / "build" / "host" / "host" / "native" if IS_CLONE else PACKAGE
    return folder / "libpvid_native.so"


@dataclass
class Filled:
    """A struct of C with the tables that it points to, by field: they must live as long as the struct."""

    struct: Any  # a reference to it
    tables: Tables
    designs: dict[str, Any]  # structs that it points to, by field
    owners: list[Any]


@dataclass(frozen=True)
class Scalar:
    """One number or pointer in a struct of C: `name` with its path (estimator.start[2]), its C type and its place."""

    name: str
    kind: Any
    holder: Any
    key: str | int

    @property
    def value(self) -> Any:
        """Its value."""
        return self.holder[self.key] if isinstance(self.key, int) else getattr(self.holder, self.key)

    def set(self, value: Any) -> None:
        """Overwrites the value."""
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


class Headers:
    """The declarations of one build of the core. `ffi`: cffi's interface to them."""

    def __init__(self, text: str) -> None:
        space: dict[str, Any] = {}
        exec(_compiled(text), space)
        self.ffi: Any = space["ffi"]
        self._records: dict[Any, np.dtype[Any]] = {}

    @staticmethod
    def of(library: Path) -> Headers:
        """Those that `library` was built with; of a library without them, those of the build in this checkout.

        Raises PvidError when there are none.
        """
        beside = library.with_name(HEADERS)
        path = beside if beside.exists() else _built().with_name(HEADERS)
        try:
            return _parsed(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise PvidError(f"cannot read {path}: {error.strerror}; build it with ./tools/pvid") from error

    def enum(self, name: str) -> dict[str, int]:
        """The enumerators of a C enumeration, by value."""
        elements = self.ffi.typeof(name).elements
        return {elements[value]: value for value in sorted(elements)}

    def dtype(self, kind: Any) -> np.dtype[Any]:
        """numpy's type of the same layout as a C type, given by name or as cffi's."""
        ctype = self.ffi.typeof(kind) if isinstance(kind, str) else kind
        size = self.ffi.sizeof(ctype)
        match ctype.kind:
            case "struct" | "union":
                names, fields = zip(*ctype.fields, strict=True)
                formats = [self.dtype(field.type) for field in fields]
                offsets = [field.offset for field in fields]
                return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})
            case "array":
                inner = self.dtype(ctype.item)
                return np.dtype((inner.base, (ctype.length, *inner.shape)))
            case "pointer":
                return np.dtype(np.uintp)
            case "enum":
                return np.dtype(f"u{size}")
        if ctype.cname in ("float", "double"):
            return np.dtype(f"f{size}")
        return np.dtype(np.bool_ if ctype.cname == "_Bool" else f"{'u' if ctype.cname[0] == 'u' else 'i'}{size}")

    def pointer(self, array: Any) -> Any:
        """The address of an array's first element, which C takes for any pointer; the caller keeps the array."""
        return self.ffi.cast("void *", array.ctypes.data)

    def viewed(self, struct: Any) -> npt.NDArray[np.void]:
        """A copy of a struct as a numpy record, shape ()."""
        ctype = self.ffi.typeof(struct)
        if ctype not in self._records:
            self._records[ctype] = self.dtype(ctype)
        return np.frombuffer(self.ffi.buffer(self.ffi.addressof(struct)), self._records[ctype], 1)[0].copy()  # type: ignore[no-any-return]

    def placed(self, pointer: Any) -> Placed:
        """A copy of the struct at a pointer, with its address."""
        return self.viewed(pointer[0]), int(self.ffi.cast("uintptr_t", pointer))

    def filled(self, kind: str, settings: Any) -> Filled:
        """A struct of C with the settings' attributes of its fields' names; PvidError where an integer does not fit."""
        owner = self.ffi.new(f"{kind} *")
        filled = Filled(owner[0], {}, {}, [owner])
        try:
            self._fill(filled, owner[0], settings)
        except OverflowError as error:
            raise PvidError(
                f"a setting is beyond the fixed-point format ({error}): is a length, a resolution or a guess of the "
                "rig file far from that of a real rig?"
            ) from error
        return filled

    def _fill(self, whole: Filled, struct: Any, settings: Any) -> None:
        for name, field in self.ffi.typeof(struct).fields:
            if name in _FILLED_LATER:
                continue
            value, kind = getattr(settings, _NAMES.get(name, name)), field.type.kind
            if kind == "pointer" and value is None:
                continue
            if kind == "pointer" and isinstance(value, np.ndarray):
                whole.tables[name] = np.ascontiguousarray(value, self.dtype(field.type.item))
                whole.owners.append(whole.tables[name])  # an array of structs has several tables of one name
                setattr(struct, name, self.pointer(whole.tables[name]))
            elif kind == "pointer" and isinstance(value, tuple):
                owner = self.ffi.new(f"{field.type.item.cname}[]", max(len(value), 1))
                whole.owners.append(owner)
                setattr(struct, name, owner)
                for place, one in enumerate(value):
                    self._fill(whole, owner[place], one)
            elif kind == "pointer":
                owner = self.ffi.new(field.type)
                whole.owners.append(owner)
                whole.designs[name] = owner[0]
                setattr(struct, name, owner)
                self._fill(whole, owner[0], value)
            elif kind == "struct" and not isinstance(value, tuple):
                self._fill(whole, getattr(struct, name), value)
            elif kind == "array":
                getattr(struct, name)[0 : len(value)] = np.asarray(value).tolist()
            else:
                setattr(struct, name, value)

    def scalars(self, struct: Any, prefix: str = "") -> Iterator[Scalar]:
        """All numbers and pointers of a configuration, those of the structs within it and of its design as well."""
        for name, field in self.ffi.typeof(struct).fields:
            path, kind = f"{prefix}{name}", field.type.kind
            pointed = kind == "pointer" and field.type.item.kind == "struct" and name not in _FILLED_LATER
            if kind == "struct":
                yield from self.scalars(getattr(struct, name), f"{path}.")
            elif pointed and getattr(struct, name):
                yield from self.scalars(getattr(struct, name)[0], f"{path}.")
            elif kind == "array":
                array = getattr(struct, name)
                yield from (Scalar(f"{path}[{i}]", field.type.item, array, i) for i in range(field.type.length))
            else:
                yield Scalar(path, field.type, struct, name)


@cache
def _parsed(text: str) -> Headers:
    return Headers(text)


def _compiled(text: str) -> str:
    """Python text that makes cffi's interface to declarations in milliseconds; parsing them takes a third of a second,
    once: the text stays in the cache of builds."""
    name = hashlib.sha256("\n".join((cffi.__version__, text)).encode()).hexdigest()[:24]
    place = cache_folder() / "headers" / f"{name}.py"
    kept = kept_text(place)
    if kept:
        return kept
    from cffi import recompiler  # with the parser of C

    ffi = cffi.FFI()
    without = _INLINE.sub("", text)  # cffi knows no inline functions, and no address of a constant that is no number
    ffi.cdef(without.replace("extern const ", "extern "))
    out = io.StringIO()
    recompiler.make_py_source(ffi, "pvid_headers", out)
    keep_text(place, out.getvalue())
    return out.getvalue()
