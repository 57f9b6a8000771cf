"""Serial ports: a device, a pseudo-terminal, or a URL of pyserial's (socket://host:port, rfc2217://host:port)."""

from __future__ import annotations

import errno
import os
from typing import Any, Protocol

from pvid.base.errors import PvidError
from pvid.base.wording import reason

BAUD = 115200
_READ_S = 0.02
_WRITE_S = 8.0  # an emulator on a busy machine may not read for seconds


class Port(Protocol):
    """What is needed of a serial port; pyserial's have it."""

    def read(self, size: int = 1, /) -> bytes: ...

    def write(self, data: bytes, /) -> int | None: ...

    def close(self) -> None: ...


def open_port(name: str, *, keeps_input: bool = False) -> Port:
    """A serial port by device or URL, 115200 baud, for this program alone; DTR and RTS low, so that opening resets no
    board.

    Raises PvidError when it cannot be opened; the sentence contains the cause.

    Parameters
    ----------
    keeps_input : whether what a device has received before is read, too; of a socket it always is
    """
    try:
        port = _unopened(name, keeps_input)
        port.port, port.baudrate, port.timeout, port.write_timeout = name, BAUD, _READ_S, _WRITE_S
        if "://" not in name:
            port.exclusive = True
            port.dtr = False
            port.rts = False
        port.open()
        opened: Port = port
    except ModuleNotFoundError:
        raise
    except Exception as error:  # the classes that pyserial loads for URLs let through whatever their text provokes
        raise PvidError(opening_failure(name, error)) from error
    return opened


def _unopened(name: str, keeps_input: bool) -> Any:
    """Of pyserial, which what opens no port does without.

    Opening a port of pyserial throws away what a board has sent by then; that of a socket keeps it, that of a device
    where it is asked to.
    """
    import serial
    from serial.urlhandler import protocol_socket

    class Socket(protocol_socket.Serial):
        def reset_input_buffer(self) -> None:
            pass

    class Device(serial.Serial):
        def _reset_input_buffer(self) -> None:
            pass

    if name.startswith("socket://"):
        return Socket()
    return Device() if keeps_input and "://" not in name else serial.serial_for_url(name, do_not_open=True)


def opening_failure(name: str, error: Exception) -> str:
    """One sentence on a port that did not open."""
    cause = error.__context__ if getattr(error, "errno", None) is None and error.__context__ is not None else error
    words = {
        errno.ENOENT: f"there is no port {name}: is the board plugged in? `pvid ports` lists the ports and the "
        "emulated boards",
        errno.EACCES: f"no permission to open the port {name}: its group (dialout) has it",
        errno.EAGAIN: f"the port {name} is in use by another program",
        errno.EBUSY: f"the port {name} is in use by another program",
        errno.ECONNREFUSED: f"no connection to {name}: nothing listens there",
    }
    number = cause.args[0] if cause.args else None  # termios has its own exception, with nothing else
    if number in words:
        return words[number]
    if number in (errno.ENOTTY, errno.EISDIR):
        return f"{name} is no serial port"
    return f"cannot open the port {name}: {reason(error)}"


def loss_cause(error: Exception) -> str:
    """A few words on a port that stopped working."""
    if "returned no data" in str(error) or "disconnected" in str(error):
        return "its other end was closed"
    number = getattr(error, "errno", None) or getattr(error.__context__, "errno", None)
    return os.strerror(number) if number else str(error)
