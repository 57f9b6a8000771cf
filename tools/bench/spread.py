"""How evenly the weak form's work is spread over its ticks: instructions of each one, by callgrind on the host."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from pvid.base.errors import PvidError

PERIOD = 855  # ticks from window to window of tests/cost/weak_rig.h, at the standard rig's size

_STEP = "pvid_weak_step_f32"


@dataclass(frozen=True)
class Spread:
    """Instructions of the ticks of whole periods."""

    ticks: list[int]

    @property
    def mean(self) -> float:
        """Of a tick."""
        return sum(self.ticks) / len(self.ticks)

    @property
    def longest(self) -> int:
        """Tick."""
        return max(self.ticks)

    @property
    def ratio(self) -> float:
        """The longest tick in means."""
        return self.longest / self.mean


def require_valgrind() -> None:
    """Raises a PvidError where valgrind is missing."""
    if shutil.which("valgrind") is None:
        raise PvidError("valgrind is not installed: run ./tools/test once, or install the package valgrind")


def measure(binary: Path, periods: int = 2, period: int = PERIOD) -> Spread:
    """Steps the weak form of the given tick_cost binary (bench.cost.build) and counts every tick.

    `period` is the number of ticks from window to window where the binary was built for another size.

    Raises
    ------
    PvidError
        When valgrind is missing or the binary fails.
    """
    require_valgrind()
    with TemporaryDirectory() as folder:
        dump = Path(folder) / "ticks"
        command = ["valgrind", "--tool=callgrind", f"--toggle-collect={_STEP}", f"--dump-after={_STEP}"]
        command += ["--combine-dumps=yes", f"--callgrind-out-file={dump}", str(binary), "weak", str(periods * period)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        text = dump.read_text(encoding="utf-8") if dump.exists() else ""
    counts = [int(n) for n in re.findall(r"^totals: (\d+)", text, re.MULTILINE) if int(n) > 0]
    if done.returncode != 0 or len(counts) < periods * period:
        raise PvidError(f"counting the weak form's ticks failed: {done.stderr.strip().splitlines()[-1:]}")
    return Spread(counts[-periods * period :])
