"""Bytes of structs of the core as a board's compiler lays them out."""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.core.sources import INCLUDES


def state_table(
    header: str, parts: Sequence[tuple[str, str]], whole: str, rest: str, macros: Mapping[str, object]
) -> list[tuple[str, ...]]:
    """Rows of title and bytes on a Cortex-M, the rest and the whole at the end.

    Parameters
    ----------
    header : of the core
    parts : title and size in C of each
    whole : size in C
    rest : title of what is in no part
    macros : of pvid/config.h
    """
    expressions = [*(size for _, size in parts), whole]
    lines = [f"char size_{k}[{size}];" for k, size in enumerate(expressions)]
    prefix = BOARDS["mps2-an386"].tool_prefix
    with tempfile.TemporaryDirectory() as folder:
        source, made = Path(folder) / "a.c", Path(folder) / "a.o"
        source.write_text("\n".join([f'#include "{header}"', *lines, ""]), encoding="ascii")
        options = [f"-D{name}={value}" for name, value in macros.items()]
        command = [
            f"{prefix}gcc",
            "-mcpu=cortex-m4",
            "-mthumb",
            "-c",
            *options,
            *INCLUDES,
            str(source),
            "-o",
            str(made),
        ]
        if subprocess.run(command, check=False).returncode != 0:
            raise PvidError("the sizes of the state did not compile")
        listed = subprocess.run([f"{prefix}nm", "-S", str(made)], capture_output=True, text=True, check=True).stdout
    found = {int(k): int(size, 16) for size, k in re.findall(r"^\w+ (\w+) \w size_(\d+)$", listed, re.MULTILINE)}
    rows = [(title, str(found[k])) for k, (title, _) in enumerate(parts)]
    return [*rows, (rest, str(found[len(parts)] - sum(int(n) for _, n in rows))), ("**all**", str(found[len(parts)]))]
