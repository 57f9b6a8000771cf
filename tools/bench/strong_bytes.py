"""Where the bytes of the strong form go: code by part, state by member, on a Cortex-M4F; its cost in fixed point."""

from __future__ import annotations

import re
from collections import Counter
from typing import NamedTuple

from bench.struct_sizes import state_table
from pvid.board.boards import BOARDS
from pvid.board.replay_image import ReplayReport, build_image, play, standard_run
from pvid.board.sizes import ARITHMETIC, CODE, CORE, TICKS, TIMEOUT_S, sections
from pvid.settings.enums import Core

BOARD = "mps2-an386"
TEXT_HEADER = ("code", "float32", "fixed point")
STATE_HEADER = ("state", "bytes")

# What a function belongs to, by its source and its name; the first that fits.
_PARTS = (
    (
        "checks of a configuration, init",
        r"",
        r"init|valid|settings_of|take_bank|places|refuse|defaults|sized|gain|decay|retention|ranges",
    ),
    ("check of the arithmetic", r"arithmetic", r""),
    ("58 sums: a block of four rows added, folded", r"kapitza_sums", r""),
    ("58 sums: joined and shifted to p, C^T M C", r"kapitza_project", r""),
    ("58 sums: joined and shifted to p, C^T M C", r"kapitza_estimator_f32", r"gather|project|triple|pair"),
    ("solve, limits, residuals", r"kapitza_(estimator|solve|assess|residual)|assess|cholesky|system", r""),
    ("the tick: five points, row, innovation (float32: the solve)", r"strong_(f32|q31)|kapitza_row", r""),
    ("derivatives of any bank", r"derivatives|differentiator", r""),
    ("gate and verdict", r"gate|misfit", r""),
    ("numbers with a scale", r"scaled|integer", r""),
)
_OTHERS = "hash, text, the rest"

_STATE = (
    ("58 sums at two levels", "sizeof(pvid_strong_sums_f32)"),
    ("block of rows", "(PVID_STRONG_ROWS - 1) * sizeof(pvid_strong_row_f32)"),
    ("window of five points", "sizeof(((pvid_strong_window_f32 *)0)->samples)"),
    ("factors and places of the window", "sizeof(pvid_strong_window_f32) - PVID_MAX_WINDOW * 8"),
    ("counters", "sizeof(pvid_counters)"),
    ("gate", "sizeof(pvid_gate_f32)"),
    ("verdict", "sizeof(pvid_misfit_f32)"),
    (
        "p, prior, equations of the next step, schedule",
        "sizeof(pvid_strong_estimator_f32) - sizeof(pvid_strong_sums_f32) - sizeof(pvid_counters) - "
        "(PVID_STRONG_ROWS - 1) * sizeof(pvid_strong_row_f32)",
    ),
)


class Build(NamedTuple):
    """Bytes of an image by part, and its run."""

    parts: Counter[str]
    compiler: int
    application: int
    report: ReplayReport


def measured(core: Core) -> Build:
    """Builds and runs the standard image of the strong form, without a dead zone."""
    image, _ = build_image(BOARDS[BOARD], standard_run(TICKS, core))
    parts: Counter[str] = Counter()
    compiler = application = 0
    for section, size, file in sections(image.with_suffix(".map").read_text(encoding="utf-8")):
        if not re.match(CODE, section) or "replay_samples" in section:
            continue
        if re.search(CORE, file):
            parts[_part_of(section, file)] += size
        elif re.search(ARITHMETIC, file):
            compiler += size
        else:
            application += size
    return Build(parts, compiler, application, play(BOARDS[BOARD], image, TIMEOUT_S))


def text_rows() -> list[tuple[str, ...]]:
    """Bytes of code and constants by part, and instructions a tick, as in TEXT_HEADER."""
    builds = (measured("f32"), measured("q31"))
    titles = [*dict.fromkeys(title for title, _, _ in _PARTS), _OTHERS]
    rows = [(title, *(str(build.parts[title]) for build in builds)) for title in titles]
    return [
        *rows,
        ("**all of the core**", *(str(build.parts.total()) for build in builds)),
        ("the compiler's: division, `memset`", *(str(build.compiler) for build in builds)),
        ("the application: replay, its settings and texts, start, UART", *(str(build.application) for build in builds)),
        ("instructions a tick, mean", *(f"{build.report.instructions_mean:.0f}" for build in builds)),
        ("instructions, longest tick", *(f"{build.report.instructions_longest:.0f}" for build in builds)),
    ]


SOFT = ("mps2-an386", "mps2-an385", "microbit", "virt-rv32imac")
FIXED_HEADER = ("instructions per tick", "q31", "q31, a solve at every eighth row", "float32", "ratio")


def fixed_rows() -> list[tuple[str, ...]]:
    """A tick in fixed point beside float32, by a floating-point unit (Cortex-M4F) or soft float, as in FIXED_HEADER."""
    rows = []
    for name in SOFT:
        runs = (standard_run(TICKS, "q31"), standard_run(TICKS, "q31", 8), standard_run(TICKS))
        means = [play(BOARDS[name], build_image(BOARDS[name], run)[0], TIMEOUT_S).instructions_mean for run in runs]
        rows.append((BOARDS[name].core, *(f"{one:.0f}" for one in means), f"{means[2] / means[0]:.1f}"))
    return rows


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
