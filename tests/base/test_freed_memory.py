"""Memory that stays with the process."""

import subprocess
import sys

_ROUNDS, _ARRAYS, _BYTES = 50, 40, 400_000
_FAULTS = f"""
import resource
import sys
import numpy as np
from pvid.base.freed_memory import keep_freed

if "kept" in sys.argv:
    keep_freed()


def come_and_go() -> None:
    arrays = [np.ones({_BYTES} // 8) for _ in range({_ARRAYS})]
    while arrays:
        arrays.pop()


come_and_go()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range({_ROUNDS}):
    come_and_go()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def _faults(*options: str) -> int:
    done = subprocess.run([sys.executable, "-c", _FAULTS, *options], capture_output=True, text=True, check=True)
    return int(done.stdout)


def test_arrays_that_come_and_go_get_the_pages_of_those_before() -> None:
    pages = _ARRAYS * _BYTES // 4096
    assert _faults("kept") < pages
    assert _faults() > _ROUNDS * pages / 2
