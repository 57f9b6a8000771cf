"""Objects of JSON in a file, a line each: what a long work has done so far, kept if it is interrupted."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pvid.base.errors import PvidError


def read_json_lines(path: Path) -> list[dict[str, Any]]:
    """The objects; none where there is no file. A line that was cut off while it was written is none."""
    if not path.exists():
        return []
    found = []
    for line in path.read_bytes().split(b"\n")[:-1]:
        try:
            one = json.loads(line)
        except ValueError:
            continue
        if isinstance(one, dict):
            found.append(one)
    return found


def append_json_line(path: Path, one: Mapping[str, Any]) -> None:
    """Appends an object, behind what an interruption has left of a line. Raises PvidError when it cannot be written."""
    try:
        with path.open("ab") as file:
            if file.tell() > 0 and not _ends_a_line(path):
                file.write(b"\n")
            file.write(json.dumps(one).encode() + b"\n")
    except OSError as error:
        raise PvidError(f"{path}: cannot be written: {error.strerror}") from error


def _ends_a_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, 2)
        return file.read(1) == b"\n"
