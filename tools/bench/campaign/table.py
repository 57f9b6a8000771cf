"""Results of a campaign as tables and as one line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

import numpy as np
from rich.box import MARKDOWN
from rich.table import Table

from bench.campaign.judge import Record

_HEADINGS = (
    "rigs",
    "data suffice",
    "published",
    "answered",
    "within 1 %",
    "within 5 %",
    "warned",
    "silently wrong",
    "missed",
    "first s",
    "error %",
    "s.e. w %",
    "bound w %",
    "publications",
    "wrong",
    "right",
    "alarmed",
)

LEGEND = (
    "data suffice: Cramer-Rao bound of w and d1 below 1 %; answered, missed: of those. answered: published, w, d1 and "
    "d2 each within 1 % or 3 standard errors; missed: not published. silently wrong: at the end, not warned, off by "
    "more than 3 standard errors and 1 %. first s: median time to the first publication. error: median of the largest "
    "of w, d1, d2. publications: over the whole runs; wrong silently, right (within 0.3 % or 2 standard errors), right "
    "with the alarm."
)

_EDGES: dict[str, tuple[float, ...]] = {
    "slow_hz": (0.45, 0.9),
    "fast_hz": (2.0, 4.0, 8.0),
    "angle_lsb": (20.0, 100.0),
    "largest_phi": (0.03, 0.06, 0.12),
    "y_um": (5.0, 20.0, 50.0),
    "duration": (15.0, 50.0),
    "bound_w": (1e-4, 1e-3, 1e-2),
}
PROPERTIES = ("sample_rate", "drive", *_EDGES)

# A gain error of the pivot's sensor beyond this cannot be seen by any method; below, standard errors must hold it.
GAIN_KNOWN = 0.003


def by_condition(records: list[Record], conditions: Iterable[str]) -> Table:
    """A row a condition, in this order, and one for all."""
    return _table("condition", records, lambda record: str(record["condition"]), list(conditions))


def by_property(records: list[Record], name: str) -> Table:
    """A row a group of rigs alike in a property."""
    groups = {_group(record, name) for record in records}
    return _table(name, records, lambda record: _group(record, name), sorted(groups, key=_rank))


def _table(title: str, records: list[Record], group_of: Callable[[Record], str], order: list[str]) -> Table:
    table = Table(box=MARKDOWN)
    table.add_column(title)
    for heading in _HEADINGS:
        table.add_column(heading, justify="right")
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(group_of(record), []).append(record)
    for name in order:
        if name in groups:
            table.add_row(name, *cells(groups[name]))
    table.add_row("all", *cells(records))
    return table


def _rank(group: str) -> tuple[int, float, str]:
    """Groups in order: numbers by size, intervals by their lower end, then names."""
    first = group.split(" ")[0]
    if first == "below":
        return 0, -np.inf, group
    try:
        return 0, float(first), group
    except ValueError:
        return 1, 0.0, group


def _group(record: Record, name: str) -> str:
    if name in ("sample_rate", "drive"):
        value = record[name]
        return f"{value:g}" if isinstance(value, float) else str(value)
    edges = _EDGES[name]
    measured = _measure(record, name)
    place = int(np.searchsorted(edges, measured, side="right"))
    if place == 0:
        return f"below {edges[0]:g}"
    return f"{edges[place - 1]:g} and more" if place == len(edges) else f"{edges[place - 1]:g} to {edges[place]:g}"


def _measure(record: Record, name: str) -> float:
    if name == "angle_lsb":
        return _number(record, "largest_phi") / _number(record, "phi_lsb")
    if name == "y_um":
        return 1e6 * _number(record, "y_lsb")
    return _number(record, name)


def _number(record: Record, name: str) -> float:
    value = record[name]
    return float(value) if isinstance(value, (int, float)) else np.inf


def cells(records: list[Record]) -> tuple[str, ...]:
    """The cells behind a row's name."""
    sufficient = [record for record in records if record["suffices"]]
    published = [record for record in records if record["published"]]

    def count(name: str) -> str:
        return str(sum(bool(record[name]) for record in records))

    def total(name: str) -> str:
        return str(sum(int(_number(record, name)) for record in records))

    relative_se = [_number(record, "w_se") / abs(_number(record, "w")) for record in published]
    return (
        str(len(records)),
        str(len(sufficient)),
        count("published"),
        str(sum(bool(record["answered"]) for record in sufficient)),
        count("within_1"),
        count("within_5"),
        count("warned"),
        count("silently_wrong"),
        count("missed"),
        _median((_number(record, "first_s") for record in published if record["first_s"] is not None), 1.0),
        _median((_number(record, "worst_error") for record in published), 100.0),
        _median(relative_se, 100.0),
        _median((_number(record, "bound_w") for record in records), 100.0),
        total("publications"),
        total("publications_wrong"),
        total("publications_right"),
        total("publications_right_alarmed"),
    )


def _median(values: Iterable[float], factor: float) -> str:
    listed = list(values)
    return f"{factor * float(np.median(listed)):.2g}" if listed else "-"


def summary(records: list[Record]) -> str:
    """One line: answered, published, within 1 %, silently wrong, alarms on right answers."""
    sufficient = [record for record in records if record["suffices"]]
    wrong = [record for record in records if record["silently_wrong"]]
    by_gain = sum(abs(_number(record, "gain")) > GAIN_KNOWN for record in wrong)
    right = [record for record in records if record["right"]]

    def share(part: int, whole: int) -> str:
        return f"{100 * part / whole:.1f} %" if whole else "none"

    def of_sufficient(name: str) -> str:
        return share(sum(bool(record[name]) for record in sufficient), len(sufficient))

    def total(name: str) -> int:
        return sum(int(_number(record, name)) for record in records)

    crashed = sum(bool(record["crashed"]) for record in records)
    return (
        f"answered {of_sufficient('answered')} of the {len(sufficient)} rigs whose data suffice (of {len(records)}), "
        f"published {of_sufficient('published')}, within 1 % {of_sufficient('within_1')}; silently wrong at the end "
        f"{len(wrong)}"
        + (f" ({by_gain} of them by a gain error above {100 * GAIN_KNOWN:g} %)" if by_gain else "")
        + ", "
        f"silently wrong publications {share(total('publications_wrong'), total('publications'))}; alarms on right "
        f"answers: {share(sum(bool(record['warned']) for record in right), len(right))} of those at the end, "
        f"{share(total('publications_right_alarmed'), total('publications_right'))} of all publications"
        + (f"; CRASHED {crashed}" if crashed else "")
    )


def reasons(records: list[Record], most: int = 8) -> list[str]:
    """Why nothing was published, the most frequent first; numbers in a sentence do not tell two reasons apart."""
    counted = Counter(_without_numbers(str(record["reason"])) for record in records if record["reason"])
    return [f"{count} x {reason}" for reason, count in counted.most_common(most)]


def _without_numbers(reason: str) -> str:
    words = ("#" if any(letter.isdigit() for letter in word) else word for word in reason.split())
    return " ".join(words)
