"""Plots of a mechanism's samples and estimates as a layout file for PlotJuggler or Foxglove.

The plots are of the fields that pvid.log.export writes as MCAP and, for PlotJuggler, that pvid.log.live_stream sends.

PlotJuggler, as its program reads and writes a layout (plotjuggler_app of github.com/facontidavide/PlotJuggler:
tabbedplotwidget.cpp, plot_docker.cpp, plotwidget.cpp): root, tabbed_widget, Tab, Container, DockSplitter with as many
`sizes` as its `count`, DockArea, plot, curve; a curve is called TOPIC/FIELD, of MCAP and of JSON by UDP alike.

Foxglove, as a layout is exported by it (LayoutData of the open source studio): `configById` has the settings of each
panel by an id TYPE!NAME, `layout` is a tree of ids and of splits with direction, first, second and splitPercentage; a
plotted path is TOPIC.FIELD.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any
from xml.etree import ElementTree

from pvid.log.mechanism import LogMechanism
from pvid.log.values import tables_of

COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#ff7f0e", "#9467bd", "#17becf", "#8c564b", "#e377c2")


@dataclass(frozen=True)
class Plot:
    """A field of a table, with a title and a colour."""

    title: str
    table: str
    field: str
    colour: str


def plots_of(mechanism: LogMechanism) -> dict[str, list[Plot]]:
    """The plots by the title of their page."""
    estimated = [one.name for one in mechanism.answers]
    pages = {
        "samples": ("samples", [one.name for one in mechanism.samples]),
        "estimates": ("estimates", estimated),
        "standard errors": ("estimates", [f"{name}_se" for name in estimated]),
        "quality": ("estimates", ["kappa", "residual", "updates"]),
    }
    tables = tables_of(mechanism)

    def plots(table: str, names: Sequence[str]) -> list[Plot]:
        units = [tables[table][name].unit for name in names]
        titles = [name if unit == "1" else f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
        drawn = zip(titles, names, cycle(COLOURS), strict=False)
        return [Plot(title, table, name, colour) for title, name, colour in drawn]

    return {title: plots(*page) for title, page in pages.items()}


def plotjuggler(mechanism: LogMechanism) -> str:
    """XML: a tab for each page, its plots in one or two columns."""
    root = ElementTree.Element("root")
    tabs = ElementTree.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    for title, plots in plots_of(mechanism).items():
        tab = ElementTree.SubElement(tabs, "Tab", tab_name=title, containers="1")
        container = ElementTree.SubElement(tab, "Container")
        columns = _columns(plots)
        across = _splitter(container, "|", len(columns))
        for column in columns:
            down = _splitter(across, "-", len(column))
            for plot in column:
                _dock_area(down, plot)
    ElementTree.SubElement(tabs, "currentTabIndex", index="1")
    ElementTree.SubElement(root, "use_relative_time_offset", enabled="1")
    ElementTree.indent(root, " ")
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{ElementTree.tostring(root, encoding='unicode')}\n"


def _columns(plots: Sequence[Plot]) -> list[Sequence[Plot]]:
    """One up to four plots, else two."""
    half = len(plots) if len(plots) <= 4 else (len(plots) + 1) // 2
    return [part for part in (plots[:half], plots[half:]) if part]


def _splitter(parent: ElementTree.Element, orientation: str, count: int) -> ElementTree.Element:
    sizes = ";".join([f"{1 / count:.6g}"] * count)
    return ElementTree.SubElement(parent, "DockSplitter", orientation=orientation, count=str(count), sizes=sizes)


def _dock_area(parent: ElementTree.Element, plot: Plot) -> None:
    area = ElementTree.SubElement(parent, "DockArea", name=plot.title)
    style = "Lines" if plot.table == "samples" else "LinesAndDots"
    drawn = ElementTree.SubElement(area, "plot", mode="TimeSeries", style=style, flip_x="false", flip_y="false")
    ElementTree.SubElement(drawn, "limitY")
    ElementTree.SubElement(drawn, "curve", name=f"/{plot.table}/{plot.field}", color=plot.colour)


def foxglove(mechanism: LogMechanism) -> str:
    """JSON: one panel with a tab for each page, its plots in one or two columns."""
    panels: dict[str, Any] = {}
    tabs = []
    for title, plots in plots_of(mechanism).items():
        ids = []
        for plot in plots:
            ids.append(f"Plot!{plot.table}-{plot.field}")
            panels[ids[-1]] = _panel(plot)
        middle = len(_columns(plots)[0])
        columns = [_tree(part, "column") for part in (ids[:middle], ids[middle:]) if part]
        tabs.append({"title": title, "layout": _tree(columns, "row")})
    panels["Tab!pvid"] = {"activeTabIdx": 1, "tabs": tabs}
    made = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": "Tab!pvid",
    }
    return json.dumps(made, indent=1) + "\n"


def _panel(plot: Plot) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": plot.title,
        "paths": [
            {
                "value": f"/{plot.table}.{plot.field}",
                "label": plot.field,
                "enabled": True,
                "timestampMethod": "receiveTime",
                "color": plot.colour,
            }
        ],
        "xAxisVal": "timestamp",
        "isSynced": True,
        "showLegend": False,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
    }


def _tree(nodes: Sequence[Any], direction: str) -> Any:
    """Splits of equal parts: a tree has two branches at each split."""
    first, *rest = nodes
    if not rest:
        return first
    share = 100 / len(nodes)
    return {"direction": direction, "first": first, "second": _tree(rest, direction), "splitPercentage": share}


LAYOUTS: Mapping[str, Callable[[LogMechanism], str]] = {"plotjuggler": plotjuggler, "foxglove": foxglove}
