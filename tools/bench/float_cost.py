"""Where instructions and bytes of the weak engine in float32 go: a tick by part, state, text; every mechanism."""

from __future__ import annotations

import re
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator

from bench.fixed_cost import part_of, tick_parts
from bench.struct_sizes import state_table
from pvid.board.boards import BOARDS
from pvid.board.engine_image import engine_image
from pvid.board.mechanism_image import mechanism_run
from pvid.board.sizes import Configuration, measure
from pvid.codegen.fitted_sizes import fitted_sizes
from pvid.models.mechanisms import names

BOARD = "mps2-an386"
TICK_HEADER = ("part of a tick", "instructions")
STATE_HEADER = ("state", "bytes")
TEXT_HEADER = ("text", "bytes")
MECHANISMS_HEADER = ("mechanism", "mean", "longest", "state", "tables", "text")

_PARTS = (
    ("samples to the block sums, schedule", r"weak_f32|limits_f32"),
    ("jets at a step", r"weak_front_f32"),
    ("channels and integrals of a step", r"weak_step_f32|\w+_weak_f32|elementary_f32"),
    ("half-window sums and their join", r"sums_f32"),
    ("a window: white columns, rows, residuals, noise", r"weak_finish_f32|columns_f32|white_f32|products_f32"),
    ("a window: scatter of the scores, equation errors", r"scores_f32|error_f32"),
    (
        "a window: sums, solves, assessment",
        r"staged_f32|direct_f32|pattern_f32|cholesky_f32|information_f32|assess_f32|estimator_f32|step_f32|kinds",
    ),
    ("a window: gate, trust, publication", r"trust_f32|gate_f32|publication"),
    ("checks of the settings at init", r"valid_f32|settings_f32"),
)
_STRUCTS = (
    ("block sums and the line of the compensators", "sizeof(pvid_weak_front_f32)"),
    ("inputs, gains and integrals of the last steps", "sizeof(pvid_weak_history_f32)"),
    ("range and least motion of the samples", "sizeof(pvid_weak_limits_f32)"),
    ("sums of two half windows", "sizeof(((pvid_weak_sums_f32 *)0)->sum)"),
    ("blocks of eight steps", "sizeof(((pvid_weak_sums_f32 *)0)->block)"),
    (
        "rows while they are made, with the window's sums if these need a place; or a solve",
        "sizeof(pvid_weak_work_f32)",
    ),
    ("noise of the rows and their reflections", "sizeof(pvid_weak_white_f32)"),
    ("scores of the windows", "sizeof(pvid_weak_scores_f32)"),
    ("estimates: candidate, published, its copy", "3 * sizeof(pvid_estimate_f32)"),
    ("sums M, b and rr, two levels", "sizeof(pvid_information_f32)"),
    ("the rest of the estimator", "sizeof(pvid_estimator_f32) - sizeof(pvid_information_f32)"),
    ("trust", "sizeof(pvid_trust_f32) - 2 * sizeof(pvid_estimate_f32)"),
)


def tick_rows(model: str) -> list[tuple[str, ...]]:
    """Instructions of a tick by part, as in TICK_HEADER."""
    return tick_parts(model, "f32", (BOARD,), _PARTS)


def state_rows(model: str) -> list[tuple[str, ...]]:
    """Bytes of the state by part, as in STATE_HEADER."""
    sizes = fitted_sizes(mechanism_run(model).config)
    return state_table("pvid/weak.h", _STRUCTS, "sizeof(pvid_weak_f32)", "schedule, pointers, padding", sizes)


def text_rows(model: str) -> list[tuple[str, ...]]:
    """Bytes of the code of an image by part, as in TEXT_HEADER."""
    image = engine_image(BOARDS[BOARD], model, "f32").image
    command = [f"{BOARDS[BOARD].tool_prefix}nm", "--line-numbers", "--print-size", "--defined-only", str(image)]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    parts: Counter[str] = Counter()
    for size, file in re.findall(r"^[0-9a-f]+ ([0-9a-f]+) [tTwW] \S+(?:\t(\S+):\d+)?$", listing, re.MULTILINE):
        parts[part_of(file.rpartition("/")[2], _PARTS)] += int(size, 16)
    titles = [title for title, _ in _PARTS]
    rows = [(title, str(parts[title])) for title in titles]
    return [*rows, ("**all**", str(sum(parts[title] for title in titles)))]


def mechanism_rows(progress: Callable[[], object] | None = None) -> Iterator[tuple[str, ...]]:
    """Costs of every shipped mechanism with the design of its rig, as in MECHANISMS_HEADER."""
    for name in names():
        found = measure(Configuration(BOARDS[BOARD], "weak", "f32", name))[0]
        yield (name, *(str(getattr(found, one)) for one in ("mean", "longest", "bss", "tables", "text")))
        if progress is not None:
            progress()
