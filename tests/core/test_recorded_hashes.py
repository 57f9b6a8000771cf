"""The engines end with the running hashes that they had when these were recorded: a change of bits is no accident.

    build/venv/bin/python tests/core/test_recorded_hashes.py    writes tests/recorded_hashes.toml anew

A twin that is printed from the C changes with it, so that it does not notice a wrong sign there; this does. Whoever
changes the bits on purpose records them anew and explains why. The samples and tables are recorded as well: where a
library of this machine computes others, the hashes say nothing.
"""

from __future__ import annotations

import sys
import tomllib
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where it is run as a program

from playback_engine import BOTH_STAGES, IN_FIXED_POINT, BothStages, InFixedPoint, set_in

RECORDED = Path(__file__).resolve().parents[1] / "recorded_hashes.toml"
NAMES = [*(f"{name}_f32" for name in BOTH_STAGES), *(f"{name}_q31" for name in IN_FIXED_POINT)]


def hashes_of(name: str) -> Iterator[tuple[str, str]]:
    """Of each variant its name, and the CRC-32 of its samples and the running hash behind them."""
    mechanism, _, core = name.rpartition("_")
    if core == "f32":
        both = BothStages.of(mechanism)
        for variant, (weak, refine, samples) in both.variants().items():
            record = both.native.refined_of(weak, refine).run_both(samples)
            yield variant, f"{zlib.crc32(samples.tobytes()):08x} {int(record.hash[-1]):08x}"
        return
    fixed = InFixedPoint.of(mechanism)
    for variant, (settings, counts) in fixed.variants().items():
        identifier = fixed.native.identifier()
        kept = [set_in(identifier, field, value) for field, value in settings.items()]
        assert identifier.initialise() == 0 and len(kept) == len(settings)
        record = identifier.run_samples(counts)
        yield variant, f"{zlib.crc32(counts.tobytes()):08x} {int(record.hash[-1]):08x}"


@pytest.mark.parametrize("name", NAMES)
def test_the_running_hashes_are_those_recorded(name: str) -> None:
    with RECORDED.open("rb") as file:
        recorded = tomllib.load(file)[name]
    assert dict(hashes_of(name)) == recorded


def main() -> None:
    lines = [
        "# CRC-32 of the samples and running hash (pvid/fnv.h) of each variant: tests/core/test_recorded_hashes.py"
    ]
    for name in NAMES:
        lines += ["", f"[{name}]", *(f'"{variant}" = "{words}"' for variant, words in hashes_of(name))]
    RECORDED.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
