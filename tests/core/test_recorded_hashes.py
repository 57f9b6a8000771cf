"""The identifiers end with the running hashes that they had when these were recorded: a change of bits is no accident.

    build/venv/bin/python tests/core/test_recorded_hashes.py    writes tests/recorded_hashes.toml anew

A twin that is printed from the C changes with it, so that it does not notice a wrong sign there; this does. Whoever
changes the bits on purpose records them anew and explains why. The samples and tables are recorded as well: where a
library of this machine computes others, the hashes say nothing.
"""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where it is run as a program

from playback_weak import BOTH_STAGES, IN_FIXED_POINT, BothStages, InFixedPoint, Subject

ROOT = Path(__file__).resolve().parents[2]
RECORDED = ROOT / "tests" / "recorded_hashes.toml"
NAMES = [*(f"{name}_f32" for name in BOTH_STAGES), *(f"{name}_q31" for name in IN_FIXED_POINT)]


def hashes_of(name: str) -> dict[str, str]:
    """By variant."""
    mechanism, _, core = name.rpartition("_")
    subject: Subject = (BothStages if core == "f32" else InFixedPoint).of(mechanism)
    return dict(subject.hashes(subject.library))


def assert_recorded(*names: str) -> None:
    with RECORDED.open("rb") as file:
        recorded = tomllib.load(file)
    for name in names:
        assert hashes_of(name) == recorded[name], name


@pytest.mark.parametrize("name", NAMES)
def test_the_running_hashes_are_those_recorded(name: str) -> None:
    assert_recorded(name)


@pytest.mark.night
@pytest.mark.parametrize("compiler", ["gcc -O0", "gcc -O3", "clang -O0", "clang -O2", "clang -O3"])
def test_each_compiler_and_level_gives_them(compiler: str) -> None:
    """The others are those of gcc -O2."""
    name, level = compiler.split()
    wrapper, text = ROOT / "build" / "compilers" / f"{name}{level}", f'#!/bin/sh\nexec {name} "$@" {level}\n'
    if not wrapper.exists() or wrapper.read_text(encoding="utf-8") != text:  # what it has compiled is found again
        wrapper.parent.mkdir(parents=True, exist_ok=True)
        wrapper.write_text(text, encoding="utf-8")
        wrapper.chmod(0o755)
    code = "import test_recorded_hashes as one; one.assert_recorded('kapitza_f32', 'battery_2rc_f32', 'kapitza_q31')"
    environment = {**os.environ, "CC": str(wrapper), "PYTHONPATH": str(Path(__file__).parent)}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)


def main() -> None:
    lines = [
        "# CRC-32 of the samples and running hash (pvid/fnv.h) of each variant: tests/core/test_recorded_hashes.py"
    ]
    for name in NAMES:
        lines += ["", f"[{name}]", *(f'"{variant}" = "{words}"' for variant, words in hashes_of(name).items())]
    RECORDED.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
