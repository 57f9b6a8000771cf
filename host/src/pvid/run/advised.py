"""The identification of a pendulum's run with advice, for a person or a program."""

from __future__ import annotations

from dataclasses import replace

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.identify import Identification, identify


def answered(
    run: Run, rig: RigFile, native: Native, *, refine: bool | None = None, streamed: bool = False
) -> Identification:
    """The answer of the rig file's form: the weak engine's, refined, or the strong form's.

    Parameters
    ----------
    refine : the full equations are fitted to the whole run, from the answer on; None: after the weak form
    streamed : the run is streamed to a target as well, whose answer is not refined
    """
    from pvid.run.engine_identify import held_if_wide, identify_by_engine  # loads SymPy
    from pvid.run.refined_identify import RefinementVerdict, refined_identification

    if not rig.identifier.form_traits.publishes:
        found = identify(run, rig, native)
        return refined_identification(run, rig, found) if refine else found
    found = identify_by_engine(run, rig)
    if refine is None and not streamed and (unit := _wrong_unit(run, rig, held_if_wide(found))) is not None:
        found = replace(found, refinement=RefinementVerdict(False, f"not refined: {unit}"))
    elif refine is not False and not streamed:
        found = refined_identification(run, rig, found)
    return held_if_wide(found)


def _wrong_unit(run: Run, rig: RigFile, found: Identification) -> str | None:
    """A mistake of a unit, by which a refinement would simulate another motion for minutes and find nothing."""
    from pvid.run.advice import suspected_unit

    return None if found.identified and found.warning is None else suspected_unit(run, rig)


def identified(
    run: Run, rig: RigFile, native: Native, *, refine: bool | None = None, streamed: bool = False
) -> Identification:
    """The answer with advice, as of `answered`; a refusal has the advice in front of its sentence."""
    from pvid.run.advice import advice, advice_on_refusal, behind

    try:
        result = answered(run, rig, native, refine=refine, streamed=streamed)
    except PvidError as error:
        raise behind(advice_on_refusal(run, rig), error) from error
    return replace(result, notes=run.notes, advice=advice(run, rig, result))
