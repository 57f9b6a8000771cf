"""Compilers' options that could change bits: the sources forbid them, or pvid_arithmetic_faults_f32 finds them."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from processes import PATIENCE_S

from pvid.board import mechanism_image
from pvid.board.boards import BOARDS
from pvid.board.mechanism_image import build_mechanism_image, mechanism_run, native_hashes
from pvid.board.replay_image import play
from pvid.core.sources import INCLUDES, core_sources, source

ASK = """#include "pvid/arithmetic.h"
int main(void) { return (int)pvid_arithmetic_faults_f32(); }
"""
REORDERED = ("-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math")


def faults(folder: Path, compiler: str, *options: str) -> int:
    """What a program says whose library was compiled with these options."""
    (folder / "ask.c").write_text(ASK, encoding="utf-8")
    library = [compiler, *options, *INCLUDES, "-c", str(source("arithmetic_f32.c")), "-o", "arithmetic.o"]
    program = [compiler, *INCLUDES, "ask.c", "arithmetic.o", "-lm", "-o", "ask"]
    for command in (library, program):
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    return subprocess.run([str(folder / "ask")], check=False).returncode


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("level", ["-O1", "-O2", "-O3"])
def test_reordered_sums_are_found(compiler: str, level: str, tmp_path: Path) -> None:
    assert faults(tmp_path, compiler, level, *REORDERED) == 32
    assert faults(tmp_path, compiler, level, "-funsafe-math-optimizations") == 32
    assert faults(tmp_path, compiler, level) == 0


def test_gcc_fuses_nothing_at_its_default_standard(tmp_path: Path) -> None:
    """Nor when it is asked to; this machine's processor may have no such instruction, so its code is read."""
    if (
        subprocess.run(["gcc", "-march=haswell", "-E", "-"], input=b"", capture_output=True, check=False).returncode
        != 0
    ):
        pytest.skip("not an x86-64")
    for options in ((), ("-ffp-contract=fast",)):
        command = ["gcc", "-O2", "-march=haswell", *options, *INCLUDES, "-S", "-o", "-"]
        for name in ("sums_f32.c", "cholesky_f32.c", "arithmetic_f32.c"):
            done = subprocess.run([*command, str(source(name))], capture_output=True, text=True, check=True)
            assert "mulss" in done.stdout and "vfmadd" not in done.stdout, name


def test_gcc_warns_of_nothing_when_it_vectorises() -> None:
    options = ["-std=c99", "-O3", "-march=haswell", "-Wall", "-Wextra", *INCLUDES, "-S", "-o", "/dev/null"]
    for name in ("system_q31.c", "staged_q31.c", "sums_f32.c"):
        done = subprocess.run(["gcc", *options, str(source(name))], capture_output=True, text=True, check=True)
        assert done.stderr == ""


def test_every_float_source_forbids_fusing_before_all_else() -> None:
    for path in core_sources("*_f32.c"):
        assert path.read_text(encoding="utf-8").startswith('#include "number/uncontracted.h"\n'), path.name


def test_a_cortex_m4f_image_at_gccs_default_standard_has_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As an IDE compiles copied sources: without -std=c99 and -ffp-contract=off."""
    compiler = tmp_path / "bin" / "arm-none-eabi-gcc"
    compiler.parent.mkdir()
    compiler.write_text(
        '#!/bin/bash\nkept=()\nfor one in "$@"; do\n'
        "  case $one in -std=*|-ffp-contract=*|-fno-fast-math|-fno-delete-null-pointer-checks) ;;\n"
        '  *) kept+=("$one") ;; esac\ndone\n'
        f"echo \"${{kept[@]}}\" >> '{tmp_path}/given'\n"
        f"exec '{shutil.which('arm-none-eabi-gcc')}' \"${{kept[@]}}\"\n",
        encoding="utf-8",
    )
    compiler.chmod(0o755)
    monkeypatch.setenv("PATH", f"{compiler.parent}:{os.environ['PATH']}")
    monkeypatch.setattr(mechanism_image, "BUILD", tmp_path / "targets")
    run = mechanism_run("kapitza", 3000)
    image, _ = build_mechanism_image(BOARDS["mps2-an386"], run)
    given = (tmp_path / "given").read_text(encoding="utf-8")
    assert "weak/weak_f32.c" in given and "-std=" not in given and "-ffp-contract" not in given
    assert play(BOARDS["mps2-an386"], image, PATIENCE_S).hash == int(native_hashes(run)[-1])
