"""`pvid compare` of a recording: the C core against its twin and on targets, by the weak and by the strong form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pvid.base.console import progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.board.compare_on import Outcome
from pvid.board.strong_image import compare_on_board
from pvid.board.verify_board import verify_recording
from pvid.cli.identify_run import IN_C, LAWS, STRONG_FORM, recording_of
from pvid.codegen.weak_sizes import refuse_too_many_unknowns
from pvid.compare.bits import Comparison
from pvid.compare.strong import StrongComparison
from pvid.compare.weak import compare_recording as compared
from pvid.identification.core_refined import compare_both
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.cores import CORES, FLOAT, STRONG, STRONG_CORES


def compare_recording(
    path: Path, rig: MechanismRig, columns: str | None, targets: Sequence[str] = (), **given: str | None
) -> list[Outcome]:
    """The C core against its twin on a recording of a described mechanism, in float32 by default, with the second stage
    where a board has it; then targets against the C core, which stream the first stage alone.

    Parameters
    ----------
    targets : the recording is streamed to them; of the strong form emulated boards, which replay it
    given : options, by name; a value that the form does not have is refused
    """
    if given.get("form") == STRONG_FORM:
        return _compared_strong(path, rig, columns, targets, given)
    name = rig.compiled().name
    for option, value in given.items():
        if value is not None and (option, value) not in (("core", "all"), *IN_C):
            raise PvidError(
                f"--{option} {value}: {name} is compared in float32 or fixed point by the weak form; omit --{option}"
            )
    recording, model = recording_of(path, rig, columns)
    refuse_too_many_unknowns(model)
    outcomes = []
    chosen = given.get("core") or FLOAT.name
    for core in [one.name for one in CORES.values() if chosen in (one.name, "all")]:
        with progress_bar(core, len(recording)) as advance:
            if core == FLOAT.name:
                found, second = compare_both(model, recording, advance)
            else:
                found, second = compared(model, recording, core, advance), None
        outcomes.append(_compared("weak", core, found))
        if isinstance(second, Comparison):
            outcomes.append(_compared("refined", core, second))
        elif second is not None:
            write_stderr(f"pvid: note: no second stage: {second}")
        for target in targets:
            with progress_bar(f"{core} on {target}", len(recording)) as advance:
                there = verify_recording(target, rig, recording, core, advance)
            ticks, last = there.playback.done, there.playback.hash
            outcomes.append(Outcome(target, core, "weak", "stationary", ticks, last, there.equal, there.text))
    return outcomes


def _compared(form: str, core: str, found: Comparison, law: str = "stationary") -> Outcome:
    verdict = "equal" if found.equal else f"DIFFERENT: {found.difference}"
    return Outcome("host", core, form, law, found.ticks, found.core_hash, found.equal, verdict)


def _compared_strong(
    path: Path, rig: MechanismRig, columns: str | None, targets: Sequence[str], given: Mapping[str, str | None]
) -> list[Outcome]:
    """The same by the strong form, on this computer and on emulated boards."""
    recording, model = recording_of(path, rig, columns)
    refuse_too_many_unknowns(model)
    law = given.get("law") or "stationary"
    chosen = given.get("core") or STRONG.name
    outcomes = []
    for core in [one.name for one in STRONG_CORES.values() if chosen in (one.name, "all")]:
        with progress_bar(f"{law} law, {core}", len(recording)) as advance:
            run = StrongComparison.of(model, recording, LAWS[law], advance, core)
        outcomes.append(_compared(STRONG_FORM, core, run.found, law))
        outcomes += [compare_on_board(target, run, law) for target in targets]
    return outcomes
