"""`pvid ports`."""

from __future__ import annotations

import click
from rich.console import Console
from rich.table import Table
from serial.tools import list_ports

from pvid.base.console import DONE
from pvid.board.target import EMULATORS, HOST_TARGET


@click.command(name="ports")
def command() -> int:
    """Lists what `pvid log` can record: the serial ports of this machine, and the emulated boards."""
    table = Table(box=None, pad_edge=False)
    for title in ("PORT", "what it is", "USB id", "serial number"):
        table.add_column(title, overflow="fold")
    serial_ports = sorted(list_ports.comports(), key=lambda one: str(one.device))
    for one in serial_ports:
        usb = "" if one.vid is None else f"{one.vid:04x}:{one.pid:04x}"
        table.add_row(one.device, one.description or "", usb, one.serial_number or "")
    for name in EMULATORS:
        table.add_row(name, "emulated board", "", "")
    table.add_row(HOST_TARGET, "the same firmware as a program of this machine", "", "")
    console = Console()
    console.print(table)
    if not serial_ports:
        console.print("\nThis machine has no serial port: is the board plugged in, and is its driver loaded?")
    return DONE
