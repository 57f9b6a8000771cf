"""A library of the C core with the generated C of a mechanism, compiled for this computer; kept in the cache of builds.

The core's arrays get the sizes that the mechanism needs. Flags are those of tools/pvid's own library.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock

from pvid.base.errors import PvidError
from pvid.core.headers import HEADERS
from pvid.core.host_compiler import build_of, host_compiler, objects_of, run_compiler
from pvid.core.sizes import options_of
from pvid.core.sources import FIRMWARE, INCLUDES, REFINE_MODEL, ROOT, SRC, cache_folder, core_sources
from pvid.settings.cores import FLOAT, CoreBuild

NATIVE = ROOT / "host" / "native"
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-fast-math", "-fPIC", "-w")
_ROOMS = ("number", "solve", "judge", "persist")  # of every form
_REFINED = "refine_model_f32.h"  # a text that comes with the second stage
_STANDARD = ("math", "stdbool", "stddef", "stdint", "string")
_WHAT = "identification in C of a described mechanism"


@dataclass(frozen=True, eq=False)
class ModelSources:
    """What a library of a mechanism and its twin are made of; the arguments of `model_library`."""

    name: str
    texts: Mapping[str, str]
    sizes: Mapping[str, int]
    build: CoreBuild = FLOAT
    headers: Sequence[str] | None = None

    @property
    def refined(self) -> bool:
        """With the second stage."""
        return _REFINED in self.texts

    def library(self) -> Path:
        """The shared library; raises as `model_library`."""
        return model_library(self.name, self.texts, self.sizes, self.build, self.headers)


def model_library(
    name: str,
    texts: Mapping[str, str],
    sizes: Mapping[str, int],
    build: CoreBuild = FLOAT,
    headers: Sequence[str] | None = None,
) -> Path:
    """The shared library, beside it what cffi reads.

    Raises PvidError when there is no compiler, or it refuses the code; or somebody changes the core meanwhile.

    Parameters
    ----------
    name : of the mechanism, for the file's name
    texts : file name -> generated C
    sizes : PVID_MAX_ macro -> value
    build : its arithmetic, or the strong form
    headers : names of the texts that cffi reads; None: all headers
    """
    compiler = host_compiler(_WHAT)
    definitions = options_of(sizes)
    core = _core_hash()
    key = hashlib.sha256("\0".join([build_of(compiler), *_FLAGS, *definitions, core, *_flat(texts)]).encode())
    folder = _kept() / f"{name}-{build.name}-{key.hexdigest()[:20]}"
    library = folder / f"lib{name}.so"
    if not library.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        declared = headers or sorted(one for one in texts if one.endswith(".h"))
        _build(compiler, texts, definitions, library, build, declared, core)
    return library


def _kept() -> Path:
    return cache_folder() / "models"


def _flat(texts: Mapping[str, str]) -> Iterable[str]:
    for name in sorted(texts):
        yield from (name, texts[name])


def core_of(build: CoreBuild, refined: bool) -> list[Path]:
    """Sources beside the generated ones. refined: with the second stage."""
    rooms = (*_ROOMS, build.room, *(["refine"] if refined else []))
    found = [path for path in core_sources() if path.parent.parent == SRC and path.parent.name in rooms]
    replays = [*([] if build.replay is None else [build.replay]), *(["replay_refine"] if refined else [])]
    kept = [path for path in found if not path.stem.endswith(build.without)]
    return [*kept, *(NATIVE / f"{name}.c" for name in replays)]


def of_second_stage(source: Path) -> bool:
    """Whether a source or an object of the core depends on the shape of the mechanism's second stage."""
    return "refine" in source.stem


def core_options(definitions: Iterable[str]) -> list[str]:
    """The compiler's for the core on this computer: with the same ones ccache finds the objects of another program."""
    return [*_FLAGS, *definitions, *INCLUDES]


def compiled_by() -> str:
    """Compiler and optimisation of the libraries, for a sentence."""
    return f"{Path(host_compiler(_WHAT)).resolve().name} {next(one for one in _FLAGS if one.startswith('-O'))}"


def _core_hash() -> str:
    """Of everything in the core that may be compiled or included, as it is now: 5 ms."""
    whole = hashlib.sha256()
    paths = sorted([*FIRMWARE.glob("include/**/*.h"), *FIRMWARE.glob("src/**/*.[ch]"), *REFINE_MODEL.glob("**/*.h")])
    for path in [*paths, *sorted(NATIVE.glob("*.[ch]"))]:
        whole.update(path.name.encode())
        whole.update(path.read_bytes())
    return whole.hexdigest()


def _build(
    compiler: str,
    texts: Mapping[str, str],
    definitions: list[str],
    library: Path,
    build: CoreBuild,
    headers: Sequence[str],
    core: str,
) -> None:
    """Whole or not at all: several processes may build the same."""
    with tempfile.TemporaryDirectory(dir=library.parent.parent) as made:
        # Its name is that of the headers in it, and the options have no other path of here: ccache finds the objects
        # of another mechanism, but for those of the second stage, whose shape is one of these (pvid/refine_shape.h).
        headers_here = sorted(name for name in texts if name.endswith(".h"))
        folder = Path(made) / hashlib.sha256("\0".join(headers_here).encode()).hexdigest()[:8]
        folder.mkdir()
        for name, text in texts.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        options = [f"-I{folder.name}", *core_options(definitions), f"-I{NATIVE}"]
        code = [folder / name for name in sorted(texts) if name.endswith(".c")]
        shared = _core_objects(compiler, definitions, build, core)
        if _REFINED in texts:
            shared = [one for one in shared if not of_second_stage(Path(one))]
            code += [one for one in core_of(build, True) if of_second_stage(one)]
        objects = [*shared, *objects_of(compiler, options, code, Path(made))]
        run_compiler([compiler, "-shared", *objects, "-o", str(folder / library.name), "-lm"])
        declared = _declarations(compiler, headers, options, Path(made), build)
        (folder / HEADERS).write_text(declared, encoding="utf-8")
        _refuse_changed(core)
        try:
            folder.rename(library.parent)
        except OSError:
            if not library.exists():
                raise


def _refuse_changed(core: str) -> None:
    """What is kept under a hash of sources that somebody edited meanwhile would be wrong for everybody who has them."""
    if _core_hash() != core:
        raise PvidError("the sources of the C core have changed while they were compiled: start again")


def _core_objects(compiler: str, definitions: list[str], build: CoreBuild, core: str) -> list[str]:
    """Of the core without the second stage: those of one size are the same for every mechanism."""
    sources = core_of(build, False)
    named = [str(one) for one in sources]
    key = hashlib.sha256("\0".join([build_of(compiler), *_FLAGS, *definitions, *named, core]).encode())
    place = _kept() / f"core-{build.name}-{key.hexdigest()[:20]}"
    with FileLock(place.with_name(f".{place.name}.lock")):
        if not place.exists():
            with tempfile.TemporaryDirectory(dir=_kept()) as made:
                folder = Path(made) / "objects"
                folder.mkdir()
                objects_of(compiler, core_options(definitions), sources, folder)
                _refuse_changed(core)
                folder.rename(place)
    return sorted(map(str, place.glob("*.o")))


def _declarations(compiler: str, headers: Sequence[str], options: list[str], folder: Path, build: CoreBuild) -> str:
    """The headers, preprocessed: cffi knows the types of the standard ones."""
    empty = folder / "no_standard_headers"
    empty.mkdir()
    for name in _STANDARD:
        (empty / f"{name}.h").write_text("", encoding="utf-8")
    replays = [*([] if build.replay is None else [build.replay]), *(["replay_refine"] if _REFINED in headers else [])]
    own = [*(f"{name}.h" for name in replays), *(name for name in headers if name != _REFINED)]
    top = folder / "native.h"
    top.write_text("".join(f'#include "{name}"\n' for name in own), encoding="utf-8")
    return run_compiler(
        [compiler, "-E", "-P", "-nostdinc", "-DPVID_LITTLE_ENDIAN_H", f"-I{empty}", *options, str(top)], folder=folder
    )
