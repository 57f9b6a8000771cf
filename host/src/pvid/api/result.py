"""The answer of `pvid.identify`."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pvid.api.data import Data, recording_of
from pvid.api.words import columns_text, in_python, words_of_python
from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.base.packages import installing
from pvid.base.replacing import replacing
from pvid.base.rounding import with_error
from pvid.base.toml_text import toml_document
from pvid.base.wording import reason
from pvid.identification.answer import LEVEL, Answer, interval_of
from pvid.identification.summary import Made, Shown, shown, summary
from pvid.model.compiled import CompiledModel
from pvid.model.description import Model
from pvid.model.readable import aligned, latex_name, latex_unit
from pvid.models.mechanisms import compiled_of
from pvid.models.registry import asked_for, names, shipped
from pvid.oracle.weak.words import Word
from pvid.rig.columns import parsed
from pvid.rig.mechanism_file import MechanismRig, channels_of, parsed_file
from pvid.rig.run import Recording

if TYPE_CHECKING:
    from pvid.identification.validation import Validation

Float = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """A value with its standard error `se`, both in `unit` (SI), and its `verdict`, as that of a `Result`.

    below : it is below this with 95 %, where it may be 0
    """

    value: float
    se: float
    unit: str
    verdict: Word = "good"
    below: float | None = None

    @property
    def shown(self) -> Shown | None:
        """As a person reads it, with its 95 % interval."""
        return shown(self)

    def interval(self, level: float = LEVEL) -> tuple[float, float]:
        """In which it is with this probability [unit]."""
        _refuse_level(level)
        return interval_of(self.value, self.se, self.below, level)

    def __float__(self) -> float:
        return self.value

    def __format__(self, spec: str) -> str:
        return format(self.value, spec) if spec else str(self)

    def __str__(self) -> str:
        value, error = with_error(self.value, self.se)
        return f"{value} ± {error} {self.unit}".rstrip()


class Picture(type(Path())):  # type: ignore[misc]
    """The path of a PNG file, which a notebook shows as a picture."""

    def _repr_png_(self) -> bytes | None:
        return self.read_bytes() if self.suffix == ".png" else None


@dataclass(frozen=True, eq=False)
class Result(Mapping[str, Parameter]):
    """An identification, a mapping of names to parameters.

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
    covariance : of the parameters, in their order [n, n]; its diagonal is their squared standard errors
    """

    identified: bool
    parameters: Mapping[str, Parameter]
    verdict: Word
    status: str
    warning: str | None
    advice: tuple[str, ...]
    notes: tuple[str, ...]
    details: Mapping[str, Any]
    covariance: Float
    _model: CompiledModel
    _answer: Answer | None = None
    _made: Made = Made("")
    _columns: str | None = None
    _words: str = ""  # of a result from a file

    def __getitem__(self, name: str) -> Parameter:
        """Raises KeyError with the reason where the run does not determine this parameter."""
        if name not in self.parameters:
            raise KeyError(self._why_without(name))
        return self.parameters[name]

    __eq__, __hash__ = object.__eq__, object.__hash__  # not those of a mapping

    def __len__(self) -> int:
        return len(self.parameters)

    def __iter__(self) -> Iterator[str]:
        return iter(self.parameters)

    def _why_without(self, name: str) -> str:
        known: Mapping[str, Any] = self.details.get("parameters", {})
        if name not in known:
            return f"{name} is no parameter of this answer; it has {', '.join(known) or 'none'}"
        return f"the run does not determine {name}: {known[name].get('reason') or self.status}"

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
        rows = ["<tr><th>parameter</th><th>value</th><th>95 % interval</th></tr>"]
        for name, one in self.parameters.items():
            cells = (name, *(one.shown.texts if one.shown is not None else ("", "")))
            rows.append(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>")
        return f"<table>{''.join(rows)}</table>" + "".join(f"<p>{escape(one)}</p>" for one in self._doubts)

    def _repr_latex_(self) -> str:
        rows = []
        for name, one in self.parameters.items():
            if (told := one.shown) is not None:
                power = rf" \cdot 10^{{{told.power}}}" if told.power else ""
                value, ends = f"{told.value}{power}", rf"[{told.low}, {told.high}]{power}"
                rows.append(rf"{latex_name(name)} &= {value}\;{latex_unit(told.unit)} \quad {ends}")
        return f"${aligned(rows)}$" if rows else str(self)

    @property
    def params(self) -> dict[str, float]:
        """The values by name."""
        return {name: one.value for name, one in self.parameters.items()}

    @property
    def correlation(self) -> Float:
        """Of the parameters, in their order [n, n]: the covariance over the standard errors."""
        se = np.array([one.se for one in self.parameters.values()])
        return np.divide(self.covariance, np.outer(se, se), out=np.eye(len(se)), where=np.outer(se, se) > 0)

    def interval(self, level: float = LEVEL) -> dict[str, tuple[float, float]]:
        """By parameter: the interval in which it is with this probability, from 0 to 1."""
        return {name: one.interval(level) for name, one in self.parameters.items()}

    @property
    def residuals(self) -> dict[str, Float]:
        """Measured less predicted samples of this recording by sensor, and their times "t" [s], shape (n,) each; NaN
        where a sample is missing. Blocks of it are simulated by the full equations, from starts that are fitted: the
        last samples, which fill no block, are left out.

        Raises
        ------
        PvidError
            Where a parameter has no value, the motion runs away, or the result was loaded from a file.
        """
        recording = self._identified_here("residuals").recording
        found = self._validated(recording)
        return {"t": found.t} | {name: found.measured[name] - found.simulated[name] for name in found.measured}

    @property
    def unseen(self) -> Validation | None:
        """How motion is predicted that was not fitted, in this recording: as of `validate`; None: it was not looked
        at."""
        return self._identified_here("predictions").unseen

    def summary(self) -> str:
        """The answer in words, the values with their 95 % intervals, the doubts and the advice: the text of the report.

        Raises
        ------
        PvidError
            Where the result was loaded from a file of a version before 0.4.
        """
        return self._words or in_python(summary(self._identified_here("words")))

    def to_frame(self) -> Any:
        """A data frame (pandas) with a row for each parameter: value, se, low and high of the 95 % interval, unit,
        verdict, and the parts of the standard error.

        Raises
        ------
        PvidError
            Where pandas is not installed.
        """
        if importlib.util.find_spec("pandas") is None:
            raise PvidError(f"to_frame needs pandas: {installing('pandas')}")
        import pandas as pd

        rows = {
            name: {"value": one.value, "se": one.se, **dict(zip(("low", "high"), one.interval(), strict=True))}
            | {"unit": one.unit, "verdict": one.verdict}
            | {part: self.details["parameters"][name][part] for part in ("se_noise", "se_scale", "se_model")}
            for name, one in self.parameters.items()
        }
        return pd.DataFrame.from_dict(rows, orient="index")

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Writes the result as JSON: the object of `pvid identify --json`, with the covariance and the rig, for `load`
        and for `pvid validate --from`. Returns the path.

        Parameters
        ----------
        force : replace a file that pvid did not write, too

        Raises
        ------
        PvidError
            When it cannot be written, or there is such a file.
        """
        own: dict[str, Any] = {"covariance": self.covariance.tolist(), "names": list(self.parameters)}
        own |= {
            "rig": self._made.settings,
            "columns": self._columns,
            "words": self.summary(),
            "notes": list(self.notes),
        }
        out = Path(path)
        with replacing(force), _writing(out):
            write_whole(out, json.dumps({**self.details, "saved": own}) + "\n")
        return out

    def report(self, path: str | Path | None = None, *, force: bool = False) -> Path:
        """Writes the report: one HTML page with the answer in words, measured against predicted motion that was not
        fitted, what is missing, the parts of the errors, and how it was made. Returns its path.

        Parameters
        ----------
        path : None: MODEL.html in the present folder
        force : replace a file that pvid did not write, too

        Raises
        ------
        PvidError
            When it cannot be written, there is such a file, or the result was loaded from a file.
        """
        answer, out = self._identified_here("report"), Path(path or f"{self._model.name}.html")
        with replacing(force):
            from pvid.show.report import write_report  # loads matplotlib

            write_report(answer, self._made, out)
        return out

    def _identified_here(self, what: str) -> Answer:
        if self._answer is None:
            raise PvidError(f"a result from a file has no {what}: they need the recording; identify it again")
        return self._answer

    def _validated(self, recording: Recording) -> Validation:
        from pvid.identification.validation import predicted

        return predicted(self._model, recording, self.params, self.details.get("window_s"))

    def plot(self, path: str | Path | None = None, *, force: bool = False) -> Path:
        """Writes a figure of the estimates over time, with the answer and its standard errors, and of the measured
        against the simulated signals (png, svg or pdf). Returns its path, which a notebook shows as a picture.

        Parameters
        ----------
        path : None: MODEL.png in the present folder
        force : replace a file that pvid did not write, too

        Raises
        ------
        PvidError
            When it cannot be written, or there is such a file.
        """
        out = Picture(path or f"{self._model.name}.png")
        with replacing(force):
            from pvid.show.answer_figure import write_figure

            write_figure(self._identified_here("figure"), out)
        return out

    @words_of_python()
    def validate(self, data: Data, *, columns: str | Mapping[str, str | int] | None = None) -> Validation:
        """How well these parameters predict another recording of the mechanism: blocks of it are simulated by the full
        equations, from starts that are fitted.

        Parameters
        ----------
        data : as of `pvid.identify`
        columns : as of `pvid.identify`; None: those of the identification; {}: columns have the names of the signals

        Returns
        -------
        `sensors` (rms [unit], share of the motion, R^2), and `t` [s], `measured` and `simulated` by name, each [n].

        Raises
        ------
        PvidError
            Where the data cannot be read, or a parameter has no value.
        """
        return self._validated(self._recording(data, columns))

    @words_of_python()
    def predict(self, data: Data, *, columns: str | Mapping[str, str | int] | None = None) -> dict[str, Float]:
        """The sensors as these parameters predict them: the whole recording is simulated by the full equations under
        its recorded inputs, from the start that fits it best.

        Parameters
        ----------
        data : as of `pvid.identify`
        columns : as of `pvid.identify`; None: those of the identification; {}: columns have the names of the signals

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

        return simulation_of(self._model, self._recording(data, columns), p_of(self._model, self.params))

    def _recording(self, data: Data, columns: str | Mapping[str, str | int] | None) -> Recording:
        path = Path(data) if isinstance(data, str | os.PathLike) else None
        given = self._columns if columns is None else columns_text(columns)
        return recording_of(data, path, None, parsed(given, channels_of(self._model)))

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


def result_of(found: Answer, made: Made | None = None, columns: str | None = None) -> Result:
    """What a user sees of an answer."""
    details = found.as_json()
    notes = (*found.recording.notes, *(one.text for one in found.verdict.reasons if not one.alarm))
    covariance = found.covariance_of_values
    return _of_details(details, notes, covariance, found.model, found, made or Made(""), columns)


@words_of_python()
def load(path: str | os.PathLike[str], *, model: str | os.PathLike[str] | Model | None = None) -> Result:
    """A result that `Result.save` wrote. It predicts and validates; what needs its recording, it does not have.

    Parameters
    ----------
    model : the model file, or the `pvid.Model`, of a mechanism that is not shipped: what a file names is never run

    Raises
    ------
    PvidError
        Where the file is none, or is of another mechanism than `model`.
    """
    return parsed_file(Path(path), partial(_loaded, model=model))


def _loaded(text: str, model: str | os.PathLike[str] | Model | None) -> Result:
    """What `load` finds in the text of a file, which may be anything."""
    none = "it is not what Result.save writes"
    try:
        details = json.loads(text)
        own = details.pop("saved")
        rig = MechanismRig.of_document(toml_document(own["rig"]), None if model is None else asked_for(model))
        if model is None and rig.model not in names():
            raise PvidError(f"it is of a model of its own, {details['model']}: load it with model=..., that model")
        of = compiled_of(shipped(rig.model, "the file") if isinstance(rig.model, str) else rig.model)
        if details["model"] != of.name:
            raise PvidError(f"it is of the mechanism {details['model']}, not of {of.name}")
        covariance, notes = np.array(own["covariance"], np.float64), tuple(map(str, own["notes"]))
        made, columns = Made("", (), own["rig"]), own.get("columns") and str(own["columns"])
        result = _of_details(
            details, notes, covariance, rig.applied(of), None, made, columns, str(own.get("words", ""))
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise PvidError(f"{none}: {reason(error)}") from error
    if covariance.size != len(result.parameters) ** 2:
        raise PvidError(f"{none}: covariance and parameters differ in number")
    return result


def _of_details(
    details: dict[str, Any],
    notes: tuple[str, ...],
    covariance: Float,
    model: CompiledModel,
    answer: Answer | None,
    made: Made,
    columns: str | None,
    words: str = "",
) -> Result:
    known = {
        name: Parameter(one["value"], one["se"], one["unit"], one["verdict"], one.get("below"))
        for name, one in details["parameters"].items()
        if details["identified"] and one["value"] is not None
    }
    warning = details["warning"] and in_python(details["warning"])
    advice, notes = tuple(map(in_python, details["advice"])), tuple(map(in_python, notes))
    head = (details["identified"], known, details["verdict"], details["status"], warning)
    return Result(*head, advice, notes, details, covariance, model, answer, made, columns, words)


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise PvidError(f"cannot write {path}: {reason(error)}") from error


def _refuse_level(level: float) -> None:
    if not 0 < level < 1:
        raise PvidError(f"the level of an interval is a probability between 0 and 1, as 0.95, not {level:g}")
