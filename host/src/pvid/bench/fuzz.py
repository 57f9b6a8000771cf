"""libFuzzer on the C side of the link, with the address and undefined-behaviour sanitizers."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

from pvid.boards import ROOT
from pvid.errors import PvidError


def fuzz_link(folder: Path, runs: int, seed: int = 1) -> int:
    """Builds tests/fuzz/fuzz_link.c in `folder` and runs it `runs` times; returns how many runs it reports.

    Raises
    ------
    PvidError
        When clang is missing, it does not build, or an input breaks the codec; the input is kept in `folder`.
    """
    binary = folder / "fuzz_link"
    link, core = ROOT / "firmware" / "link", ROOT / "firmware"
    options = ["-std=c99", "-g", "-O1", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all"]
    sources = [link / "link.c", core / "src" / "crc32.c", ROOT / "tests" / "fuzz" / "fuzz_link.c"]
    build = ["clang", *options, f"-I{link}", f"-I{core / 'include'}", *map(str, sources)]
    for command in (
        [*build, "-o", str(binary)],
        [str(binary), f"-runs={runs}", f"-seed={seed}", "-max_len=1200", "-timeout=10", f"-artifact_prefix={folder}/"],
    ):
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except FileNotFoundError as error:
            raise PvidError("clang is not installed: it comes with ./tools/test") from error
        if done.returncode != 0:
            raise PvidError(f"fuzzing the link failed in {folder}: {done.stderr.strip()[-500:]}")
    found = re.search(r"^Done (\d+) runs", done.stderr, re.MULTILINE)
    return int(found.group(1)) if found else 0
