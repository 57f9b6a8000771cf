"""C text made into a shared library by the host's compiler, once: it stays in the cache of builds."""

from __future__ import annotations

import ctypes
import hashlib
import subprocess
import tempfile
from pathlib import Path

from pvid.base.errors import PvidError
from pvid.core.host_compiler import build_of, host_compiler
from pvid.core.sources import cache_folder

_FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-shared", "-fPIC", "-w")


def loaded(code: str) -> ctypes.CDLL:
    """The library of a C text. Raises PvidError when there is no compiler, or it refuses the text."""
    compiler = host_compiler("a simulation")
    name = hashlib.sha256("\n".join((build_of(compiler), *_FLAGS, code)).encode()).hexdigest()[:24]
    place = cache_folder() / "plants" / f"{name}.so"
    if not place.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        _build(compiler, code, place)
    return ctypes.CDLL(str(place))


def _build(compiler: str, code: str, place: Path) -> None:
    """Whole or not at all: several processes may build the same."""
    with tempfile.TemporaryDirectory(dir=place.parent) as folder:
        source, library = Path(folder) / "plant.c", Path(folder) / "plant.so"
        source.write_text(code, encoding="utf-8")
        command = [compiler, *_FLAGS, str(source), "-o", str(library), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise PvidError(f"{compiler} refused the code of the simulation: {done.stderr.strip()[:300]}")
        library.replace(place)
