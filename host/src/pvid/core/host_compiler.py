"""The C compiler of this computer, for code that is made while the program runs."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from pvid.base.errors import PvidError
from pvid.core.sources import cache_folder


def host_compiler(what: str) -> str:
    """Path of the one that CC names, else of cc, gcc or clang.

    Raises PvidError when there is none.

    Parameters
    ----------
    what : needs it, for the message
    """
    for name in (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        found = shutil.which(name) if name else None
        if found:
            return found
    raise PvidError(f"{what} needs a C compiler (cc, gcc or clang, or the one that CC names), and there is none")


def build_of(compiler: str) -> str:
    """What tells one build of a compiler from another, without starting it: its file, size and time."""
    file = Path(compiler).resolve()
    found = file.stat()
    return f"{file} {found.st_size} {found.st_mtime_ns}"


def compiled_once() -> Mapping[str, str]:
    """The environment in which ccache, where it is installed, keeps the objects of all builds: in CCACHE_DIR, or beside
    what else is kept.

    Trees of one processor hold the same objects but for a macro or two.
    """
    return {"CCACHE_DIR": str(cache_folder() / "ccache"), **os.environ, "CCACHE_NOHASHDIR": "true"}


def objects_of(compiler: str, options: Sequence[str], sources: Sequence[Path], folder: Path) -> list[str]:
    """Compiles each source into a folder, side by side; the names of the objects.

    Raises PvidError when the compiler refuses one; the sentence has its first error.

    Parameters
    ----------
    options : paths in them are from the folder; where they do not name it, ccache finds the objects of another one
        without reading a header
    """
    ccache = shutil.which("ccache")
    environment = compiled_once()

    def made(source: Path) -> str:
        place = str(folder / f"{source.parent.name}-{source.stem}.o")  # a generated source may have the name of another
        command = [*([ccache] if ccache else []), compiler, *options, "-c", str(source), "-o", place]
        run_compiler(command, environment, folder)
        return place

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(made, sources))


def run_compiler(
    command: Sequence[str], environment: Mapping[str, str] | None = None, folder: Path | None = None
) -> str:
    """What it prints; it is started in a folder. Raises PvidError when it fails, with its first error."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, cwd=folder)
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if "error" in line or "undefined" in line]
        told = (lines or done.stderr.splitlines() or ["no output"])[0]
        raise PvidError(f"the C compiler refused the code: {told.strip()[:300]}")
    return done.stdout
