"""How a recording goes, in one line: rewritten on a terminal, a new one every ten seconds elsewhere."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import TextIO

from pvid.base.errors import PvidError
from pvid.link.frames import Estimate, EstimateQ31, Hello, Names, RefinedEstimate
from pvid.log.mechanism import UNNAMED, LogMechanism, mechanism_named
from pvid.log.reader import Account, Record
from pvid.log.values import in_si
from pvid.settings.enums import Reason, Stage

_ON_TERMINAL_S = 0.25
_ELSEWHERE_S = 10.0


class StatusLine:
    """An observer that writes to a stream, standard error in general."""

    def __init__(self, to: TextIO, mechanism: LogMechanism = UNNAMED) -> None:
        self._mechanism = mechanism
        self._follows = mechanism is UNNAMED
        self._to = to
        self._terminal = to.isatty()
        self._period = _ON_TERMINAL_S if self._terminal else _ELSEWHERE_S
        self._written = self._rated = time.monotonic()
        self._samples = 0
        self._estimate: Estimate | EstimateQ31 | None = None
        self._refined: RefinedEstimate | None = None
        self._tick = 0

    def take(self, record: Record, account: Account) -> None:
        """See logreader.Observer."""
        if isinstance(record.item, Estimate | EstimateQ31):
            self._estimate, self._tick = record.item, record.tick
        elif isinstance(record.item, RefinedEstimate):
            self._refined = record.item
        elif isinstance(record.item, Names) and self._follows:
            with suppress(PvidError):
                self._mechanism, self._estimate = mechanism_named(record.item.text), None
                self._refined = None

    def idle(self, account: Account) -> None:
        """See logreader.Observer."""
        now = time.monotonic()
        if now - self._written >= self._period:
            self._written = now
            line = self.line(account, now)
            self._to.write(f"\r\x1b[2K{line}" if self._terminal else f"{line}\n")
            self._to.flush()

    def close(self, account: Account) -> None:
        """See logreader.Observer."""
        if self._terminal:
            self._to.write("\r\x1b[2K")
            self._to.flush()

    def line(self, account: Account, now: float) -> str:
        """Rate since the last line, losses, the last estimate; before the link is up that it is not."""
        if not account.segments:
            return "the link is not up yet"
        rate = (account.samples - self._samples) / max(now - self._rated, 1e-9)
        self._rated, self._samples = now, account.samples
        text = f"{account.samples} samples, {rate:.0f}/s, lost {account.missing_samples}, damaged {account.damaged}"
        if account.segments[-1].why is not None:
            text += f"; waiting for the link ({account.obstacle or account.segments[-1].why})"
        hello, estimate = account.lasting.get(Hello), self._estimate
        if isinstance(hello, Hello) and estimate is not None:
            refined, p = self._refined, in_si(estimate, hello)[0]
            if is_refined := refined is not None and refined.stage == Stage.REFINED:
                p = refined.of_p[0]
            numbers = zip(self._mechanism.parameters[: hello.n_p], p, strict=False)
            values = ", ".join(f"{one.name} {value:.5g} {one.unit}".rstrip() for one, value in numbers)
            reason = Reason(estimate.reason).text if estimate.reason in list(Reason) else str(estimate.reason)
            text += f"; tick {self._tick}: {values}, {'refined; first stage: ' if is_refined else ''}{reason}"
        return text
