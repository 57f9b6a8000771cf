"""The comparison itself must be able to fail: a core with one constant changed is caught and the bit is named."""

from __future__ import annotations

import subprocess
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


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run and its rig file."""
    folder = tmp_path_factory.mktemp("recorded")
    assert pvid(folder, "simulate", "run.csv", "--duration", "2", "--bits", "20").returncode == 0
    return folder


@pytest.mark.parametrize("name", MUTANTS)
def test_a_changed_core_exits_1_and_names_tick_variable_and_words(name: str, recorded: Path, tmp_path: Path) -> None:
    original, changed = MUTANTS[name]
    text = source(name).read_text(encoding="utf-8")
    assert text.count(original) == 1
    (tmp_path / name).write_text(text.replace(original, changed), encoding="utf-8")
    library = tmp_path / "libpvid_native.so"
    others = [str(path) for path in core_sources() if path.name != name]
    includes = [*INCLUDES, '-DPVID_NATIVE_BUILD="mutant"']
    includes += SIZES
    command = ["gcc", "-std=c99", "-O0", "-ffp-contract=off", "-fPIC", "-shared", *includes, str(tmp_path / name)]
    subprocess.run([*command, *others, str(ROOT / "host/native/replay.c"), "-o", str(library), "-lm"], check=True)

    compare = ("compare", "run.csv", "--rig", "run.toml", "--form", "strong")
    done = pvid(recorded, *compare, PVID_NATIVE_LIBRARY=str(library))
    assert done.returncode == 1, done.stdout + done.stderr
    words = " ".join(done.stdout.split())
    assert "DIFFERENT: tick" in words
    assert "core" in words and "twin" in words
