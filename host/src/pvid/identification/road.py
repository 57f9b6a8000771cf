"""The road from a recording to an answer in float64: analysis, advice, refinement, prediction."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from pvid.base.console import working
from pvid.identification.advice import advised
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis, Refinement
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.weights import Weights
from pvid.rig.run import Recording


def identified(
    recording: Recording,
    model: CompiledModel,
    weights: Weights = "residuals",
    *,
    refine: bool | None = None,
    predict: bool = True,
    own: Collection[str] = (),
) -> Analysis:
    """The answer that `identify` prints.

    Raises PvidError when the recording is too short, or holds a signal beyond all reason.

    Parameters
    ----------
    weights : of the rows; those of the sensors alone are not compared with others
    refine : fit the full equations to the whole recording, from the answer on; None: refine a single recording if
        the model has separate, more exact equations for that
    predict : with the prediction of unseen motion; where the equations do not explain the recording, publish the
        estimate that predicts it best
    own : unknowns that have a value of their own in each of several recordings
    """
    answer = analysed(recording, model, weights, own)
    answer = advised(answer)
    another_column = bool(answer.advice) and not answer.identified  # no estimate of this one can help
    if refine is None:
        refine = bool(model.refinement.equations) and weights == "residuals" and not recording.origins
        refine = refine and not another_column
    if refine and another_column:
        answer = replace(answer, refinement=Refinement(False, "not refined: the advice about the columns comes first"))
    elif refine:
        from pvid.identification.refinement.adoption import refined_answer  # loads the simulation

        with working("refining"):
            found, fit, text = refined_answer(answer)
        answer = replace(found, refinement=Refinement(found is not answer, text, fit))
    return judged_by_prediction(answer) if predict and not another_column else answer


def judged_by_prediction(answer: Analysis) -> Analysis:
    """The answer with how well it predicts motion that was not fitted; where the equations do not explain the recording
    and no refinement has been adopted, the estimate that predicts it best."""
    if not answer.identified and answer.is_explained or answer.model.drifts:  # one p predicts no motion of others
        return answer
    from pvid.identification.judge import judged, with_prediction  # loads the simulation

    refined = answer.refinement is not None and answer.refinement.adopted
    as_it_is = answer.is_explained or answer.weights != "residuals" or refined
    return with_prediction(answer) if as_it_is else judged(answer)
