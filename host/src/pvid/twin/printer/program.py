"""From C sources to a Python module: printed once, then from the cache of builds.

    twin = printed_module([Path("gate_f32.c")], [FIRMWARE / "include", SRC], {})

`text_of` does not load it; `pvid.twin.printer.values` makes the structs of a printed module from those of cffi.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType

from pvid.core.sources import cache_folder, keep_text, kept_text
from pvid.twin.printer.directives import Reader
from pvid.twin.printer.translate import Translator

_ABOUT = "The numpy twin of a C core. Printed from C by pvid.twin.printer: do not edit."
_HEAD = '''"""{about}"""

from pvid.twin.printer.machine import (
    WHOLE, Array, Place, Pointer, assign_all, bits, clear, f32, fabsf, from_bits, quotient, remainder, share, signed,
    sqrtf, struct,
)

'''


def text_of(
    sources: Sequence[Path],
    folders: Sequence[Path],
    macros: Mapping[str, str],
    roots: Sequence[str] = (),
    texts: Mapping[str, str] | None = None,
    about: str = _ABOUT,
) -> str:
    """The printed module's text.

    Raises UntranslatedError at a construct without a translation, with its file and line.

    Parameters
    ----------
    sources : .c files
    folders : of their headers
    macros : name -> value, as with -D
    roots : functions and tables that are wanted, with all that they need; empty: all
    texts : name -> text of generated files; those that end with .c are sources as well
    about : the module's docstring
    """
    return _printed(sources, folders, macros, roots, texts, about)[0]


def printed_module(
    sources: Sequence[Path],
    folders: Sequence[Path],
    macros: Mapping[str, str],
    roots: Sequence[str] = (),
    texts: Mapping[str, str] | None = None,
) -> ModuleType:
    """The printed module, loaded; as `text_of`."""
    return loaded(*_printed(sources, folders, macros, roots, texts, _ABOUT))


def _printed(
    sources: Sequence[Path],
    folders: Sequence[Path],
    macros: Mapping[str, str],
    roots: Sequence[str],
    texts: Mapping[str, str] | None,
    about: str,
) -> tuple[str, str]:
    """The text of a module, and its place in the cache of builds, where it stays."""
    made_from = repr((_PRINTER, about, sorted(macros.items()), list(roots), sorted((texts or {}).items())))
    key = _hash_of(sources, folders, made_from)
    place = cache_folder() / "twins" / f"{key[:24]}.py"
    text = kept_text(place)
    if not text:
        reader = Reader(folders, macros, texts)
        for one in [*sources, *(Path(name) for name in texts or () if name.endswith(".c"))]:
            reader.read(one)
        unit = Translator(reader.unit, [reader.renamed(one) for one in roots])
        text = _HEAD.format(about=about) + unit.printed()
        if _hash_of(sources, folders, made_from) == key:  # nobody has edited them meanwhile
            keep_text(place, text)
    return text, str(place)


def _hash_of(sources: Iterable[Path], folders: Iterable[Path], more: str) -> str:
    whole = hashlib.sha256(more.encode())
    for one in [*sources, *(one for folder in folders for one in sorted(folder.glob("**/*.h")))]:
        whole.update(one.name.encode() + b"\0" + one.read_bytes())
    return whole.hexdigest()


_PRINTER = _hash_of(sorted(Path(__file__).parent.glob("*.py")), [], "")  # as this process has it


@cache
def loaded(text: str, place: str) -> ModuleType:
    """A printed module from its text. Constants f32(...) are made once, not where they stand."""
    tree = _Hoisted().made(ast.parse(text, place))
    module = ModuleType("pvid_printed_twin")
    module.__file__ = place
    exec(compile(tree, place, "exec"), vars(module))
    return module


class _Hoisted(ast.NodeTransformer):
    """Replaces each f32(number) within a function by a name of the module."""

    def __init__(self) -> None:
        self._names: dict[str, str] = {}
        self._within = 0

    def made(self, tree: ast.Module) -> ast.Module:
        self.visit(tree)
        lines = "".join(f"{name} = {code}\n" for code, name in self._names.items())
        tree.body += ast.parse(lines).body
        return ast.fix_missing_locations(tree)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        self._within += 1
        self.generic_visit(node)
        self._within -= 1
        return node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        plain = isinstance(node.func, ast.Name) and node.func.id == "f32" and len(node.args) == 1
        if (
            self._within
            and plain
            and all(
                isinstance(one, (ast.Constant, ast.UnaryOp, ast.USub)) or not isinstance(one, ast.expr)
                for one in ast.walk(node.args[0])
                if not isinstance(one, ast.Load)
            )
        ):
            code = ast.unparse(node)
            name = self._names.setdefault(code, f"_f32_{len(self._names)}")
            return ast.copy_location(ast.Name(name, ast.Load()), node)
        return node
