"""The README's C program is compiled and run as it stands."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
from conftest import ROOT

from pvid.rig import STANDARD_PENDULUM, Sensors, simulate


def example() -> str:
    block = re.search(r"```c\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert block is not None
    return block.group(1)


def test_the_example_identifies_the_standard_rig(tmp_path: Path) -> None:
    source = tmp_path / "example.c"
    source.write_text(example(), encoding="utf-8")
    binary = tmp_path / "example"
    core = sorted(str(path) for path in (ROOT / "firmware" / "src").glob("*.c"))
    include = f"-I{ROOT / 'firmware' / 'include'}"
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror", include]
    subprocess.run(["gcc", *flags, str(source), *core, "-o", str(binary), "-lm"], check=True)
    # exact samples: what is tested is the program, not the differentiator's noise
    run = simulate(sensors=Sensors(), truth="linear", duration=20.0).run
    samples = "\n".join(f"{phi:.9g} {y:.9g}" for phi, y in zip(run.phi, run.y, strict=True))
    printed = subprocess.run([str(binary)], input=samples, capture_output=True, text=True, check=True).stdout
    numbers = [float(number) for number in re.findall(r"-?\d+\.\d+", printed)]
    assert len(numbers) == 6, printed
    truth = np.array([STANDARD_PENDULUM.g, STANDARD_PENDULUM.l2, STANDARD_PENDULUM.rho2])
    # five points 8 ms apart differentiate 4.1 Hz with an error of h^2 order: a few per cent in the fourth derivative
    np.testing.assert_allclose(numbers[::2], truth, rtol=0.10)


def test_every_command_the_readme_names_exists() -> None:
    from pvid.cli import commands

    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"\./tools/pvid ([a-z]+)", readme))
    assert named, "the README names no command"
    assert named <= set(commands.commands)
