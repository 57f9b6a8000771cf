"""The pages of the shipped mechanisms, host/docs/mechanisms/NAME.md: description, rows, verdict, a picture."""

from __future__ import annotations

import importlib
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from bench.figures import results_of
from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.base.figure_file import save
from pvid.base.replacing import replacing
from pvid.cli.page_table import markdown
from pvid.cli.results import Results
from pvid.model.compiled import CompiledModel
from pvid.model.report import check_report
from pvid.models.mechanisms import compiled_of, names, path_of
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import identify
from pvid.sim.simulated_run import RigSimulation

SEED = 1
ERRORS = "mechanisms-chosen"  # the table of results on a mechanism's page
_ERRORS_HEAD = """
## Errors of 20 runs

A design chosen on each run, friction sharp, float64 (`./tools/pvid bench mechanisms`).

"""
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


def errors_of(results: Results, name: str) -> str:
    """The rows of one mechanism, in Markdown, without its column; "": it has none."""
    rows = [row[1:] for row in results.rows if row[0] == name]
    return markdown(results.header[1:], rows) if rows else ""


def command_of(model: CompiledModel) -> str:
    """What identifies a recording; a constant that must be stated has its usual value."""
    needed = "".join(f" --set {one.name}={one.value:g}" for one in model.knowns if one.required)
    return f"./tools/pvid identify recorded.csv --model {model.name}{needed}"


def rig_of(name: str) -> str:
    """The shipped rig in words."""
    text = importlib.import_module(f"pvid.models.{name}.rig").__doc__
    assert text is not None
    return f"The rig: {text[0].lower()}{' '.join(text.split())[1:]}"


def gallery() -> str:
    """The page of all mechanisms: what is measured of each, and what is found."""
    rows: list[tuple[str, ...]] = []
    for name in names():
        model = compiled_of(name)
        found = [*model.p_names, *(one.name for one in model.outputs)]
        measured = ", ".join(one.name for one in model.signals)
        rows.append((f"[{name}]({name}.md)", model.title, measured, ", ".join(found)))
    return "\n".join(
        [
            "# Gallery",
            "",
            "Written by `./tools/pvid bench pages`: do not edit. "
            f"{len(rows)} mechanisms are included. Each is one model file, with a simulated rig and a page: copy the "
            "file to change it ([how](../models.md)). A recording whose columns have the names in the table needs no "
            "`--model`; `./tools/pvid look recorded.csv` lists the mechanisms that any columns can be of.",
            "",
            markdown(("mechanism", "what it is", "recorded", "found"), rows),
            "",
        ]
    )


def page(name: str, example: Example, errors: str) -> str:
    """The text of a page.

    Parameters
    ----------
    errors : a table
    """
    model, (_, path) = example.model, path_of(name)
    sensors = [one for one in model.signals if one.kind == "sensor" and not one.driven]
    fits = ", ".join(f"{one.name} {fit_of(example, one.name):.6f}" for one in sensors)
    return "\n".join(
        [
            f"# {model.title}",
            "",
            "Written by `./tools/pvid bench pages`: do not edit. [Accuracy](../benchmarks.md), "
            "[how to describe your own](../models.md).",
            "",
            "```python",
            path.read_text(encoding="utf-8").rstrip(),
            "```",
            "",
            f"`{command_of(model)}` identifies a recording of it. `./tools/pvid model check {name}` prints:",
            "",
            "```text",
            check_report(model).rstrip(),
            "```",
            "",
            f"{rig_of(name)} A simulated run (seed {SEED}), and the motion that the parameters identified from it "
            "give, "
            f"from the same start and drive; R^2 over the whole run: {fits}.",
            "",
            f"![Measured and simulated signals](../images/mechanisms/{name}.png)",
            *([_ERRORS_HEAD + errors] if errors else []),
            "",
        ]
    )


def printed_demo() -> str:
    """What the demo prints. Raises PvidError when it fails."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-P", "-m", "pvid", "demo"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise PvidError(f"the demo failed: {(done.stderr or done.stdout).strip()[-300:]}")
    return "\n".join(line.rstrip() for line in done.stdout.rstrip().splitlines())


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
    errors = errors_of(results_of(ERRORS), name)
    write_whole(docs / "mechanisms" / f"{name}.md", page(name, example, errors), freely=True)


def write_gallery(docs: Path) -> None:
    """The page of all."""
    write_whole(docs / "mechanisms" / "gallery.md", gallery(), freely=True)
