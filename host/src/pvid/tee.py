"""Numbers by UDP while they come: JSON for PlotJuggler and whoever else listens, or Teleplot's own lines."""

from __future__ import annotations

import contextlib
import json
import socket
from urllib.parse import urlsplit

from pvid.errors import PvidError
from pvid.logreader import Account, Record
from pvid.logvalues import TABLES, Rows, Values

_TABLES = ("samples", "estimates")
_LEFT_OUT = ("segment", "run", "log_time", "tick")


class Tee:
    """An observer that sends samples and estimates to `udp://host:port` or `teleplot://host:port`.

    udp: a JSON object a datagram, `{"timestamp": 1.7e9, "tick": 5, "estimates": {"w": 31.6, ...}}`, time in seconds.
    teleplot: lines `estimates.w:1700000000000:31.6§1/s^2`, time in milliseconds. Nobody need listen; what does not
    get through is lost, as UDP is.

    Parameters
    ----------
    l1
        Length of rod 1 [m]; None: g, l2 and rho2 are not sent.

    Raises
    ------
    PvidError
        When the address is none.
    """

    def __init__(self, address: str, l1: float | None = None) -> None:
        parts = urlsplit(address)
        try:
            host, port = parts.hostname, parts.port
        except ValueError:
            host, port = None, None
        if parts.scheme not in ("udp", "teleplot") or not host or not port:
            raise PvidError(f"{address!r} is no address to send to: udp://host:port or teleplot://host:port")
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        except OSError as error:
            raise PvidError(f"cannot send to {address}: {error.strerror}") from error
        self._datagram = _teleplot if parts.scheme == "teleplot" else _json
        self._values = Values(l1)
        self._socket = socket.socket(found[0], socket.SOCK_DGRAM)
        self._to = found[4]

    def take(self, record: Record, account: Account) -> None:
        """See logreader.Observer."""
        for rows in self._values.rows(record):
            if rows.table in _TABLES:
                for index in range(len(rows.columns["t"])):
                    with contextlib.suppress(OSError):  # nobody there: the log has it all
                        self._socket.sendto(self._datagram(rows, index), self._to)

    def idle(self, account: Account) -> None:
        """See logreader.Observer."""

    def close(self, account: Account) -> None:
        """See logreader.Observer."""
        self._socket.close()


def _numbers(rows: Rows, index: int) -> dict[str, float]:
    """Of one row; what is no number is left out."""
    values = {name: column[index].item() for name, column in rows.columns.items() if name not in _LEFT_OUT}
    return {name: value for name, value in values.items() if not isinstance(value, str) and value == value}


def _json(rows: Rows, index: int) -> bytes:
    when = rows.columns["log_time"][index] / 1e9
    content = {"timestamp": when, "tick": int(rows.columns["tick"][index]), rows.table: _numbers(rows, index)}
    return (json.dumps(content) + "\n").encode()


def _teleplot(rows: Rows, index: int) -> bytes:
    when = rows.columns["log_time"][index] // 1_000_000
    lines = []
    for name, value in _numbers(rows, index).items():
        unit = TABLES[rows.table][name].unit
        lines.append(f"{rows.table}.{name}:{when}:{value!r}" + (f"§{unit}" if unit != "1" else ""))
    return ("\n".join(lines) + "\n").encode()
