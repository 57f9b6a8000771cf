"""Memory that has been freed stays with the process.

Arrays of a run come and go. Fresh pages of the system cost as much as what is computed in them, and the C library gives
back what is large: a tenth of the processor time of `pvid identify`.
"""

from __future__ import annotations

import contextlib
import ctypes

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of glibc's mallopt
_KEPT = 256 << 20  # at the end of the heap
_OWN_PAGES = 32 << 20  # arrays from this size on have pages of their own: the largest that glibc takes


def keep_freed() -> None:
    """Keeps it, where the C library is glibc."""
    with contextlib.suppress(OSError, TypeError, AttributeError):  # musl has no mallopt, Windows no such handle
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_MMAP_THRESHOLD, _OWN_PAGES)
        mallopt(_TRIM_THRESHOLD, _KEPT)
