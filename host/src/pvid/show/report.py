"""The report of an identification: one page for a customer, from any answer of any mechanism.

What the recording determines comes first, then what the equations predict of data that was not fitted; the words of the
method are in the last section alone.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from html import escape
from pathlib import Path

from matplotlib.figure import Figure

from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.base.rounding import percent
from pvid.base.version import __version__
from pvid.base.wording import listed, reason, with_unit
from pvid.identification.answer import Analysis, Answer, Value
from pvid.identification.sensor_prediction import SensorPrediction
from pvid.identification.summary import (
    REACH,
    VERDICTS,
    Made,
    has_0,
    head,
    meaning_of,
    prefixed,
    printed_unit,
    sentences,
    shown,
)
from pvid.identification.validation import Validation
from pvid.model.readable import readable
from pvid.oracle.weak.words import Word
from pvid.show import answer_figure
from pvid.show.document import document, picture, table, text

_CLASS: dict[Word, str] = {"good": "good", "usable": "usable", "not_explained": "bad", "not_identified": "bad"}
_PARTS = (
    ("se_noise", "noise", "var(--value)", "noise of the sensors: a longer recording makes it smaller"),
    (
        "se_scale",
        "scale",
        "var(--measured)",
        "gains of the sensors, constants and the clock: a calibration makes it smaller",
    ),
    ("se_model", "model", "var(--predicted)", "what the equations seem to lack: a better model makes it smaller"),
)
_OPTIONS = re.compile(r"--(?:columns|set|own) \S+|--add (?:'[^']*'|\S+)(?: --add (?:'[^']*'|\S+))*")
_ONCE = "--columns"  # of a command line: the last one counts


def write_report(
    answer: Answer, made: Made, path: Path, *, validation: Validation | None = None, name: str = "", more: str = ""
) -> None:
    """Writes `report` to a file. Raises PvidError where it cannot be written, or is a file that pvid did not write."""
    page = report(answer, made, validation=validation, name=name, more=more)
    try:
        write_whole(path, page)
    except OSError as error:
        raise PvidError(f"cannot write the report {path}: {reason(error)}") from error


def report(answer: Answer, made: Made, *, validation: Validation | None = None, name: str = "", more: str = "") -> str:
    """The page.

    Parameters
    ----------
    validation, name : how the answer predicts another recording, and its name
    more : a section in HTML, before the last one
    """
    model, recording = answer.model, answer.recording
    word: Word = answer.verdict.word if answer.identified else "not_identified"
    told, meaning = head(answer)
    length, samples = len(recording) / recording.sample_rate, len(recording)
    files = listed([one.name for one in made.files[: max(1, len(recording.origins))]] or ["data of a program"])
    parts = [
        f"<h1>{text(model.title)}</h1>",
        f'<p class="quiet">{text(files)}: {with_unit(length, "s", 3)}, {samples} samples of '
        f"{text(listed(recording.signals))} at {with_unit(recording.sample_rate, 'Hz', 4)}. "
        f"Report of {datetime.now(UTC):%d %B %Y}.</p>",
        f'<p><span class="badge {_CLASS[word]}">{told}</span> <strong>{text(meaning)}</strong></p>',
        *(f"<p>{text(one)}</p>" for one in sentences(answer)),
        _values(answer.values, model.meanings) if answer.identified else "",
        *_drift(answer),
        *_missing(answer, made),
        *_against(answer, validation, name),
        *_notes(answer),
        _parts_of_errors(answer) if answer.identified else "",
        _settling(answer) if answer.identified and answer_figure.histories(answer) else "",
        more,
        "<h2>How this was made</h2>",
        *_method(answer, made),
    ]
    return document(f"{model.title}: {files}", "".join(parts))


def _values(values: Mapping[str, Value], meanings: Mapping[str, str]) -> str:
    """Each with what it is, and its interval."""
    rows = []
    for name, one in values.items():
        meaning = meaning_of(name, meanings)
        label = text(name) + (f'<br><span class="quiet">{text(meaning)}</span>' if meaning else "")
        told, word = shown(one), f'<span class="{_CLASS[one.word]}">{VERDICTS[one.word][0].lower()}</span>'
        if told is None:
            rows.append([label, "not determined", text(one.reason or ""), word])
            continue
        power = f" × 10<sup>{told.power}</sup>" if told.power else ""
        unit = f" {text(told.unit)}" if told.unit else ""
        rows.append([label, f"{told.value}{power}{unit}", f"{told.low} to {told.high}{power}{unit}", word])
    heads = ["parameter", "value", "95 % interval", "verdict"]
    return table(heads, rows, numbers=3 if all(one.value is not None for one in values.values()) else 0)


def _drift(answer: Answer) -> Iterator[str]:
    """What the parameters did, below their values."""
    if isinstance(answer, Analysis) and answer.drift:
        whole = answer.drift[0].upper() + answer.drift[1:]
        yield f"<p>{text(whole)}{' (± standard errors)' if '±' in whole else ''}.</p>"


def _missing(answer: Answer, made: Made) -> Iterator[str]:
    """Why the values are in doubt, and the line to type."""
    alarms = [one.text for one in answer.doubts if one.alarm or not answer.identified]
    if not alarms and not answer.advice:
        return
    yield '<h2 id="doubt">What is missing, or in doubt</h2>'
    yield f"<ul>{''.join(f'<li>{text(one)}</li>' for one in alarms)}</ul>" if alarms else ""
    for sentence in answer.advice:
        line = line_to_type(made.command, sentence)
        yield f"<p><strong>Try this:</strong> {text(sentence)}.</p>"
        yield f"<pre>{text(line)}</pre>" if line else ""


def line_to_type(command: str, advice: str) -> str:
    """The command line with the options that an advice names; "": it was no command, or it has another such option."""
    found = _OPTIONS.search(advice)
    if found is None or not command.startswith("pvid identify") or (_ONCE in command and _ONCE in found[0]):
        return ""
    return f"{command} {found[0]}"


def _notes(answer: Answer) -> Iterator[str]:
    """What is no doubt, but should be known."""
    notes = [one.text for one in answer.doubts if not one.alarm] if answer.identified else []
    if notes:
        yield f"<h2>Notes</h2><ul>{''.join(f'<li>{text(one)}</li>' for one in notes)}</ul>"


def _against(answer: Answer, validation: Validation | None, name: str) -> Iterator[str]:
    """Measured against predicted, on data that was not fitted."""
    model, unseen = answer.model, answer.unseen
    if validation is not None:
        yield f"<h2>Measured against predicted: {text(name)}, another recording</h2>"
        yield from _compared(answer, validation, "other", "The values are those of this report.")
    yield "<h2>Measured against predicted, on data that was not fitted</h2>"
    if unseen is None and model.drifts:
        yield "<p>Parameters may drift: one set of values predicts no motion.</p>"
        return
    if unseen is None:
        yield "<p>The equations could not be simulated with this recording: it shows what was fitted alone.</p>"
        return
    how = (
        "The recording is divided into parts. Values that are found in every other part predict the parts between "
        "them, and the reverse: no part is predicted by values that were fitted to it."
    )
    yield from _compared(answer, unseen, "unseen", how)
    by_recording = answer.analysis.predicted if isinstance(answer, Analysis) else {}
    rows = [[text(own), *_row(one)] for own, sensors in by_recording.items() for one in sensors]
    if rows:
        yield "<p>Of each recording:</p>" + table(["recording", *_HEADS], rows)
    yield "<h2>What remains: measured less predicted</h2>"
    yield picture(
        lambda figure: answer_figure.differences(model, unseen, figure),
        answer_figure.height_of(unseen),
        "Left over time, right how often. What a right model leaves is as small as the noise of the sensor and has no "
        "pattern.",
        "differences",
    )


_HEADS = ("sensor", "rms difference", "of the motion", "times the noise")


def _row(one: SensorPrediction) -> list[str]:
    unit, scale = prefixed(one.rms, one.unit)
    return [
        text(one.name),
        text(with_unit(one.rms / scale, printed_unit(unit), 2)),
        percent(one.of_motion),
        one.times_noise,
    ]


def _compared(answer: Answer, validation: Validation, key: str, how: str) -> Iterator[str]:
    own = [f"{name} = {value:.4g}" for name, value in validation.fitted.items()]
    yield (
        f"<p>{text(how)} Each of {validation.blocks} stretches of {with_unit(validation.block_s, 's', 3)} starts from "
        "the initial state that fits it best; what follows is computed from the inputs, the values and the equations "
        "alone."
        f"{text(f' Fitted to it: {listed(own)}.') if own else ''}</p>"
    )
    yield table(_HEADS, map(_row, validation.sensors))
    yield (
        '<p class="quiet">Of the motion: the difference over how far the sensor moves in a stretch (rms). Times the '
        "noise: over the standard deviation of the noise that the rig states of the sensor; 1 is what that noise "
        "would leave.</p>"
    )
    height = answer_figure.height_of(validation)

    def drawn(draw: Callable[..., None]) -> Callable[[Figure], None]:
        return lambda figure: draw(answer.model, validation, figure)

    yield picture(drawn(answer_figure.against), height, "All stretches.", key)
    worst = "The stretch that is predicted worst, of each sensor."
    yield picture(drawn(answer_figure.closest), height + 0.15 * len(validation.sensors), worst, f"{key}-worst")


def _parts_of_errors(answer: Answer) -> str:
    """How much of each interval is noise, scale and model."""
    rows = []
    for name in answer.names:
        one = answer.values[name]
        shares = [(getattr(one, part) or 0.0) ** 2 for part, *_ in _PARTS]
        whole = sum(shares) or 1.0
        unit, scale = prefixed(REACH * whole**0.5, one.unit)
        sizes = [
            text(with_unit(REACH * share**0.5 / scale, printed_unit(unit), 2))
            if has_0(one)
            else percent(REACH * share**0.5 / abs(one.value or 1.0))
            for share in shares
        ]
        bars = "".join(
            f'<span style="width:{100 * share / whole:.1f}%;background:{color}"></span>'
            for share, (_, _, color, _) in zip(shares, _PARTS, strict=True)
        )
        rows.append([text(name), f'<span class="bar">{bars}</span>', *sizes])
    meanings = "".join(
        f'<li><strong style="color:{color}">{name}</strong>: {meaning}</li>' for _, name, color, meaning in _PARTS
    )
    heads = ["parameter", "shares", *(f"{name} [±]" for _, name, *_ in _PARTS)]
    return (
        "<h2>Parts of the error</h2><p>The ± of the 95 % interval if this part were the only one, in percent of the "
        f"value. The squares add up.</p>{table(heads, rows, numbers=3)}<ul>{meanings}</ul>"
    )


def _settling(answer: Answer) -> str:
    rows = -(-len(answer.model.p_names) // 2)
    return "<h2>How the values settle</h2>" + picture(
        lambda figure: answer_figure.settling(answer, figure),
        0.5 + 1.5 * rows,
        "The value from the data up to each time, and the 95 % interval of the answer."
        + (" The answer is that of a second fit, from this one on." if _is_refined(answer) else ""),
        "settling",
    )


def _is_refined(answer: Answer) -> bool:
    return isinstance(answer, Analysis) and answer.refinement is not None and answer.refinement.adopted


def _method(answer: Answer, made: Made) -> Iterator[str]:
    """Command, files, equations, settings, and the words of the method."""
    yield f"<pre>{text(made.command)}</pre>"
    yield f"<p>pvid {__version__}; {text(answer.identifier)}.</p><ul>"
    yield (
        "".join(f"<li>{text(line)}</li>" for line in (*answer.method, *answer.lines, *answer.recording.notes)) + "</ul>"
    )
    if made.files:
        rows = [[text(one), f"<code>{_digest(one)}</code>"] for one in made.files]
        yield table(["file", "SHA-256"], rows)
    yield "<p>Equations, each of them 0:</p>"
    yield f"<pre>{'<br>'.join(text(readable(one)) for one in answer.model.alone.equations)}</pre>"
    constants = [f"{one.name} = {with_unit(one.value, one.unit, 6)}" for one in answer.model.knowns]
    yield f"<p>Constants: {text(listed(constants))}.</p>" if constants else ""
    yield f"<p>Settings:</p><pre>{escape(made.settings)}</pre>" if made.settings else ""


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        return text(error.strerror or "cannot be read")
