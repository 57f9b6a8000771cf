"""The columns of a file over time."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt

from pvid.base.figure_file import drawable, save
from pvid.identification.survey import Survey
from pvid.show.axis_limits import plain_ticks

_MOST = 4000  # points of a line
_PANEL = 1.5  # inches
_PANELS = 16  # the first columns


def write_columns_figure(survey: Survey, path: Path) -> None:
    """Draws each column of numbers in the unit of the file; png, svg or pdf by suffix.

    Raises PvidError when it cannot be written.
    """
    recording = survey.recording
    moving = [one for one in survey.facts if one.low < one.high][:_PANELS]
    figure, axes = plt.subplots(
        max(1, len(moving)),
        1,
        sharex=True,
        squeeze=False,
        figsize=(10, 0.8 + _PANEL * max(1, len(moving))),
        layout="constrained",
    )
    step = max(1, len(recording) // _MOST)
    try:
        for one, axis in zip(moving, axes[:, 0], strict=False):
            values = recording.signals[one.key]
            axis.plot(recording.t[::step], values[::step], color="C0", linewidth=0.8)
            axis.set_ylabel(drawable(f"{one.name} [{one.unit}]" if one.unit else one.name))
            plain_ticks(axis)
            axis.grid(alpha=0.3)
        axes[-1, 0].set_xlabel("time [s]")
        figure.suptitle(drawable(survey.path.name), parse_math=False)
        save(figure, path, dpi=110)
    finally:
        plt.close(figure)
