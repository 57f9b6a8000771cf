"""Every port from the outside: memory, counter, stack, bytes both ways, faults, the exit code, square roots."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from processes import PATIENCE_S

from pvid.board.boards import BOARDS, BUILD, Board, Outcome, build, run
from pvid.core.sources import SRC

FAULT = 112
# A port needs nothing of the core. The build of all of it, without an FPU, shows that firmware/cmake/no_float.cmake
# finds no floating point in the fixed-point core.
WITH_THE_CORE = "microbit"

boards = pytest.mark.parametrize("board", BOARDS.values(), ids=lambda board: board.name)
with_guard = pytest.mark.parametrize(
    "board", [board for board in BOARDS.values() if board.toolchain != "avr"], ids=lambda board: board.name
)


def square_roots(number: int) -> str:
    """Cases {x, sqrt(x)} in bits: every exponent, subnormals, zeros, infinity, NaN, one ulp beside squares."""
    random = np.random.default_rng(5)
    x = random.integers(0, 0x7F800000, number, dtype=np.uint32)
    squares = (np.arange(1, 100, dtype=np.float32) ** 2).view(np.uint32)
    special = np.array([0, 0x80000000, 1, 2, 3, 0x7FFFFF, 0x800000, 0x7F7FFFFF, 0x7F800000, 0xBF800000], np.uint32)
    words = np.concatenate([special, squares, squares - 1, squares + 1, x])[:number].astype(np.uint32)
    with np.errstate(invalid="ignore"):
        roots = np.sqrt(words.view(np.float32))
    bits = np.where(np.isnan(roots), np.uint32(0x7FC00000), roots.view(np.uint32))
    return "".join(f"{{0x{a:08X}u, 0x{b:08X}u}},\n" for a, b in zip(words.tolist(), bits.tolist(), strict=True))


@cache
def image(board: Board) -> Path:
    # an AVR's constants stand in its RAM, and its library is avr-libc's, whose root of a negative number is its own
    tables = BUILD / "runs" / ("roots-short" if board.toolchain == "avr" else "roots")
    text = "{0x40800000u, 0x40000000u},\n" if board.toolchain == "avr" else square_roots(2000)
    place = tables / "square_roots.h"
    if not place.exists() or place.read_text(encoding="utf-8") != text:
        tables.mkdir(parents=True, exist_ok=True)
        place.write_text(text, encoding="utf-8")
    tree = BUILD / f"{board.name}-check"
    rooms = "|".join(sorted(room.name for room in SRC.iterdir() if room.is_dir()))
    needless = "" if board.name == WITH_THE_CORE else rf"/src/({rooms})/.*_|/models/"
    options = {"PORT_CHECK_TABLES": str(tables), "PVID_LEAVE_OUT": needless}
    build(board, tree, options, source=ROOT / "tests" / "ports")
    return tree / "port_check.elf"


def ask(board: Board, letters: bytes) -> Outcome:
    return run(board, image(board), PATIENCE_S, input_bytes=letters)


def numbers(outcome: Outcome) -> dict[str, int]:
    found = re.findall(r"^([a-z_0-9]+) ([0-9]+)$", outcome.text, re.MULTILINE)
    return {name: int(value) for name, value in found}


@pytest.mark.long
def test_the_fixed_point_core_has_no_floating_point_on_risc_v_either() -> None:
    """The build itself says so (firmware/cmake/no_float.cmake)."""
    board = BOARDS["virt-rv32imac"]
    image(board)
    tables = {"PORT_CHECK_TABLES": str(BUILD / "runs" / "roots"), "PVID_LEAVE_OUT": ""}
    build(board, BUILD / f"{board.name}-whole", tables, source=ROOT / "tests" / "ports")


@boards
def test_an_exit_code_gets_out(board: Board) -> None:
    assert [ask(board, b"x" + bytes([code])).exit_code for code in (0, 7)] == [0, 7]


@boards
def test_variables_start_with_their_values(board: Board) -> None:
    assert "initialised 12345678\ncleared 00000000\n" in ask(board, b"mx\0").text


@boards
def test_every_byte_comes_back_in_order(board: Board) -> None:
    random = np.random.default_rng(3)
    data = random.integers(1, 256, 5000, dtype=np.uint8).tobytes()
    outcome = ask(board, b"e" + data + b"\0x\0")
    assert outcome.sent == b"ready\n" + data + b"\0"


@boards
def test_the_counter_counts_instructions(board: Board) -> None:
    counted = numbers(ask(board, b"cx\0"))
    instructions = (counted["thousand"] - counted["nothing"]) * 1024 / counted["counts_per_1024"]
    assert instructions == pytest.approx(1000, abs=2)  # a count or two of rounding to SysTick's grid


@boards
def test_the_clock_goes_with_the_instructions(board: Board) -> None:
    ns_an_instruction = {"cortex-m": 256.0, "riscv": 1.0, "avr": 62.5}[board.toolchain]  # -icount; cycles of 16 MHz
    shortest = 50_000 * ns_an_instruction / 1000
    around = 0.3 if board.toolchain == "avr" else 0.1  # the loop and the call; divisions take an AVR 600 cycles
    assert shortest - 1 <= numbers(ask(board, b"tx\0"))["microseconds"] <= (1 + around) * shortest + 1


@boards
def test_a_deep_call_is_seen_in_the_paint(board: Board) -> None:
    found = numbers(ask(board, b"sx\0"))
    assert found["last"] == 255
    assert max(1024, found["before"]) < found["after"] <= found["before"] + 1024 + 64
    assert found["after"] < found["size"]


@boards
def test_square_roots_are_correctly_rounded(board: Board) -> None:
    found = numbers(ask(board, b"rx\0"))
    assert found["cases"] == (1 if board.toolchain == "avr" else 2000)
    assert found["wrong"] == 0


@with_guard
def test_a_stack_that_overflows_is_reported(board: Board) -> None:
    outcome = ask(board, b"o")
    assert outcome.exit_code == FAULT
    assert "pvid fault: stack overflow, " in outcome.text


@with_guard
def test_an_undefined_instruction_is_reported_with_its_place(board: Board) -> None:
    outcome = ask(board, b"u")
    assert outcome.exit_code == FAULT
    cause = {"riscv": "illegal instruction", "cortex-m": "undefined instruction|hard fault"}[board.toolchain]
    assert re.search(rf"pvid fault: ({cause}), .*pc 0x[0-9a-f]{{8}}", outcome.text), outcome.text


@with_guard
def test_an_access_to_no_memory_is_reported(board: Board) -> None:
    outcome = ask(board, b"b")
    assert outcome.exit_code == FAULT
    cause = {"riscv": "no memory to store", "cortex-m": "bus error|hard fault"}[board.toolchain]
    assert re.search(rf"pvid fault: ({cause}), ", outcome.text), outcome.text
