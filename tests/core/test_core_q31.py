"""The fixed-point core as a user meets it: no floating point in its objects and its headers."""

import re
import shutil
import subprocess
from pathlib import Path

from conftest import ROOT

from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, source

FIRMWARE = ROOT / "firmware"


def test_the_search_for_floating_point_finds_it(tmp_path: Path) -> None:
    """Builds for a core without an FPU search their objects (tests/board/test_ports.py): float32's own solve is full of
    it."""
    compiled, search = tmp_path / "0_q31.c.o", FIRMWARE / "cmake" / "no_float.cmake"
    command = ["arm-none-eabi-gcc", "-mcpu=cortex-m0plus", *INCLUDES, "-c", str(source("pattern_f32.c"))]
    subprocess.run([*command, "-o", str(compiled)], check=True)
    for k in range(1, 10):
        shutil.copy(compiled, tmp_path / f"{k}_q31.c.o")
    subprocess.run(["ar", "rc", "all.a", *(f"{k}_q31.c.o" for k in range(10))], cwd=tmp_path, check=True)
    tools = [f"-D{one.upper()}=arm-none-eabi-{one}" for one in ("ar", "nm", "objdump")]
    given = [f"-DARCHIVE={tmp_path / 'all.a'}", f"-DFOLDER={tmp_path / 'scratch'}", *tools]
    done = subprocess.run(["cmake", *given, "-P", search], capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "_q31.c.o calls __aeabi_f" in done.stderr


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
