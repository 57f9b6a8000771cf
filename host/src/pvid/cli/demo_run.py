"""`pvid demo MODEL`: a shipped mechanism's simulated rig, identified in C while an emulated board runs it."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from pvid.base.console import DIFFERENT, DONE, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.base.rounding import percent, with_prefix
from pvid.base.wording import typed_name
from pvid.board.design_cost import Asked, Cost, CostedDesign
from pvid.board.target import HOST_TARGET, Verdict
from pvid.board.verify_board import verify_recording
from pvid.compare.bits import Comparison
from pvid.compare.weak import compare_recording
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis, Value
from pvid.identification.core import CoreAnswer, identify_in_c
from pvid.identification.core_refined import RefinedCoreAnswer, compare_both, refined_in_c
from pvid.identification.strong import identify_strong_mechanism
from pvid.identification.values import outputs_at
from pvid.models.mechanisms import compiled_of
from pvid.models.mechanisms import names as shipped
from pvid.models.simulated_rig import SimulatedRig, simulated_rig
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.settings.cores import FIXED, FLOAT
from pvid.show.demo_figure import convergence
from pvid.sim.simulated_run import RigSimulation

_THE_SAME = 1e-3  # relative, of a guess and the truth
_COVERED = 3.0  # standard errors within which an estimate is marked as right
_FINER = 64  # times, for the strong form: 20 bits in place of 14
_LONG_S = 1000.0  # without decimals from here on
_IN_TWO_COLUMNS = 5  # parameters from which on two stand in a line


@dataclass(frozen=True, eq=False)
class Demonstrated:
    """A recording of a simulated rig, as a user would have it.

    Attributes
    ----------
    rig : with a start that is up to 50 % off
    recording : of the rig
    truth : by name: outputs of the model, then p
    answer : the analysis
    """

    rig: MechanismRig
    recording: Recording
    truth: Mapping[str, float]
    answer: Analysis

    @classmethod
    def of(cls, model: str, seed: int) -> Demonstrated:
        """Of a shipped mechanism, with its full equations where it has any."""
        rig = simulated_rig(model)
        simulation = RigSimulation.of(compiled_of(model), rig, whole=True)
        own = _guessed(model, rig, simulation, seed)
        compiled = own.compiled()
        signals = simulation.run(seed)
        t = signals.pop("t")
        recording = Recording(t, signals, rig.sample_rate)
        truth = {**outputs_at(compiled, simulation.truth), **dict(zip(compiled.p_names, simulation.truth, strict=True))}
        return cls(own, recording, truth, analysed(recording, compiled))

    @property
    def names(self) -> tuple[str, ...]:
        """What is shown: physical parameters where the model has them, else p."""
        return tuple(one.name for one in self.answer.model.outputs) or self.answer.model.p_names


def demo(model: str, target: str, where: str, seed: int, figure: Path) -> int:
    """Simulates the rig, identifies it in every arithmetic and form that the mechanism has, and compares every bit.

    Parameters
    ----------
    model : name of a shipped mechanism
    target, where : what the run is streamed to, and what it is called

    Returns
    -------
    The exit code.
    """
    if model not in shipped():
        own = f"; pvid model simulate {model} simulates a rig of a model file" if model.endswith(".py") else ""
        raise PvidError(f"there is no shipped mechanism {model}; there are {', '.join(shipped())}{own}")
    write_stderr(f"simulating the rig of {model}")
    shown = Demonstrated.of(model, seed)
    title, duration = shown.answer.model.title, float(shown.recording.t[-1])
    rate = shown.recording.sample_rate
    click.echo(
        f"Simulated: {title}, {duration:.0f} s at {rate:g} Hz. Identified by {where}, as it runs (± standard error):"
    )
    equal = _in_float(shown, target, figure)
    equal = _in_fixed_point(shown, target) and equal
    _by_the_paper(shown, seed)
    click.echo(f"Picture: {figure}.  Your own recording: {typed_name()} identify FILE.csv --model MODEL")
    return DONE if equal else DIFFERENT


def _in_float(shown: Demonstrated, target: str, figure: Path) -> bool:
    """Both stages in float32, on the target and here; whether every bit is equal."""
    answer, ticks = shown.answer, len(shown.recording)
    weak = identify_in_c(answer, FLOAT.name)
    refined: RefinedCoreAnswer | None = None
    try:
        refined = refined_in_c(weak)
    except PvidError as error:
        write_stderr(f"pvid: note: {error}")
    with ThreadPoolExecutor(1) as beside:  # the emulator has a processor of its own
        cost = beside.submit(_cost, shown, target, refined is not None)
        with progress_bar(f"streaming to {target}, comparing with the twin", 3 * ticks) as advance:
            there = verify_recording(
                target, shown.rig, shown.recording, FLOAT.name, advance, answer.ranking, refined=refined is not None
            )
            first, second = compare_both(
                answer.model, shown.recording, lambda done: advance(ticks + done), answer.ranking
            )
        measured = cost.result()
    values = weak.values if refined is None else refined.values
    if weak.identified or (refined is not None and refined.identified):
        _table(shown, values)
    else:
        click.echo(f"The C core publishes nothing ({weak.reason.text}). The float64 analysis on the PC:")
        _table(shown, answer.values)
    stages = "both stages" if refined is not None else "the estimator"
    since = refined.first_s if refined is not None and refined.adopted else _first(weak)
    texts = (
        []
        if since is None
        else [f"First answer after {since:.3g} s" if since < _LONG_S else f"First answer after {since:.0f} s"]
    )
    texts += [] if measured is None else [_words(measured)]
    if texts:
        click.echo(f"{'; '.join(texts)}.")
    click.echo(f"{_bits(f'{ticks} samples, {stages} in float32:', there, [first, second])}.")
    convergence(answer, weak, refined, shown.truth, shown.names, figure)
    return there.equal and first.equal and (isinstance(second, str) or second.equal)


def _in_fixed_point(shown: Demonstrated, target: str) -> bool:
    """The same by integers alone, in a line."""
    answer, ticks = shown.answer, len(shown.recording)
    linearised = ", linearised equations" if any(one.neglected for one in answer.model.signals) else ""
    form = f"Integers only (first stage{linearised})"
    try:
        found = identify_in_c(answer, FIXED.name)
        with progress_bar(f"streaming integers to {target}, comparing with the twin", 2 * ticks) as advance:
            there = verify_recording(target, shown.rig, shown.recording, FIXED.name, advance, answer.ranking)
            here = compare_recording(
                answer.model, shown.recording, FIXED.name, lambda done: advance(ticks + done), answer.ranking
            )
    except PvidError as error:
        click.echo(f"{form}: {error}.")
        return True
    said = _line(shown, found.values) if found.identified else f"nothing identified, {found.reason.text}"
    click.echo(f"{form}: {said}; {_bits('all samples', there, [here])}.")
    return there.equal and here.equal


def _by_the_paper(shown: Demonstrated, seed: int) -> None:
    """The strong form on this computer, in a line. It differentiates its samples, and needs finer ones."""
    form = f"The paper's own form (derivatives and a solution at each sample), with sensors {_FINER} times finer"
    try:
        values = _strong(shown, seed)
    except PvidError as error:
        click.echo(f"{form}: {error}.")
        return
    click.echo(f"{form}: {_line(shown, values) or 'nothing identified'}.")


def _strong(shown: Demonstrated, seed: int) -> Mapping[str, Value]:
    """By the C that is printed for the model."""
    model = shown.answer.model
    signals = tuple(replace(one, resolution=one.resolution / _FINER) for one in model.signals)
    finer = replace(model, signals=signals)
    rig = simulated_rig(model.name)
    run = RigSimulation.of(finer, rig).run(seed)
    return identify_strong_mechanism(Recording(run.pop("t"), run, rig.sample_rate), finer).values


def _cost(shown: Demonstrated, target: str, refined: bool) -> Cost | None:
    """Instructions and bytes on the emulated board; None: on this computer nobody counts them."""
    if target == HOST_TARGET:
        return None
    asked = Asked.of(target, FLOAT.name, refined=refined, clock_mhz=None)
    design = CostedDesign.of_recording(asked, shown.answer.model, shown.recording)
    return design.cost(asked, design.refine)


def _first(weak: CoreAnswer) -> float | None:
    """Time of the first estimate [s]."""
    t = weak.publications.t
    return float(t[0]) if len(t) else None


def _words(cost: Cost) -> str:
    bytes_ = cost.footprint.bss + cost.footprint.data
    return (
        f"{cost.footprint.mean} instructions a sample on average, {cost.footprint.longest} in the longest one "
        f"observed; {bytes_ / 1000:.1f} kB of RAM"
    )


def _bits(what: str, there: Verdict, here: list[Comparison | str]) -> str:
    compared = [one for one in here if isinstance(one, Comparison)]
    if not there.equal:
        return f"{what}: the board DIFFERS, {there.text}"
    different = next((one for one in compared if not one.equal), None)
    if different is not None:
        return f"{what}: the numpy twin DIFFERS, {different.difference}"
    return f"{what} equal on board, PC and in numpy in every bit (hash {compared[-1].core_hash:08x})"


def _table(shown: Demonstrated, values: Mapping[str, Value]) -> None:
    """Value, standard error, truth, and a mark where they agree."""
    columns = 2 if len(shown.names) >= _IN_TWO_COLUMNS else 1
    table = Table(box=None, show_header=False, padding=(0, 1), pad_edge=True)
    for _ in range(columns):
        for justify in ("left", "right", "left", "left"):
            table.add_column(justify=justify, no_wrap=True)
    if columns == 1:
        table.add_column(no_wrap=True)  # what it is
    meanings = shown.answer.model.meanings
    cells = [
        (*_cells(name, values[name], shown.truth[name]), *([] if columns > 1 else [meanings.get(name, "")]))
        for name in shown.names
        if values[name].value is not None
    ]
    rows = -(-len(cells) // columns)
    for row in range(rows):
        table.add_row(*[cell for one in cells[row::rows] for cell in one])
    Console(width=140).print(table)


def _cells(name: str, one: Value, truth: float) -> tuple[str, str, str, str]:
    assert one.value is not None and one.se is not None
    value, error, unit, scale = with_prefix(one.value, one.se, one.unit)
    right = abs(one.value - truth) <= _COVERED * one.se
    return name, value, f"± {error} {unit}".rstrip(), f"truth {truth / scale:.6g} {'✓' if right else '✗'}"


def _line(shown: Demonstrated, values: Mapping[str, Value]) -> str:
    """The parameters; of many how far they are off."""
    known = [(name, values[name]) for name in shown.names if values[name].value is not None]
    if len(known) < _IN_TWO_COLUMNS:
        cells = [_cells(name, one, shown.truth[name]) for name, one in known]
        return ", ".join(f"{name} {value} {error}" for name, value, error, _ in cells)
    off = [(abs((one.value or 0.0) - shown.truth[name]), one.se or np.inf, shown.truth[name]) for name, one in known]
    largest = percent(max(error / abs(truth) for error, _, truth in off if truth))
    worst = max(error / se for error, se, _ in off)
    return f"{len(known)} parameters, largest error {largest}, {worst:.1f} standard errors at most"


def _guessed(model: str, rig: SimulatedRig, simulation: RigSimulation, seed: int) -> MechanismRig:
    """The rig with a start: the guesses of the model; one that is the truth is moved by up to 50 %.

    Its gains are exact, as those of every simulation.
    """
    random, nominal = np.random.default_rng(seed), {}
    compiled = compiled_of(model)
    for one, x in zip(compiled.unknowns, simulation.truth.tolist(), strict=True):
        factor = float(random.uniform(0.5, 1.5))
        if x and abs(one.guess / x - 1) < _THE_SAME:
            nominal[one.name] = float(f"{factor * x:.4g}")
    exact = {one.name: {"gain_sd": 0.0} for one in compiled.signals if one.gain_sd > 0}
    known_sd = {one.name: 0.0 for one in compiled.knowns if one.sd}
    return MechanismRig(model, rig.sample_rate, rig.knowns, exact, nominal, known_sd, clock_sd=0.0)
