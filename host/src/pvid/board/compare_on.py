"""One row of `pvid compare`; the pendulum's strong form on this machine against its twin, and on a target against this
machine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pvid.board.stream_rig import played_samples, stream_rig
from pvid.board.target import Verdict, verify
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.compare import compare_rig

Progress = Callable[[int], None]


@dataclass(frozen=True)
class Outcome:
    """`hash` is the running one after the last of `ticks`; None: the target never said."""

    target: str
    core: str
    form: str
    law: str
    ticks: int
    hash: int | None
    equal: bool
    verdict: str

    @property
    def cells(self) -> tuple[str, ...]:
        """As text, in the order of the fields."""
        hashed = "-" if self.hash is None else f"{self.hash:08x}"
        return self.target, self.core, self.form, self.law, str(self.ticks), hashed, self.verdict


def verify_run(target: str, rig: RigFile, run: Run, native: Native, progress: Progress | None = None) -> Verdict:
    """Plays a run on a target by the strong form, in the rig file's core; every hash is compared with this machine's.

    Raises
    ------
    PvidError
        When the target cannot be started or refuses.
    """
    image = stream_rig(rig, run.sample_rate, run)
    return verify(target, image, native, *played_samples(rig, run), progress=progress)


def compare_here(rig: RigFile, run: Run, native: Native, progress: Progress | None = None) -> Outcome:
    """The rig file's core, form and law on this machine against the twin, in every bit."""
    found = compare_rig(native, rig, run, progress=progress)
    return Outcome(
        target="host",
        core=rig.identifier.core,
        form=rig.identifier.form,
        law=rig.identifier.law,
        ticks=found.ticks,
        hash=found.core_hash,
        equal=found.equal,
        verdict="equal" if found.equal else f"DIFFERENT: {found.difference}",
    )


def compare_there(target: str, rig: RigFile, run: Run, native: Native, progress: Progress | None = None) -> Outcome:
    """The same on a target, streamed to it, against this machine.

    Raises
    ------
    PvidError
        When the target cannot be started or refuses.
    """
    verdict = verify_run(target, rig, run, native, progress)
    return Outcome(
        target=target,
        core=rig.identifier.core,
        form=rig.identifier.form,
        law=rig.identifier.law,
        ticks=verdict.playback.done,
        hash=verdict.playback.hash,
        equal=verdict.equal,
        verdict=verdict.text,
    )
