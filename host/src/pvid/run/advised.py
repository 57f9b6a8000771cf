"""The identification of a pendulum's run with advice, for a person or a program."""

from __future__ import annotations

from dataclasses import replace

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.identify import Identification, identify


def answered(
    run: Run, rig: RigFile, native: Native, *, refine: bool | None = None, of_image: bool = False
) -> Identification:
    """The answer of the rig file's form: the weak engine's, refined, or the strong form's.

    Parameters
    ----------
    refine : the full equations are fitted to the whole run, from the answer on; None: after the weak form
    of_image : by the form that the streamed image of the pendulum contains, so that its bits can be compared
    """
    if of_image:
        return identify(run, rig, native)
    from pvid.run.engine_identify import identify_by_engine  # loads SymPy
    from pvid.run.refined_identify import refined_identification

    weak = rig.identifier.form_traits.publishes
    found = identify_by_engine(run, rig) if weak else identify(run, rig, native)
    return refined_identification(run, rig, found) if (weak if refine is None else refine) else found


def identified(
    run: Run, rig: RigFile, native: Native, *, refine: bool | None = None, of_image: bool = False
) -> Identification:
    """The answer with advice, as of `answered`; a refusal has the advice in front of its sentence."""
    from pvid.run.advice import advice, advice_on_refusal, behind

    try:
        result = answered(run, rig, native, refine=refine, of_image=of_image)
    except PvidError as error:
        raise behind(advice_on_refusal(run, rig, native), error) from error
    return replace(result, notes=run.notes, advice=advice(run, rig, result, native))
