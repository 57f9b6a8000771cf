"""The pages of the shipped mechanisms, host/docs/mechanisms/NAME.md: description, rows, verdict, a picture."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from pvid.base.atomic_write import write_whole
from pvid.base.figure_file import save
from pvid.base.replacing import replacing
from pvid.model.compiled import CompiledModel
from pvid.model.report import check_report
from pvid.models.mechanisms import compiled_of, path_of
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import identify
from pvid.sim.simulated_run import RigSimulation

SEED = 1
# Tables of benchmarks/mechanisms.md and their headings on a mechanism's own page.
TABLES = {
    "mechanisms": "Errors with soft friction, the rig's own design",
    "mechanisms-chosen": "Errors with sharp friction, a design chosen on each run",
}
_SHOWN = 0.25  # of the run, in the picture


@dataclass(frozen=True, eq=False)
class Example:
    """A simulated run and the motion that the parameters identified from it give, by signal [n]."""

    model: CompiledModel
    t: Float
    measured: dict[str, Float]
    simulated: dict[str, Float]


def example_of(name: str) -> Example:
    """The shipped rig: run, identify, simulate again with the identified parameters."""
    model = compiled_of(name)
    rig = simulated_rig(name)
    run = RigSimulation.of(model, rig).run(SEED)
    t = run.pop("t")
    found = identify(model, run, rig.sample_rate)
    again = replace(rig, truth=dict(zip(found.names, map(float, found.p), strict=True)))
    exact = replace(model, signals=tuple(replace(one, resolution=0.0, noise=0.0) for one in model.signals))
    simulated = RigSimulation.of(exact, again).run(SEED)
    return Example(model, t, run, simulated)


def picture(example: Example, path: Path) -> None:
    """Each sensor that is not driven: measured, simulated, and their difference in resolutions."""
    sensors = [one for one in example.model.signals if one.kind == "sensor" and not one.driven]
    figure, grid = plt.subplots(
        2,
        len(sensors),
        sharex=True,
        squeeze=False,
        figsize=(4.6 * len(sensors), 4.2),
        layout="constrained",
        height_ratios=(2, 1),
    )
    some = slice(0, max(2, int(_SHOWN * len(example.t))))
    for axes, one in zip(grid.T, sensors, strict=True):
        measured, simulated = example.measured[one.name], example.simulated[one.name]
        axes[0].plot(example.t[some], measured[some], color="C0", linewidth=2.0, label="measured")
        axes[0].plot(
            example.t[some], simulated[some], color="C1", linewidth=0.9, label="simulated with the identified p"
        )
        axes[0].set_ylabel(f"{one.name} [{one.unit}]")
        axes[1].plot(example.t[some], (measured - simulated)[some] / one.resolution, color="C3", linewidth=0.6)
        axes[1].set_ylabel("difference\n[resolutions]")
        axes[1].set_xlabel("time [s]")
        for axis in axes:
            axis.grid(alpha=0.3)
    grid[0, 0].legend(loc="upper right", fontsize="small")
    try:
        save(figure, path, dpi=80)
    finally:
        plt.close(figure)


def fit_of(example: Example, name: str) -> float:
    """R^2 of the simulated signal."""
    measured, simulated = example.measured[name], example.simulated[name]
    return 1.0 - float(np.sum((measured - simulated) ** 2) / np.sum((measured - measured.mean()) ** 2))


def errors_of(table: str, page_text: str, name: str) -> list[str]:
    """Lines of a table of benchmarks/mechanisms.md with the rows of one mechanism, without its column; none: []."""
    found = re.search(rf"<!-- {table} -->\n(.*?)<!-- /{table} -->", page_text, re.S)
    lines = found[1].strip().splitlines() if found else []
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    rows = [row for row in cells[2:] if row[0] == name]
    return [f"| {' | '.join(row[1:])} |" for row in [*cells[:2], *rows]] if rows else []


def page(name: str, example: Example, errors: Mapping[str, str]) -> str:
    """The text of a page.

    Parameters
    ----------
    errors : heading -> table
    """
    model, (_, path) = example.model, path_of(name)
    sensors = [one for one in model.signals if one.kind == "sensor" and not one.driven]
    fits = ", ".join(f"{one.name} {fit_of(example, one.name):.6f}" for one in sensors)
    return "\n".join(
        [
            f"# {model.title}",
            "",
            "Written by `./tools/pvid bench pages`: do not edit. [All mechanisms](../benchmarks/mechanisms.md), "
            "[how to describe your own](../models.md).",
            "",
            "```python",
            path.read_text(encoding="utf-8").rstrip(),
            "```",
            "",
            f"`./tools/pvid model check {name}` prints:",
            "",
            "```text",
            check_report(model).rstrip(),
            "```",
            "",
            f"A simulated run of its rig (seed {SEED}), and the motion that the parameters identified from it give, "
            f"from the same start and drive; R^2 over the whole run: {fits}.",
            "",
            f"![Measured and simulated signals](../images/mechanisms/{name}.png)",
            *(f"\n## {heading}\n\n{table}" for heading, table in errors.items()),
            "",
        ]
    )


def printed_answer() -> str:
    """What the first two commands of models.md print, standard output before standard error."""
    from click.testing import CliRunner

    from pvid.cli.main import commands

    with TemporaryDirectory() as folder:
        path = str(Path(folder) / "motor.csv")
        done = [
            CliRunner().invoke(commands, list(arguments), catch_exceptions=False, standalone_mode=False)
            for arguments in (("model", "simulate", "dc_motor", path), ("identify", path))
        ]
    lines = "".join(one.stdout + one.stderr for one in done).replace(f"{folder}/", "").splitlines()
    return "\n".join(line.rstrip() for line in lines).strip()


def write_page(docs: Path, name: str) -> None:
    """The page and the picture of a mechanism below a folder of documents."""
    (docs / "mechanisms").mkdir(exist_ok=True)
    (docs / "images" / "mechanisms").mkdir(parents=True, exist_ok=True)
    example = example_of(name)
    with replacing():  # pictures of any version
        picture(example, docs / "images" / "mechanisms" / f"{name}.png")
    measured = (docs / "benchmarks" / "mechanisms.md").read_text(encoding="utf-8")
    tables = {heading: errors_of(table, measured, name) for table, heading in TABLES.items()}
    errors = {heading: "\n".join(lines) for heading, lines in tables.items() if lines}
    write_whole(docs / "mechanisms" / f"{name}.md", page(name, example, errors), freely=True)
