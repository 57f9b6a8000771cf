"""The identifiers end with the running hashes that they had when these were recorded: a change of bits is no accident.

    build/venv/bin/python tests/core/test_recorded_hashes.py    writes tests/recorded_hashes.toml anew

A twin that is printed from the C changes with it, so that it does not notice a wrong sign there; this does. Whoever
changes the bits on purpose records them anew and explains why. The samples and tables are recorded as well: where a
library of this machine computes others, the hashes say nothing.
"""

import sys
import tomllib
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where it is run as a program

from playback_weak import BOTH_STAGES, IN_FIXED_POINT, BothStages, InFixedPoint, Subject

RECORDED = Path(__file__).resolve().parents[1] / "recorded_hashes.toml"
NAMES = [*(f"{name}_f32" for name in BOTH_STAGES), *(f"{name}_q31" for name in IN_FIXED_POINT)]


def hashes_of(name: str) -> dict[str, str]:
    """By variant."""
    mechanism, _, core = name.rpartition("_")
    subject: Subject = (BothStages if core == "f32" else InFixedPoint).of(mechanism)
    return dict(subject.hashes(subject.library))


@pytest.mark.parametrize("name", NAMES)
def test_the_running_hashes_are_those_recorded(name: str) -> None:
    with RECORDED.open("rb") as file:
        recorded = tomllib.load(file)[name]
    assert hashes_of(name) == recorded


def main() -> None:
    lines = [
        "# CRC-32 of the samples and running hash (pvid/fnv.h) of each variant: tests/core/test_recorded_hashes.py"
    ]
    for name in NAMES:
        lines += ["", f"[{name}]", *(f'"{variant}" = "{words}"' for variant, words in hashes_of(name).items())]
    RECORDED.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
