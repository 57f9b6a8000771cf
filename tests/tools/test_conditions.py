"""Where the sources tell the identifiers apart: by form (weak, strong) or core (f32, q31, f64).

The door of the printed twin is the place for it. Elsewhere few conditions may be left.
"""

import ast
import re
from collections.abc import Iterator
from typing import Any

from conftest import ROOT

LIMIT = 22
HOMES = ("host/src/pvid/twin/printed.py",)

NAMES = {"weak", "strong", "f32", "q31", "f64"}
MEMBERS = {("Form", "WEAK"), ("Form", "STRONG"), ("Core", "F32"), ("Core", "Q31")}
# Types of which there is one for each form or core.
OWN = re.compile(r"(?:Weak|Strong|Fixed|Float)(?:Config|Twin|Identifier)(?:Q31)?|ConfigQ31|EstimatorQ31")
PAIRS = (("Configure", "ConfigureQ31"), ("Estimate", "EstimateQ31"), ("Sample", "Count"), ("Raw", "RawCount"))
MACROS = re.compile(
    r"^\s*#\s*(?:el)?if.*\b(?:STREAM|REPLAY)_(?:FORM|CORE|Q31|WEAK|IS_FLOAT)\b|\bif\(.*PVID_STREAM_CORE"
)


def _is_name(node: ast.AST) -> bool:
    """Whether it is a form or core: "weak", Form.WEAK, or a tuple or list of them."""
    match node:
        case ast.Constant():
            return node.value in NAMES
        case ast.Attribute(value=ast.Name(id=owner), attr=name):
            return (owner, name) in MEMBERS
        case ast.Tuple() | ast.List() | ast.Set():
            return any(map(_is_name, node.elts))
    return False


def _types(node: ast.AST) -> set[str]:
    """Names of the types in an expression."""
    names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
    return names | {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}


def _siblings(name: str) -> Iterator[str]:
    """The types of the other core and of the other form."""
    for pair in PAIRS:
        if name in pair:
            yield pair[1 - pair.index(name)]
            return
    if OWN.fullmatch(name):
        yield name.removesuffix("Q31") if name.endswith("Q31") else f"{name}Q31"
        yield name.replace("Weak", "Strong") if "Weak" in name else name.replace("Strong", "Weak")


def _tells_apart(names: set[str]) -> bool:
    return any(sibling not in names for name in names for sibling in _siblings(name))


def _is_condition(node: ast.AST) -> bool:
    match node:
        case ast.Compare():
            sides = [node.left, *node.comparators]
            return any(_is_name(side) or (isinstance(side, ast.Attribute) and side.attr == "fixed") for side in sides)
        case ast.Call(func=ast.Name(id="isinstance"), args=[_, kinds]):
            return _tells_apart(_types(kinds))
        case ast.match_case():
            classes = [part.cls for part in ast.walk(node.pattern) if isinstance(part, ast.MatchClass)]
            values = [part.value for part in ast.walk(node.pattern) if isinstance(part, ast.MatchValue)]
            return _tells_apart(set[str]().union(*map(_types, classes))) or any(map(_is_name, values))
        case ast.Dict():
            return sum(key is not None and _is_name(key) for key in node.keys) >= 2
        case ast.IfExp() | ast.If():
            return isinstance(node.test, ast.Attribute) and node.test.attr.lstrip("_") == "fixed"
    return False


def _line(node: Any) -> int:
    return int(node.pattern.lineno if isinstance(node, ast.match_case) else node.lineno)


def conditions() -> list[str]:
    """file:line of every condition on form or core outside their home: Python, C and CMake."""
    found = []
    for path in sorted((ROOT / "host" / "src" / "pvid").rglob("*.py")):
        place = path.relative_to(ROOT).as_posix()
        if place not in HOMES:
            nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            found += [f"{place}:{line}" for line in sorted(_line(node) for node in nodes if _is_condition(node))]
    for suffix in ("*.c", "*.h", "*.txt", "*.cmake"):
        for path in sorted((ROOT / "firmware").rglob(suffix)):
            lines = path.read_text(encoding="utf-8").splitlines()
            place = path.relative_to(ROOT).as_posix()
            found += [f"{place}:{number}" for number, line in enumerate(lines, 1) if MACROS.search(line)]
    return found


def test_few_conditions_on_form_or_core_are_left_outside_the_cases() -> None:
    found = conditions()
    assert len(found) <= LIMIT, "\n".join(found)


def test_a_condition_is_found_in_each_of_its_shapes() -> None:
    shapes = (
        'x = a if core == "q31" else b',
        'y = form in ("weak", "strong")',
        "z = isinstance(config, WeakConfigQ31)",
        'table = {"weak": 1, "strong": 2}',
        "if core is Core.Q31: pass",
        "match twin:\n    case StrongTwin(): pass",
        "fixed = isinstance(item, EstimateQ31)",
    )
    for shape in shapes:
        assert any(map(_is_condition, ast.walk(ast.parse(shape)))), shape
    for shape in ('print(case.form, "weak")', "isinstance(item, Estimate | EstimateQ31)"):
        assert not any(map(_is_condition, ast.walk(ast.parse(shape)))), shape
