"""How much RAM the identifier of a deployment takes."""

from __future__ import annotations

import re
import subprocess
import tempfile
from functools import cache
from pathlib import Path

from pvid.base.errors import PvidError
from pvid.core.host_compiler import host_compiler
from pvid.deploy.core_files import core_files
from pvid.deploy.deployment import Deployment

_UNO, _MEGA = 2048, 8192
_REST = 1024  # for the stack and Arduino itself


@cache
def _bytes(d: Deployment, header: str, state: str) -> int | None:
    """Size of a state [bytes] on this computer, whose pointers are longer than those of a microcontroller; None
    where there is no compiler."""
    program = f'#include "{header}"\nchar pvid_state[sizeof({state})];\n'
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for name, text in (core_files(d) | dict(d.generated)).items():
            if name.endswith(".h"):
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_text(text, encoding="utf-8")
        (folder / "size.c").write_text(program, encoding="utf-8")
        try:
            command = [host_compiler("the size of the identifier"), "-std=c99", "-I.", "-S", "-o", "-", "size.c"]
        except PvidError:
            return None
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    found = re.search(r"\.(?:comm\s+_?pvid_state\s*,|size\s+pvid_state\s*,)\s*(\d+)", done.stdout)
    return None if done.returncode or found is None else int(found[1])


def state_bytes(d: Deployment) -> int | None:
    """Size of the identifier [bytes], as `_bytes`."""
    return _bytes(d, d.arithmetic.header, f"pvid_weak_{d.core}")


def note(d: Deployment) -> str:
    """One sentence on RAM."""
    size = state_bytes(d)
    if size is None:
        return ""
    second = None if d.second is None else _bytes(d, "pvid/refine.h", "pvid_refine_f32")
    more = "" if second is None else f", the second stage {second} more"
    return f"The identifier takes about {size} bytes of RAM{more}."


def avr_note(d: Deployment) -> str:
    """What an AVR needs to know."""
    where = "On an AVR the tables are in RAM as well: take `--core q31`, whose tables stay in flash."
    if d.arithmetic.is_integer:
        where = "On an AVR the tables stay in flash."
    size = state_bytes(d)
    if size is None:
        return where
    if size + _REST <= _UNO:
        return f"{where} An Uno's {_UNO} bytes of RAM hold the identifier's {size}."
    if size + _REST <= _MEGA:
        return f"{where} An Uno has {_UNO} bytes of RAM, too few for the identifier's {size}; a Mega has {_MEGA}."
    return f"{where} Neither an Uno ({_UNO} bytes of RAM) nor a Mega ({_MEGA}) holds the identifier's {size} bytes."
