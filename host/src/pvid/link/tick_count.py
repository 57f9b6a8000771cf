"""Extends the ticks of a board to 64 bits, also if the board sends only the low 32 bits."""

from __future__ import annotations

_TURN = 1 << 32
_HALF = 1 << 31


class TickCount:
    """64-bit ticks from the ticks of frames in order of arrival, session after session."""

    def __init__(self) -> None:
        self._session = 0  # 0: unknown
        self._latest: int | None = None

    def begin(self) -> None:
        """The board has started a new session."""
        self._session, self._latest = 0, None

    def of(self, tick: int, session: int) -> int:
        """The 64-bit tick of a frame: if the tick falls by more than 2^31 within a session, its 32 bits have wrapped.

        Parameters
        ----------
        tick : tick of the frame, with the upper bits that the frame contains
        session : session number in the frame; 0: the frame has none
        """
        if session not in (0, self._session):
            if self._session != 0:
                self._latest = None
            self._session = session
        if self._latest is None:
            self._latest = tick
        elif tick < self._latest - _HALF:
            tick = self._latest + (tick - self._latest + _HALF) % _TURN - _HALF
        self._latest = max(self._latest, tick)
        return tick
