"""The files of the C core that the weak form of a mechanism needs, in one folder with one include path."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from pvid.base.errors import PvidError
from pvid.core.sources import FIRMWARE, SRC
from pvid.deploy.arithmetic import Arithmetic
from pvid.deploy.deployment import Deployment, Files

_ROOMS = ("number", "solve", "judge", "weak", "keep")
_INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)
_OWN_CONFIG = "#ifdef PVID_CONFIG_HEADER\n#include PVID_CONFIG_HEADER\n#endif\n"
SIZES = "pvid/rig_sizes.h"


@cache
def _files(arithmetic: Arithmetic) -> dict[str, Path]:
    """Name below the include path -> file: sources of the rooms that need no mechanism's own headers, and headers."""
    found: dict[str, Path] = {}
    for room in _ROOMS:
        for path in sorted((SRC / room).glob("*.c")):
            headers = None if path.stem.endswith(arithmetic.without) else _headers_of(path)
            if headers is not None:
                found |= {_name(one): one for one in (path, *headers)}
    return dict(sorted(found.items()))


def _headers_of(source: Path) -> set[Path] | None:
    """All headers that a source includes, directly or not; None: one of them is not of the weak form."""
    found: set[Path] = set()
    rest = [source]
    while rest:
        for name in includes_of(rest.pop().read_text(encoding="utf-8")):
            path = FIRMWARE / "include" / name if name.startswith("pvid/") else SRC / name
            if not path.is_file() or path.is_relative_to(SRC) and path.parent.name not in _ROOMS:
                return None
            if path not in found:
                found.add(path)
                rest.append(path)
    return found


def includes_of(text: str) -> list[str]:
    """Names of the library's own headers that a text includes."""
    return _INCLUDE.findall(text)


def _name(path: Path) -> str:
    return path.relative_to(SRC if path.is_relative_to(SRC) else FIRMWARE / "include").as_posix()


def core_files(deployment: Deployment) -> Files:
    """Name -> text; pvid/config.h takes the sizes of the rig from pvid/rig_sizes.h.

    Raises
    ------
    PvidError
        When pvid/config.h has no place for them.
    """
    files = {name: path.read_text(encoding="utf-8") for name, path in _files(deployment.arithmetic).items()}
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
