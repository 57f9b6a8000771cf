"""The report of firmware/apps/replay, and how an image plays."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.boards import Board
from pvid.board.boards import run as run_image
from pvid.settings.enums import Core

REPORT_EVERY = 500  # ticks from one line with the running hash to the next
BLOCK = 24  # samples that an image gives at once, where it gives them in blocks


# REPLAY_IN_FLASH of replay_run.h: an AVR reads tables in flash by instructions of their own.
IN_FLASH = (
    "#if defined(__AVR__)",
    "#include <avr/pgmspace.h>",
    "#define REPLAY_IN_FLASH PROGMEM",
    "#else",
    "#define REPLAY_IN_FLASH",
    "#endif",
)


def in_blocks(header: str, core: Core) -> str:
    """replay_run.h of an image that gives its samples in blocks."""
    step = f"#define REPLAY_STEP pvid_weak_step_{core}"
    assert step in header
    return header.replace(step, f"#define REPLAY_STEP pvid_weak_step_block_{core}\n#define REPLAY_BLOCK {BLOCK}u")


@dataclass(frozen=True)
class ReplayReport:
    """What the image printed. `instructions` are clock cycles on an AVR; the longest is a tick, or a block."""

    ticks: int
    hash: int
    hashes: dict[int, int]  # running hash by ticks done
    instructions_mean: float
    instructions_longest: float
    stack_used: int
    stack_size: int
    state_bytes: int
    estimator_bytes: int

    def differs_at(self, hashes: npt.NDArray[np.uint32]) -> int | None:
        """The first tick with another hash than that of `hashes` after it [ticks], or none there; None: all agree."""
        reported = (*self.hashes.items(), (self.ticks, self.hash))
        return next((at for at, found in reported if at > len(hashes) or found != int(hashes[at - 1])), None)


def parse_report(text: str) -> ReplayReport:
    """Reads what the image printed.

    Raises PvidError when the image faulted or did not come to its end; the sentence has its own words.
    """
    fault = re.search(r"pvid fault: .*", text)
    if fault:
        raise PvidError(f"the image stopped: {fault.group(0)}")
    lines = [line.strip() for line in text.splitlines()]
    if "done" not in lines:
        last = next((line for line in reversed(lines) if line), "nothing")
        raise PvidError(f"the image did not finish; its last output: {last}")
    values = dict(line.split(" ", 1) for line in lines if re.fullmatch(r"[a-z_0-9]+ [0-9a-f]+", line))
    number = {name: int(value) for name, value in values.items() if value.isdecimal()}
    total = int(values["total_counts_high"] + values["total_counts_low"], 16)
    scale = 1024 / number["counts_per_1024"]
    return ReplayReport(
        ticks=number["ticks"],
        hash=int(values["hash"], 16),
        hashes={int(at): int(value, 16) for at, value in re.findall(r"^at (\d+) ([0-9a-f]{8})", text, re.MULTILINE)},
        instructions_mean=scale * total / number["measured_ticks"],
        instructions_longest=scale * number["longest_counts"],
        stack_used=number["stack_used"],
        stack_size=number["stack_size"],
        state_bytes=number["state_bytes"],
        estimator_bytes=number["estimator_bytes"],
    )


def play(target: Board, image: Path, timeout: float) -> ReplayReport:
    """Runs a replay image in its board's emulator and reads its report; `timeout` [s] as in `board.boards.run`.

    Raises PvidError when the image fails; of a stack that grows into the variables, which nothing on an AVR detects, a
    sentence of its own.
    """
    outcome = run_image(target, image, timeout)
    full = f"{target.name}: the image does not fit: its stack exceeds the RAM"
    if "out of ram" in outcome.text + outcome.complaints:  # simavr's words
        raise PvidError(full)
    report = parse_report(outcome.text)
    if report.stack_used >= report.stack_size:
        raise PvidError(full)
    if outcome.exit_code != 0:
        raise PvidError(f"{target.name}: the image ended with exit code {outcome.exit_code}")
    return report
