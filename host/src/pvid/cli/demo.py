"""What `pvid demo` does with its run, in both cores at once: identified here, streamed through a serial link to a
board, and compared with the twin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy.typing as npt

from pvid.board.boards import BOARDS
from pvid.board.stream_rig import played_samples, stream_rig
from pvid.board.target import HOST_TARGET, Verdict, verify
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.compare import Comparison, compare_run
from pvid.run.compare_q31 import compare_run_q31
from pvid.run.identify import Identification, identify
from pvid.setup.f32 import config_of
from pvid.setup.q31 import config_for_run

BOARD = BOARDS["mps2-an386"]


@dataclass(frozen=True)
class Stage:
    """Where the demo's firmware runs: a target, what it is called, and why it is not the emulated board (or None)."""

    target: str
    where: str
    lacking: str | None


def stage() -> Stage:
    """The emulated board where its emulator and compiler are installed, else this machine's pseudo-terminal."""
    if not BOARD.missing:
        return Stage(BOARD.name, f"{BOARD.name}, {BOARD.core} in QEMU", None)
    where = "this machine, over a pseudo-terminal"
    return Stage(HOST_TARGET, where, f"{BOARD.name} needs {' and '.join(BOARD.missing)}")


@dataclass(frozen=True)
class Played:
    """A core's part of the demo: its answer, the core here against the twin, the board against the core here."""

    result: Identification
    comparison: Comparison
    verdict: Verdict

    @property
    def equal(self) -> bool:
        """In every bit, everywhere."""
        return self.comparison.equal and self.verdict.equal


def _compare(
    rig: RigFile, run: Run, native: Native, start: npt.ArrayLike, progress: Callable[[int], None]
) -> Comparison:
    samples = played_samples(rig, run)
    if rig.identifier.core == "q31":
        return compare_run_q31(native, config_for_run(rig, run, start), *samples, progress=progress)
    return compare_run(native, config_of(rig, run.sample_rate, start), *samples, progress=progress)


def play_demo(
    on: Stage,
    rigs: Sequence[RigFile],
    run: Run,
    native: Native,
    start: npt.ArrayLike,
    progress: Callable[[int], None],
) -> list[Played]:
    """Plays a run in the core of each rig file. The link is what takes long: all are streamed while the rest is done.

    Raises
    ------
    PvidError
        When the target cannot be started.
    """
    images = [stream_rig(rig, run.sample_rate, run, start) for rig in rigs]
    with ThreadPoolExecutor(len(rigs)) as pool:
        streams = [
            pool.submit(verify, on.target, image, native, *played_samples(rig, run))
            for rig, image in zip(rigs, images, strict=True)
        ]
        results, comparisons = [], []
        for number, rig in enumerate(rigs):
            results.append(identify(run, rig, native, start=start))
            before = number * len(run.t)
            comparisons.append(_compare(rig, run, native, start, lambda done, before=before: progress(before + done)))  # type: ignore[misc]
        verdicts = [stream.result() for stream in streams]
    return [
        Played(replace(result, on=on.target) if verdict.equal else result, comparison, verdict)
        for result, comparison, verdict in zip(results, comparisons, verdicts, strict=True)
    ]
