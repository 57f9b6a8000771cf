"""Saved states of the C core's identifiers (pvid/snapshot_slots.h), for tests and for looking at a board's flash."""

from __future__ import annotations

from dataclasses import dataclass

from pvid.core.native import Native, Publisher
from pvid.settings.enums import SnapshotStatus

ROOM_BESIDE_THE_OBJECT = 40  # header and checksum


@dataclass(frozen=True)
class Choice:
    """pvid_snapshot_choice: slot to read (None: no valid one), slot to write to, generation to write."""

    newest: int | None
    next: int
    generation: int


def save_as(kind: str, identifier: Publisher, size: int, generation: int = 1) -> bytes:
    """A snapshot of the identifier as it stands; kind: end of the function's name; size: of the objects in it."""
    ffi, library = identifier.native.headers.ffi, identifier.native.library
    image = ffi.new("uint8_t[]", size + ROOM_BESIDE_THE_OBJECT)
    function = getattr(library, f"pvid_snapshot_save_{kind}")
    n = function(identifier.state, identifier.config_pointer, generation, image, len(image))
    return bytes(ffi.buffer(image, n))


def restore_as(kind: str, identifier: Publisher, image: bytes) -> SnapshotStatus:
    """Restores a freshly made identifier of the same configuration; unless RESTORED, it is left as it was."""
    function = getattr(identifier.native.library, f"pvid_snapshot_restore_{kind}")
    return SnapshotStatus(function(identifier.state, identifier.config_pointer, image, len(image)))


def choose(native: Native, slot_0: bytes, slot_1: bytes) -> Choice:
    """pvid_snapshot_choose; the slots have the same length."""
    choice = native.library.pvid_snapshot_choose(slot_0, slot_1, min(len(slot_0), len(slot_1)))
    return Choice(None if choice.newest < 0 else choice.newest, choice.next, choice.generation)
