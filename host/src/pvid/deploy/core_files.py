"""The files of the C core that the weak form of a mechanism needs, in one folder with one include path."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

from pvid.base.errors import PvidError
from pvid.core.sources import FIRMWARE, SRC
from pvid.deploy.arithmetic import Arithmetic
from pvid.deploy.deployment import Deployment, Files

_ROOMS = ("number", "solve", "judge", "weak", "persist")
_REFINED, _EXCITE = "refine", "excite"  # rooms that some deployments have
_OF_MODEL = ("pvid/refine_shape.h", "refine_model_f32.h")  # which come with the mechanism
_INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)
_OWN_CONFIG = "#ifdef PVID_CONFIG_HEADER\n#include PVID_CONFIG_HEADER\n#endif\n"
SIZES = "pvid/rig_sizes.h"


@cache
def _files(arithmetic: Arithmetic, refined: bool, excited: bool) -> dict[str, Path]:
    """Name below the include path -> file: sources of the rooms whose headers the deployment has, and these headers."""
    found: dict[str, Path] = {}
    rooms, given = ((*_ROOMS, _REFINED), _OF_MODEL) if refined else (_ROOMS, ())
    rooms = (*rooms, _EXCITE) if excited else rooms
    for room in rooms:
        for path in sorted((SRC / room).glob("*.c")):
            headers = None if path.stem.endswith(arithmetic.without) else _headers_of(path, rooms, given)
            if headers is not None:
                found |= {_name(one): one for one in (path, *headers)}
    return dict(sorted(found.items()))


def _headers_of(source: Path, rooms: tuple[str, ...], given: tuple[str, ...]) -> set[Path] | None:
    """All headers of the core that a source includes, directly or not; None: one of them is of no room."""
    found: set[Path] = set()
    rest = [source]
    while rest:
        for name in includes_of(rest.pop().read_text(encoding="utf-8")):
            if name in given:
                continue
            path = _path(name)
            if not path.is_file() or path.is_relative_to(SRC) and path.parent.name not in rooms:
                return None
            if path not in found:
                found.add(path)
                rest.append(path)
    return found


def _included(texts: Iterable[str], known: Mapping[str, Path]) -> dict[str, Path]:
    """Headers of the core that generated files include beside the known ones."""
    rooms = (*_ROOMS, _REFINED, _EXCITE)
    paths = [_path(name) for text in texts for name in includes_of(text) if name not in known]
    headers = [{path} | (_headers_of(path, rooms, _OF_MODEL) or set()) for path in paths if path.is_file()]
    return {_name(path): path for group in headers for path in sorted(group)}


def _path(name: str) -> Path:
    return FIRMWARE / "include" / name if name.startswith("pvid/") else SRC / name


def includes_of(text: str) -> list[str]:
    """Names of the library's own headers that a text includes."""
    return _INCLUDE.findall(text)


def _name(path: Path) -> str:
    return path.relative_to(SRC if path.is_relative_to(SRC) else FIRMWARE / "include").as_posix()


def core_files(deployment: Deployment) -> Files:
    """Name -> text; pvid/config.h takes the sizes of the rig from pvid/rig_sizes.h.

    Raises PvidError when pvid/config.h has no place for them.
    """
    found = _files(deployment.arithmetic, deployment.second is not None, deployment.excitation is not None)
    found |= _included(deployment.generated.values(), found)
    files = {name: path.read_text(encoding="utf-8") for name, path in found.items()}
    config = files["pvid/config.h"]
    if _OWN_CONFIG not in config:
        raise PvidError("pvid/config.h does not include PVID_CONFIG_HEADER: a rig's sizes have no place in it")
    files["pvid/config.h"] = config.replace(_OWN_CONFIG, f'#include "{SIZES}"\n')
    files[SIZES] = _sizes(deployment)
    return files


def _sizes(deployment: Deployment) -> str:
    tables = []
    if deployment.arithmetic.is_integer:
        tables = [
            "",
            "/* Tables stay in the flash of an AVR; C++ has no word for it, and includes no table. */",
            "#if defined(__AVR__) && !defined(__cplusplus) && !defined(__STRICT_ANSI__)",
            "#define PVID_TABLE __flash",
            "#endif",
        ]
    return "\n".join(
        [
            f"/* {deployment.banner}",
            " * The smallest sizes of the core that hold the design of the rig. */",
            "#ifndef PVID_RIG_SIZES_H",
            "#define PVID_RIG_SIZES_H",
            "",
            *(f"#define {macro} {size}" for macro, size in sorted(deployment.sizes.items())),
            *tables,
            "",
            "#endif",
            "",
        ]
    )
