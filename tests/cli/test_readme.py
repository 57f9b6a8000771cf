"""The README's C program is compiled and run as it stands."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest
from conftest import ROOT

from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, core_sources
from pvid.rig.file import RigFile
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate


def example() -> str:
    block = re.search(r"```c\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert block is not None
    return block.group(1)


def test_the_example_identifies_the_standard_rig(tmp_path: Path) -> None:
    (tmp_path / "example.c").write_text(example(), encoding="utf-8")
    RigFile.standard().write(tmp_path / "rig.toml")
    command = [sys.executable, "-P", "-m", "pvid", "tables", "--rig", str(tmp_path / "rig.toml")]
    header = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    (tmp_path / "tables.h").write_text(header, encoding="utf-8")
    binary = tmp_path / "example"
    core = map(str, core_sources())
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    includes = [*INCLUDES, f"-I{tmp_path}"]
    subprocess.run(["gcc", *flags, *includes, str(tmp_path / "example.c"), *core, "-o", str(binary), "-lm"], check=True)
    run = simulate(truth="full").run  # 14 bits: what `pvid simulate` gives
    samples = "\n".join(f"{phi:.9g} {y:.9g}" for phi, y in zip(run.phi, run.y, strict=True))
    printed = subprocess.run([str(binary)], input=samples, capture_output=True, text=True, check=True).stdout
    numbers = np.array([float(number) for number in re.findall(r"-?\d+\.\d+", printed)])
    assert len(numbers) == 6, printed
    truth = np.array([STANDARD_PENDULUM.g, STANDARD_PENDULUM.l2, STANDARD_PENDULUM.rho2])
    errors, standard_errors = np.abs(numbers[::2] - truth), numbers[1::2]
    assert (errors < 4 * standard_errors).all(), printed
    assert (standard_errors < 2e-3 * truth).all(), printed


@pytest.mark.parametrize("standard", ["c++14", "c++20"])
def test_the_example_is_cpp_too(standard: str, tmp_path: Path) -> None:
    (tmp_path / "example.cpp").write_text(example(), encoding="utf-8")
    declared = '#include "pvid/weak.h"\nextern "C" const pvid_weak_design_f32 weak_tables;\n'
    (tmp_path / "tables.h").write_text(declared, encoding="utf-8")
    command = ["g++", f"-std={standard}", "-fsyntax-only", "-Wall"]
    includes = [*PUBLIC_INCLUDES, f"-I{tmp_path}"]
    done = subprocess.run([*command, *includes, str(tmp_path / "example.cpp")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_every_command_the_readme_names_exists() -> None:
    from pvid.cli.main import commands

    pages = [ROOT / "README.md", ROOT / "firmware" / "README.md", ROOT / "host" / "README.md"]
    named = set(re.findall(r"\./tools/pvid ([a-z-]+)", "".join(page.read_text(encoding="utf-8") for page in pages)))
    assert named, "the READMEs name no command"
    assert named <= set(commands.list_commands(click.Context(commands)))
