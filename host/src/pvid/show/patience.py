"""HTTP connections of the live page with time-outs: uvicorn alone would wait forever for the rest of a request."""

from __future__ import annotations

import asyncio
from typing import ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_S = 8.0  # for a complete request; uvicorn itself closes a connection that is idle for 5 s
ANSWER_S = 30.0  # in which the client must read some bytes of the answer
MOST_WAITING = 24  # connections without a complete request: beyond this number the oldest is closed


class Impatient(H11Protocol):
    """A connection that is closed if its request does not arrive, or its answer is not read, in time."""

    _waiting: ClassVar[dict[Impatient, None]] = {}  # in the order in which they began to wait
    _limit: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """See asyncio.Protocol."""
        super().connection_made(transport)
        self._await_request()

    def connection_lost(self, exc: Exception | None) -> None:
        """See asyncio.Protocol."""
        self._waiting.pop(self, None)
        self._within(None)
        super().connection_lost(exc)

    def handle_events(self) -> None:
        """Reads received bytes; a complete request starts the time-out of the answer."""
        before = self.cycle
        super().handle_events()
        if self.cycle is not before:
            self._waiting.pop(self, None)
            self._within(ANSWER_S)

    def on_response_complete(self) -> None:
        """The answer has been passed to the operating system; waits for the next request."""
        self._await_request()
        super().on_response_complete()

    def resume_writing(self) -> None:
        """The client has read some of the answer."""
        super().resume_writing()
        if self not in self._waiting:
            self._within(ANSWER_S)

    def _await_request(self) -> None:
        if self.transport.is_closing():
            self._within(ANSWER_S)
            return
        self._waiting[self] = None
        self._within(REQUEST_S)
        if len(self._waiting) > MOST_WAITING:
            next(iter(self._waiting))._abort()

    def _within(self, seconds: float | None) -> None:
        if self._limit is not None:
            self._limit.cancel()
        self._limit = None if seconds is None else self.loop.call_later(seconds, self._abort)

    def _abort(self) -> None:
        self._waiting.pop(self, None)
        self.transport.abort()
