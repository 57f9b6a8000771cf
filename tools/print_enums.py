#!/usr/bin/env python3
"""Prints the enumerations of the public C headers as host/src/pvid/settings/enums.py; --check: only compares.

Run it with build/venv/bin/python after a change of the headers, when ./tools/pvid has built the C core.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "host" / "src"))
from pvid.core.headers import Headers, default_library  # noqa: E402

FILE = ROOT / "host" / "src" / "pvid" / "settings" / "enums.py"
ENUMS = {
    "Reason": ("pvid_reason", "Outcome of a tick"),
    "Status": ("pvid_status", "Answer of an init"),
    "Law": ("pvid_law", "How the estimate follows the data"),
    "SnapshotStatus": ("pvid_snapshot_status", "Answer of a snapshot's restore"),
}
HEAD = '''"""Enumerations of the public C headers. Printed by tools/print_enums.py: do not edit."""

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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    text = printed(Headers.of(default_library()))
    if not parser.parse_args().check:
        FILE.write_text(text, encoding="utf-8")
    elif FILE.read_text(encoding="utf-8") != text:
        sys.exit(f"{FILE.relative_to(ROOT)} differs from the headers: run tools/print_enums.py")


if __name__ == "__main__":
    main()
