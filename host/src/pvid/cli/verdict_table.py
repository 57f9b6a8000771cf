"""The words of the verdict as a table for the documentation: meaning, rule with its numbers, use."""

from __future__ import annotations

from pvid.base.rounding import percent
from pvid.cli.page_table import markdown
from pvid.identification.judge import PREDICTED
from pvid.oracle.weak.missing import MOVES, VISIBLE
from pvid.oracle.weak.parameters import UNKNOWN
from pvid.oracle.weak.words import WIDE, Word

HEADER = ("verdict", "meaning", "rule, of a parameter", "rule, of the answer", "what to do with the values")

ROWS: dict[Word, tuple[str, str, str, str]] = {
    "good": (
        "the standard error holds: the truth is within two of them in 95 % of all runs",
        f"no warning concerns it: what the equations seem to lack moves it by less than {MOVES:g} standard errors "
        f"(without `se_model`), or by less than {percent(VISIBLE)}; and its standard error is at most {percent(WIDE)} "
        "of it. A parameter that may be 0 is good where its upper bound (`below`) is below its guess",
        "all parameters are good",
        "use them with their standard errors",
    ),
    "usable": (
        "the value is about right, with a large error, or a cause of error that is named",
        f"its standard error is above {percent(WIDE)} of it, or a warning concerns it. The standard error contains "
        "what the warning has found",
        "not all parameters are good, and at least one is good or usable",
        "read the warning; use the values that there are with their standard errors where these suffice; do not "
        "compare rigs, do not set limits or alarms with them",
    ),
    "not_explained": (
        "the equations do not describe the run, and no cause was found",
        f"R^2 of unseen motion is below {PREDICTED:g} for a sensor; or the cause of what is unexplained is unknown, "
        "and no unseen motion could be predicted; or what the equations seem to lack may change it by more than "
        f"{percent(UNKNOWN)}",
        "that concerns all parameters",
        "do not use them; look for the cause with the sentences of the warning and a figure",
    ),
    "not_identified": (
        "the run does not determine the parameter",
        f"its standard error is above {percent(UNKNOWN)} of it, or it is at a bound, or the search ran away",
        "no parameter is identified (exit code 3)",
        "there is no value; record another drive, or declare another parameter as known",
    ),
}


def verdict_table() -> str:
    """A row a word, in Markdown."""
    return markdown(HEADER, [(f"`{word}`", *cells) for word, cells in ROWS.items()])
