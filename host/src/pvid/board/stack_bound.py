"""The deepest stack an image can need: frames and calls read off its machine code.

Frames of compiled functions come from the compiler (-fstack-usage), those of the compiler's own arithmetic from their
instructions. A call through a pointer may reach any function whose address is in a constant of the core.
"""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

from pvid.base.errors import PvidError

_FUNCTION = re.compile(r"^[0-9a-f]+ <(.+)>:$")
_INSTRUCTION = re.compile(r"^\s*[0-9a-f]+:\t[0-9a-f ]+\t(\S+)\s*(.*)$")
_TRANSFER = re.compile(
    r"^(b|bl|blx|bx|b[a-z]{2,3}(\.[nw])?|b\.[nw]|cbn?z|j|jr|jal|jalr|e?i?r?call|e?i?r?jmp|br[a-z]{2})$"
)
_TARGET = re.compile(r"<([^+>]+)(?:\+0x[0-9a-f]+)?>")
_RETURN = re.compile(r"^(lr|ra)$")
_POINTER_CALLS = {"blx", "bx", "jr", "jalr", "icall", "eicall", "ijmp", "eijmp"}

# Pushed by hand in the compiler's arithmetic.
_ARM_PUSH = re.compile(r"\{(.*)\}")


@dataclass
class _Function:
    callees: set[str] = field(default_factory=set)
    through_pointer: bool = False
    pushed: int = 0  # by the instructions


def _output(*command: str) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise PvidError(f"cannot run {command[0]}: {error.strerror}") from error
    if done.returncode != 0:
        raise PvidError(f"{command[0]} failed: {done.stderr.strip()[:200]}")
    return done.stdout


def _registers(text: str) -> int:
    """Registers in {r4-r7, lr} or {s16-s19}."""
    match = _ARM_PUSH.search(text)
    if match is None:
        return 0
    n = 0
    for part in match.group(1).split(","):
        low, _, high = part.strip().partition("-")
        n += int(high[1:]) - int(low[1:]) + 1 if high else 1
    return n


def _pushed(mnemonic: str, operands: str) -> int:
    """Bytes by which an instruction moves the stack pointer down."""
    if mnemonic in ("push", "push.w", "stmdb", "stmfd") and (mnemonic.startswith("push") or operands.startswith("sp!")):
        return 1 if "{" not in operands else 4 * _registers(operands)  # push r2 of an AVR: one byte
    if mnemonic == "vpush":
        return (8 if "{d" in operands else 4) * _registers(operands)
    if down := re.match(r"^sp, (?:sp, )?#(\d+)", operands):
        return int(down.group(1)) if mnemonic in ("sub", "sub.w", "subw") else 0
    if down := re.search(r", \[sp, #-(\d+)\]!", operands):
        return int(down.group(1))
    if down := re.match(r"^sp,sp,-(\d+)$", operands):
        return int(down.group(1)) if mnemonic == "addi" else 0
    return 0


def _functions(disassembly: str) -> dict[str, _Function]:
    functions: dict[str, _Function] = {}
    name, here = "", _Function()
    for line in disassembly.splitlines():
        if header := _FUNCTION.match(line):
            name = header.group(1)
            here = functions.setdefault(name, _Function())
            continue
        instruction = _INSTRUCTION.match(line)
        if instruction is None:
            continue
        mnemonic, operands = instruction.groups()
        here.pushed += _pushed(mnemonic, operands)
        if not _TRANSFER.match(mnemonic):
            continue
        target = _TARGET.search(operands)
        if target is None:
            here.through_pointer |= mnemonic in _POINTER_CALLS and not _RETURN.match(operands.strip())
        elif target.group(1) != name:
            here.callees.add(target.group(1))
    return functions


def _frames(tree: Path) -> dict[str, int]:
    """Frames by function [bytes]; of functions that share a name, the largest. A source that is gone has none."""
    frames: dict[str, int] = {}
    for path in tree.rglob("*.su"):
        for line in path.read_text(encoding="utf-8").splitlines():
            place, size, kind = line.split("\t")
            if place.startswith("/") and not Path(place.rsplit(":", 3)[0]).exists():
                continue
            if kind not in ("static", "dynamic,bounded"):  # the second: with what it pushes for its callees
                raise PvidError(f"{place}: a frame whose size is not known before it runs ({kind})")
            name = place.rsplit(":", 1)[1]
            frames[name] = max(frames.get(name, 0), int(size))
    return frames


def _pointed_to(relocations: str) -> set[str]:
    """Functions whose address stands in constant data."""
    names: set[str] = set()
    in_data = False
    for line in relocations.splitlines():
        if line.startswith("RELOCATION RECORDS FOR"):
            in_data = bool(re.search(r"\[\.(s?rodata|s?data)", line))
        elif in_data and (fields := line.split()) and len(fields) == 3:
            # An AVR names the section; elsewhere a section in data is a place inside a function: a switch's table.
            names.add(fields[2].removeprefix(".text.") if fields[1] == "R_AVR_16_PM" else fields[2])
    return names


def stack_bound(tool_prefix: str, image: Path, tree: Path, entry: str) -> int:
    """Bytes of stack that `entry` and all it can call need at most.

    Parameters
    ----------
    tool_prefix
        What stands before objdump.
    entry
        Where the stack is still empty.
    image, tree
        The linked image, and the build tree with the compiler's records (*.su) and libpvid.a.

    Raises
    ------
    PvidError
        When a frame's size is unknown or a function can call itself.
    """
    functions = _functions(_output(f"{tool_prefix}objdump", "-d", str(image)))
    pointed = _pointed_to(_output(f"{tool_prefix}objdump", "-r", str(tree / "libpvid.a"))) & functions.keys()
    frames = _frames(tree)
    is_avr = tool_prefix.startswith("avr")
    depth: dict[str, int] = {}

    def arithmetic(name: str, seen: set[str]) -> int:
        """Of the compiler's own functions, which jump into each other: each that can be reached, once."""
        if name in seen or name not in functions:
            return 0
        seen.add(name)
        own = functions[name].pushed + (3 if is_avr else 0)  # an AVR's call pushes the return address
        return own + sum(arithmetic(callee, seen) for callee in functions[name].callees)

    def deepest(name: str, callers: tuple[str, ...]) -> int:
        compiled = frames.get(name, frames.get(name.split(".")[0]))  # a part split off has a frame of its own
        if compiled is None:
            return arithmetic(name, set())
        if name in callers:
            raise PvidError(f"{name} can call itself: {' > '.join(callers[callers.index(name) :])}")
        if name not in depth:
            below = functions[name].callees & functions.keys()
            if functions[name].through_pointer:
                below = below | pointed
            depth[name] = compiled + max((deepest(callee, (*callers, name)) for callee in below), default=0)
        return depth[name]

    interrupts = max((deepest(name, ()) for name in functions if name.startswith("__vector_")), default=0)
    return deepest(entry, ()) + interrupts
