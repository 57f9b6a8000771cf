"""What --rig, --run and --columns of `pvid model build` and `pvid deploy` name: the model with its rig, a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # SymPy takes a third of a second to load
    from pvid.identification.answer import Analysis
    from pvid.model.compiled import CompiledModel
    from pvid.rig.mechanism_file import MechanismRig
    from pvid.rig.run import Recording


def model_of_rig(model: str, rig_path: Path | None, run_path: Path | None) -> tuple[CompiledModel, MechanismRig | None]:
    """The model with the values of a rig file, and that file; the one beside a run counts."""
    from pvid.log.rig_choice import rig_of
    from pvid.models.mechanisms import compiled_of
    from pvid.models.registry import asked_for

    compiled = compiled_of(asked_for(model))
    if rig_path is None and run_path is None:
        return compiled, None
    rig = rig_of(run_path, rig_path, (), model)
    return rig.applied(compiled), rig


def analysis_of(compiled: CompiledModel, recording: Recording) -> Analysis:
    """That which `identify` prints of a recording, with its warnings on standard error."""
    from pvid.base.console import working, write_stderr
    from pvid.identification.road import identified

    with working("identifying"):
        answer = identified(recording, compiled, refine=False)
    for one in answer.doubts:
        if one.alarm:
            write_stderr(f"pvid: warning: {one.text}")
    return answer


def recorded(compiled: CompiledModel, rig: MechanismRig | None, run_path: Path, columns: str | None) -> Recording:
    """All of a recording in the units of the model. Raises PvidError where it cannot be read or is damaged."""
    from pvid.rig.columns import parsed
    from pvid.rig.mechanism_file import channels_of
    from pvid.rig.run import read_recording

    rate = None if rig is None else rig.sample_rate
    recording = read_recording(run_path, rate, parsed(columns, channels_of(compiled)))
    recording.refuse_damaged()
    return recording.whole()
