"""Layout files: every plotted field is one that the exporter and the tee write, in the structure the programs read."""

import json
import re
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import field_board
import pytest
from click.testing import CliRunner
from logs import log_of
from mcap.reader import make_reader

from pvid.cli.main import commands
from pvid.core.native import Native
from pvid.log.export import export_log
from pvid.log.layout import LAYOUTS
from pvid.log.live_stream import live_stream
from pvid.log.mechanism import UNNAMED, LogMechanism, mechanism_named
from pvid.log.reader import LogStream

PENDULUM = field_board.mechanism()
MOTOR = b"motor\nsample V V\nsample i A\nsample phi rad\np R ohm\np L H\np k N*m/A\np J kg*m^2\np i0"
MECHANISMS = [PENDULUM, UNNAMED, mechanism_named(MOTOR)]


@pytest.fixture(scope="module")
def frames(native: Native) -> list[bytes]:
    """Of a run of 4 s, with estimates."""
    return list(field_board.frames(list(field_board.messages(field_board.Field(4000)))))


@pytest.fixture(scope="module")
def log(frames: list[bytes], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "field.pvlog"
    return log_of(path, b"".join(frames), rig=field_board.text())


def fields_of_mcap(path: Path) -> set[tuple[str, str]]:
    """(topic, field) that a message of the file has with a number."""
    with path.open("rb") as file:
        return {
            (channel.topic, name)
            for _, channel, message in make_reader(file).iter_messages()
            for name, value in json.loads(message.data).items()
            if isinstance(value, int | float)
        }


def curves(text: str) -> list[str]:
    return [one.attrib["name"] for one in ElementTree.fromstring(text).iter("curve")]


def paths(text: str) -> list[str]:
    panels = json.loads(text)["configById"].values()
    return [path["value"] for panel in panels for path in panel.get("paths", [])]


@pytest.fixture(scope="module")
def written(log: Path) -> set[tuple[str, str]]:
    (path,) = export_log(log, "mcap", log.with_suffix(""), PENDULUM)
    return fields_of_mcap(path)


# Where a row is, which no plot shows.
NOT_PLOTTED = {"t", "tick", "segment", "run"}


def test_the_plots_are_all_fields_of_samples_and_estimates_that_the_exporter_writes(
    written: set[tuple[str, str]],
) -> None:
    """A field that is not there makes PlotJuggler warn, and an empty plot."""
    worth = {one for one in written if one[0] in ("/samples", "/estimates") and one[1] not in NOT_PLOTTED}
    assert {("/samples", "phi"), ("/estimates", "g"), ("/estimates", "g_se"), ("/estimates", "kappa")} <= worth
    drawn = curves(LAYOUTS["plotjuggler"](PENDULUM))
    assert sorted(drawn) == sorted(f"{topic}/{name}" for topic, name in worth)
    assert sorted(paths(LAYOUTS["foxglove"](PENDULUM))) == sorted(f"{topic}.{name}" for topic, name in worth)


def test_plotjuggler_finds_the_same_names_in_what_the_tee_sends(frames: list[bytes]) -> None:
    """Its JSON parser names a number by the keys on the way to it, with "/" before each."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(0)
        tee, stream, names = live_stream(f"udp://127.0.0.1:{listener.getsockname()[1]}", PENDULUM), LogStream(), set()
        for record in stream.feed(b"".join(frames)):
            tee.take(record, stream.account)
            try:
                while True:
                    names |= set(named(json.loads(listener.recv(1 << 16))))
            except BlockingIOError:
                pass
        tee.close(stream.account)
    assert set(curves(LAYOUTS["plotjuggler"](PENDULUM))) <= names


def named(content: Any, prefix: str = "") -> Iterator[str]:
    if isinstance(content, dict):
        for key, value in content.items():
            yield from named(value, f"{prefix}/{key}")
    else:
        yield prefix


@pytest.mark.parametrize("mechanism", MECHANISMS)
def test_plotjuggler_can_restore_the_layout(mechanism: LogMechanism) -> None:
    """As plot_docker.cpp and plotwidget.cpp read it: a splitter has `count` sizes and children."""
    text = LAYOUTS["plotjuggler"](mechanism)
    assert text.startswith("<?xml version='1.0' encoding='UTF-8'?>\n<root>")
    root = ElementTree.fromstring(text)
    (tabs,) = root.findall("tabbed_widget")
    assert tabs.attrib == {"name": "Main Window", "parent": "main_window"}
    pages = tabs.findall("Tab")
    assert [one.attrib["tab_name"] for one in pages] == ["samples", "estimates", "standard errors", "quality"]
    current = tabs.find("currentTabIndex")
    assert current is not None and 0 <= int(current.attrib["index"]) < len(pages)
    for page in pages:
        assert page.attrib["containers"] == "1" and [one.tag for one in page] == ["Container"]
        assert [one.tag for one in page[0]] == ["DockSplitter"]
    splitters = list(root.iter("DockSplitter"))
    for one in splitters:
        sizes = [float(size) for size in one.attrib["sizes"].split(";")]
        assert one.attrib["orientation"] in ("|", "-")
        assert int(one.attrib["count"]) == len(sizes) == len(one) > 0
        assert sum(sizes) == pytest.approx(1, abs=1e-4)
        assert {child.tag for child in one} <= {"DockSplitter", "DockArea"}
    for area in root.iter("DockArea"):
        (plot,) = area
        assert plot.tag == "plot" and plot.attrib["mode"] == "TimeSeries"
        assert plot.attrib["style"] in ("Lines", "Dots", "LinesAndDots", "Sticks", "Steps", "StepsInv")
        assert {plot.attrib["flip_x"], plot.attrib["flip_y"]} <= {"true", "false"}
        assert [one.tag for one in plot] == ["limitY", "curve"]
        assert re.fullmatch("#[0-9a-f]{6}", plot[1].attrib["color"])
    drawn = curves(text)
    assert len(set(drawn)) == len(drawn) > 0


def leaves(node: Any) -> Iterator[str]:
    """Panels of a tree of splits (react-mosaic's MosaicNode)."""
    if isinstance(node, str):
        yield node
        return
    assert set(node) == {"direction", "first", "second", "splitPercentage"}
    assert node["direction"] in ("row", "column") and 0 < node["splitPercentage"] < 100
    yield from leaves(node["first"])
    yield from leaves(node["second"])


@pytest.mark.parametrize("mechanism", MECHANISMS)
def test_foxglove_can_import_the_layout(mechanism: LogMechanism) -> None:
    """Its LayoutData: every panel of the tree has its settings, and every panel with settings is in the tree."""
    layout = json.loads(LAYOUTS["foxglove"](mechanism))
    assert set(layout) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    panels = layout["configById"]
    shown = list(leaves(layout["layout"]))
    for panel in shown:
        for tab in panels[panel].get("tabs", []):
            shown.extend(leaves(tab["layout"]))
    assert sorted(shown) == sorted(panels) and len(set(shown)) == len(shown)
    assert 0 <= panels["Tab!pvid"]["activeTabIdx"] < len(panels["Tab!pvid"]["tabs"]) == 4
    for name, panel in panels.items():
        assert re.fullmatch(r"(Plot|Tab)![A-Za-z0-9_-]+", name)
        for path in panel.get("paths", []):
            assert re.fullmatch(r"/(samples|estimates)\.[A-Za-z_][A-Za-z0-9_]*", path["value"])
            assert path["enabled"] is True and path["timestampMethod"] == "receiveTime"
        if name.startswith("Plot!"):
            assert panel["xAxisVal"] == "timestamp" and len(panel["paths"]) == 1 and panel["foxglovePanelTitle"]


def test_without_a_rigs_constants_no_output_is_plotted() -> None:
    assert "/estimates/g" in curves(LAYOUTS["plotjuggler"](PENDULUM))
    assert "/estimates/g" not in curves(LAYOUTS["plotjuggler"](UNNAMED))
    motor = paths(LAYOUTS["foxglove"](mechanism_named(MOTOR)))
    assert {"/samples.V", "/estimates.R", "/estimates.R_se", "/estimates.i0"} <= set(motor)


@pytest.mark.parametrize("program", LAYOUTS)
def test_the_command_writes_what_it_prints(program: str, log: Path, tmp_path: Path) -> None:
    def said(*arguments: str) -> str:
        command = ["layout", str(log), "--for", program, *arguments]
        return CliRunner().invoke(commands, command, standalone_mode=False, catch_exceptions=False).stdout

    path = tmp_path / "layout"
    printed = said()
    assert printed == LAYOUTS[program](PENDULUM)
    assert said("-o", str(path)).strip() == str(path) and path.read_text(encoding="utf-8") == printed
