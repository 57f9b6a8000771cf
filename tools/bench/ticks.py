"""The longest tick of the weak form of mechanisms on a Cortex-M4F: searched, and bounded by the code."""

from __future__ import annotations

from collections.abc import Iterator

from bench.case import Advance, Report, chosen
from pvid.board.boards import BOARDS
from pvid.board.longest_tick import longest_tick
from pvid.board.mechanism_image import mechanism_run
from pvid.board.mechanism_image_q31 import fixed_run
from pvid.settings.cores import CORES, FLOAT
from pvid.settings.enums import Core

BOARD = BOARDS["mps2-an386"]
HEADER = ("mechanism", "core", "searched", "bound", "bound / searched", "loops", "of these not entered", "stack bound")


def row_of(name: str, core: Core) -> tuple[str, ...]:
    """Of a mechanism's shipped rig."""
    run = mechanism_run(name, long=True) if core == FLOAT.name else fixed_run(name, long=True)
    found = longest_tick(BOARD, run)
    loops = len(found.passes) + len(found.assumed)
    figures = (found.longest, found.bound, f"{found.bound / found.longest:.1f}", loops, len(found.assumed), found.stack)
    return name, core, *map(str, figures)


def report(mechanism: tuple[str, ...], advance: Advance) -> Report:
    """See bench.case."""

    def rows() -> Iterator[tuple[str, ...]]:
        for name in chosen(mechanism):
            for core in CORES:
                yield row_of(name, CORES[core].name)
                advance()

    return Report([("ticks", HEADER, rows())])
