"""Where the sources tell the identifiers apart: by form (weak, strong) or core (f32, q31, f64).

pvid.cases is the place for it. Elsewhere few conditions may be left.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from conftest import ROOT

LIMIT = 20
HOME = "host/src/pvid/cases.py"

NAMES = {"weak", "strong", "f32", "q31", "f64"}
MEMBERS = {(owner, name) for owner, names in (("Form", ("WEAK", "STRONG")), ("Core", ("F32", "Q31"))) for name in names}
# Types of which there is one for each form or core, by the names that they have and that they had.
OWN = re.compile(
    r"(?:(?:Weak|Strong|Fixed|Float)(?:Config|Twin|Identifier|Settings|Arithmetic|Tables)?"
    r"|ConfigQ31|Configure|Estimate|Estimator|\w+)Q31|(?:Weak|Strong|Fixed|Float)(?:Config|Twin|Identifier)"
)
MACROS = re.compile(r"^\s*#\s*(?:el)?if.*\b(?:STREAM|REPLAY)_(?:FORM|CORE|Q31|WEAK)\b|\bif\(.*PVID_STREAM_CORE")


def _is_name(node: ast.expr) -> bool:
    """Whether it is a form or core: "weak", Form.WEAK, or a tuple or list of them."""
    if isinstance(node, ast.Constant):
        return node.value in NAMES
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return (node.value.id, node.attr) in MEMBERS
    return isinstance(node, ast.Tuple | ast.List | ast.Set) and any(map(_is_name, node.elts))


def _types(node: ast.expr) -> Iterator[str]:
    for part in ast.walk(node):
        if isinstance(part, ast.Name):
            yield part.id
        elif isinstance(part, ast.Attribute):
            yield part.attr


def _is_condition(node: ast.AST) -> bool:
    match node:
        case ast.Compare():
            sides = [node.left, *node.comparators]
            fixed = any(isinstance(side, ast.Attribute) and side.attr == "fixed" for side in sides)
            return any(map(_is_name, sides)) or fixed
        case ast.Call(func=ast.Name(id="isinstance"), args=[_, kinds]):
            return any(OWN.fullmatch(name) for name in _types(kinds))
        case ast.match_case():
            kinds = [part.cls for part in ast.walk(node.pattern) if isinstance(part, ast.MatchClass)]
            values = [part.value for part in ast.walk(node.pattern) if isinstance(part, ast.MatchValue)]
            return any(OWN.fullmatch(name) for kind in kinds for name in _types(kind)) or any(map(_is_name, values))
        case ast.Dict():
            return sum(key is not None and _is_name(key) for key in node.keys) >= 2
        case ast.IfExp() | ast.If():
            return isinstance(node.test, ast.Attribute) and node.test.attr.lstrip("_") == "fixed"
    return False


def conditions() -> list[str]:
    """file:line of every condition on form or core outside their home: Python, C and CMake."""
    found = []
    for path in sorted((ROOT / "host" / "src" / "pvid").rglob("*.py")):
        place = path.relative_to(ROOT).as_posix()
        if place != HOME:
            tree = ast.parse(path.read_text(encoding="utf-8"))
            lines = [getattr(node, "lineno", 0) or node.pattern.lineno for node in ast.walk(tree) if _is_condition(node)]  # type: ignore[attr-defined]
            found += [f"{place}:{line}" for line in sorted(lines)]
    for suffix in ("*.c", "*.h", "*.txt", "*.cmake"):
        for path in sorted((ROOT / "firmware").rglob(suffix)):
            found += _lines_of(path)
    return found


def _lines_of(path: Path) -> list[str]:
    lines = path.read_text(encoding="utf-8").splitlines()
    place = path.relative_to(ROOT).as_posix()
    return [f"{place}:{number}" for number, line in enumerate(lines, 1) if MACROS.search(line)]


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
    )
    for shape in shapes:
        assert any(map(_is_condition, ast.walk(ast.parse(shape)))), shape
    assert not any(map(_is_condition, ast.walk(ast.parse('print(case.form, "weak")'))))
