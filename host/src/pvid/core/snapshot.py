"""Saved states of the C core's identifiers (pvid/snapshot.h), for tests and for looking at a board's flash."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from enum import IntEnum

from pvid.core.native import Native, StrongIdentifier, WeakIdentifier
from pvid.core.native_q31 import StrongIdentifierQ31, WeakIdentifierQ31

Identifier = StrongIdentifier | WeakIdentifier | StrongIdentifierQ31 | WeakIdentifierQ31

_SUFFIXES = {
    StrongIdentifier: "strong_f32",
    WeakIdentifier: "weak_f32",
    StrongIdentifierQ31: "strong_q31",
    WeakIdentifierQ31: "weak_q31",
}

# Header, checksum, and the storage of the angle's correction, which stands behind the object.
ROOM_BESIDE_THE_OBJECT = 32 + 8192


class SnapshotStatus(IntEnum):
    """pvid_snapshot_status."""

    RESTORED = 0
    NONE = 1
    CUT_SHORT = 2
    DAMAGED = 3
    OTHER_VERSION = 4
    OTHER_KIND = 5
    OTHER_LAYOUT = 6
    OTHER_CONFIG = 7
    NOT_READY = 8


class _ChoiceStruct(ctypes.Structure):
    _fields_ = [("newest", ctypes.c_int8), ("next", ctypes.c_uint8), ("generation", ctypes.c_uint32)]


@dataclass(frozen=True)
class Choice:
    """pvid_snapshot_choice: slot to read (None: no valid one), slot to write to, generation to write."""

    newest: int | None
    next: int
    generation: int


def save(identifier: Identifier, generation: int = 1) -> bytes:
    """A snapshot of the identifier as it stands."""
    room = ctypes.sizeof(identifier.state) + ROOM_BESIDE_THE_OBJECT
    image = ctypes.create_string_buffer(room)
    function = getattr(identifier.native.library, f"pvid_snapshot_save_{_SUFFIXES[type(identifier)]}")
    function.restype = ctypes.c_size_t
    config = ctypes.byref(identifier.config_struct)
    n = function(identifier.state, config, ctypes.c_uint32(generation), image, ctypes.c_size_t(room))
    return image.raw[:n]


def restore(identifier: Identifier, image: bytes) -> SnapshotStatus:
    """Restores a freshly made identifier of the same configuration; unless RESTORED, it is left as it was."""
    function = getattr(identifier.native.library, f"pvid_snapshot_restore_{_SUFFIXES[type(identifier)]}")
    config = ctypes.byref(identifier.config_struct)
    return SnapshotStatus(function(identifier.state, config, image, ctypes.c_size_t(len(image))))


def choose(native: Native, slot_0: bytes, slot_1: bytes) -> Choice:
    """pvid_snapshot_choose; the slots have the same length."""
    function = native.library.pvid_snapshot_choose
    function.restype = _ChoiceStruct
    choice = function(slot_0, slot_1, ctypes.c_size_t(min(len(slot_0), len(slot_1))))
    return Choice(None if choice.newest < 0 else int(choice.newest), int(choice.next), int(choice.generation))
