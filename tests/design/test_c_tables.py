"""Tables for the core: the C compiler reads the very float32 that Python wrote."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from pvid.base.errors import PvidError
from pvid.cases import CASES
from pvid.cli.main import commands
from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, source
from pvid.design.c_tables import bank_header, float_array, float_literal
from pvid.design.fir import finite_difference, savitzky_golay
from pvid.rig.file import Nominal, RigFile
from pvid.rig.run import write_run
from pvid.run.survey import fitted
from pvid.setup.f32 import weak_design_of
from pvid.sim.pendulum import simulate, standard_sensors


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_literal_reads_back_as_the_same_float(value: float) -> None:
    text = float_literal(np.float32(value))
    assert text.endswith("f")
    back = np.float32(text[:-1])
    assert back.tobytes() == np.float32(value).tobytes()


def test_the_compiler_reads_the_same_bits(tmp_path: Path) -> None:
    bank = savitzky_golay(61, 8)
    (tmp_path / "bank.h").write_text(bank_header(bank, "bank", "a test"), encoding="utf-8")
    (tmp_path / "print.c").write_text(
        '#include <stdio.h>\n#include <string.h>\n#include "bank.h"\n'
        "int main(void) { for (size_t i = 0; i < sizeof bank / sizeof bank[0]; i++) {"
        ' unsigned bits; memcpy(&bits, &bank[i], 4); printf("%08x\\n", bits); } return 0; }\n',
        encoding="utf-8",
    )
    binary = tmp_path / "print"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run(["gcc", *flags, str(tmp_path / "print.c"), "-o", str(binary)], check=True)
    printed = subprocess.run([str(binary)], capture_output=True, text=True, check=True).stdout.split()
    expected = [f"{word:08x}" for word in bank.weights32.ravel().view(np.uint32)]
    assert printed == expected


def test_five_points_of_the_core_are_what_is_generated(tmp_path: Path) -> None:
    (tmp_path / "print.c").write_text(
        '#include <stdio.h>\n#include "pvid/differentiator.h"\n'
        "int main(void) { for (int i = 0; i < 10; i++) {"
        ' printf("%.9g\\n", (double)pvid_five_points_f32[i]); } return 0; }\n',
        encoding="utf-8",
    )
    command = [
        "gcc",
        "-std=c99",
        *INCLUDES,
        str(tmp_path / "print.c"),
        str(source("differentiator_f32.c")),
    ]
    subprocess.run([*command, "-o", str(tmp_path / "print")], check=True)
    printed = subprocess.run([str(tmp_path / "print")], capture_output=True, text=True, check=True).stdout.split()
    assert np.array_equal(np.array(printed, np.float32), finite_difference().weights32.ravel())


def test_the_command_prints_and_checks(tmp_path: Path) -> None:
    command = [sys.executable, "-P", "-m", "pvid", "tables", "--form", "fir", "--points", "21"]
    command += ["--degree", "6", "--name", "sg21"]
    header = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert ".half = 10, .stride = 1, .block = 1, .weights = sg21" in header
    path = tmp_path / "sg21.h"
    path.write_text(header, encoding="utf-8")
    assert subprocess.run([*command, "--check", str(path)], capture_output=True, check=False).returncode == 0
    path.write_text(header.replace("sg21[", "sg22["), encoding="utf-8")
    assert subprocess.run([*command, "--check", str(path)], capture_output=True, check=False).returncode == 1


def test_a_name_that_is_not_c_is_refused() -> None:
    with pytest.raises(PvidError, match="3d"):
        float_array("3d", np.zeros(3, np.float32), "nothing")


def test_weak_tables_follow_a_run(tmp_path: Path) -> None:
    """From a poor guess the tables of what the run shows, and what a core must have room for."""
    run = simulate(sensors=standard_sensors(14), sample_rate=2000.0, duration=12.0, truth="full", seed=1).run
    write_run(tmp_path / "run.csv", run)
    poor = replace(RigFile.standard(), nominal=Nominal(l2=0.25, rho2=0.05), sample_rate=2000.0)
    poor.write(tmp_path / "poor.toml")
    known = replace(fitted(poor, run), sample_rate=2000.0)
    runner, table = CliRunner(), ["tables", "--rig", str(tmp_path / "poor.toml")]
    shown = runner.invoke(commands, [*table, "--run", str(tmp_path / "run.csv")], catch_exceptions=False)
    banner = "pvid tables --form weak --core f32 --rig poor.toml --run run.csv --name weak_config"
    case = CASES["weak", "f32"]
    expected = case.header(case.settings(known, 2000.0), known.l1, "weak_config", banner)
    assert shown.stdout == expected
    assert "build the core with -DPVID_MAX_TAPS=" in " ".join(shown.stderr.split())
    guessed = runner.invoke(commands, table, catch_exceptions=False)
    assert guessed.stdout.splitlines()[1:] != expected.splitlines()[1:]
    fixed = runner.invoke(
        commands, [*table, "--core", "q31", "--run", str(tmp_path / "run.csv")], catch_exceptions=False
    )
    assert f".window = {weak_design_of(known, 2000.0).window}" in fixed.stdout


def test_weak_tables_reach_the_core_with_their_bits(tmp_path: Path) -> None:
    case = CASES["weak", "f32"]
    config = case.settings(RigFile.standard(), 1000.0)
    (tmp_path / "config.h").write_text(case.header(config, 0.3, "own", "a test"), encoding="utf-8")
    (tmp_path / "print.c").write_text(
        '#include <stdio.h>\n#include <string.h>\n#include "config.h"\n'
        "static void print(const float *x, size_t n) { for (size_t i = 0; i < n; i++) {"
        ' unsigned bits; memcpy(&bits, &x[i], 4); printf("%08x\\n", bits); } }\n'
        "int main(void) { const pvid_weak_design_f32 *d = own.design;"
        " const size_t k = d->functions, half = (d->taps - 1u) / 2u;"
        " print(d->smooth, half); print(d->second, half); print(d->chi, d->window * 3u * k);"
        " print(d->gram, 6u * k * (k + 1u) / 2u); print(&d->overlap, 1); print(own.estimator.start, 3); return 0; }\n",
        encoding="utf-8",
    )
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *PUBLIC_INCLUDES]
    subprocess.run(["gcc", *flags, str(tmp_path / "print.c"), "-o", str(tmp_path / "print")], check=True)
    printed = subprocess.run([str(tmp_path / "print")], capture_output=True, text=True, check=True).stdout.split()
    tables = weak_design_of(RigFile.standard(), 1000.0).f32
    values = [tables.smooth, tables.second, tables.chi, tables.gram, tables.overlap, config.estimator.start[:3]]
    words = np.concatenate([np.ravel(np.asarray(v, np.float32)) for v in values]).view(np.uint32)
    assert printed == [f"{word:08x}" for word in words]
