"""The notebooks run, cell by cell, and show what they show; the runner's outputs are those of a kernel."""

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from conftest import ROOT

from pvid.base.packages import PACKAGES

MODULES_OF_EXTRAS = {"plot": ["matplotlib"], "serial": ["serial"], "parquet": ["pyarrow"]}
NOTEBOOKS = sorted((ROOT / "host" / "notebooks").glob("*.ipynb"))


@pytest.fixture(scope="module")
def runner() -> ModuleType:
    spec = importlib.util.spec_from_file_location("notebooks", ROOT / "tools" / "notebooks.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def outputs_of(notebook: dict[str, Any]) -> list[list[str]]:
    """The kinds of the outputs of each cell of code."""
    return [
        [kind for one in cell["outputs"] for kind in one.get("data", {"stream": ""})]
        for cell in notebook["cells"]
        if cell["cell_type"] == "code"
    ]


def without(folder: Path, modules: list[str]) -> None:
    """Modules that a process finds in this folder first, and that are not installed there."""
    for name in modules:
        (folder / name).mkdir(parents=True)
        text = f"raise ModuleNotFoundError('No module named {name!r}', name={name!r})\n"
        (folder / name / "__init__.py").write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    "path",
    [pytest.param(one, id=one.stem, marks=() if one.stem == "motor" else pytest.mark.night) for one in NOTEBOOKS],
)
def test_every_cell_runs_and_shows_what_the_file_shows(
    path: Path, runner: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the environment that the first cell names: no other extra is installed."""
    named = re.search(
        r"\./host\[([\w,]+)\]", "".join(json.loads(path.read_text(encoding="utf-8"))["cells"][0]["source"])
    )
    assert named is not None
    brought = {module for extra in named[1].split(",") for module in MODULES_OF_EXTRAS[extra]}
    without(tmp_path / "absent", [one for one in PACKAGES if one not in brought])
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "absent"))
    monkeypatch.chdir(tmp_path)
    ran = runner.run_notebook(path)
    kept = json.loads(path.read_text(encoding="utf-8"))
    assert outputs_of(ran) == outputs_of(kept), "run tools/notebooks.py --update"
    assert "image/png" in str(outputs_of(kept)) and "text/html" in str(outputs_of(kept))
    assert kept["nbformat"] == 4 and len({cell["id"] for cell in kept["cells"]}) == len(kept["cells"])


def test_a_cell_shows_what_it_prints_and_its_last_value(runner: ModuleType) -> None:
    names: dict[str, Any] = {}
    assert runner.run_cell("x = 2\nprint(x)\nx + 1", names) == [
        {"name": "stdout", "output_type": "stream", "text": ["2\n"]},
        {"data": {"text/plain": ["3"]}, "metadata": {}, "output_type": "display_data"},
    ]
    assert runner.run_cell("x", names)[0]["data"] == {"text/plain": ["2"]} and runner.run_cell("y = x", names) == []
    with pytest.raises(ZeroDivisionError):
        runner.run_cell("x / 0", names)
