"""The road from a recording to an answer in float64: analysis, advice, refinement, prediction."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from pvid.base.console import working
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.weights import Weights
from pvid.rig.run import Recording
from pvid.run.mechanism import MechanismAnswer, Refinement
from pvid.run.mechanism_advice import analysed, judged_by_prediction


def identified(
    recording: Recording,
    model: CompiledModel,
    weights: Weights = "residuals",
    *,
    refine: bool | None = None,
    own: Collection[str] = (),
) -> MechanismAnswer:
    """The answer that `identify` prints.

    Parameters
    ----------
    weights : of the rows; those of the sensors alone are not compared with others
    refine
        the full equations are fitted to the whole recording, from the answer on; None: of a single recording, where the
        model has equations of its own for that, because those of its rows are approximations
    own : unknowns that have a value of their own in each of several recordings

    Raises
    ------
    PvidError
        When the recording is too short, or holds a signal beyond all reason.
    """
    usual = bool(model.refinement.equations) and weights == "residuals" and not recording.origins
    asked = usual if refine is None else refine
    weak = analysed(recording, model, weights, predict=not asked, own=own)
    if not asked or (refine is None and weak.advice and not weak.identified):
        return weak
    from pvid.run.refined_answer import refined_answer  # loads the simulation

    with working("refining"):
        found, fit, text = refined_answer(weak)
    answer = replace(found, refinement=Refinement(found is not weak, text, fit))
    return judged_by_prediction(answer)
