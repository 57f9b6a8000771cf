"""The processes of this machine."""

import signal
from pathlib import Path


def children_of(pid: int) -> list[int]:
    """Processes of which this one is the parent, and that still run."""
    found = []
    for one in Path("/proc").glob("[0-9]*/stat"):
        try:
            number, _, rest = one.read_text().rpartition(")")
        except OSError:
            continue
        state, parent = rest.split()[:2]
        if int(parent) == pid and state != "Z":
            found.append(int(number.split()[0]))
    return found


def heed_interrupts() -> None:
    """In a process about to start: whoever runs the tests in the background may have Ctrl-C ignored."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
