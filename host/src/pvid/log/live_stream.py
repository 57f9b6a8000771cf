"""Sends rows as they arrive: by UDP as JSON for PlotJuggler and others or as Teleplot's lines, or to Foxglove.

JSON as PlotJuggler's "UDP Server" takes it (plotjuggler_plugins/DataStreamUDP and the JSON parser of its repository,
github.com/facontidavide/PlotJuggler): an object a datagram of less than 2048 bytes; objects within it become paths
(`/estimates/w`); its time is a number of seconds in a field at the top, which the user names there: "timestamp".

Teleplot as its page has it (github.com/nesnes/teleplot, "Telemetry Format"): lines `name:time:value§unit`, time in
milliseconds, more `time:value` of the same name behind a `;`, lines apart by newlines, a datagram up to 1432 bytes; no
`:` and `|` in a name, none of `,;:|.` in a unit.
"""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Iterator
from urllib.parse import urlsplit

from pvid.base.errors import PvidError
from pvid.base.hosts import Address, addresses
from pvid.link.frames import Loss
from pvid.log.foxglove import FoxgloveServer
from pvid.log.mechanism import UNNAMED, LogMechanism
from pvid.log.reader import Account, Observer, Record
from pvid.log.values import Column, Rows, Tables, Values

SCHEMES = ("udp", "teleplot", "foxglove")
_TABLES = ("samples", "estimates", "refined")
_LEFT_OUT = ("segment", "run", "log_time", "tick")
_TELEPLOT_ROWS = 8  # a row of samples is at most 3 points of 46 bytes


def live_stream(address: str, mechanism: LogMechanism = UNNAMED) -> Observer:
    """The observer that sends to `udp://host:port`, `teleplot://host:port` or serves `foxglove://host:port`.

    Raises PvidError when the address is none, or what it needs is not installed.

    Parameters
    ----------
    mechanism : of the rig; without its constants no outputs are sent
    """
    try:
        parts = urlsplit(address)
        scheme, host, port = parts.scheme, parts.hostname, parts.port
    except ValueError:
        scheme, host, port = "", None, None
    if scheme not in SCHEMES or not host or not port:
        forms = [f"{one}://host:port" for one in SCHEMES]
        raise PvidError(f"{address!r} is no address to send to: {', '.join(forms[:-1])} or {forms[-1]}")
    if scheme == "foxglove":
        return FoxgloveServer(address, host, port, mechanism)
    to = addresses(host, port, socket.SOCK_DGRAM, f"cannot send to {address}")[0]
    return LiveStream(to, mechanism, teleplot=scheme == "teleplot")


class LiveStream:
    """An observer that sends samples and estimates by UDP.

    udp: `{"timestamp": 1.7e9, "tick": 5, "estimates": {"w": 31.6, ...}}`, one for each row.
    teleplot: `estimates.w:1700000000000:31.6§1/s^2`, up to eight rows of a table together. Nobody need listen;
    what does not get through is lost, as UDP is.
    """

    def __init__(self, to: Address, mechanism: LogMechanism, teleplot: bool) -> None:
        self._teleplot = teleplot
        self._values = Values(mechanism, follows=mechanism is UNNAMED)
        self._socket = socket.socket(to[0], socket.SOCK_DGRAM)
        self._to = to[1]

    def take(self, record: Record, account: Account) -> None:
        """See logreader.Observer."""
        if isinstance(record.item, Loss):
            return  # of which a line in trouble has many
        for rows in self._values.rows(record):
            if rows.table in _TABLES:
                for datagram in _teleplot(rows, self._values.tables) if self._teleplot else _json(rows):
                    with contextlib.suppress(OSError):  # no listener: the log is complete anyway
                        self._socket.sendto(datagram, self._to)

    def idle(self, account: Account) -> None:
        """See logreader.Observer."""

    def close(self, account: Account) -> None:
        """See logreader.Observer."""
        self._socket.close()


def _numbers(rows: Rows, index: int) -> dict[str, float]:
    """Of one row; what is no number is left out."""
    values = {name: column[index].item() for name, column in rows.columns.items() if name not in _LEFT_OUT}
    return {name: value for name, value in values.items() if not isinstance(value, str) and value == value}


def _json(rows: Rows) -> Iterator[bytes]:
    for index in range(len(rows.columns["t"])):
        when = rows.columns["log_time"][index] / 1e9
        content = {"timestamp": when, "tick": int(rows.columns["tick"][index]), rows.table: _numbers(rows, index)}
        yield (json.dumps(content) + "\n").encode()


def _teleplot(rows: Rows, tables: Tables) -> Iterator[bytes]:
    count = len(rows.columns["t"])
    for first in range(0, count, _TELEPLOT_ROWS):
        points: dict[str, list[str]] = {}
        for index in range(first, min(first + _TELEPLOT_ROWS, count)):
            when = _milliseconds(int(rows.columns["log_time"][index]))
            for name, value in _numbers(rows, index).items():
                points.setdefault(name, []).append(f"{when}:{value!r}")
        yield "\n".join(
            f"{rows.table}.{name}:{';'.join(texts)}{_unit(tables[rows.table][name])}" for name, texts in points.items()
        ).encode()


def _milliseconds(ns: int) -> str:
    """All of its digits: at more than 1000 samples a second whole milliseconds would be ambiguous."""
    whole, rest = divmod(ns, 1_000_000)
    return f"{whole}.{rest:06d}".rstrip("0") if rest else str(whole)


def _unit(column: Column) -> str:
    return f"§{column.unit}" if column.unit != "1" else ""
