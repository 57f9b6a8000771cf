"""HTTP connections of the live page: a slow client's is ended, where uvicorn would wait for the rest of a request."""

from __future__ import annotations

import asyncio
from typing import ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_S = 8.0  # in which a request has to come; uvicorn ends a connection that is idle for 5 s by itself
ANSWER_S = 30.0  # in which some of an answer has to be read
MOST_WAITING = 24  # connections without a whole request: the oldest makes room for the next


class Impatient(H11Protocol):
    """A connection that is ended when its request does not come, or its answer is not taken, in time."""

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
        """Reads what has come; a request that is whole is given the time to be answered."""
        before = self.cycle
        super().handle_events()
        if self.cycle is not before:
            self._waiting.pop(self, None)
            self._within(ANSWER_S)

    def on_response_complete(self) -> None:
        """The answer has been handed to the system; the next request may come."""
        self._await_request()
        super().on_response_complete()

    def resume_writing(self) -> None:
        """Some of the answer has been read."""
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
