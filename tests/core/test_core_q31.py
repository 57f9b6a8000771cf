"""The fixed-point core as a user meets it: no floating point in its objects, the command line, the C header."""

import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from conftest import ROOT

from pvid.cli.main import commands
from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, core_sources, source
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.sim.simulated_run import RigSimulation, write_simulated_run

FIRMWARE = ROOT / "firmware"
# Of the fixed-point core, and what both cores need.
SOURCES = sorted(path for path in core_sources() if not path.stem.endswith("_f32"))
COMPILERS = {
    "arm-none-eabi": ["-mcpu=cortex-m0plus", "-mthumb"],
    "riscv64-unknown-elf": ["-march=rv32imac", "-mabi=ilp32"],
}
# What libgcc's soft float is called, and what an instruction on floats looks like where there are registers for them.
SOFT_FLOAT = re.compile(
    r"__aeabi_(?:[cdf]|u?[il]2[df])|__(?:add|sub|mul|div|neg|eq|ne|lt|le|gt|ge|fix|float|extend)\w*[sdtx]f"
)
FLOAT_INSTRUCTION = re.compile(
    r"\t(?:v(?:add|sub|mul|div|ldr|str|mov|cvt|sqrt|cmp)|f(?:add|sub|mul|div|lw|sw|ld|sd|cvt|mv))[.\t]"
)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A run of the standard rig, 10 s, and its rig file."""
    folder = tmp_path_factory.mktemp("q31")
    rig = replace(simulated_rig("kapitza"), duration=10.0)
    simulation = RigSimulation.of(compiled_of("kapitza"), rig)
    return folder / "run.csv", write_simulated_run(folder / "run.csv", simulation.run(2), simulation)


def tool(*command: str | Path) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("prefix", ["arm-none-eabi", pytest.param("riscv64-unknown-elf", marks=pytest.mark.long)])
def test_no_object_has_floating_point(prefix: str, tmp_path: Path) -> None:
    includes = [*INCLUDES, f"-I{FIRMWARE}/ports/freestanding/include"]
    flags = ["-std=c99", "-O2", "-ffreestanding", *COMPILERS[prefix], *includes]
    assert len(SOURCES) >= 10
    for one in SOURCES:
        tool(f"{prefix}-gcc", *flags, "-c", one, "-o", tmp_path / f"{one.stem}.o")
    objects = sorted(tmp_path.glob("*.o"))
    assert len(objects) == len(SOURCES)
    called = tool(f"{prefix}-nm", "--undefined-only", "--print-file-name", *objects)
    assert [line for line in called.splitlines() if SOFT_FLOAT.search(line)] == []
    listing = tool(f"{prefix}-objdump", "-d", *objects)
    assert [line for line in listing.splitlines() if FLOAT_INSTRUCTION.search(line)] == []


def pvid_text(header: str) -> str:
    """What a compiler reads of pvid's own headers after #include "pvid/HEADER"."""
    command = ["gcc", "-std=c99", *PUBLIC_INCLUDES, "-E", "-x", "c", "-"]
    done = subprocess.run(command, input=f'#include "pvid/{header}"', capture_output=True, text=True, check=True)
    kept, own = [], False
    for line in done.stdout.splitlines():
        marker = re.match(r'# \d+ "([^"]*)"', line)
        if marker:
            own = str(FIRMWARE) in marker[1]
        elif own:
            kept.append(line)
    return "\n".join(kept)


def test_public_headers_contain_no_floating_point_type() -> None:
    floating = re.compile(r"\b(?:float|double)\b")
    assert "pvid_weak_step_q31" in pvid_text("pvid_q31.h") and not floating.search(pvid_text("pvid_q31.h"))
    assert floating.search(pvid_text("pvid.h")) and not re.search(r"_q31(?!theta|moments|c\d)", pvid_text("pvid.h"))


def test_the_search_for_floating_point_finds_it(tmp_path: Path) -> None:
    """The test above can fail: float32's own solve is full of it."""
    compiled = tmp_path / "float.o"
    tool("arm-none-eabi-gcc", "-mcpu=cortex-m0plus", *INCLUDES, "-c", source("pattern_f32.c"), "-o", compiled)
    assert SOFT_FLOAT.search(tool("arm-none-eabi-nm", "--undefined-only", compiled))


def test_identify_answers_from_the_fixed_point_core(recorded: tuple[Path, Path]) -> None:
    run, rig = recorded
    done = CliRunner().invoke(commands, ["identify", str(run), "--rig", str(rig), "--core", "q31", "--json"])
    answer = json.loads(done.stdout)
    assert answer["core"] == "q31"
    truth = simulated_rig("kapitza").truth
    for name, value in ((name, truth[name]) for name in ("w", "d1", "d2")):
        # ten seconds: 4 standard errors, and these below half a per cent
        one = answer["parameters"][name]
        assert abs(one["value"] - value) < 4 * one["se"] and one["se_noise"] < 0.005 * value
    assert answer["parameters"]["g"]["value"] == pytest.approx(9.5, rel=0.005)


def test_compare_runs_both_cores(recorded: tuple[Path, Path]) -> None:
    run, rig = recorded
    done = CliRunner().invoke(
        commands, ["compare", str(run), "--rig", str(rig), "--core", "all", "--law", "stationary"]
    )
    assert re.search(r"f32 .*equal", done.stdout) and re.search(r"q31 .*equal", done.stdout), done.stdout
    assert "DIFFERENT" not in done.stdout
