"""Ticks of a board in 64 bits, also of one that sends no more than their low 32."""

from __future__ import annotations

_TURN = 1 << 32
_HALF = 1 << 31


class TickCount:
    """The ticks of one session after the other, as they stand in frames that come in order."""

    def __init__(self) -> None:
        self._session = 0  # 0: none was named
        self._latest: int | None = None

    def begin(self) -> None:
        """The board has begun anew."""
        self._session, self._latest = 0, None

    def of(self, tick: int, session: int) -> int:
        """The tick of a frame: a count that falls by more than 2^31 within a session has passed 2^32.

        Parameters
        ----------
        tick
            Of the frame, with the upper bits that it has.
        session
            That it names; 0: none.
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
