"""Tables for the core: the C compiler reads the very float32 that Python wrote."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvid.base.errors import PvidError
from pvid.core.sources import INCLUDES, source
from pvid.design.c_tables import bank_header, float_array, float_literal
from pvid.design.fir import finite_difference, savitzky_golay


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
        *(str(source(name)) for name in ("differentiator_f32.c", "finite_f32.c")),
    ]
    subprocess.run([*command, "-o", str(tmp_path / "print")], check=True)
    printed = subprocess.run([str(tmp_path / "print")], capture_output=True, text=True, check=True).stdout.split()
    for bank in (finite_difference(), savitzky_golay(5, 4)):  # there is one polynomial of degree 4
        assert np.array_equal(np.array(printed, np.float32), bank.weights32.ravel())


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
