"""The record of the parameters (pvid/record.h), written and read by the compiled core."""

from typing import Any

from pvid.core.native import Publisher
from pvid.settings.enums import RecordStatus

MECHANISM = 0x50564944


class Writer:
    """Pieces of the record of an identifier of the core `core`."""

    def __init__(self, identifier: Publisher, core: str, n_p: int) -> None:
        ffi, library = identifier.native.headers.ffi, identifier.native.library
        self._writer = ffi.new("pvid_record_writer *")
        self._bytes = ffi.new("uint8_t[]", 16 + 8 * n_p + n_p * (n_p - 1))
        self._buffer = ffi.buffer(self._bytes)
        self._save = getattr(library, f"pvid_record_save_weak_{core}")
        self._state = identifier.state

    def piece(self) -> RecordStatus:
        """Writes the next one."""
        given: tuple[Any, ...] = (self._state, self._writer, MECHANISM, self._bytes, len(self._bytes))
        return RecordStatus(self._save(*given))

    @property
    def record(self) -> bytes:
        """As far as it is written."""
        return bytes(self._buffer)

    def whole(self) -> bytes:
        """All pieces."""
        while (status := self.piece()) is RecordStatus.MORE:
            pass
        assert status is RecordStatus.DONE, status
        return self.record


def load(identifier: Publisher, core: str, record: bytes, mechanism: int = MECHANISM) -> RecordStatus:
    """The record as the start of the identifier's next life."""
    function = getattr(identifier.native.library, f"pvid_record_load_weak_{core}")
    return RecordStatus(function(identifier.state, identifier.config_pointer, mechanism, record, len(record)))
