"""The comparison itself must be able to fail: a core with one constant changed is caught and the bit is named."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT
from program import pvid

from pvid.core.sources import INCLUDES, core_sources, source
from pvid.settings.bounds import SIZES

MUTANTS = {
    "strong_f32.c": ("    rhs[0] = own[0];", "    rhs[0] = 1.0000001f * own[0];"),
    "kapitza_estimator_f32.c": ("square = ratio * ratio;", "square = 1.0000001f * (ratio * ratio);"),
    "kapitza_sums_f32.c": (
        "self->low[i] = (kept_high - (total - part)) + (kept_low - part);",
        "self->low[i] = 0.0f * part;",
    ),
}


COMPARED = """
from pathlib import Path
from pvid.cases import CASES
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import read_run
from pvid.compare.bits import compare_run

rig, case, run = RigFile.standard(), CASES["strong", "f32"], read_run(Path("run.csv"), 1000.0)
found = compare_run(Native(), case.settings(rig, 1000.0), *case.samples(rig, run))
print(found.equal, found.difference)
"""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run and its rig file."""
    folder = tmp_path_factory.mktemp("recorded")
    assert pvid(folder, "simulate", "run.csv", "--duration", "2", "--set", "sensor.phi.resolution=6e-6").returncode == 0
    return folder


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The core with nothing changed: of each source its object."""
    folder = tmp_path_factory.mktemp("objects")
    compile_into(folder, *core_sources(), ROOT / "host" / "native" / "replay.c")
    return {path.name: folder / f"{path.stem}.o" for path in (*core_sources(), Path("replay.c"))}


def compile_into(folder: Path, *sources: Path) -> None:
    options = ["-std=c99", "-O0", "-ffp-contract=off", "-fPIC", *INCLUDES, '-DPVID_NATIVE_BUILD="mutant"', *SIZES]
    subprocess.run(["gcc", *options, "-c", *map(str, sources)], cwd=folder, check=True)


@pytest.mark.parametrize("name", MUTANTS)
def test_a_changed_core_is_named_with_tick_variable_and_words(
    name: str, objects: dict[str, Path], recorded: Path, tmp_path: Path
) -> None:
    original, changed = MUTANTS[name]
    text = source(name).read_text(encoding="utf-8")
    assert text.count(original) == 1
    (tmp_path / name).write_text(text.replace(original, changed), encoding="utf-8")
    compile_into(tmp_path, tmp_path / name)
    library = tmp_path / "libpvid_native.so"
    linked = [str(path) for path in (objects | {name: (tmp_path / name).with_suffix(".o")}).values()]
    subprocess.run(["gcc", "-shared", *linked, "-o", str(library), "-lm"], check=True)

    done = subprocess.run(
        [sys.executable, "-P", "-c", COMPARED],
        cwd=recorded,
        env=os.environ | {"PVID_NATIVE_LIBRARY": str(library)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert re.match(r"False tick \d+, \S+.*: core \w{8}, twin \w{8}$", done.stdout), done.stdout
