"""The deepest stack an image can need: frames and calls read off its machine code.

Frames of compiled functions come from the compiler (-fstack-usage), those of the compiler's own arithmetic from their
instructions. A call through a pointer may reach any function whose address is in a constant of the core or the model.
"""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

from pvid.base.errors import PvidError

_FUNCTION = re.compile(r"^([0-9a-f]+) <(.+)>:$")
_INSTRUCTION = re.compile(r"^\s*[0-9a-f]+:\t[0-9a-f ]+\t(\S+)\s*(.*)$")
_TRANSFER = re.compile(
    r"^(b|bl|blx|bx|b[a-z]{2,3}(\.[nw])?|b\.[nw]|cbn?z|j|jr|jal|jalr|e?i?r?call|e?i?r?jmp|br[a-z]{2})$"
)
_TARGET = re.compile(r"\b(?:0x)?([0-9a-f]+) <[^+>]+(?:\+0x([0-9a-f]+))?>")
_CLONE = re.compile(r"\.\d+")  # in a symbol, not in the compiler's record: work.constprop.0
_RETURN = re.compile(r"^(lr|ra)$")
_POINTER_CALLS = {"blx", "bx", "jr", "jalr", "icall", "eicall", "ijmp", "eijmp"}

# Pushed by hand in the compiler's arithmetic.
_ARM_PUSH = re.compile(r"\{(.*)\}")


@dataclass
class _Function:
    name: str  # static functions of several files may share it
    callees: set[int] = field(default_factory=set)  # where they begin
    through_pointer: bool = False
    pushed: int = 0  # by the instructions
    stored: int = 0  # a Cortex-M0: arguments of registers, in front of the frame that the compiler counts


def output_of(*command: str) -> str:
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
    if down := re.match(r"^sp,sp,-(\d+)\b", operands):  # an alias of addi for some binutils; a comment may follow
        return int(down.group(1)) if mnemonic in ("add", "addi") else 0
    return 0


def _functions(disassembly: str) -> dict[int, _Function]:
    """By the address where they begin."""
    functions: dict[int, _Function] = {}
    at, here = 0, _Function("")
    popped, freed = "", 0  # a Cortex-M0 that has stored arguments returns by pop {r3}, add sp, #8, bx r3
    for line in disassembly.splitlines():
        if header := _FUNCTION.match(line):
            at = int(header.group(1), 16)
            here = functions.setdefault(at, _Function(header.group(2)))
            continue
        instruction = _INSTRUCTION.match(line)
        if instruction is None:
            continue
        mnemonic, operands = instruction.groups()
        here.pushed += _pushed(mnemonic, operands)
        if mnemonic == "bx" and operands.strip() == popped:
            here.stored = freed
            continue
        if popped and mnemonic == "add" and (up := re.match(r"^sp, #(\d+)", operands)):
            freed = int(up.group(1))
        else:
            popped = operands.strip("{} ") if mnemonic == "pop" else ""
        if not _TRANSFER.match(mnemonic):
            continue
        target = _TARGET.search(operands)
        if target is None:
            here.through_pointer |= mnemonic in _POINTER_CALLS and not _RETURN.match(operands.strip())
        elif (begin := int(target.group(1), 16) - int(target.group(2) or "0", 16)) != at:
            here.callees.add(begin)
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


def _pointed_to(relocations: str) -> set[tuple[str, str]]:
    """(object file, name) of the functions whose address stands in constant data."""
    found: set[tuple[str, str]] = set()
    file, in_data = "", False
    for line in relocations.splitlines():
        if ":     file format" in line:
            file = line.partition(":")[0].rpartition("/")[2]
        elif line.startswith("RELOCATION RECORDS FOR"):
            in_data = bool(re.search(r"\[\.(s?rodata|s?data)", line))
        elif in_data and (fields := line.split()) and len(fields) == 3:
            # An AVR names the section; elsewhere a section in data is a place inside a function: a switch's table.
            found.add((file, fields[2].removeprefix(".text.") if fields[1] == "R_AVR_16_PM" else fields[2]))
    return found


def _placed(map_text: str) -> dict[tuple[str, str], int]:
    """Where a function of an object file begins, by the linker's map: one section each."""
    entry = re.compile(r"^ \.text\.(\S+)\s+0x([0-9a-f]+)\s+0x[0-9a-f]+\s+\S*?([^/(\s]+)\)?$", re.MULTILINE)
    kept = map_text.partition("Linker script and memory map")[2]
    return {(file, name): int(at, 16) for name, at, file in entry.findall(kept)}


def _addresses(pointed: set[tuple[str, str]], placed: dict[tuple[str, str], int], names: dict[int, str]) -> set[int]:
    """Of functions that calls through a pointer may reach; of a name that its own file does not have, all."""
    found = {placed[one] for one in pointed if one in placed}
    elsewhere = {name for file, name in pointed if (file, name) not in placed}
    return (found | {at for at, name in names.items() if name in elsewhere}) & names.keys()


def pointed_to(tool_prefix: str, image: Path, tree: Path, names: dict[int, str]) -> set[int]:
    """Where functions of these `names` begin that calls through a pointer may reach; image, tree as of stack_bound."""
    compiled_in = [tree / "libpvid.a", *sorted((tree / "apps").rglob("*.o*"))]  # a model is beside the image's own
    relocations = output_of(f"{tool_prefix}objdump", "-r", *map(str, compiled_in))
    return _addresses(_pointed_to(relocations), _placed(image.with_suffix(".map").read_text(encoding="utf-8")), names)


def stack_bound(tool_prefix: str, image: Path, tree: Path, entry: str) -> int:
    """Bytes of stack that `entry` and all it can call need at most.

    Raises PvidError when a frame's size is unknown or a function can call itself.

    Parameters
    ----------
    tool_prefix : what stands before objdump
    entry : where the stack is still empty
    image, tree : the linked image, with its map beside it, and the build tree with the compiler's records (*.su),
        libpvid.a and the image's objects
    """
    functions = _functions(output_of(f"{tool_prefix}objdump", "-d", str(image)))
    pointed = pointed_to(tool_prefix, image, tree, {at: one.name for at, one in functions.items()})
    frames = _frames(tree)
    is_avr = tool_prefix.startswith("avr")
    depth: dict[int, int] = {}

    def arithmetic(at: int, seen: set[int]) -> int:
        """Of the compiler's own functions, which jump into each other: each that can be reached, once."""
        if at in seen or at not in functions:
            return 0
        seen.add(at)
        own = functions[at].pushed + (3 if is_avr else 0)  # an AVR's call pushes the return address
        return own + sum(arithmetic(callee, seen) for callee in functions[at].callees)

    def deepest(at: int, callers: tuple[int, ...]) -> int:
        name = functions[at].name
        part = _CLONE.sub("", name)  # a part split off, or a copy, has a frame of its own
        compiled = frames.get(name, frames.get(part, frames.get(name.split(".")[0])))
        if compiled is None:
            return arithmetic(at, set())
        if at in callers:
            path = [functions[one].name for one in (*callers[callers.index(at) :], at)]
            raise PvidError(f"{name} can call itself: {' > '.join(path)}")
        if at not in depth:
            below = functions[at].callees & functions.keys()
            if functions[at].through_pointer:
                below = below | pointed
            own = compiled + functions[at].stored
            depth[at] = own + max((deepest(callee, (*callers, at)) for callee in below), default=0)
        return depth[at]

    def deepest_of(wanted: str) -> int:
        return max((deepest(at, ()) for at, one in functions.items() if one.name.startswith(wanted)), default=0)

    return deepest_of(entry) + deepest_of("__vector_")
