"""Where the instructions and the bytes of the weak form go: a tick by part, the state by struct, the text by part."""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.board.mechanism_image import mechanism_run
from pvid.board.mechanism_image_q31 import fixed_run
from pvid.board.profile import profile
from pvid.board.sizes import Configuration, measure
from pvid.board.weak_image import weak_image
from pvid.codegen.fitted_sizes import fitted_sizes
from pvid.core.sources import INCLUDES
from pvid.settings.enums import Core

Parts = Sequence[tuple[str, str]]

FIXED_BOARDS = ("mps2-an386", "microbit")
FIXED_HEADER = ("part of a tick", *(f"{BOARDS[name].core}" for name in FIXED_BOARDS))

# Sources that a part of the identifier has of its own; what is left is arithmetic that all parts share.
_FIXED_PARTS = (
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
_FIXED_STRUCTS = (
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
_FIXED_ALL = "sizeof(pvid_weak_q31)"


def fixed_tick_rows(model: str) -> list[tuple[str, ...]]:
    """Instructions of a tick by part, on each board, as in FIXED_HEADER."""
    return tick_parts(model, "q31", FIXED_BOARDS, _FIXED_PARTS)


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


def fixed_state_rows(model: str) -> list[tuple[str, ...]]:
    """Bytes of the state by part on a Cortex-M, with the arrays of the sizes that the mechanism needs."""
    sizes = fixed_run(model).sizes
    return state_table("pvid/weak_q31.h", _FIXED_STRUCTS, _FIXED_ALL, "schedule, pointers, padding", sizes)


# ---- float32 ----

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
    image = weak_image(BOARDS[BOARD], model, "f32").image
    command = [f"{BOARDS[BOARD].tool_prefix}nm", "--line-numbers", "--print-size", "--defined-only", str(image)]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    parts: Counter[str] = Counter()
    for size, file in re.findall(r"^[0-9a-f]+ ([0-9a-f]+) [tTwW] \S+(?:\t(\S+):\d+)?$", listing, re.MULTILINE):
        parts[part_of(file.rpartition("/")[2], _PARTS)] += int(size, 16)
    titles = [title for title, _ in _PARTS]
    rows = [(title, str(parts[title])) for title in titles]
    return [*rows, ("**all**", str(sum(parts[title] for title in titles)))]


def mechanism_rows(names: Sequence[str], progress: Callable[[], object]) -> Iterator[tuple[str, ...]]:
    """Costs of every shipped mechanism with the design of its rig, as in MECHANISMS_HEADER."""
    for name in names:
        found = measure(Configuration(BOARDS[BOARD], "weak", "f32", name))[0]
        yield (name, *(str(getattr(found, one)) for one in ("mean", "longest", "bss", "tables", "text")))
        progress()


# ---- both ----


def state_table(
    header: str, parts: Sequence[tuple[str, str]], whole: str, rest: str, macros: Mapping[str, object]
) -> list[tuple[str, ...]]:
    """Rows of title and bytes on a Cortex-M, the rest and the whole at the end.

    Parameters
    ----------
    header : of the core
    parts : title and size in C of each
    whole : size in C
    rest : title of what is in no part
    macros : of pvid/config.h
    """
    expressions = [*(size for _, size in parts), whole]
    lines = [f"char size_{k}[{size}];" for k, size in enumerate(expressions)]
    prefix = BOARDS["mps2-an386"].tool_prefix
    with tempfile.TemporaryDirectory() as folder:
        source, made = Path(folder) / "a.c", Path(folder) / "a.o"
        source.write_text("\n".join([f'#include "{header}"', *lines, ""]), encoding="ascii")
        options = [f"-D{name}={value}" for name, value in macros.items()]
        command = [
            f"{prefix}gcc",
            "-mcpu=cortex-m4",
            "-mthumb",
            "-c",
            *options,
            *INCLUDES,
            str(source),
            "-o",
            str(made),
        ]
        if subprocess.run(command, check=False).returncode != 0:
            raise PvidError("the sizes of the state did not compile")
        listed = subprocess.run([f"{prefix}nm", "-S", str(made)], capture_output=True, text=True, check=True).stdout
    found = {int(k): int(size, 16) for size, k in re.findall(r"^\w+ (\w+) \w size_(\d+)$", listed, re.MULTILINE)}
    rows = [(title, str(found[k])) for k, (title, _) in enumerate(parts)]
    return [*rows, (rest, str(found[len(parts)] - sum(int(n) for _, n in rows))), ("**all**", str(found[len(parts)]))]


Tables = Iterator[tuple[str, tuple[str, ...], list[tuple[str, ...]]]]  # marker, header, rows


def _one_of(names: Sequence[str]) -> str:
    return "kapitza" if "kapitza" in names else names[0]


def float_tables(names: Sequence[str], progress: Callable[[], object]) -> Tables:
    """Parts of one mechanism, costs of each."""
    one = _one_of(names)
    yield "float-tick", TICK_HEADER, tick_rows(one)
    yield "float-state", STATE_HEADER, state_rows(one)
    yield "float-text", TEXT_HEADER, text_rows(one)
    yield "float-mechanisms", MECHANISMS_HEADER, list(mechanism_rows(names, progress))


def fixed_tables(names: Sequence[str], progress: Callable[[], object]) -> Tables:
    """Parts of one mechanism."""
    one = _one_of(names)
    yield "fixed-tick", FIXED_HEADER, fixed_tick_rows(one)
    progress()
    yield "fixed-state", STATE_HEADER, fixed_state_rows(one)
