"""`pvid bench long`: the long forms of the tests, of which `./tools/test` runs the short ones."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections import defaultdict
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

from bench.case import Advance, Report
from pvid.base.errors import PvidError
from pvid.core.sources import ROOT

HEADER = ("room", "claim", "cases", "ticks", "result")


def long_table(only: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Runs the tests that have a long form; a row for each, as in HEADER.

    Parameters
    ----------
    only
        Rooms: folders of tests/. Default: all.

    Raises
    ------
    PvidError
        When pytest is missing, a room is unknown, or pytest stops before its end.
    """
    if find_spec("pytest") is None:
        raise PvidError("pytest is not installed: run ./tools/test once, for instance ./tools/test tests/base")
    rooms = [ROOT / "tests" / room for room in only] or [ROOT / "tests"]
    if unknown := [room.name for room in rooms if not room.is_dir()]:
        raise PvidError(f"there is no folder tests/{unknown[0]}")
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        command = [sys.executable, "-P", "-m", "pytest", "-c", "host/pyproject.toml", "--rootdir=.", "--long", "-q"]
        command += ["-m", "long or ticks", "-n", "2", "--dist", "loadfile", f"--junit-xml={report}"]
        done = subprocess.run([*command, *map(str, rooms)], cwd=ROOT, stdout=sys.stderr, check=False)
        if done.returncode not in (0, 1) or not report.exists():
            raise PvidError(f"pytest ended with code {done.returncode}")
        return _rows(ElementTree.parse(report).getroot())


def _rows(report: ElementTree.Element) -> list[tuple[str, ...]]:
    cases: dict[tuple[str, str], list[ElementTree.Element]] = defaultdict(list)
    for case in report.iter("testcase"):
        room = case.get("classname", "").split(".")[1]
        cases[room, case.get("name", "").partition("[")[0]].append(case)
    rows: list[tuple[str, ...]] = []
    for (room, name), of_it in sorted(cases.items()):
        ticks = {one.get("value", "") for case in of_it for one in case.iter("property") if one.get("name") == "ticks"}
        failed = sum(case.find("failure") is not None or case.find("error") is not None for case in of_it)
        claim = name.removeprefix("test_").replace("_", " ")
        result = f"{failed} failed" if failed else "passed"
        rows.append((room, claim, str(len(of_it)), ", ".join(sorted(ticks, key=int)), result))
    return rows


def report(only: tuple[str, ...], advance: Advance) -> Report:
    """See bench.case."""
    rows = long_table(only)
    return Report([("long", HEADER, rows)], [f"{row[0]}: {row[1]}: {row[-1]}" for row in rows if row[-1] != "passed"])
