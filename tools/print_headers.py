#!/usr/bin/env python3
"""Prints what the host has from the public C headers: the enumerations as host/src/pvid/settings/enums.py, the settings
of the estimator and of what judges it as host/src/pvid/settings/parts.py; the texts of firmware/src/judge/text.c; and
the version. --check: only compares.

Run it with build/venv/bin/python after a change of the headers, when ./tools/pvid has built the C core.
"""

import argparse
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "host" / "src"))
from pvid.core.headers import Headers  # noqa: E402
from pvid.core.native import Native  # noqa: E402

FILE = ROOT / "host" / "src" / "pvid" / "settings" / "enums.py"
TEXTS = ROOT / "firmware" / "src" / "judge" / "text.c"
PARTS = FILE.with_name("parts.py")
VERSION = ROOT / "firmware" / "include" / "pvid" / "version.h"
MODULE = ROOT / "host" / "src" / "pvid" / "base" / "version.py"
CITATION = ROOT / ".github" / "CITATION.cff"
STATUS = ROOT / "firmware" / "include" / "pvid" / "status.h"
ENUMS = {
    "Reason": ("pvid_reason", "Outcome of a tick"),
    "Status": ("pvid_status", "Analysis of an init"),
    "Stage": ("pvid_stage", "Whose estimate is published"),
    "Standing": ("pvid_standing_state", "Whether a published estimate still holds"),
    "Doubt": ("pvid_doubt", "Why it is doubted or withdrawn, one bit each"),
    "Law": ("pvid_law", "How the estimate follows the data"),
    "RecordStatus": ("pvid_record_status", "Analysis of a record's save or load"),
    "SnapshotStatus": ("pvid_snapshot_status", "Analysis of a snapshot's restore"),
}
# Settings: class, its struct without the core, its header, and the fields that every user gives.
STRUCTS = (
    ("EstimatorConfig", "pvid_estimator_config", "estimator", ("row_sd", "y_bits")),
    ("TrustConfig", "pvid_trust_config", "trust", ()),
    ("GateConfig", "pvid_gate_config", "gate", ()),
)
SET_BY_INIT = ("model", "update_rate_hz")
PARTS_HEAD = '''"""Settings of the estimator and of what judges it, in float32 and fixed point.

Arrays have one entry a free parameter. Printed by tools/print_headers.py: do not edit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Law
'''

HEAD = '''"""Enumerations of the public C headers. Printed by tools/print_headers.py: do not edit."""

from __future__ import annotations

from enum import IntEnum
from typing import Literal

Form = Literal["weak", "strong"]
Core = Literal["f32", "q31"]


class _Named(IntEnum):
    @property
    def text(self) -> str:
        """The name in words."""
        return self.name.lower().replace("_", " ")
'''


TEXT_HEAD = """\
/* pvid/text.h. Printed by tools/print_headers.py from pvid/status.h: do not edit. */
#include "pvid/text.h"

#include <stddef.h>

#if PVID_TEXTS

/* clang-format off */
static const char *const reasons[] = {
@reasons@
};

static const char *const statuses[] = {
@statuses@
};
/* clang-format on */

const char *pvid_reason_text(pvid_reason reason)
{
    const size_t place = (size_t)reason;
    return (place < (sizeof reasons / sizeof reasons[0])) ? reasons[place] : "unknown reason";
}

const char *pvid_status_text(pvid_status status)
{
    const size_t place = (size_t)status;
    return (place < (sizeof statuses / sizeof statuses[0])) ? statuses[place] : "unknown status";
}

#else

const char *pvid_reason_text(pvid_reason reason)
{
    (void)reason;
    return "";
}

const char *pvid_status_text(pvid_status status)
{
    (void)status;
    return "";
}

#endif
"""


def comments(text: str) -> dict[str, str]:
    """Enumerator -> its comment in status.h, on one line; it stands behind the enumerator's comma."""
    found = re.findall(r"^    (PVID_\w+)(?: = 0)?,?\s*/\*\s*(.*?)\s*\*/", text, re.MULTILINE | re.DOTALL)
    return {name: re.sub(r"\s*\n\s*", " ", comment) for name, comment in found}


def texts(headers: Headers) -> str:
    """The C source with the texts: the words of a name, of a status with the comment of the header."""
    about = comments(STATUS.read_text(encoding="utf-8"))
    lines = {}
    for place, c_name in (("reasons", "pvid_reason"), ("statuses", "pvid_status")):
        members = headers.enum(c_name)
        if list(members.values()) != list(range(len(members))):
            sys.exit(f"{c_name} has gaps: its texts are in a table")
        words = {name: name.removeprefix("PVID_").lower().replace("_", " ") for name in members}
        if c_name == "pvid_status":
            words |= {name: f"{words[name]}: {about[name]}" for name in members if name in about}
        lines[place] = "\n".join(f'    "{words[name]}",' for name in members)
    return TEXT_HEAD.replace("@reasons@", lines["reasons"]).replace("@statuses@", lines["statuses"])


def printed(headers: Headers) -> str:
    """The text of the module."""
    classes = [HEAD]
    for name, (c_name, sentence) in ENUMS.items():
        members = headers.enum(c_name)
        # enumerators share a prefix of whole words: PVID_, PVID_LAW_, PVID_SNAPSHOT_
        words = [one.split("_") for one in members]
        shared = next(i for i, column in enumerate(zip(*words, strict=False)) if len(set(column)) > 1)
        lines = [f"    {'_'.join(one.split('_')[shared:])} = {value}" for one, value in members.items()]
        classes.append("\n".join(["", f"class {name}(_Named):", f'    """{sentence} ({c_name})."""', "", *lines, ""]))
    return "\n".join(classes)


def field_of(kind: Any, default: Any, required: bool) -> str:
    """Type and default of a field in Python."""
    floating = "float" in kind.cname
    if kind.kind in ("array", "pointer"):
        table = "npt.NDArray[np.float32]" if floating else "tuple[int, ...]"
        return table if kind.kind == "array" else f"{table} | None = None"
    if kind.kind == "enum":
        return f"Law = Law({int(default)})" if isinstance(default, int) else "Law = Law.STATIONARY"
    if required:
        return "float" if floating else "int"
    return f"float = {float(str(np.float32(default)))!r}" if floating else f"int = {int(default)}"


def parts(native: Native) -> str:
    """The text of the module with the settings: the structs' fields in C's order, with C's defaults."""
    ffi, classes = native.headers.ffi, [PARTS_HEAD]
    for core in ("f32", "q31"):
        for name, struct, header, required in STRUCTS:
            constant = f"{struct.replace('_config', '_defaults')}_{core}"
            defaults = getattr(native.library, constant, None) or ffi.new(f"{struct}_{core} *")[0]
            place = f"{header}.h" if core == "f32" else f"{header}_q31.h"
            lines = [
                f"    {field}: {field_of(ctype.type, getattr(defaults, field), field in required)}"
                for field, ctype in ffi.typeof(f"{struct}_{core}").fields
                if field not in SET_BY_INIT
            ]
            own = name if core == "f32" else f"{name}Q31"
            classes.append(
                "\n".join(["", "@dataclass(frozen=True)", f"class {own}:", f'    """As in {place}."""', "", *lines, ""])
            )
    return "\n".join(classes)


def version() -> str:
    """That of version.h."""
    return ".".join(re.findall(r"#define PVID_VERSION_\w+ (\d+)", VERSION.read_text(encoding="utf-8")))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    native = Native()
    headers = native.headers
    only_check = parser.parse_args().check
    module = f'"""The version, printed by tools/print_headers.py from version.h."""\n\n__version__ = "{version()}"\n'
    citation = re.sub(r"(?m)^version: .*$", f"version: {version()}", CITATION.read_text(encoding="utf-8"))
    made = {FILE: printed(headers), PARTS: parts(native), TEXTS: texts(headers)}
    for file, text in (made | {MODULE: module, CITATION: citation}).items():
        if not only_check:
            file.write_text(text, encoding="utf-8")
        elif file.read_text(encoding="utf-8") != text:
            sys.exit(f"{file.relative_to(ROOT)} differs from the headers: run tools/print_headers.py")


if __name__ == "__main__":
    main()
