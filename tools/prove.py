#!/usr/bin/env python3
"""Proofs by abstract interpretation: Frama-C's Eva over the programs of tests/proofs.

    tools/prove.py            all of them; exits 1 when one leaves an alarm
    tools/prove.py link       one of them

A program feeds the functions of one module every input that their header allows. That Eva raises no alarm proves, for
all of these inputs: no overflow of signed arithmetic, no value lost in a conversion to a smaller signed type, no access
out of bounds, no division by zero, no bad shift, no uninitialised read, and the assertions of the program.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
INCLUDES = " ".join(
    f"-I'{ROOT / name}'" for name in ("firmware/include", "firmware/src", "firmware/link", "tests/proofs")
)
LONGEST = 600  # seconds: many times what the slowest needs on a machine that is busy


@dataclass(frozen=True)
class Proof:
    """A program of tests/proofs, what it is linked with, and how far Eva unrolls loops or keeps paths apart."""

    name: str
    sources: tuple[str, ...]
    options: tuple[str, ...]


PROOFS = (
    Proof(
        "integer_q31",
        ("src/integer_q31.c",),
        ("-eva-auto-loop-unroll", "200", "-eva-min-loop-unroll", "33"),
    ),
    Proof(
        "information_q31",
        ("src/information_q31.c", "src/integer_q31.c"),
        ("-eva-auto-loop-unroll", "1100", "-eva-min-loop-unroll", "13"),
    ),
    Proof(
        "link",
        ("link/link.c", "src/crc32.c"),
        (
            *("-eva-split-return", "full"),
            *("-eva-slevel-function", "one_byte:20,pvid_link_decode:40,accept:40"),
        ),
    ),
)


def prove(proof: Proof) -> tuple[bool, str]:
    """Whether nothing is left, and what Eva says: the alarms, or its summary in one line."""
    started = time.monotonic()
    program = ROOT / "tests" / "proofs" / f"prove_{proof.name}.c"
    files = [str(program), *(str(ROOT / "firmware" / source) for source in proof.sources)]
    always = ["-machdep", "gcc_x86_64", f"-cpp-extra-args={INCLUDES}", "-warn-signed-downcast"]
    quiet = ["-eva", "-eva-no-show-progress", "-eva-msg-key=-initial-state,-final-states"]
    command = ["frama-c", *always, *files, *quiet, *proof.options]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST)
    reached = re.search(r"(\d+) statements reached \(out of (\d+)\)", done.stdout)
    alarms = re.search(r"^ +(\d+) alarms? generated", done.stdout, re.MULTILINE)
    unproved = re.search(r"Assertions +(\d+) valid +(\d+) unknown +(\d+) invalid", done.stdout)
    if done.returncode != 0 or reached is None or alarms is None or unproved is None:
        return False, done.stdout + done.stderr
    if alarms[1] != "0" or (unproved[2], unproved[3]) != ("0", "0"):
        found = re.findall(r"^\[eva:alarm\][^\n]*(?:\n  [^\n]*)*", done.stdout, re.MULTILINE)
        return False, "\n".join(found)
    took = f"{time.monotonic() - started:.0f} s"
    return True, f"no alarm in {reached[1]} of {reached[2]} statements, {unproved[1]} assertions proved, {took}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(proof.name for proof in PROOFS))
    names = parser.parse_args().names or [proof.name for proof in PROOFS]
    chosen = [proof for proof in PROOFS if proof.name in names]
    unknown = set(names) - {proof.name for proof in chosen}
    if unknown:
        parser.error(f"no proof is called {', '.join(sorted(unknown))}")
    if shutil.which("frama-c") is None:
        raise SystemExit("missing: frama-c-base (Debian's name); ./tools/test installs it")
    failed = 0
    with ThreadPoolExecutor(2) as pool:
        for proof, (proved, text) in zip(chosen, pool.map(prove, chosen), strict=True):
            failed += not proved
            print(f"{proof.name}: {text}" if proved else f"{proof.name}: NOT PROVED\n{text}")
    print(f"Found {failed} modules not proved" if failed else f"All checks passed! {len(chosen)} modules proved")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
