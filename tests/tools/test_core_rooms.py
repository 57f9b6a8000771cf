"""The core's files depend on one another one way only: no circles, and no room uses one above it."""

import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from pvid.core.sources import INCLUDES, SRC, core_sources

# Each room may use itself and those before it; the forms do not use each other.
ROOMS = ("number", "solve", "judge", "strong", "weak", "robot", "refine", "excite", "persist")
FORMS = ("strong", "weak", "robot", "refine")
STRANGERS = {(a, b) for a in FORMS for b in FORMS if a != b}

Graph = dict[str, set[str]]


def node(path: Path) -> str:
    """Room and stem: a source and its header are one."""
    return f"{path.parent.name}/{path.stem}"


def room(name: str) -> str:
    return name.partition("/")[0]


@pytest.fixture(scope="module")
def uses(tmp_path_factory: pytest.TempPathFactory) -> Graph:
    """Which files each file uses: by the symbols of its object, and by its includes."""
    folder = tmp_path_factory.mktemp("objects")
    sources = core_sources()

    def compiled(source: Path) -> str:
        target = folder / f"{source.stem}.o"
        command = ["gcc", "-std=c99", "-O0", *INCLUDES, "-c", str(source), "-o", str(target)]
        subprocess.run(command, check=True)
        return subprocess.run(["nm", str(target)], capture_output=True, text=True, check=True).stdout

    with ThreadPoolExecutor(2) as pool:
        listings = list(pool.map(compiled, sources))
    defined: dict[str, str] = {}
    for source, listing in zip(sources, listings, strict=True):
        defined |= dict.fromkeys(re.findall(r" [TDRB] (\w+)$", listing, re.MULTILINE), node(source))
    graph: Graph = {node(path): set() for path in SRC.glob("*/*.[ch]")}
    for source, listing in zip(sources, listings, strict=True):
        wanted = re.findall(r" U (\w+)$", listing, re.MULTILINE)
        graph[node(source)] |= {defined[name] for name in wanted if name in defined}
    for path in SRC.glob("*/*.[ch]"):
        graph[node(path)] |= set(
            re.findall(r'^#include "(?!pvid/|refine_model)(.*)\.h"$', path.read_text(encoding="utf-8"), re.MULTILINE)
        )
    return {name: used - {name} for name, used in graph.items()}


def circles(graph: Graph) -> list[list[str]]:
    """Files that use themselves by way of others, each with those on the way."""
    reached: Graph = {}
    for start in graph:
        ahead, seen = list(graph[start]), set()
        while ahead:
            if (one := ahead.pop()) not in seen:
                seen.add(one)
                ahead += graph[one]
        reached[start] = seen
    return [sorted(one for one in reached[name] if name in reached[one]) for name in graph if name in reached[name]]


def test_files_form_no_circle(uses: Graph) -> None:
    assert len(uses) > 50 and "solve/staged_f32" in uses["weak/weak_finish_f32"]
    assert circles(uses) == []


def test_rooms_depend_one_way(uses: Graph) -> None:
    against = {
        (name, one)
        for name, used in uses.items()
        for one in used
        if ROOMS.index(room(one)) > ROOMS.index(room(name)) or (room(name), room(one)) in STRANGERS
    }
    assert against == set()


def test_estimator_contains_nothing_of_the_mechanism() -> None:
    for path in SRC.glob("solve/*.[ch]"):
        assert "kapitza" not in path.read_text(encoding="utf-8").lower(), path.name


def test_step_and_assessment_are_pure() -> None:
    """They take normal equations and settings alone: no estimator, no model, no counter, no memory of their own."""
    for path in [*SRC.glob("solve/step_*.[ch]"), *SRC.glob("solve/assess_*.[ch]")]:
        text = path.read_text(encoding="utf-8")
        found = re.findall(
            r"pvid_estimator_\w+|pvid_model_\w+|pvid_counters|pvid_count_\w+|^static (?!inline)\w+ \w+ =", text, re.M
        )
        assert found == [], path.name


def test_a_circle_is_found() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == [["b", "c"], ["b", "c"]]
