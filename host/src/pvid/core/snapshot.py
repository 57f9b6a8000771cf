"""Saved states of the C core's identifiers (pvid/snapshot_slots.h), for tests and for looking at a board's flash."""

from __future__ import annotations

from pvid.core.native import Publisher
from pvid.settings.enums import SnapshotStatus

ROOM_BESIDE_THE_OBJECT = 40  # header and checksum


def save_as(kind: str, identifier: Publisher, size: int) -> bytes:
    """A snapshot of the identifier as it stands; kind: end of the function's name; size: of the objects in it."""
    ffi, library = identifier.native.headers.ffi, identifier.native.library
    image = ffi.new("uint8_t[]", size + ROOM_BESIDE_THE_OBJECT)
    function = getattr(library, f"pvid_snapshot_save_{kind}")
    n = function(identifier.state, identifier.config_pointer, 1, image, len(image))
    return bytes(ffi.buffer(image, n))


def restore_as(kind: str, identifier: Publisher, image: bytes) -> SnapshotStatus:
    """Restores a freshly made identifier of the same configuration; unless RESTORED, it is left as it was."""
    function = getattr(identifier.native.library, f"pvid_snapshot_restore_{kind}")
    return SnapshotStatus(function(identifier.state, identifier.config_pointer, image, len(image)))
