"""The most instructions that a call can take: the longest path through the machine code of an image.

Every path that the code has counts, run or not: all stages of a window, refusals, restarts. The longest path through a
function is a linear program over its basic blocks (implicit path enumeration), with what it calls added. How often a
loop runs follows from the design (numbers of parameters, channels, harmonics), not from samples, and is read off runs
in the emulator. A loop that no run enters makes as many passes as those that end at a limit of the same name in the
source, and where there is none, as the loop with the most passes. A call through a pointer leads where it led in runs,
or, if none made it, to each function whose address the code takes. Interrupts are not in it.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array

from pvid.base.errors import PvidError
from pvid.board.profile import Counts
from pvid.board.stack_bound import output_of, pointed_to

_FUNCTION = re.compile(r"^([0-9a-f]+) <(.+)>:$")
_LINE = re.compile(r"^\s*([0-9a-f]+):\t([0-9a-f ]+?)\s*\t(\S+)\s*(.*)$")
_CONDITION = "eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le"
_BRANCH = re.compile(rf"^b(?P<if>{_CONDITION})?(\.[nw])?$|^cbn?z$")
_CALL = re.compile(rf"^blx?(?P<if>{_CONDITION})?$")
_LEAVES = re.compile(rf"^(bx|pop|ldmia|ldr)(?P<if>{_CONDITION})?(\.w)?$")
_DATA = {".word": 4, ".short": 2, ".byte": 1}


_FOR = re.compile(r"\b(?:for|while) \((.*)\) \{$")
_LIMITS = (r"<=? \(?([\w.>-]+)", r"= ([\w.>-]+)[;(]", r"(\w+) >=? ")  # up to it, down from it, until it is used up


@dataclass
class _Block:
    """Instructions in a row, of which the last alone leads elsewhere."""

    places: list[int] = field(default_factory=list)
    next: set[int] = field(default_factory=set)  # where those of this function begin that may follow
    ends: bool = False  # it may leave the function
    calls: list[tuple[int, int | None]] = field(default_factory=list)  # from where, what; None: through a pointer


@dataclass
class _Loop:
    """Edges back to its first block, and whether it lies in no other loop."""

    back: set[tuple[int, int]]
    body: set[int]
    outermost: bool


_Blocks = dict[int, _Block]


@dataclass(frozen=True)
class TickBound:
    """Of a call.

    Attributes
    ----------
    bound : the most instructions
    longest : of the runs
    passes : of each loop by the place where it begins, in one call of its function
    assumed : passes, each time it is reached, of the loops that no run entered
    stack : bound of the whole image [bytes]; 0: not asked for
    """

    bound: int
    longest: int
    passes: Mapping[int, int]
    assumed: Mapping[int, int]
    stack: int = 0


def tick_bound(
    tool_prefix: str, image: Path, tree: Path, entry: str, run: Counts, limits: Mapping[str, int]
) -> TickBound:
    """Of the function `entry` and all that it calls, in an image for a Cortex-M with Thumb-2.

    Raises PvidError where the code has a transfer that is not understood.

    Parameters
    ----------
    tool_prefix : what stands before objdump
    image, tree : as of stack_bound
    run : of this image, counted in the emulator
    limits : of loops that no run enters, by their names in the source, where the design gives them
    """
    disassembly = output_of(f"{tool_prefix}objdump", "-d", str(image))
    functions = _functions(disassembly)
    names = {at: name for at, (name, _) in functions.items()}
    pointed = pointed_to(tool_prefix, image, tree, names)
    entered: dict[int, set[int]] = defaultdict(set)
    for at, to in run.enters:
        entered[at].add(to)
    loops = {at: _loops(at, blocks) for at, (_, blocks) in functions.items()}
    begin = next((at for at, name in names.items() if name == entry), None)
    if begin is None:
        raise PvidError(f"the image has no function {entry}")

    def called(place: int, what: int | None) -> set[int]:
        return {what} if what is not None else entered[place] or pointed

    reached, ahead = set[int](), [begin]
    while ahead:
        at = ahead.pop()
        if at in functions and at not in reached:
            reached.add(at)
            calls = [one for block in functions[at][1].values() for one in block.calls]
            ahead += [to for one in calls for to in called(*one)]
    most = dict(run.most)
    for at in reached:
        words = max(_words(disassembly, names[at], reached), default=0)
        most |= {head: max(most[head], words) for head in loops[at] if head in most}
    assumed = _assumed(f"{tool_prefix}addr2line", image, functions, loops, most, limits)
    bounds: dict[int, int] = {}
    under_way: set[int] = set()
    cut: set[int] = set()  # no function calls itself (tools/loops.py): a pointer would lead to another function

    def bound_of(at: int) -> int:
        if at in under_way:
            cut.add(at)
            return 0
        if at in bounds:
            return bounds[at]
        if at not in functions:
            raise PvidError(f"a call of {at:x}, where no function begins")
        under_way.add(at)
        blocks = functions[at][1]
        costs = {
            begin: len(block.places) + sum(max(map(bound_of, called(*one)), default=0) for one in block.calls)
            for begin, block in blocks.items()
        }
        longest = _longest_path(at, blocks, costs, loops[at], most, assumed)
        under_way.remove(at)
        cut.discard(at)
        if not cut:
            bounds[at] = longest
        return longest

    bound = bound_of(begin)
    heads = {head for at in bounds for head in loops[at]}
    return TickBound(
        bound,
        run.longest,
        {head: most[head] for head in heads if head in most},
        {head: assumed[head] for head in heads if head in assumed},
    )


def _longest_path(
    begin: int,
    blocks: _Blocks,
    costs: Mapping[int, int],
    loops: Mapping[int, _Loop],
    passes: Mapping[int, int],
    assumed: Mapping[int, int],
) -> int:
    """The largest sum of costs times executions, which are conserved from block to block. A loop's first block is
    executed `passes` times at most, or `assumed` times whenever the loop is reached."""
    edges: list[tuple[int | None, int | None]] = [(None, begin)]
    edges += [(at, to) for at, block in blocks.items() for to in block.next]
    edges += [(at, None) for at, block in blocks.items() if block.ends]
    row = {at: k for k, at in enumerate(blocks)}
    flow = [(row[to], k, 1.0) for k, (_, to) in enumerate(edges) if to is not None]
    flow += [(row[at], k, -1.0) for k, (at, _) in enumerate(edges) if at is not None]
    into = {
        head: [(k, edge in loop.back) for k, edge in enumerate(edges) if edge[1] == head]
        for head, loop in loops.items()
    }
    limits: list[float] = []
    capped: list[tuple[int, int, float]] = []
    for head, columns in into.items():
        each = passes.get(head, 0) or assumed[head]
        body = loops[head].body
        capped += [(len(limits), k, 1.0) for k, again in columns if again]
        capped += [
            (len(limits), k, float((to == head) - each))
            for k, (at, to) in enumerate(edges)
            if to in body and at not in body
        ]
        limits.append(0.0)
        if head in passes:
            capped += [(len(limits), k, 1.0) for k, _ in columns]
            limits.append(float(passes[head]))

    def matrix(entries: list[tuple[int, int, float]], rows: int) -> coo_array:
        at, column, value = zip(*entries, strict=True)
        return coo_array((value, (at, column)), shape=(rows, len(edges)))

    found = linprog(
        [0.0 if to is None else -costs[to] for _, to in edges],
        A_ub=matrix(capped, len(limits)) if loops else None,
        b_ub=limits if loops else None,
        A_eq=matrix(flow, len(blocks)),
        b_eq=np.zeros(len(blocks)),
        bounds=[(1.0, 1.0), *[(0.0, None)] * (len(edges) - 1)],
        method="highs",
    )
    if not found.success:
        raise PvidError(f"no longest path through the function at {begin:x}: {found.message}")
    return int(np.ceil(-found.fun - 1e-6))


def _words(disassembly: str, name: str, callers: set[int]) -> Iterator[int]:
    """How many words calls of memset or memcpy fill, where their size is a constant: a run may have made others. Of
    callers by their addresses: static functions of two files may have one name."""
    if name not in ("memset", "memcpy"):
        return
    function, size = 0, 0
    for line in disassembly.splitlines():
        if header := _FUNCTION.match(line):
            function, size = int(header[1], 16), 0
        elif constant := re.search(r"\tmov(?:s|w|\.w)\s+r2, #(\d+)", line):
            size = int(constant[1])
        elif function in callers and line.endswith(f" <{name}>"):
            yield (size + 3) // 4


# ---- loops ----


def _loops(begin: int, blocks: _Blocks) -> dict[int, _Loop]:
    """By their first blocks: what a search by depth finds again while it is under way."""
    back: dict[int, set[tuple[int, int]]] = defaultdict(set)
    done: dict[int, bool] = {begin: False}
    path = [(begin, iter(sorted(blocks[begin].next)))]
    while path:
        at, ahead = path[-1]
        to = next(ahead, None)
        if to is None:
            done[at] = True
            path.pop()
        elif to not in done:
            done[to] = False
            path.append((to, iter(sorted(blocks[to].next))))
        elif not done[to]:
            back[to].add((at, to))
    before: dict[int, set[int]] = defaultdict(set)
    for at, block in blocks.items():
        for to in block.next:
            before[to].add(at)
    bodies = {head: _body(head, {at for at, _ in edges}, before) for head, edges in back.items()}
    return {
        head: _Loop(edges, bodies[head], not any(head in body for other, body in bodies.items() if other != head))
        for head, edges in back.items()
    }


def _body(head: int, ends: set[int], before: Mapping[int, set[int]]) -> set[int]:
    """The blocks from which a loop's ends are reached without its first block, and that."""
    found, ahead = {head}, list(ends)
    while ahead:
        at = ahead.pop()
        if at not in found:
            found.add(at)
            ahead += before.get(at, ())
    return found


def _assumed(
    addr2line: str,
    image: Path,
    functions: Mapping[int, tuple[str, _Blocks]],
    loops: Mapping[int, Mapping[int, _Loop]],
    passes: Mapping[int, int],
    given: Mapping[str, int],
) -> dict[int, int]:
    """Passes of the loops that no run entered."""
    tails = {
        (head, at): [*functions[begin][1][head].places, *functions[begin][1][at].places]
        for begin, of_function in loops.items()
        for head, loop in of_function.items()
        for at, _ in loop.back
    }
    places = sorted({place for tail in tails.values() for place in tail})
    lines = dict(zip(places, output_of(addr2line, "-e", str(image), *map(hex, places)).splitlines(), strict=True))
    names: dict[int, list[str]] = defaultdict(list)
    for (head, _), tail in tails.items():
        found = (list(_limits(lines[place].split(" (")[0])) for place in reversed(tail))
        names[head] += next(filter(None, found), [])
    outermost = {head: loop.outermost for of_function in loops.values() for head, loop in of_function.items()}
    most: dict[str, int] = defaultdict(int, given)
    for head in outermost:
        if outermost[head] and head in passes:
            for limit in ("", *names[head]):
                most[limit] = max(most[limit], passes[head])
    return {
        head: next((most[one] for one in names[head] if most[one]), most[""])
        for head in outermost
        if head not in passes
    }


def _limits(line: str) -> Iterator[str]:
    """What a loop of this line of the source (FILE:NUMBER) ends at, the most definite first."""
    file, _, number = line.rpartition(":")
    text = _source(file)[int(number) - 1] if number.isdecimal() and _source(file) else ""
    if loop := _FOR.search(text):
        yield line
        below = next(filter(None, (re.search(one, loop[1]) for one in _LIMITS)), None)
        if below:
            name = re.split(r"->|\.", below[1])[-1].removeprefix("n_")
            yield f"{file}:{name}"
            yield name


@cache
def _source(file: str) -> list[str]:
    path = Path(file)
    return path.read_text(encoding="utf-8").splitlines() if path.is_file() else []


# ---- machine code ----


def _functions(disassembly: str) -> dict[int, tuple[str, _Blocks]]:
    """Name and basic blocks by the address where a function begins."""
    found: dict[int, tuple[str, _Blocks]] = {}
    for part in re.split(r"\n\n(?=[0-9a-f]+ <)", disassembly):
        lines = part.splitlines()
        start = next((k for k, line in enumerate(lines) if _FUNCTION.match(line)), None)
        if start is not None and (header := _FUNCTION.match(lines[start])):
            begin = int(header[1], 16)
            found[begin] = header[2], _blocks(begin, lines[start + 1 :])
    # constants beside the code have no blocks
    return {begin: (name, _reachable(begin, blocks)) for begin, (name, blocks) in found.items() if blocks}


def _table(base: int, data: dict[int, int], width: int) -> set[int]:
    """Where the branches of a tbb (width 1) or tbh (2) lead, whose offsets stand from `base` on."""
    found, at = set(), base
    while all(at + k in data for k in range(width)):
        found.add(base + 2 * sum(data[at + k] << (8 * k) for k in range(width)))
        at += width
    return found


def _blocks(begin: int, lines: list[str]) -> _Blocks:
    code: dict[int, tuple[int, str, str]] = {}  # size in bytes, mnemonic, operands
    data: dict[int, int] = {}
    for line in lines:
        if (match := _LINE.match(line)) is None:
            continue
        at, raw, mnemonic, operands = int(match[1], 16), match[2].replace(" ", ""), match[3], match[4]
        if mnemonic in _DATA:
            value = int(raw, 16)
            data |= {at + k: value >> 8 * k & 255 for k in range(_DATA[mnemonic])}
        else:
            code[at] = len(raw) // 2, mnemonic, operands.split("@")[0].strip()
    leads = {at: _leads(at, *one, data, code) for at, one in code.items()}
    starts = {begin} | {to for targets, _, _, _ in leads.values() for to in targets}
    blocks: _Blocks = {}
    here = begin
    ended, end = False, begin
    for at, (size, _, _) in code.items():
        targets, ends, call, falls = leads[at]
        if at in starts or ended:
            if not ended and at != begin:
                blocks[here].next.add(at)
            here = at
            blocks.setdefault(here, _Block())
        block = blocks[here]
        block.places.append(at)
        if call is not None:
            block.calls.append((at, call[0]))
        ended = bool(targets) or ends or not falls
        if ended:
            block.next |= targets | ({at + size} if falls and at + size in code else set())
            block.ends |= ends
        end = at + size
    if code and not ended:  # into what stands behind it
        blocks[here].ends = True
        blocks[here].calls.append((end, end))
    return blocks


def _reachable(begin: int, blocks: _Blocks) -> _Blocks:
    """Without what fills the place behind a function."""
    found, ahead = set[int](), [begin]
    while ahead:
        at = ahead.pop()
        if at not in found:
            found.add(at)
            ahead += blocks[at].next
    return {at: block for at, block in blocks.items() if at in found}


def _leads(
    at: int, size: int, mnemonic: str, operands: str, data: dict[int, int], code: dict[int, tuple[int, str, str]]
) -> tuple[set[int], bool, tuple[int | None] | None, bool]:
    """Of an instruction: where in the function it may lead besides the next one, whether it may leave, what it calls
    on the way (None: through a pointer), and whether the next one may follow."""
    if mnemonic in ("tbb", "tbh"):
        table = {to for to in _table(at + size, data, 1 if mnemonic == "tbb" else 2) if to in code}
        if not table:
            raise PvidError(f"a switch without a table at {at:x}: {mnemonic} {operands}")
        return table, False, None, False
    to = re.search(r"\b([0-9a-f]+) <", operands)
    target = int(to[1], 16) if to else None
    if match := _BRANCH.match(mnemonic):
        falls = bool(match["if"]) or mnemonic.startswith("cb")
        if target is None:
            raise PvidError(f"a branch without a target at {at:x}: {mnemonic} {operands}")
        return ({target}, False, None, falls) if target in code else (set(), True, (target,), falls)
    if _CALL.match(mnemonic):
        return set(), False, (target,), True
    if (match := _LEAVES.match(mnemonic)) and (
        mnemonic.startswith("bx")
        or re.search(r"\bpc\b", operands.partition(",")[0] if mnemonic.startswith("ldr") else operands)
    ):
        if mnemonic.startswith("ldr") and "[sp" not in operands:
            raise PvidError(f"a transfer that is not understood at {at:x}: {mnemonic} {operands}")
        pointer = mnemonic.startswith("bx") and operands != "lr"
        return set(), True, (None,) if pointer else None, bool(match["if"])
    if re.match(r"^(mov|add|sub)\w*(\.w)?$", mnemonic) and operands.startswith("pc,"):
        raise PvidError(f"a transfer that is not understood at {at:x}: {mnemonic} {operands}")
    return set(), False, None, True
