"""The processes of this machine, and waiting for them."""

import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

PATIENCE_S = 300.0  # of a test that waits for what a busy machine does late
_T = TypeVar("_T")


def until(done: Callable[[], _T]) -> _T:
    """Waits until this is true of something, and returns it."""
    limit = time.monotonic() + PATIENCE_S
    while not (found := done()):
        assert time.monotonic() < limit, "it never came so far"
        time.sleep(0.05)
    return found


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
