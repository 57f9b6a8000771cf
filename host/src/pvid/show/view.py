"""The live view of a recording on a terminal: an observer that redraws itself a few times a second."""

from __future__ import annotations

import math
import time

import numpy as np
import numpy.typing as npt
from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from pvid.base.rounding import percent, prefix_of, with_error
from pvid.link.names import Quantity
from pvid.log.history import History, Rates
from pvid.log.mechanism import UNNAMED, LogMechanism
from pvid.log.reader import Account, Record
from pvid.log.words import (
    KAPPA_WEAK,
    board_words,
    kappa_share,
    kappa_words,
    link_words,
    loss_words,
    reason_words,
    received_words,
    residual_words,
    stage_words,
    standing_words,
)

_PERIOD_S = 0.25
_BAR, _SHORT_BAR = 30, 18  # in a terminal of 100 columns and more, and in a narrower one
_BLOCKS = "▁▂▃▄▅▆▇█"
_WIDEST = 110


class LiveView:
    """Draws on a console that is a terminal, until `close`; the last picture stays.

    Parameters
    ----------
    title : what is recorded where
    mechanism : of the rig; without its constants no outputs are shown
    page : address of the live page; empty: none
    """

    def __init__(self, console: Console, title: str, mechanism: LogMechanism = UNNAMED, page: str = "") -> None:
        self.history = History(mechanism)
        self._console = console
        self._title = title
        self._page = page
        self._began = self._drawn = time.monotonic()
        self._rates = Rates()
        self._rates.now(Account(), self._began)
        self._live = Live(console=console, auto_refresh=False)
        self._ended = False

    def take(self, record: Record, account: Account) -> None:
        """See logreader.Observer."""
        self.history.take(record)

    def idle(self, account: Account) -> None:
        """See logreader.Observer."""
        now = time.monotonic()
        if now - self._drawn < _PERIOD_S:
            return
        self._drawn = now
        self._live.start()  # does nothing from the second time on
        self._live.update(self.panel(account, now), refresh=True)

    def close(self, account: Account) -> None:
        """See logreader.Observer."""
        self._ended = True
        self._live.start()
        self._live.update(self.panel(account, time.monotonic()), refresh=True)
        self._live.stop()

    def panel(self, account: Account, now: float) -> Panel:
        """All of it at the time `now` (of time.monotonic)."""
        lasted = int(now - self._began)
        clock = f"{lasted // 3600:02d}:{lasted // 60 % 60:02d}:{lasted % 60:02d}"
        return Panel(
            Group(self._link(account, now), Rule(style="dim"), self._parameters(), Rule(style="dim"), self._quality()),
            title=Text(f"{self._title}  {clock}", style="bold"),
            title_align="left",
            subtitle="ended" if self._ended else "Ctrl-C ends the recording",
            subtitle_align="right",
            box=box.ROUNDED,
            width=min(_WIDEST, self._console.width),
        )

    def _link(self, account: Account, now: float) -> Table:
        rows = _labelled()
        rows.add_row("board", Text(board_words(self.history.hello, account)))
        up, how = link_words(account)
        rows.add_row("link", Text(how, style="" if up else "yellow"))
        rows.add_row("received", received_words(account, *self._rates.now(account, now)))
        lost = loss_words(account)
        rows.add_row("lost", Text(lost, style="red") if lost else Text("nothing", style="green"))
        if self._page:
            rows.add_row("live page", Text(self._page))
        return rows

    def _parameters(self) -> Table:
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_edge=False)
        table.add_column("parameter", min_width=8)
        table.add_column("estimate", justify="right", min_width=12)
        table.add_column("± standard error", justify="left", min_width=12)
        table.add_column("in %", justify="right", min_width=8)
        published = self.history.published
        for one in (*self.history.mechanism.answers, *self.history.extras):
            name = one.name
            value = published.get(name, math.nan)
            error = published.get(f"{name}_se", math.nan)
            if math.isnan(value):
                continue
            relative = percent(error / abs(value)) if error < abs(value) else ""
            shown, spread = with_error(value, error)
            table.add_row(name, shown, f"± {spread} {one.shown_unit}", relative)
        if not self.history.newest:
            table.add_row("none yet", "the first estimate follows when a window of samples is full")
        elif not self.history.is_physical:
            names = ", ".join(one.name for one in self.history.mechanism.outputs)
            table.add_row(names, "outside the physical region")
        return table

    def _quality(self) -> Table:
        rows = _labelled()
        newest, history = self.history.newest, self.history
        kappa, residual = newest.get("kappa", math.nan), newest.get("residual", math.nan)
        length = _BAR if self._console.width >= 100 else _SHORT_BAR
        filled = round(length * kappa_share(kappa))
        style = "green" if kappa >= KAPPA_WEAK else "yellow"
        bar = Text("█" * filled, style=style) + Text("░" * (length - filled), style="dim")
        rows.add_row("excited", bar + Text(f"  {kappa:.2g}  {kappa_words(kappa)}" if newest else "  none yet"))
        line = sparkline(history.estimates("residual"), length)
        rows.add_row(
            "residual",
            Text(line.ljust(length), style="cyan")
            + Text(f"  {residual:.3g} {residual_words(history.hello)}" if line else "  none yet"),
        )
        t, *signals = history.samples()
        if len(t):
            spans = (_span(one, x) for one, x in zip(history.mechanism.samples, signals, strict=True))
            rows.add_row("motion", f"{', '.join(spans)} ({t[-1] - t[0]:.0f} s)")
        rows.add_row("state", Text(history.reason or "no estimate yet", style="bold"))
        rows.add_row("", Text(reason_words(history.reason), style="dim"))
        if history.standing:
            rows.add_row("estimate", Text(standing_words(history.standing)))
        if history.stage:
            rows.add_row("published", Text(stage_words(history.stage, history.refined_reason)))
        return rows


def _labelled() -> Table:
    rows = Table.grid(padding=(0, 2, 0, 0))
    rows.add_column(style="bold", min_width=9)
    rows.add_column()
    return rows


def _span(sample: Quantity, x: npt.NDArray[np.float64]) -> str:
    unit, scale = prefix_of(float(np.abs(x).max()), sample.shown_unit)
    return f"{sample.name} {x.min() / scale:+.3g} to {x.max() / scale:+.3g} {unit}".rstrip()


def sparkline(x: npt.NDArray[np.float64], width: int) -> str:
    """The last `width` numbers as blocks from 0 up, their median at half height; what is twice that or more is full."""
    last = x[-width:]
    known = last[np.isfinite(last)]
    if not len(known):
        return ""
    unit = max(float(np.median(known)), 1e-300) * 2 / (len(_BLOCKS) - 1)
    with np.errstate(over="ignore"):  # 1e38 over 1e-300 is full, too
        heights = np.clip(np.nan_to_num(last) / unit, 0, len(_BLOCKS) - 1)
    return "".join(
        _BLOCKS[round(height)] if np.isfinite(one) else " "
        for one, height in zip(last.tolist(), heights.tolist(), strict=True)
    )
