"""`pvid identify` of a mechanism with a compiled model."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from pvid.base.atomic_write import write_whole
from pvid.base.console import DIFFERENT, DONE, NOTHING_IDENTIFIED, progress_bar, working, write_stderr
from pvid.base.errors import PvidError
from pvid.base.rounding import with_error
from pvid.base.wording import listed, printable
from pvid.cli.input import print_notes
from pvid.codegen.weak_sizes import refuse_too_many_unknowns
from pvid.identification.analysis import analysed, own_of
from pvid.identification.answer import Analysis, Answer, Value
from pvid.identification.reading import read_all
from pvid.identification.road import identified
from pvid.identification.summary import Made, head, meaning_of, summary
from pvid.log.rig import source_of
from pvid.oracle.weak.weights import Weights
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.rig.together import names_of
from pvid.settings.cores import CORES, FLOAT, STRONG
from pvid.settings.enums import Core, Law

if TYPE_CHECKING:
    from pvid.identification.core import CoreAnswer
    from pvid.identification.robot import RobotAnswer
    from pvid.identification.validation import Validation
    from pvid.model.compiled import CompiledModel

IN_C = (*(("core", name) for name in CORES), ("form", "weak"))  # options of the weak form, and their values
STRONG_FORM = "strong"  # as --form
Style = Literal["plain", "verbose", "json"]  # of what is printed; verbose: with words of the method
LAWS = {"stationary": Law.STATIONARY, "pseudovelocity": Law.PSEUDOVELOCITY}


def recording_of(
    path: Path, rig: MechanismRig, columns: str | None, *, whole: bool = True
) -> tuple[Recording, CompiledModel]:
    """A recording as it is identified, and the model with the values of the rig; prints what was done to it.

    Parameters
    ----------
    whole : the longest stretch without a missing sample alone
    """
    return recordings_of([path], rig, columns, whole=whole)


def recordings_of(
    paths: Sequence[Path], rig: MechanismRig, columns: str | None, *, whole: bool = False
) -> tuple[Recording, CompiledModel]:
    """Several recordings of one mechanism as one, likewise."""
    names = names_of(paths) if len(paths) > 1 else ()
    recording, model = read_all(rig, [source_of(one) for one in paths], names, columns, whole=whole)
    print_notes(recording.notes)
    return recording, model


def identify_run(
    paths: Sequence[Path],
    rig: MechanismRig,
    columns: str | None,
    *,
    style: Style,
    pictures: Pictures,
    weights: Weights = "residuals",
    refine: bool | None = None,
    on: str | None = None,
    other: Path | None = None,
    empty: Path | None = None,
    add: Sequence[str] = (),
    write_model: Path | None = None,
    own: Sequence[str] = (),
    shared: Sequence[str] = (),
    **only_in_c: str | None,
) -> int:
    """Identifies a recording of a described mechanism, or several together, and prints the answer.

    Parameters
    ----------
    paths : of the recordings
    pictures : what is written beside the text
    weights : of the rows, as in pvid.oracle.weak.identify
    refine : the equations are fitted to the whole run, from the answer on; None: as of pvid.identification.road
    other : another recording, of which is said how well the answer predicts it
    empty : a recording of a robot without its payload
    add : terms that are added to the model
    write_model : where the model file with them is written; of a robot, where its URDF or MJCF file
    own, shared : unknowns that each recording has of its own, or not, as in pvid.identification.analysis.own_of
    on : a target, to which the recording is streamed as well; nothing is printed unless its hashes are those of here
    only_in_c : options that the C core alone has, by name; a value is refused
    """
    name = rig.compiled().name
    if rig.compiled().chain is not None:
        asked: dict[str, Any] = {"--on": on, "--refine": refine, "--add": add, "--own": own, "--shared": shared}
        asked |= {"--weights": weights != "residuals", "--figure": pictures.figure, "--report": pictures.report}
        asked |= {f"--{option} {value}": value for option, value in only_in_c.items()}
        return _identified_robot(paths, rig, columns, other, empty, write_model, asked, style=style)
    if empty is not None:
        raise PvidError(f"--without is for the payload of a robot, which {name} is not: omit it")
    if len(paths) > 1:
        _refuse_several(on=on, refine=bool(refine), **only_in_c)
    if only_in_c.get("form") == STRONG_FORM:
        if pictures.figure is not None or refine or weights != "residuals" or add:
            raise PvidError("--figure, --refine, --weights and --add are for the weak form; omit --form strong")
        return _identified_by_strong_form(paths[0], rig, columns, pictures, style=style, on=on, **only_in_c)
    for option, value in only_in_c.items():
        if value is not None and (option, value) not in (("core", "f64"), *IN_C):
            raise PvidError(
                f"--{option} {value}: {name} is identified in float64, or in C by --core f32 or q31, by the weak form; "
                f"omit --{option}"
            )
    in_c = CORES.get(only_in_c.get("core") or "")
    if add and on is not None:
        raise PvidError("--add is not for a target: write the model with --write-model FILE and name that with --model")
    if write_model is not None and not add:
        raise PvidError("--write-model writes the model with the terms of --add: add one")
    if other is not None and refine and in_c:
        raise PvidError("--validate is not for --core f32 --refine: use pvid validate RUN2 --from ANSWER")
    if weights != "residuals" and in_c:
        raise PvidError(f"--weights {weights} is for float64; omit --core {in_c.name}")
    if refine and in_c and in_c is not FLOAT:
        raise PvidError(f"--refine is in float32 and float64; omit --core {in_c.name}")
    if on is not None or (refine and in_c is not None):
        recording, model = recording_of(paths[0], rig, columns)
    else:
        recording, model = recordings_of(paths, rig, columns)
    if in_c or on is not None:
        refuse_too_many_unknowns(model)
    if on is not None and not _streamed(on, rig, recording, (in_c or FLOAT).name, bool(refine)):
        return DIFFERENT
    of_each = own_of(model, recording, own, shared, in_c=in_c is not None)
    without: Analysis | None = None
    if add:
        from pvid.identification.additions import added

        with working("identifying without the added terms"):
            without = analysed(recording, model, weights, of_each)
            more = added(without, rig, add)
            model = more.model
    with working("identifying"):
        in_float = False if in_c else refine
        answer = identified(recording, model, weights, refine=in_float, own=of_each)
    if without is not None:
        with_them: dict[str, Any] = {"added": list(more.terms), "without": _values_json(without.values)}
        if style != "json":
            Console().print(_beside(without.values, answer.values, more.terms))
        if write_model is not None:
            write_whole(write_model, more.text_of(answer))
            write_stderr(f"pvid: {write_model}: the model with {listed(more.terms)}")
    print_notes(answer.recording.notes[len(recording.notes) :])
    core: CoreAnswer | None = None
    no_second: dict[str, Any] = {}
    if in_c:
        from pvid.identification.core import identify_in_c

        with working(f"identifying in {in_c.words}"):
            core = identify_in_c(answer, in_c.name)
    if core is not None and refine:
        try:
            return _refined_in_c(core, pictures, style=style, on=on)
        except PvidError as error:  # the answer is that of the first stage
            no_second = {"refinement": {"adopted": False, "text": f"not refined: {error}"}}
            write_stderr(f"pvid: note: not refined: {error}")
    shown: Analysis | CoreAnswer = core or answer
    validation = _predicted(other, rig, columns, shown)
    entries = no_second | _validation_json(validation) | ({} if without is None else with_them)
    lines = [] if validation is None else [f"{other}: the answer {validation.text}"]
    style = "verbose" if refine and style == "plain" else style  # which estimate it is, and why
    done = _told(shown, style=style, more=entries | ({} if on is None else {"on": on}), lines=lines)
    if core is None and not model.following.is_usual:
        write_stderr("pvid: note: the analysis in float64 takes all windows alike: [identifier] has no effect")
    pictures.write(shown, validation, "" if other is None else other.name)
    return done


def _identified_robot(
    paths: Sequence[Path],
    rig: MechanismRig,
    columns: str | None,
    other: Path | None,
    empty: Path | None,
    written: Path | None,
    asked: Mapping[str, Any],
    *,
    style: Style,
) -> int:
    """Identifies recordings of a robot and prints the answer."""
    from pvid.identification.robot import answer_of_robot, payload_of
    from pvid.identification.robot_core import answer_of_robot_in_c

    for option, value in asked.items():
        if value and option not in ("--core f64", "--core f32", "--form weak"):
            rig.compiled().refuse_robot(option)
    identify = answer_of_robot_in_c if asked.get("--core f32") else answer_of_robot
    source = None
    if written is not None:
        from pvid.identification.robot_writing import source_of as source_of_robot

        source = source_of_robot(rig.model, written)
    recording, model = recordings_of(paths, rig, columns)
    with working("identifying"):
        answer: RobotAnswer = identify(recording, model)
    if written is not None and source is not None and answer.identified:
        from pvid.identification.robot_writing import write_robot

        files = listed(printable(one.name) for one in paths)
        for one in write_robot(answer, source, written, f"{files}, by {source.model}"):
            write_stderr(f"pvid: {written}: {one}")
        write_stderr(f"pvid: {written}: {source.path.name} with the identified values")
    more: dict[str, Any] = {}
    lines: list[str] = []
    if other is not None:
        found = answer.predicts(recordings_of([other], rig, columns)[0])
        more = {"validation": {"prediction": {one.name: one.as_json() for one in found}}}
        lines = [f"{other}: the answer predicts {listed(found)}"]
    if empty is not None:
        without = identify(recordings_of([empty], rig, columns)[0], model)
        payload = payload_of(answer, without)
        more["payload"] = _values_json(payload)
        lines += [f"{empty}: {one.text}" for one in without.verdict.reasons]
        known = {
            name: with_error(one.value, one.se) for name, one in payload.items() if one.value is not None and one.se
        }
        lines += [f"payload {name}: {value} +- {se} {payload[name].unit}" for name, (value, se) in known.items()]
        lines += [f"payload {name}: {one.reason}" for name, one in payload.items() if name not in known]
    return _told(answer, style=style, more=more, lines=lines)


def _refuse_several(*, on: str | None, refine: bool, **given: str | None) -> None:
    """PvidError for what takes one recording."""
    one = {"--form strong": given.get("form") == STRONG_FORM, "--on": on is not None}
    one["--refine in C"] = refine and given.get("core") in CORES
    for option, chosen in one.items():
        if chosen:
            raise PvidError(f"{option} takes one recording: omit it, or name one file")


def _identified_by_strong_form(
    path: Path, rig: MechanismRig, columns: str | None, pictures: Pictures, *, style: Style, **given: str | None
) -> int:
    """Identifies a recording by the strong form and prints the answer."""
    from pvid.identification.strong import identify_strong_mechanism

    core = given.get("core") or STRONG.name
    if given.get("on") is not None:
        raise PvidError("--on with the strong form of a described mechanism is for `compare`")
    recording, model = recording_of(path, rig, columns)
    if core in CORES:
        refuse_too_many_unknowns(model)
    answer = identify_strong_mechanism(recording, model, core, LAWS[given.get("law") or "stationary"])
    done = _told(answer, style=style)
    pictures.write(answer)
    return done


@dataclass(frozen=True)
class Pictures:
    """What is written of an answer beside the text.

    Attributes
    ----------
    figure, report : files; None: none
    made : how the answer is made, for the report
    silent : their names are not printed
    """

    figure: Path | None = None
    report: Path | None = None
    made: Made = Made("")
    silent: bool = False

    def write(self, answer: Answer, validation: Validation | None = None, name: str = "") -> None:
        """Writes them and prints their names."""
        if self.figure is not None:
            from pvid.show.answer_figure import write_figure  # loads matplotlib

            write_figure(answer, self.figure)
        if self.report is not None:
            from pvid.show.log_report import boards_part
            from pvid.show.report import write_report

            more = boards_part(list(self.made.files))
            write_report(answer, self.made, self.report, validation=validation, name=name, more=more)
        for kind, path in (("figure", self.figure), ("report", self.report)):
            if path is not None and not self.silent:
                click.echo(f"{kind}: {path}")


def plot_run(path: Path, rig: MechanismRig, columns: str | None, figure: Path, *, refine: bool | None) -> None:
    """Identifies a recording of a described mechanism as `identify` does, and writes the answer as a figure.

    Parameters
    ----------
    refine : the equations are fitted to the whole run, as `identify --refine` does
    """
    from pvid.show.answer_figure import write_figure

    recording, model = recording_of(path, rig, columns, whole=False)
    answer = identified(recording, model, refine=refine)
    write_figure(answer, figure, f"{path.name}: {summary(answer)}")


def _streamed(target: str, rig: MechanismRig, recording: Recording, core: Core, refined: bool) -> bool:
    """Streams a recording to a target and prints the account; whether every hash is that of this machine."""
    from pvid.board.verify_board import verify_recording

    with progress_bar(f"streaming to {target}", len(recording)) as advance:
        verdict = verify_recording(target, rig, recording, core, advance, refined=refined)
    write_stderr(f"{target}: {verdict.playback.account}")
    if not verdict.equal:
        write_stderr(f"pvid: {target}: {verdict.text}")
    return verdict.equal


def _predicted(
    other: Path | None, rig: MechanismRig, columns: str | None, answer: Analysis | CoreAnswer
) -> Validation | None:
    """How well an answer predicts another recording of the rig; None: none was given."""
    from pvid.identification.validation import predicted

    if other is None:
        return None
    recording, model = recording_of(other, rig, columns, whole=False)
    values = {name: one.value for name, one in answer.values.items()}
    return predicted(model, recording, values, answer.analysis.found.design.window_s)


def _validation_json(validation: Validation | None) -> dict[str, Any]:
    return {} if validation is None else {"validation": validation.as_json()}


def refined_reference(model: CompiledModel, recording: Recording, figure: Path | None) -> Analysis | None:
    """The refined answer of a recording, or that of the weak form; None: neither identifies it. A sentence on standard
    error says which and why.

    Parameters
    ----------
    figure : where the measured and the simulated signals are drawn
    """
    from pvid.identification.refinement.adoption import refined_answer

    answer, refined, text = refined_answer(analysed(recording, model))
    write_stderr(f"pvid: {text}")
    if figure is not None and refined is not None:
        from pvid.identification.validation import of_fit
        from pvid.show.answer_figure import write_comparison  # loads matplotlib

        write_comparison(model, of_fit(refined.problem, refined.found), figure)
        click.echo(f"figure: {figure}")
    return answer if answer.identified else None


def _refined_in_c(core: CoreAnswer, pictures: Pictures, *, style: Style, on: str | None) -> int:
    """Refines an answer of the first stage by both stages in C and prints the refined estimate, or that of the first
    stage.

    Raises PvidError where the mechanism, or its rig, has no second stage in C; nothing is printed.
    """
    from pvid.identification.core_refined import refined_in_c

    with working(f"refining in {FLOAT.words}"):
        found = refined_in_c(core)
    done = _told(found, style="json" if style == "json" else "verbose", more={} if on is None else {"on": on})
    pictures.write(found)
    return done


def _told(answer: Answer, *, style: Style, more: Mapping[str, Any] | None = None, lines: Sequence[str] = ()) -> int:
    """Prints an answer and what is doubted of it; the exit code.

    Parameters
    ----------
    more, lines : further entries of the JSON object; further lines below the values
    """
    if style == "json":
        click.echo(json.dumps(answer.as_json() | dict(more or {})))
    else:
        if answer.identified:
            verbose = style == "verbose"
            title = f"{answer.model.title}: {answer.identifier}" if verbose else answer.model.title
            Console().print(table_of(answer.values, title, answer.model.meanings, parts=verbose))
        meaning = head(answer)[1].rstrip(".")
        click.echo(f"verdict {answer.verdict.word}: {meaning[0].lower()}{meaning[1:]}")
        for line in (*(answer.method if style == "verbose" else ()), *answer.lines, *_by_scale(answer), *lines):
            click.echo(line)
    for one in answer.doubts:
        write_stderr(f"pvid: {'warning' if one.alarm and answer.identified else 'note'}: {one.text}")
    for sentence in answer.advice:
        write_stderr(f"pvid: advice: {sentence}")
    if answer.identified:
        return DONE
    write_stderr(f"pvid: nothing identified{f': {answer.why_nothing}' if answer.why_nothing else ''}")
    return NOTHING_IDENTIFIED


def _values_json(values: Mapping[str, Value]) -> dict[str, Any]:
    return {name: {"value": one.value, "se": one.se} for name, one in values.items()}


def _beside(without: Mapping[str, Value], found: Mapping[str, Value], terms: Sequence[str]) -> Table:
    """The values without added terms and with them."""
    table = Table("parameter", "without", "with", title=escape(f"added: {listed(terms)}"))
    for column in table.columns[1:]:
        column.justify = "right"

    def shown(one: Value | None) -> str:
        if one is None:
            return ""
        return "not determined" if one.value is None or one.se is None else " ± ".join(with_error(one.value, one.se))

    for name, one in found.items():
        table.add_row(escape(f"{name} [{one.unit}]" if one.unit else name), shown(without.get(name)), shown(one))
    return table


def _is_large(value: Value, part: str) -> bool:
    """Whether a part is most of a standard error."""
    return (getattr(value, part) or 0.0) > (value.se or 0.0) / 2


def _by_scale(answer: Answer) -> Iterator[str]:
    """What reduces the errors that a longer recording does not."""
    large = [name for name, one in answer.values.items() if _is_large(one, "se_scale")]
    if large:
        of = "all" if len(large) == len(answer.values) else listed(large)
        yield (
            f"errors of {of}: most is of gains, constants and the clock, which a calibration reduces and a longer "
            "recording does not"
        )


def table_of(values: Mapping[str, Value], title: str, meanings: Mapping[str, str], *, parts: bool = False) -> Table:
    """Values by name with their standard errors, what they are, and the verdict where one is not good.

    Parameters
    ----------
    parts : also those of the errors, where noise is not most of each
    """
    large = {"from scale": "se_scale", "from the model": "se_model"} if parts else {}
    large = {name: of for name, of in large.items() if any(_is_large(one, of) for one in values.values())}
    doubted = any(one.word != "good" for one in values.values())
    names = ("parameter", "estimate", "standard error", *(["from noise", *large] if large else []))
    last: list[str | Column] = ["meaning"] if meanings else []
    last += [Column("verdict", no_wrap=True)] if doubted else []
    table = Table(*names, *last, title=title, min_width=len(title))
    for column in table.columns[: len(names)]:
        column.overflow = "fold"
    for column in table.columns[1 : len(names)]:
        column.justify = "right"
    for name, one in values.items():
        label = escape(f"{name} [{one.unit}]" if one.unit else name)
        more = [meaning_of(name, meanings)] if meanings else []
        more += [one.word] if doubted else []
        if one.value is None or one.se is None or one.se_noise is None:
            table.add_row(label, "not determined", *[""] * (len(names) - 2), *more)
            continue
        estimate, error = with_error(one.value, one.se)
        below = "" if one.below is None else f" (below {one.below:.2g})"
        sizes = [one.se_noise, *(getattr(one, of) or 0.0 for of in large.values())] if large else []
        table.add_row(label, estimate + below, error, *(f"{size:.2g}" for size in sizes), *map(escape, more))
    return table
