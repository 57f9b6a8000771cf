"""Where the bytes of the strong form in float32 go: code by function, state by member, on a Cortex-M4F."""

from __future__ import annotations

import re
from collections import Counter

from bench.struct_sizes import state_table
from pvid.board.boards import BOARDS
from pvid.board.replay_image import build_image, standard_run
from pvid.board.sizes import CODE, CORE, TICKS, sections

BOARD = "mps2-an386"
TEXT_HEADER = ("code", "bytes")
STATE_HEADER = ("state", "bytes")

# What a function belongs to, by its source and its name; the first that fits.
_PARTS = (
    (
        "checks of a configuration, init",
        r"",
        r"init|valid|settings_of|take_bank|places|refuse|defaults|sized|gain|decay",
    ),
    ("check of the arithmetic", r"arithmetic", r""),
    ("58 sums: a block of four rows added, folded", r"kapitza_sums", r""),
    ("58 sums: joined and shifted to p, C^T M C", r"kapitza_estimator", r"gather|project"),
    ("a step within a dead zone", r"", r"in_zone"),
    ("solve, limits, standard errors, residuals", r"kapitza_(estimator|solve|assess|residual)|assess", r""),
    ("the tick: derivatives, row, innovation, solve in line", r"strong_f32", r""),
    ("derivatives of other banks", r"derivatives|differentiator", r""),
    ("gate and verdict", r"gate|misfit", r""),
)
_OTHERS = "hash, text, the rest"

_STATE = (
    ("58 sums at two levels", "sizeof(pvid_strong_sums_f32)"),
    ("block of four rows", "PVID_STRONG_ROWS * sizeof(pvid_strong_row_f32)"),
    ("window of five points", "sizeof(((pvid_strong_window_f32 *)0)->samples)"),
    ("bank, factors, places of the window", "sizeof(pvid_strong_window_f32) - PVID_MAX_WINDOW * 8"),
    ("counters", "sizeof(pvid_counters)"),
    ("gate", "sizeof(pvid_gate_f32)"),
    ("verdict", "sizeof(pvid_misfit_f32)"),
    (
        "p, bounds, prior, equations of the next step, settings",
        "sizeof(pvid_strong_estimator_f32) - sizeof(pvid_strong_sums_f32) - sizeof(pvid_counters) - "
        "PVID_STRONG_ROWS * sizeof(pvid_strong_row_f32)",
    ),
)


def text_rows() -> list[tuple[str, ...]]:
    """Bytes of code by part, as in TEXT_HEADER."""
    image, _ = build_image(BOARDS[BOARD], standard_run("strong", TICKS))
    parts: Counter[str] = Counter()
    for section, size, file in sections(image.with_suffix(".map").read_text(encoding="utf-8")):
        if re.match(CODE, section) and re.search(CORE, file):
            parts[_part_of(section, file)] += size
    titles = [title for title, _, _ in _PARTS] + [_OTHERS]
    return [*((title, str(parts[title])) for title in titles), ("**all**", str(parts.total()))]


def _part_of(section: str, file: str) -> str:
    member = file.partition("(")[2]
    for title, source, function in _PARTS:
        if re.search(source, member) and re.search(function, section.partition("_window5")[0]):
            return title
    return _OTHERS


def state_rows() -> list[tuple[str, ...]]:
    """Bytes of the state by member with a window of five points, as in STATE_HEADER."""
    return state_table(
        "pvid/strong.h", _STATE, "sizeof(pvid_strong_f32)", "drive, flags, padding", {"PVID_MAX_WINDOW": 5}
    )
