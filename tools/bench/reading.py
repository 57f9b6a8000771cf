"""Processor time and memory that reading a recorded run takes, each in a process of its own."""

from __future__ import annotations

import gzip
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pvid.base.errors import PvidError

HEADER = ("file", "rows", "size, MB", "processor time, s", "peak memory of the process, MB", "of it before reading, MB")

# Rows, standard deviation of the stamps [periods], name of the file.
CASES = (
    (600_000, 0.0, "run.csv"),
    (600_000, 0.1, "jitter.csv"),
    (600_000, 0.0, "run.csv.gz"),
    (10_000_000, 0.0, "long.csv"),
    (10_000_000, 0.1, "long-jitter.csv"),
)
_RATE = 1000.0
_PIECE = 100_000

_READ = """
import re, sys, time
from pvid.rig.columns import Channel, Columns
from pvid.rig.run import read_recording
columns = Columns((Channel("phi", "rad"), Channel("y", "m")))
def peak():  # not getrusage, whose peak a child has from its parent
    return int(re.search(r"VmHWM:\\s+(\\d+) kB", open("/proc/self/status").read())[1])
before, begin = peak(), time.process_time()
read_recording(sys.argv[1], None, columns)
print(time.process_time() - begin, peak(), before)
"""


def reading_table() -> Iterator[tuple[str, ...]]:
    """A row for each case.

    Raises
    ------
    PvidError
        When a file cannot be read.
    """
    for rows, jitter, name in CASES:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            _write(path, rows, jitter)
            done = subprocess.run([sys.executable, "-c", _READ, str(path)], capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise PvidError(f"{name} cannot be read: {done.stderr.strip()[-200:]}")
            seconds, peak, before = map(float, done.stdout.split())
            size = path.stat().st_size / 1e6
            yield name, str(rows), f"{size:.0f}", f"{seconds:.2f}", f"{peak / 1024:.0f}", f"{before / 1024:.0f}"


def _write(path: Path, rows: int, jitter: float) -> None:
    """A run with every digit that Python prints."""
    random = np.random.default_rng(1)
    with gzip.open(path, "wt") if path.suffix == ".gz" else path.open("w") as file:
        file.write("t,phi,y\n")
        for first in range(0, rows, _PIECE):
            instant = np.arange(first, min(first + _PIECE, rows)) / _RATE
            stamp = instant + np.clip(jitter * random.standard_normal(instant.size), -0.4, 0.4) / _RATE
            phi = 0.1 * np.sin(10.0 * instant) + 2e-4 * random.standard_normal(instant.size)
            y = 0.01 * np.sin(13.0 * instant) + 5e-6 * random.standard_normal(instant.size)
            table = zip(stamp.tolist(), phi.tolist(), y.tolist(), strict=True)
            file.write("".join(f"{a!r},{b!r},{c!r}\n" for a, b, c in table))
