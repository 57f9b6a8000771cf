"""What the live page shows, as one JSON object of bounded size: a log that is followed while it grows."""

from __future__ import annotations

import json
import math
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.rounding import prefix_of, with_error
from pvid.base.toml_text import toml_document
from pvid.identification.summary import unit_for
from pvid.link.names import Quantity
from pvid.log.history import History, Rates, envelope
from pvid.log.reader import LogStream
from pvid.log.rig import mechanism_in
from pvid.log.tail import LogTail
from pvid.log.words import (
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
from pvid.show.axis_limits import interesting
from pvid.show.live_simulation import LiveSimulation

Float = npt.NDArray[np.float64]

_LOOK_S = 0.1
_BINS = 400  # of the motion: twice as many points


class LiveState(threading.Thread):
    """Follows a log from its beginning; the file may come later. Nobody waits for it: it reads what is there.

    A record that it fails on is left out of the page, and counted there.
    """

    def __init__(self, log: Path, title: str) -> None:
        super().__init__(name="follower", daemon=True)
        self.log = log
        self.title = title
        self._lock = threading.Lock()
        self._stream = LogStream()
        self._history = History()
        self._rates = Rates()
        self._rig: str | None = None
        self._failed = 0
        self._simulation = LiveSimulation()

    def run(self) -> None:
        """See the class."""
        while not self.log.exists():
            time.sleep(_LOOK_S)
        with self.log.open("rb") as file:
            tail = LogTail(file, self._stream)
            while True:
                with self._lock:
                    data = tail.read()
                self.take(data)
                if not data:
                    time.sleep(_LOOK_S)

    def take(self, data: bytes) -> None:
        """The next bytes of the log."""
        with self._lock:
            for record in self._stream.feed(data):
                try:
                    if self._stream.rig != self._rig:
                        self._rig = self._stream.rig
                        self._load_rig()
                    self._history.take(record)
                except Exception:  # whatever a board sends, the page shows what comes after it
                    self._failed += 1

    def _load_rig(self) -> None:
        """Where it is none, or names a model file, the page has the names of the board."""
        with suppress(PvidError):
            mechanism = None if self._rig is None else mechanism_in(toml_document(self._rig))
            if mechanism is not None:
                self._history.know(mechanism)

    def as_json(self) -> bytes:
        """The present state; page.js draws it."""
        with self._lock:
            state = self._state()
        return json.dumps(state, allow_nan=False, separators=(",", ":")).encode()

    def _state(self) -> dict[str, Any]:
        history, account = self._history, self._stream.account
        up, link = link_words(account)
        newest = history.newest
        modelled = self._simulation.words  # before the motion: a simulation that ends meanwhile has its curve at once
        kappa, residual = newest.get("kappa", math.nan), newest.get("residual", math.nan)
        return {
            "title": self.title,
            "board": board_words(history.hello, account),
            "up": up,
            "link": link,
            "received": received_words(account, *self._rates.now(account, time.monotonic())),
            "lost": loss_words(account) + (f"; {self._failed} records cannot be shown" if self._failed else ""),
            "reason": history.reason,
            "reasonWords": reason_words(history.reason),
            "standing": standing_words(history.standing),
            "stage": stage_words(history.stage, history.refined_reason),
            "kappa": f"{kappa:.2g}, {kappa_words(kappa)}" if newest else "",
            "kappaShare": kappa_share(kappa),
            "residual": f"{residual:.3g} {residual_words(history.hello)}" if newest else "",
            "parameters": self._table(),
            "estimates": self._estimates(),
            "motion": self._motion(),
            "modelled": modelled,
            "marks": self._marks(),
        }

    def _table(self) -> list[dict[str, Any]]:
        """Every answer with its standard error; `large`: the page draws its history."""
        rows: list[dict[str, Any]] = []
        mechanism = self._history.mechanism
        large = {one.name for one in self._drawn()}
        published = self._history.published
        for one in (*mechanism.answers, *self._history.extras):
            value = published.get(one.name, math.nan)
            if not math.isnan(value):
                unit, scale = unit_for(abs(value), one.unit)
                shown, spread = with_error(value / scale, published[f"{one.name}_se"] / scale)
                row = {"name": one.name, "unit": unit, "value": shown, "error": f"± {spread}"}
                rows.append({**row, "large": one.name in large})
        if not self._history.is_physical:
            names = ", ".join(one.name for one in mechanism.outputs)
            outside = {"name": names, "unit": "", "value": "outside the physical region", "error": ""}
            rows.append({**outside, "large": False})
        return rows

    def _drawn(self) -> tuple[Quantity, ...]:
        """The outputs; p where there are none, or the rig is not known."""
        return self._history.mechanism.outputs or self._history.mechanism.parameters

    def _marks(self) -> dict[str, list[Any]]:
        """When windows were held or rejected."""
        withheld = self._history.withheld()
        return {"t": [t for t, _ in withheld], "rejected": [why.startswith("rejected") for _, why in withheld]}

    def _estimates(self) -> dict[str, Any]:
        """Of those that are drawn, of the residual and of kappa; with a second stage of its estimate, too."""
        history = self._history
        curves = []
        for one in self._drawn():
            stages = {"": (history.estimates(one.name), 2 * history.estimates(f"{one.name}_se"))}
            if history.stage:
                stages["refined"] = self._at_estimates(one.name), 2 * self._at_estimates(f"{one.name}_se")
            newest = history.published.get(one.name, math.nan)
            unit, scale = unit_for(abs(newest) if math.isfinite(newest) else 1.0, one.unit)
            curve: dict[str, Any] = {"label": f"{one.name} [{unit}]" if unit else one.name}
            found = []
            for stage, (value, band) in ((stage, (own[0] / scale, own[1] / scale)) for stage, own in stages.items()):
                for name, x in (("value", value), ("low", value - band), ("high", value + band)):
                    curve[stage + name.title() if stage else name] = _numbers(x)
                low, high = interesting(value, band)
                found += [(low, high)] if low < high else []
            curve["limits"] = [min(low for low, _ in found), max(high for _, high in found)] if found else None
            curves.append(curve)
        residual, kappa = history.estimates("residual"), history.estimates("kappa")
        largest = interesting(residual, np.zeros(len(residual)))[1]
        return {
            "t": _numbers(history.estimates("t")),
            "curves": curves,
            "residual": _numbers(residual),
            "residualLabel": f"residual, {residual_words(history.hello)}",
            "residualLimits": [0.0, 1.3 * largest] if largest > 0 else None,
            "kappa": _numbers(np.where(kappa > 0, kappa, np.nan)),
        }

    def _at_estimates(self, name: str) -> Float:
        """A refined parameter at the times of the estimates, NaN where there is none."""
        history = self._history
        known = dict(zip(history.refined("t").tolist(), history.refined(name).tolist(), strict=True))
        return np.array([known.get(t, math.nan) for t in history.estimates("t").tolist()], np.float64)

    def _motion(self) -> list[dict[str, Any]]:
        """Of each channel its curve over the last seconds; of a sensor what the estimate predicts, too."""
        history = self._history
        t, *signals = history.samples()
        self._simulation.offer(history, t, signals)
        curves = []
        for one, x in zip(history.mechanism.samples, signals, strict=True):
            largest = float(np.max(np.abs(x), where=np.isfinite(x), initial=0.0))
            unit, scale = prefix_of(largest, one.unit)
            times, values = envelope(t, x / scale, _BINS)
            label = Quantity(one.name, unit).label
            curve: dict[str, Any] = {"label": label, "t": _numbers(times), "x": _numbers(values)}
            if (modelled := self._simulation.at(one.name, times)) is not None:
                curve["modelled"] = _numbers(modelled / scale)
            curves.append(curve)
        return curves


def _numbers(x: Float) -> list[float | None]:
    """To seven digits; what is not finite is None."""
    return [float(f"{one:.7g}") if math.isfinite(one) else None for one in x.tolist()]
