"""The report of a log: what this machine finds in its samples, and what the board published meanwhile."""

from __future__ import annotations

from pathlib import Path

from pvid.identification.reading import read_all
from pvid.identification.road import identified
from pvid.identification.summary import Made
from pvid.log.rig import LOG_SUFFIX, mechanism_of_log, source_of
from pvid.log.rig_choice import rig_of
from pvid.show.document import picture
from pvid.show.log_figure import estimates_of
from pvid.show.report import report


def report_of_log(log: Path) -> str:
    """The page, of a mechanism that the log names.

    Raises PvidError where the log cannot be read, names a model file, or has too few samples.
    """
    rig = rig_of(log)
    recording, model = read_all(rig, [source_of(log)], (), None)
    made = Made.of(f"pvid identify {log} --report", [log], None, rig)
    return report(identified(recording, model), made, more=boards_part([log]))


def boards_part(files: list[Path]) -> str:
    """A section of a report: the estimates that a board published, of each log among these files that has any."""
    out = []
    for number, log in enumerate(one for one in files if one.suffix == LOG_SUFFIX):
        found = estimates_of(log, mechanism_of_log(log))
        if found is not None:
            draw, panels = found
            caption = "Each estimate as the board published it, with two standard errors on either side."
            out.append(picture(draw, 0.5 + 0.75 * (panels + 1), caption, f"board{number}"))
    return f"<h2>What the board published</h2>{''.join(out)}" if out else ""
