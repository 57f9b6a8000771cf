"""Where the instructions and the bytes of the weak engine in fixed point go: a tick by part, the state by struct."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence

from bench.struct_sizes import state_table
from pvid.board.boards import BOARDS
from pvid.board.mechanism_image_q31 import fixed_run
from pvid.board.profile import profile
from pvid.settings.enums import Core

Parts = Sequence[tuple[str, str]]

BOARD_NAMES = ("mps2-an386", "microbit")
HEADER = ("part of a tick", *(f"{BOARDS[name].core}" for name in BOARD_NAMES))
STATE_HEADER = ("state", "bytes")

# Sources that a part of the engine has of its own; what is left is arithmetic that all parts share.
_PARTS = (
    ("samples to the block sums, schedule", r"weak_q31|accumulator_q31"),
    ("jets at a step", r"weak_front_q31"),
    ("channels and integrals of a step", r"values_q31|_weak_q31|elementary_q31"),
    ("half-window sums and their join", r"sums_q31"),
    ("a window: white columns, rows, residuals", r"weak_finish_q31|columns_q31|white_q31|reflection_q31|rescale_q31"),
    ("a window: the sensors' noise", r"noise_q31"),
    ("a window: scatter of the scores, equation errors", r"scores_q31|error_q31"),
    (
        "a window: sums, solves, assessment",
        r"staged_q31|system_q31|cholesky_q31|information_q31|row_q31|step_q31|assess_q31|estimator_q31|scaled_model_q31",
    ),
    ("a window: gate, trust, publication", r"trust_q31|gate_q31|publication|misfit_q31"),
    ("products, shifts and numbers of any size", r"integer_q31|scaled_q31"),
)
_OTHERS = "division, memcpy, the call"

# Of the state: what it is, and its size in C.
_STRUCTS = (
    ("block sums and the line of the compensators", "sizeof(pvid_weak_front_q31)"),
    ("inputs, gains and integrals of the last steps", "sizeof(pvid_weak_values_q31)"),
    ("sums of two half windows", "sizeof(((pvid_weak_sums_q31 *)0)->sum)"),
    ("a block of four steps", "sizeof(((pvid_weak_sums_q31 *)0)->block)"),
    ("lengths of the window's sums, with these if they need a place", "sizeof(pvid_weak_window_q31)"),
    ("rows while they are made, or a solve", "sizeof(pvid_weak_work_q31)"),
    (
        "gates, noise, equation errors, formats of the rows",
        "sizeof(pvid_weak_finish_q31) - sizeof(pvid_weak_work_q31) - sizeof(pvid_weak_scores_q31)"
        " - sizeof(((pvid_weak_finish_q31 *)0)->white)",
    ),
    ("what whitens the rows, kept between windows", "sizeof(((pvid_weak_finish_q31 *)0)->white)"),
    ("scores of the windows", "sizeof(pvid_weak_scores_q31)"),
    ("estimates: published, its copy", "2 * sizeof(pvid_estimate_q31)"),
    ("sums M, b and rr", "sizeof(pvid_information_q31)"),
    ("the rest of the estimator", "sizeof(pvid_estimator_q31) - sizeof(pvid_information_q31)"),
    ("trust", "sizeof(pvid_trust_q31) - 2 * sizeof(pvid_estimate_q31)"),
    ("drive", "sizeof(pvid_weak_drive_q31)"),
)
_ALL = "sizeof(pvid_weak_q31)"


def tick_rows(model: str) -> list[tuple[str, ...]]:
    """Instructions of a tick by part, on each board, as in HEADER."""
    return tick_parts(model, "q31", BOARD_NAMES, _PARTS)


def tick_parts(model: str, core: Core, boards: Sequence[str], named: Parts) -> list[tuple[str, ...]]:
    """The same of either arithmetic: titles, each with the sources of its part."""
    of_boards = []
    for name in boards:
        counted = profile(BOARDS[name], "weak", core, model)
        parts: defaultdict[str, float] = defaultdict(float)
        for (_, file), n in counted.functions.items():
            parts[part_of(file, named)] += n
        parts[_OTHERS] += counted.measured - counted.total
        of_boards.append((parts, counted.measured))
    titles = [title for title, _ in named] + [_OTHERS]
    rows = [(title, *(f"{parts[title]:.0f}" for parts, _ in of_boards)) for title in titles]
    return [*rows, ("**all**", *(f"{mean:.0f}" for _, mean in of_boards))]


def part_of(file: str, named: Parts) -> str:
    """The title whose sources contain a file."""
    for title, sources in named:
        if re.fullmatch(rf"\w*({sources})\.[ch]", file):
            return title
    return _OTHERS


def state_rows(model: str) -> list[tuple[str, ...]]:
    """Bytes of the state by part on a Cortex-M, with the arrays of the sizes that the mechanism needs."""
    sizes = fixed_run(model).sizes
    return state_table("pvid/weak_q31.h", _STRUCTS, _ALL, "schedule, pointers, padding", sizes)
