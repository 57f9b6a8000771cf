"""The answer of `pvid.identify`."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pvid.api.data import Data, recording_of
from pvid.base.replacing import replacing
from pvid.base.rounding import with_error
from pvid.identification.answer import Analysis
from pvid.identification.core import CoreAnswer
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.words import Word
from pvid.rig.columns import parsed
from pvid.rig.mechanism_file import channels_of
from pvid.rig.run import Recording

if TYPE_CHECKING:
    from pvid.identification.validation import Validation


@dataclass(frozen=True)
class Parameter:
    """A value with its standard error `se`, both in `unit` (SI), and its `verdict`, as that of a `Result`."""

    value: float
    se: float
    unit: str
    verdict: Word = "good"

    def __str__(self) -> str:
        value, error = with_error(self.value, self.se)
        return f"{value} ± {error} {self.unit}".rstrip()


class Picture(type(Path())):  # type: ignore[misc]
    """The path of a PNG file, which a notebook shows as a picture."""

    def _repr_png_(self) -> bytes | None:
        return self.read_bytes() if self.suffix == ".png" else None


@dataclass(frozen=True, eq=False)
class Result:
    """An identification.

    Attributes
    ----------
    identified : whether the data say enough; otherwise `parameters` is empty and `status` says why
    parameters : by name: physical parameters, then the unknowns of the equations
    verdict : "good", "usable", "not_explained" or "not_identified": what the values may be used for
    status : the last word of the identifier
    warning : reasons to doubt the estimate; None: there are none
    advice : a sentence each, with what to type, where a column seems to be wrong
    notes : what was done to the data, a sentence each
    details : everything, as `pvid identify --json` prints it
    """

    identified: bool
    parameters: Mapping[str, Parameter]
    verdict: Word
    status: str
    warning: str | None
    advice: tuple[str, ...]
    notes: tuple[str, ...]
    details: Mapping[str, Any]
    _answer: Analysis | CoreAnswer
    _model: CompiledModel

    def __getitem__(self, name: str) -> Parameter:
        return self.parameters[name]

    def __str__(self) -> str:
        head = f"nothing identified: {self.status}"
        lines = [f"{name} = {one}" for name, one in self.parameters.items()] if self.identified else [head]
        return "\n".join([*lines, *self._doubts])

    __repr__ = __str__

    @property
    def missing(self) -> Mapping[str, Any] | None:
        """What the equations seem to lack, as in `details`: terms with size and standard error, and what each parameter
        would be with them; None: nothing that moves a parameter visibly, or an identifier that does not look for it."""
        found: Mapping[str, Any] | None = self.details.get("missing")
        return found

    @property
    def _doubts(self) -> list[str]:
        """The verdict where it is not the best one, the warning and the advice, a line each."""
        verdict = [] if self.verdict == "good" else [f"verdict: {self.verdict}"]
        warning = [f"warning: {self.warning}"] if self.warning else []
        return verdict + warning + [f"advice: {one}" for one in self.advice]

    def _repr_html_(self) -> str:
        if not self.identified:
            return f"<p>{escape(str(self)).replace(chr(10), '<br>')}</p>"
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{escape(str(one))}</td></tr>" for name, one in self.parameters.items()
        )
        return f"<table>{rows}</table>" + "".join(f"<p>{escape(one)}</p>" for one in self._doubts)

    def plot(self, path: str | Path, *, force: bool = False) -> Path:
        """Writes a figure of the estimates over time, with the answer and its standard errors, and of the measured
        against the simulated signals (png, svg or pdf). Returns its path, which a notebook shows as a picture.

        Parameters
        ----------
        force : replace a file that pvid did not write, too

        Raises
        ------
        PvidError
            When it cannot be written, or there is such a file.
        """
        out = Picture(path)
        with replacing(force):
            from pvid.show.answer_figure import write_figure

            write_figure(self._answer, out)
        return out

    def validate(self, data: Data, *, columns: str | None = None) -> Validation:
        """How well these parameters predict another recording of the mechanism: blocks of it are simulated by the full
        equations, from starts that are fitted.

        Parameters
        ----------
        data, columns : as of `pvid.identify`

        Returns
        -------
        `sensors` (rms [unit], share of the motion, R^2), and `t` [s], `measured` and `simulated` by name, each [n].

        Raises
        ------
        PvidError
            Where the data cannot be read, or a parameter has no value.
        """
        from pvid.identification.validation import predicted

        values = {name: one.value for name, one in self.parameters.items()}
        return predicted(self._model, self._recording(data, columns), values, self.details.get("window_s"))

    def predict(self, data: Data, *, columns: str | None = None) -> dict[str, npt.NDArray[np.float64]]:
        """The sensors as these parameters predict them: the whole recording is simulated by the full equations under
        its recorded inputs, from the start that fits it best.

        Parameters
        ----------
        data, columns : as of `pvid.identify`

        Returns
        -------
        "t" [s] and each sensor by name, shape (n,): of the longest stretch without a missing sample.

        Raises
        ------
        PvidError
            Where the data cannot be read, a parameter has no value, or the motion runs away, as an unstable one does:
            `validate` simulates it in blocks.
        """
        from pvid.identification.validation import p_of, simulation_of

        values = {name: one.value for name, one in self.parameters.items()}
        return simulation_of(self._model, self._recording(data, columns), p_of(self._model, values))

    def _recording(self, data: Data, columns: str | None) -> Recording:
        path = Path(data) if isinstance(data, str | os.PathLike) else None
        return recording_of(data, path, None, parsed(columns, channels_of(self._model)))

    def compare(self, other: Result) -> dict[str, float]:
        """By parameter: this value less the other's, in standard errors of the difference.

        These contain noise and what the equations seem to lack. The scale of one rig's sensors, constants and clock is
        common to both and cancels.
        """
        return {
            name: (one.value - other[name].value) / math.hypot(self.se_apart(name), other.se_apart(name))
            for name, one in self.parameters.items()
            if name in other.parameters
        }

    def se_apart(self, name: str) -> float:
        """Standard error of a parameter without the part of scale, which runs of one rig have in common [its unit]."""
        parts = self.details["parameters"][name]
        noise, model = parts.get("se_noise"), parts.get("se_model")
        return self[name].se if noise is None else math.hypot(noise, model or 0.0)


def result_of(found: Analysis | CoreAnswer) -> Result:
    """What a user sees of an answer."""
    details, verdict = found.as_json(), found.verdict
    known = {
        name: Parameter(one["value"], one["se"], one["unit"], one["verdict"])
        for name, one in details["parameters"].items()
        if found.identified and one["value"] is not None
    }
    notes = (*found.recording.notes, *(one.text for one in verdict.reasons if not one.alarm))
    return Result(
        found.identified,
        known,
        verdict.word,
        found.status,
        verdict.warning,
        found.advice,
        notes,
        details,
        found,
        found.model,
    )
