"""The syntax tree of a unit of C, and what a part of it reads, writes and calls."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

from pycparser import c_ast, c_parser

from pvid.twin.printer.directives import Unit, UntranslatedError
from pvid.twin.printer.term import INTEGERS

ENTRY, EVERYTHING = "[]", "*"  # beside names of fields: an entry of an array; a whole struct


def walked(node: Any) -> Iterator[Any]:
    yield node
    for _, child in node.children():
        yield from walked(child)


@cache
def nodes_of(text: str, name: str) -> list[Any]:
    """The declarations of a text behind its first line: the core's are the same for every mechanism."""
    return [one for one in c_parser.CParser().parse(text, name).ext if one.coord.line > 1]


def parsed(unit: Unit) -> Iterator[Any]:
    """The declarations of a unit. Sources are parsed one by one: each has names of its own."""
    names = [*INTEGERS]
    for first, text in unit.texts():
        known = " ".join(f"typedef int {name};" for name in names)
        try:
            nodes = nodes_of(f"{known}\n{text}", str(first))
        except Exception as error:  # pycparser's own, of several kinds
            found = re.search(r":(\d+):", str(error))
            file, line = unit.place(first + int(found[1]) - 2) if found else ("?", 0)
            raise UntranslatedError(f"{file}:{line}: {error}") from error
        for node in nodes:
            if isinstance(node, c_ast.Typedef) and unit.place(first + node.coord.line - 2)[0].endswith(".h"):
                names.append(node.name)
            yield node
    known = " ".join(f"typedef int {name};" for name in names)
    constants = [f"int {name} = {body};" for name, body in unit.constants.items()]
    yield from nodes_of(known + "\n".join(["", *constants]), "macros")


def file_of(node: Any) -> str:
    return str(node.coord.file)


def is_seen(file: str, decl: Any) -> bool:
    """Whether other files see a function or a table."""
    return file.endswith(".h") or "static" not in decl.storage


def identifiers(node: Any) -> list[str]:
    return [] if node is None else [one.name for one in walked(node) if isinstance(one, c_ast.ID)]


def has(node: Any, kind: type) -> bool:
    return any(isinstance(one, kind) for one in walked(node))


def has_call(node: Any) -> bool:
    return has(node, c_ast.FuncCall)


def has_size(node: Any) -> bool:
    return any(isinstance(one, c_ast.UnaryOp) and one.op == "sizeof" for one in walked(node))


def addressed(node: Any) -> set[str]:
    """Variables whose address is taken."""
    return {
        one.expr.name
        for one in walked(node)
        if isinstance(one, c_ast.UnaryOp) and one.op == "&" and isinstance(one.expr, c_ast.ID)
    }


def targets_of(node: Any) -> Iterator[Any]:
    for one in walked(node):
        if isinstance(one, c_ast.Assignment):
            yield one.lvalue
        elif isinstance(one, c_ast.UnaryOp) and one.op in ("p++", "p--", "++", "--"):
            yield one.expr


def changed(node: Any) -> set[str]:
    """Variables that are written, or a part of them."""
    return {name for one in targets_of(node) for name in identifiers(one)}


def assigned(node: Any) -> set[str]:
    """Variables that are written as a whole."""
    return {one.name for one in targets_of(node) if isinstance(one, c_ast.ID)}


def written_fields(node: Any) -> set[str]:
    """Names of the fields that are written, "[]" for an entry."""
    return {
        one.field.name if isinstance(one, c_ast.StructRef) else ENTRY
        for one in targets_of(node)
        if not isinstance(one, c_ast.ID)
    }


def is_whole(length: Any) -> bool:
    """Whether a length in bytes is that of a whole struct."""
    return isinstance(length, c_ast.ID) or (
        isinstance(length, c_ast.UnaryOp) and isinstance(length.expr, c_ast.UnaryOp)
    )


def breaks(node: Any) -> bool:
    """Whether a break ends what is around a statement."""
    if isinstance(node, c_ast.Break):
        return True
    if isinstance(node, (c_ast.While, c_ast.For, c_ast.DoWhile, c_ast.Switch)):
        return False
    return any(breaks(child) for _, child in node.children())
