"""The identification of a pendulum's run with advice, for a person or a program."""

from __future__ import annotations

from dataclasses import replace

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.identify import Identification, identify


def identified(run: Run, rig: RigFile, native: Native) -> Identification:
    """The answer with advice; a refusal has the advice in front of its sentence."""
    from pvid.run.advice import advice, advice_on_refusal, behind

    try:
        result = identify(run, rig, native)
    except PvidError as error:
        raise behind(advice_on_refusal(run, rig, native), error) from error
    return replace(result, notes=run.notes, advice=advice(run, rig, result, native))
