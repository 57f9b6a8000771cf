"""`pvid demo MODEL`: a shipped mechanism's simulated rig, identified in C here and streamed to a board."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import click
import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.table import Table

from pvid.base.console import DIFFERENT, DONE, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.base.rounding import with_error
from pvid.board.engine_board import verify_recording
from pvid.models.mechanisms import compiled_of
from pvid.models.mechanisms import names as shipped
from pvid.models.simulated_rig import SimulatedRig, simulated_rig
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.run.mechanism import identify_mechanism, model_of, outputs_at
from pvid.run.mechanism_compare import compare_recording
from pvid.run.mechanism_core import CoreAnswer, identify_in_c
from pvid.settings.engine_cores import ENGINE_CORES, FIXED, FLOAT
from pvid.show.mechanism_figure import convergence
from pvid.sim.simulated_run import RigSimulation

_THE_SAME = 1e-3  # relative, of a guess and the truth


def demo(model: str, target: str, where: str, seed: int, figure: Path) -> int:
    """Simulates the rig, identifies it in every arithmetic that the mechanism has, and compares every bit.

    Parameters
    ----------
    model : name of a shipped mechanism
    target, where : what the run is streamed to, and what it is called

    Returns
    -------
    The exit code.
    """
    if model not in shipped():
        raise PvidError(f"there is no shipped mechanism {model}; there are {', '.join(shipped())}")
    rig = simulated_rig(model)
    simulation = RigSimulation.of(compiled_of(model), rig)
    run = simulation.run(seed)
    t = run.pop("t") if "t" in run else simulation.motion().t
    own = _guessed(model, rig, simulation.truth, seed)
    compiled = model_of(own)
    recording = Recording(t, {one.name: run[one.name] for one in compiled.signals}, rig.sample_rate)
    truth = {**outputs_at(compiled, simulation.truth), **dict(zip(compiled.p_names, simulation.truth, strict=True))}
    starts = (f"{one.name} {one.guess:.4g}" for one in compiled.unknowns)
    write_stderr(f"{compiled.title}: {t[-1]:.0f} s at {rig.sample_rate:g} Hz; start {', '.join(starts)}")
    answer = identify_mechanism(recording, compiled)
    equal, answered = True, False
    for core in (FLOAT.name, FIXED.name):
        try:
            found = identify_in_c(answer, core)
        except PvidError as error:
            write_stderr(f"pvid: {ENGINE_CORES[core].words}: {error}")
            continue
        _print(found, truth)
        answered = True
        with progress_bar(f"{core}: comparing with the twin, streaming to {target}", 2 * len(t)) as advance:
            compared = compare_recording(compiled, recording, core, advance, answer.ranking)
            verdict = verify_recording(
                target, own, recording, core, lambda done: advance(len(t) + done), answer.ranking
            )
        twin = (
            f"equal in every bit, hash {compared.twin_hash:08x}"
            if compared.equal
            else f"DIFFERENT at {compared.difference}"
        )
        click.echo(f"core {core} here against its numpy twin: {compared.ticks} ticks {twin}")
        click.echo(f"streamed to {where}: {verdict.playback.done} ticks, {verdict.text} to here")
        equal = equal and compared.equal and verdict.equal
    approximate = [f"{one.name}^2" for one in compiled.signals if one.neglected]
    if approximate and answered:
        click.echo(
            f"standard errors contain what small-angle equations neglect ({', '.join(approximate)}); "
            f"this simulation has none of it: its errors are those of noise"
        )
    convergence(answer, figure)
    click.echo(f"figure: {figure}")
    return DONE if equal else DIFFERENT


def _guessed(model: str, rig: SimulatedRig, truth: npt.NDArray[np.float64], seed: int) -> MechanismRig:
    """The rig with a start: the guesses of the model; one that is the truth is moved by up to 50 %."""
    random, nominal = np.random.default_rng(seed), {}
    for one, x in zip(compiled_of(model).unknowns, truth.tolist(), strict=True):
        factor = float(random.uniform(0.5, 1.5))
        if x and abs(one.guess / x - 1) < _THE_SAME:
            nominal[one.name] = float(f"{factor * x:.4g}")
    return MechanismRig(model, rig.sample_rate, known=rig.knowns, nominal=nominal)


def _print(found: CoreAnswer, truth: Mapping[str, float]) -> None:
    title = f"{found.oracle.model.title}: weak form, C in {ENGINE_CORES[found.core].words}"
    table = Table("parameter", "truth", "estimate", "standard error", "of noise alone", "error / noise", title=title)
    for column in table.columns[1:]:
        column.justify = "right"
    for name, one in found.values.items():
        if one.value is None or one.se is None or name not in truth:
            continue
        noise = one.se_noise or one.se
        apart = (one.value - truth[name]) / noise if noise > 0 else 0.0
        label = f"{name} \\[{one.unit}]" if one.unit else name
        table.add_row(label, f"{truth[name]:g}", *with_error(one.value, one.se), f"{noise:.2g}", f"{apart:+.1f}")
    Console().print(table)
    misfit = "not judged" if found.misfit is None else f"{found.misfit:.2g}"
    click.echo(
        f"status {found.verdict.status}; last window: {found.reason.text}; chi2 {misfit}; {found.windows} windows"
    )
    for doubt in found.verdict.reasons:
        if doubt.alarm:
            write_stderr(f"pvid: warning: {doubt.text}")
