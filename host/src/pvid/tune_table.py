"""The candidates of `pvid tune` as a table for the terminal."""

from __future__ import annotations

import math
from dataclasses import replace

from rich.table import Table

from pvid.tune import Judged, Tuned

_SHOWN = 12  # best ones, and beside them the choice and the rig file's own settings wherever they stand
_HEADINGS = (
    "",
    "window s",
    "functions",
    "decimation",
    "smoothing ms",
    "standard error",
    "bias",
    "split",
    "misfit",
    "colour",
    "delay s",
    "instructions",
    "expected error %",
)


def candidates_table(tuned: Tuned) -> Table:
    """The candidates, best first, with all that they were judged by."""
    table = Table(title="errors in % of w / d1 / d2, best first")
    for heading in _HEADINGS:
        table.add_column(heading, justify="right")
    chosen = tuned.chosen.settings
    for rank, one in enumerate(tuned.candidates):
        mark = ""
        if replace(one.settings, forgetting_s=chosen.forgetting_s) == chosen:
            mark = "chosen"
        elif one is tuned.default:
            mark = "rig file"
        if rank < _SHOWN or mark:
            table.add_row(mark, *_cells(one))
    return table


def _cells(one: Judged) -> tuple[str, ...]:
    settings = one.settings
    return (
        f"{settings.window_s:g}",
        f"{settings.functions}",
        f"{settings.decimation}",
        f"{1000 * settings.smoothing_s:.4g}",
        " ".join(f"{100 * error:.2g}" for error in one.se),
        " ".join(f"{100 * bias:.2g}" for bias in one.bias),
        "-" if math.isnan(one.split) else f"{one.split:.2g}",
        f"{one.misfit:.2g}",
        f"{one.colour:.2g}",
        f"{one.delay_s:.3g}",
        f"{one.instructions:.0f}",
        f"{100 * one.error:.2g}",
    )
