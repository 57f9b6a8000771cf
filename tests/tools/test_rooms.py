"""The packages of host/src/pvid stand in one order and import leftwards only; no circle of files."""

import ast
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from conftest import ROOT

SOURCE = ROOT / "host" / "src"

# Each imports from itself and from those before it.
ORDER = """
base settings model models core rig sim design oracle twin codegen link configuration compare
deploy board log identification show api fleet cli
""".split()

# Names of the pendulum's parameters stand in its own rooms only: what shows, stores or sends them asks the model.
PENDULUMS = ("models/kapitza", "oracle", "sim", "models/two_link_arm")  # the arm has a c1 and a c2
# The options of version 0.1 that the command line names.
MAY_NAME = ("cli/main.py",)
NAMES = {"d1", "d2", "c1", "c2", "l2", "rho2"}

Graph = Mapping[str, set[str]]


def module_of(path: Path, source: Path) -> str:
    """pvid.log.reader of .../pvid/log/reader.py; a package is its __init__.py."""
    name = ".".join(path.relative_to(source).with_suffix("").parts)
    return name.removesuffix(".__init__")


def imported(path: Path, modules: set[str]) -> Iterator[str]:
    """The modules among `modules` that a file imports anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: imports are absolute"
            for name in node.names:
                inner = f"{node.module}.{name.name}"
                yield from {inner if inner in modules else node.module} & modules
        elif isinstance(node, ast.Import):
            yield from {name.name for name in node.names} & modules


def graph_of(source: Path) -> dict[str, set[str]]:
    """What each module imports."""
    files = {module_of(path, source): path for path in source.rglob("*.py")}
    return {module: set(imported(path, set(files))) - {module} for module, path in files.items()}


def room_of(module: str) -> str:
    """log of pvid.log.reader; "" of pvid itself."""
    return "".join(module.split(".")[1:2])


def upward(graph: Graph, order: list[str]) -> list[str]:
    """Imports from a package on the right."""
    return [
        f"{module} imports {other}"
        for module, others in graph.items()
        for other in others
        if room_of(module) in order and room_of(other) and order.index(room_of(other)) > order.index(room_of(module))
    ]


def circle(graph: Graph) -> set[str]:
    """Modules that import one another in a circle; none: there is no circle."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return set(error.args[1])
    return set()


@pytest.fixture(scope="module")
def graph() -> dict[str, set[str]]:
    return graph_of(SOURCE)


def test_every_package_has_a_place_in_the_order(graph: Graph) -> None:
    rooms = {room_of(module) for module in graph} - {"", "__main__"}
    assert rooms == set(ORDER)


def test_imports_go_left_only(graph: Graph) -> None:
    assert upward(graph, ORDER) == []


def test_no_circle_of_files(graph: Graph) -> None:
    assert circle(graph) == set()


def test_names_of_the_pendulums_parameters_stand_in_its_own_rooms() -> None:
    """Fails where a quoted name is written a second time, beside the model."""
    package = SOURCE / "pvid"
    for path in sorted(package.rglob("*.py")):
        place = path.relative_to(package).as_posix()
        if place.startswith(PENDULUMS) or place in MAY_NAME:
            continue
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        quoted = {str(node.value) for node in nodes if isinstance(node, ast.Constant) and node.value in NAMES}
        assert not quoted, f"{place} names {sorted(quoted)}: pvid.models contains them"


@pytest.fixture
def planted(tmp_path: Path) -> Path:
    """A package of two rooms, of which the left one imports from the right one, and two files each other."""
    for name, text in {
        "base/one.py": "def late() -> None:\n    from pvid.log import two\n",
        "base/__init__.py": "",
        "log/__init__.py": "",
        "log/two.py": "import pvid.log.three\n",
        "log/three.py": "from pvid.log.two import x\n",
        "__init__.py": "",
    }.items():
        path = tmp_path / "pvid" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return tmp_path


def test_a_planted_import_to_the_right_and_a_circle_are_found(planted: Path) -> None:
    graph = graph_of(planted)
    assert upward(graph, ["base", "log"]) == ["pvid.base.one imports pvid.log.two"]
    assert circle(graph) == {"pvid.log.two", "pvid.log.three"}
