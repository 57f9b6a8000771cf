"""The settings that `pvid tune` tried, as a table for the terminal."""

from __future__ import annotations

import math

from rich.table import Table

from pvid.run.tune import Judged, Tuned

_HEADINGS = (
    "",
    "tried",
    "window s",
    "functions",
    "decimation",
    "pass band Hz",
    "filters ms",
    "full angle",
    "friction",
    "residual held back",
    "expected error %",
    "warned",
)


def candidates_table(tuned: Tuned) -> Table:
    """All settings in the order in which they were tried; residuals over those of the rig file's own settings."""
    names = ", ".join(tuned.chosen.rig.mechanism.model.mapped_names)
    table = Table(
        title=f"residuals held back, over those of the rig file's own settings; expected errors: of {names}, rms"
    )
    for heading in _HEADINGS:
        table.add_column(heading, justify="right")
    for one in tuned.candidates:
        mark = "chosen" if one is tuned.chosen else ""
        table.add_row(mark, *_cells(one, tuned.default))
    return table


def _cells(one: Judged, default: Judged) -> tuple[str, ...]:
    settings = one.rig.identifier
    over = one.residual_over(default)
    return (
        one.what,
        f"{settings.window_s:g}",
        f"{settings.test_functions}",
        f"{settings.decimation}",
        f"{settings.pass_hz:g}",
        f"{1000 * settings.smoothing_s:g}",
        "yes" if settings.full_angle else "no",
        "yes" if settings.damping else "no",
        "-" if math.isnan(over) else f"{over:.3g}",
        f"{100 * one.error:.2g}" if one.identified else "held",
        "yes" if one.warned else "no",
    )
