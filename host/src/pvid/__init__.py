"""pvid: pseudo-velocity identification of mechanical systems, on a microcontroller and on the host.

The C library under ``firmware/`` identifies the parameters at a fixed step; this package simulates rigs,
reads recorded runs and proves, bit for bit, that the C code and numpy compute the same.
"""

__version__ = "0.1.0"
