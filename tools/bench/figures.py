"""The page host/docs/benchmarks.md: five figures, and sentences with figures, from the tables of results beside it."""

from __future__ import annotations

import hashlib
import io
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pvid.base.atomic_write import write_whole
from pvid.cli.page_table import with_table
from pvid.cli.results import Results, read_results
from pvid.core.sources import ROOT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAGE = ROOT / "host" / "docs" / "benchmarks.md"
DATA = PAGE.with_suffix("")
IMAGES = ROOT / "host" / "docs" / "images" / "benchmarks"
WEAK, REFINED, BAD, OTHER = "C0", "C2", "C3", "0.6"
_DPI = 80


def results_of(name: str) -> Results:
    """A table of results of the documentation."""
    return read_results(DATA / f"{name}.csv")


def sums_of(name: str) -> dict[str, int]:
    """Counts of one run, by name."""
    return {what: int(number) for what, number in results_of(name).rows}


def _number(cell: str) -> float:
    return float(cell.removeprefix("> ").split()[0])


def _numbers(cells: Sequence[str]) -> list[float]:
    return [_number(cell) for cell in cells]


def _names(rows: Sequence[str]) -> list[str]:
    """Each once, in their order."""
    return list(dict.fromkeys(rows))


def _points(axis: Axes, table: Results, value: str, shift: float, colour: str, label: str) -> None:
    """A column of dots for each mechanism."""
    names = _names(table.column("mechanism"))
    at = [names.index(name) + shift for name in table.column("mechanism")]
    axis.plot(at, _numbers(table.column(value)), "o", color=colour, alpha=0.6, markersize=4, label=label)
    axis.set_xticks(range(len(names)), names, rotation=20)


# ---- accuracy


def _at_1_khz(table: Results) -> Results:
    """Without the mechanism that is measured at other rates too."""
    return Results(table.header, [row for row in table.rows if row[1] in ("1000", "1")], table.made)


def draw_accuracy(figure: Figure) -> None:
    """Errors of every parameter beside the Cramer-Rao bound, of each stage."""
    axis = figure.subplots()
    refined = _at_1_khz(results_of("refine-mechanisms"))
    _points(axis, refined, "weak: RMS / bound", -0.2, OTHER, "first stage in C (float32)")
    _points(axis, results_of("mechanisms-chosen"), "RMS / bound", 0.0, WEAK, "first stage in float64")
    _points(axis, refined, "refined: RMS / bound", 0.2, REFINED, "both stages in C (float32)")
    axis.axhline(1.0, color="k", linewidth=0.8)
    axis.set_yscale("log")
    axis.set_ylabel("RMS error / Cramer-Rao bound")
    axis.legend(fontsize="small", loc="upper left")


def of_accuracy() -> list[str]:
    """Sentences below the figure."""
    lines = []
    for name, value, title in (
        ("mechanisms", "RMS / bound", "First stage, float64, soft friction"),
        ("mechanisms-chosen", "RMS / bound", "First stage, float64, sharp friction"),
        ("refine-mechanisms", "weak: RMS / bound", "First stage in C, sharp friction and large angles"),
        ("refine-mechanisms", "refined: RMS / bound", "Both stages in C, the same runs"),
    ):
        table = results_of(name)
        ratios = _numbers(table.column(value))
        worst = table.rows[ratios.index(max(ratios))]
        parameter = worst[table.header.index("parameter")]
        lines.append(
            f"- {title}: median {statistics.median(ratios):.2g} times the bound, largest {max(ratios):.3g} "
            f"({parameter} of `{worst[0]}`)."
        )
    inside = [statistics.mean(_numbers(results_of(name).column("in 2 s.e. %"))) for name in _COVERED]
    lines.append(
        f"- Two standard errors contain the truth in {inside[0]:.0f} %, {inside[1]:.0f} % and {inside[2]:.0f} % of the "
        "cases of the first, second and fourth line."
    )
    q31 = _numbers(results_of("weak-q31").column("ratio"))
    lines.append(f"- Fixed point against float32: largest ratio of RMS errors {max(q31):.3f}.")
    hard = results_of("hard")
    silent = [row for row in hard.where() if int(row["wrong, no alarm"]) > 0]
    listed = ", ".join(f"{one['wrong, no alarm']} of `{one['mechanism']}`, {one['case']}" for one in silent)
    lines.append(
        f"- Difficult cases in C, {len(hard.rows)} rows of 10 runs: {sum(map(int, hard.column('wrong, no alarm')))} "
        f"runs off by more than 3 s.e. without an alarm ({listed}); chance gives "
        f"{sum(float(cell) for cell in hard.column('by chance') if cell != '-'):.1f}."
    )
    gains = results_of("imperfections")
    wrong = [row for row in gains.where() if not row["wrong without a warning"].startswith("0/")]
    lines.append(
        f"- Imperfect rigs: wrong without a warning in {len(wrong)} of {len(gains.rows)} rows: "
        f'"{", ".join(_names([row["imperfection"] for row in wrong]))}".'
    )
    lacking = results_of("refine-friction")
    lines.append(
        f"- Both stages, imperfect rigs, {len(lacking.rows)} rows of 10 runs: "
        f"{sum(map(int, lacking.column('beyond 5 s.e. and 1 %')))} estimates off by more than 5 s.e. and 1 %."
    )
    return lines


_COVERED = ("mechanisms", "mechanisms-chosen", "refine-mechanisms")


# ---- cost


def draw_cost(figure: Figure) -> None:
    """Instructions and bytes of every mechanism."""
    boards, sizes = results_of("model-boards"), results_of("sizes-models")
    left, right = figure.subplots(1, 2)
    names = list(boards.header[2:-1])
    for core, board, marker, colour, label in (
        ("f32", "Cortex-M4F (mps2-an386)", "o", WEAK, "Cortex-M4F, float32"),
        ("q31", "Cortex-M0 (microbit)", "s", REFINED, "Cortex-M0, fixed point"),
        ("f32", "Cortex-M0 (microbit)", "^", BAD, "Cortex-M0, float32"),
    ):
        (row,) = boards.where(board=board, core=core)
        left.plot(names, [int(row[name]) for name in names], marker, color=colour, label=label)
    left.set_yscale("log")
    left.set_ylabel("instructions a tick, mean")
    left.set_ylim(100, 3e5)
    left.legend(fontsize="small", loc="upper left")
    measured = [form.split(", ")[-3] if form.count(",") > 1 else "kapitza" for form in sizes.column("form")]
    base = [0.0] * len(sizes.rows)
    for column, colour, label in (("text", WEAK, "code"), ("tables", OTHER, "tables"), ("bss", REFINED, "RAM")):
        kilobytes = [int(cell) / 1000 for cell in sizes.column(column)]
        right.bar(measured, kilobytes, bottom=base, color=colour, label=label)
        base = [below + one for below, one in zip(base, kilobytes, strict=True)]
    right.set_ylabel("kB, Cortex-M4F, float32")
    right.set_ylim(0, 60)
    right.legend(fontsize="small", loc="upper left", ncols=3)
    for axis in (left, right):
        axis.tick_params(axis="x", rotation=40)


def of_cost() -> list[str]:
    """Sentences below the figure."""
    lines = []
    sizes = results_of("sizes")
    for target, form in (
        ("Cortex-M4F (mps2-an386)", "weak, f32"),
        ("Cortex-M4F (mps2-an386)", "refined, f32"),
        ("Cortex-M0 (microbit)", "weak, q31"),
    ):
        (row,) = sizes.where(target=target, form=form)
        lines.append(
            f"- `kapitza`, {form}, {target.split(' ')[0]}: {row['mean']} instructions a tick, {row['longest']} in the "
            f"longest; bytes: {row['bss']} of state, {row['stack bound']} of stack, {row['text']} of code, "
            f"{row['tables']} of tables."
        )
    choices = results_of("build-choices")
    smallest = min(choices.where(), key=lambda row: int(row["text"]))
    lines.append(
        f"- Smallest build of the first stage: {smallest['text']} bytes of code, {smallest['mean']} instructions."
    )
    played = results_of("model-boards").column("bits")
    lines.append(
        f"- Bits: those of the PC in {played.count('equal')} of {len(played) - played.count('-')} rows of mechanisms "
        "on boards."
    )
    return lines


# ---- missing effects

CAMPAIGNS = ("missing-campaign-32", "missing-campaign-73", "missing-campaign-1313")


def draw_missing(figure: Figure) -> None:
    """The campaign: of recordings that are off and have a nameable cause, which were named."""
    axis = figure.subplots()
    table = results_of(CAMPAIGNS[0])
    rows = [row for row in table.where() if row["plant"] != "all"]
    plants = [row["plant"] for row in rows]
    right, wrong, named = (
        [int(row[key]) for row in rows] for key in ("named rightly", "named wrongly", "of these have a name")
    )
    off = [int(row["with a parameter more than 2 % off"]) for row in rows]
    warned = [max(0, many - ok - bad) for many, ok, bad in zip(named, right, wrong, strict=True)]
    rest = [many - ok - bad - other for many, ok, bad, other in zip(off, right, wrong, warned, strict=True)]
    base = [0] * len(rows)
    for heights, colour, label in (
        (right, REFINED, "named rightly"),
        (wrong, BAD, "named wrongly"),
        (warned, WEAK, "not named"),
        (rest, OTHER, "effect is not in the library"),
    ):
        axis.bar(plants, heights, bottom=base, color=colour, label=label)
        base = [below + one for below, one in zip(base, heights, strict=True)]
    axis.set_ylabel("recordings, a parameter > 2 % off")
    axis.set_ylim(0, 18)
    axis.legend(fontsize="small", ncols=2, loc="upper left")


def of_missing() -> list[str]:
    """Sentences below the figure."""
    sums = sums_of("missing-sum")
    effects, silent, without, off, right, wrong, clean, warned, inside = sums.values()
    lines = [
        f"- Table of effects: wrong without a warning are {silent} of {effects} recordings with an effect ({without} "
        f"without the model's part of the s.e.); warned are {warned} of {clean} without one. Named rightly are {right} "
        f"of {off} that are more than 2 % off, wrongly {wrong}. Two s.e. contain {inside} % of the parameters."
    ]
    for name in CAMPAIGNS:
        (row,) = results_of(name).where(plant="all")
        named, nameable = int(row["named rightly"]), int(row["of these have a name"])
        lines.append(
            f"- Campaign, seed {name.rpartition('-')[2]}: wrong without a warning are {row['wrong without a warning']} "
            f"of {row['recordings with effects']} with an effect; warned are {row['of these with a warning']} of "
            f"{row['recordings without an effect']} without one. Named rightly are {named} of {nameable} "
            f"({100 * named / nameable:.0f} %), wrongly {row['named wrongly']}."
        )
    return lines


# ---- robustness


def draw_robustness(figure: Figure) -> None:
    """Accidents of a recording: the largest error, and whether there is a warning."""
    axis = figure.subplots()
    table = results_of("accidents")
    kinds = _names(table.column("accident"))
    for name, marker in zip(_names(table.column("mechanism")), "os", strict=True):
        for warned, colour in ((False, WEAK), (True, BAD)):
            rows = [row for row in table.where(mechanism=name) if (row["warned"] != "0") == warned]
            at = [kinds.index(row["accident"]) for row in rows]
            label = f"{name}, {'with a warning' if warned else 'no warning'}"
            axis.plot(_numbers([row["largest, s.e."] for row in rows]), at, marker, color=colour, label=label)
    axis.axvline(4.0, color="k", linewidth=0.8)
    axis.set_yticks(range(len(kinds)), kinds)
    axis.invert_yaxis()
    axis.set_xlabel("largest error of a parameter, standard errors (wrong: beyond 4 without a warning)")
    axis.legend(fontsize="small", loc="center right")


def of_robustness() -> list[str]:
    """Sentences below the figure."""
    accidents, longevity = results_of("accidents"), results_of("longevity")
    link, api = sums_of("fuzz-link"), sums_of("fuzz-api")
    marked = sum("**" in cell or "NOT" in cell for row in longevity.rows for cell in row)
    return [
        f"- Accidents: {sum(map(int, accidents.column('wrong, no warning')))} wrong answers without a warning in "
        f"{len(accidents.rows)} rows of two runs.",
        f"- `bench fuzz-link`, {link['inputs']} inputs: {link['failures']} failures. `bench fuzz-api`, "
        f"{api['calls of step']} calls of `step`: no failure; {api['of these with an estimate published']} of "
        f"{api['runs of garbage with valid settings']} runs of garbage published an estimate.",
        f"- `bench longevity`: {len(longevity.rows)} rows of a million ticks, {marked} cells silently wrong or not "
        "finite.",
    ]


# ---- other tools


def _of_tools() -> list[tuple[str, list[dict[str, str]], list[dict[str, str]]]]:
    """Of each tool the rows as modelled and those with an effect more, where it could be had."""
    table = [row for row in results_of("peers").where() if not row["answered"].startswith("not")]
    parts = []
    for tool in _names([row["tool"] for row in table]):
        own = [row for row in table if row["tool"] == tool]
        parts.append((tool, [row for row in own if row["recording"] == "as modelled"],
                      [row for row in own if row["recording"] != "as modelled"]))  # fmt: skip
    return parts


def draw_peers(figure: Figure) -> None:
    """Worst error of each tool on each mechanism, and how often it reports an effect that the model lacks."""
    left, right = figure.subplots(1, 2, sharey=True)
    tools = [tool for tool, _, _ in _of_tools()]
    for number, name in enumerate(_names(results_of("peers").column("mechanism"))):
        found = [(_number(row["worst %"]), tool) for tool, clean, _ in _of_tools() for row in clean
                 if row["mechanism"] == name]  # fmt: skip
        left.plot(*zip(*found, strict=True), "o", color=f"C{number}", alpha=0.7, label=name)
    left.set_xscale("log")
    left.set_xlabel("worst error as modelled, %")
    left.legend(fontsize="small")
    right.barh(tools, [_share(lacking, "warned") for _, _, lacking in _of_tools()], color=WEAK)
    right.set_xlabel("runs in which a missing effect is reported, %")
    right.invert_yaxis()


def _share(rows: Sequence[dict[str, str]], name: str) -> float:
    return 100 * sum(int(row[name]) for row in rows) / max(sum(_runs(row) for row in rows), 1)


def _runs(row: dict[str, str]) -> int:
    return int(row["answered"].split(" of ")[1])


def _span(numbers: Sequence[float]) -> str:
    return " to ".join(dict.fromkeys(f"{one:.2g}" for one in (min(numbers), max(numbers))))


def of_peers() -> list[str]:
    """Sentences below the figure."""
    lines = []
    for tool, clean, lacking in _of_tools():
        middle, seconds = (_numbers([row[name] for row in clean]) for name in ("median %", "CPU s a run"))
        known = [(float(row["in 2 s.e. %"]), _runs(row)) for row in clean if row["in 2 s.e. %"] != "-"]
        share = _share(lacking, "warned")
        parts = [f"{_span(middle)} %, worst {max(_numbers([row['worst %'] for row in clean])):.2g} %"]
        parts += [f"coverage {sum(a * b for a, b in known) / sum(b for _, b in known):.0f} %"] if known else []
        parts += [f"reports {share:.0f} %"] if share else []
        lines.append(f"- {tool}: {'; '.join([*parts, f'{_span(seconds)} s'])}.")
    return lines


# ---- the page


@dataclass(frozen=True)
class Part:
    """A section of the page: its marker and picture's name, the tables it draws, how, the sentences, inches."""

    name: str
    tables: tuple[str, ...]
    draw: Callable[[Figure], None]
    sentences: Callable[[], list[str]]
    size: tuple[float, float] = (9.0, 4.2)

    @property
    def digest(self) -> str:
        """Of the tables that the picture shows."""
        shown = [(one.header, one.rows) for one in map(results_of, self.tables)]
        return hashlib.sha256(repr(shown).encode()).hexdigest()[:16]

    def picture(self) -> bytes:
        """As PNG, with the digest as its description."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=self.size, layout="constrained")
        self.draw(figure)
        for axis in figure.axes:
            axis.grid(alpha=0.3)
        stream = io.BytesIO()
        figure.savefig(stream, dpi=_DPI, format="png", metadata={"Description": self.digest})
        return stream.getvalue()


PARTS = (
    Part("accuracy", ("refine-mechanisms", "mechanisms-chosen"), draw_accuracy, of_accuracy),
    Part("cost", ("model-boards", "sizes-models"), draw_cost, of_cost),
    Part("missing", (CAMPAIGNS[0],), draw_missing, of_missing, (9.0, 3.4)),
    Part("robustness", ("accidents",), draw_robustness, of_robustness, (9.0, 4.6)),
    Part("peers", ("peers",), draw_peers, of_peers, (9.0, 3.6)),
)


def write_page(folder: Path = IMAGES, page: Path = PAGE) -> None:
    """Draws the pictures and writes the sentences of every section."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in PARTS:
        write_whole(folder / f"{part.name}.png", part.picture(), freely=True)
        write_whole(page, with_table(page, part.name, "\n".join(part.sentences())), freely=True)
