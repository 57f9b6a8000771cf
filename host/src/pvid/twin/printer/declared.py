"""A unit's declarations: names, types, macros, and the code of a type."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pycparser import c_ast

from pvid.twin.printer.directives import Unit, UntranslatedError
from pvid.twin.printer.syntax import file_of, identifiers, is_seen, parsed
from pvid.twin.printer.term import ATOM, INTEGERS, STANDARD, TAKEN, UNARY, Function, Scope, Type, Value


class Declared:
    """The declarations of a unit, and what is printed of it so far.

    Raises UntranslatedError at a construct without a translation, with its file and line.

    Parameters
    ----------
    unit : as read
    roots : names of functions and tables that are wanted, with all that they need; empty: all
    """

    out: list[str]  # lines of the function or table that is printed
    _depth = 0
    _conditional = 0  # conditions around an expression
    _temporaries = 0
    _cursor = 0  # last line of C whose comments are printed
    _key: Any
    _result: Type
    _boxed: set[str]
    _names: set[str]

    def __init__(self, unit: Unit, roots: Sequence[str] = ()) -> None:
        self.unit, self.roots = unit, roots
        nodes = list(parsed(unit))
        self.structs: dict[str, dict[str, Type]] = {}
        self.struct_places: dict[str, dict[str, tuple[str, int]]] = {}
        self.struct_at: dict[str, tuple[str, int]] = {}
        self.typedefs: dict[str, Type] = {}
        self.enumerators: dict[tuple[str, str], int] = {}
        self.anywhere: dict[str, int] = {}
        self.functions: dict[str, list[Function]] = {}
        self.prototypes: dict[str, tuple[Any, tuple[str, int]]] = {}
        self.tables: dict[str, list[tuple[str, Any]]] = {}
        self.order: list[tuple[str, str, Any]] = []
        self.flags: set[Any] = set()
        self.links: dict[Any, Any] = {}
        self.used_structs: list[str] = []
        self.used_constants: dict[str, str] = {}
        self.used_enumerators: dict[str, str] = {}
        self._file = ""
        self.macro_names: dict[str, str] = {}  # by the names in Python
        self.macros = {node.name: node.init for node in nodes if file_of(node) == "macros"}
        for node in nodes:
            if file_of(node) != "macros":
                self._declare(node)
        self._wanted = self._reached()
        self._written: dict[Any, set[str]] = {}  # fields that a function writes

    def place(self, node: Any) -> tuple[str, int]:
        coord = getattr(node, "coord", None)
        if coord is None or not coord.file.isdigit():
            return "?", 0
        return self.unit.place(int(coord.file) + coord.line - 2)  # behind the line of typedefs

    def refuse(self, node: Any, what: str) -> UntranslatedError:
        file, line = self.place(node)
        return UntranslatedError(f"{file}:{line}: {what} has no translation to numpy")

    @staticmethod
    def _python(name: str) -> str:
        return f"{name}_" if name in TAKEN else name

    def _global(self, name: str, file: str) -> str:
        """The Python name of a function or a table: with its file's, where several files have one of this name."""
        many = [one.file for one in self.functions.get(name, [])] + [one for one, _ in self.tables.get(name, [])]
        if len(set(many)) > 1 and file in many:
            return f"{Path(file).stem}_{name}"
        return self._python(name)

    def _found(self, name: str, file: str) -> Function | None:
        """A function that a file sees; a header that is included behind a function of one source sees that."""
        many = self.functions.get(name, [])
        own = (one for one in many if one.file == file)
        includes = many[0] if len(many) == 1 and file.endswith(".h") else None
        return next(own, next((one for one in many if is_seen(one.file, one.node.decl)), includes))

    def _table(self, name: str, file: str) -> tuple[str, Any] | None:
        """A table that a file sees, as a function, and its own file."""
        many = self.tables.get(name, [])
        own = (one for one in many if one[0] == file)
        includes = many[0] if len(many) == 1 and file.endswith(".h") else None
        return next(own, next((one for one in many if is_seen(*one)), includes))

    def _declare(self, node: Any) -> None:
        file, line = self.place(node)
        self._file = file
        if isinstance(node, c_ast.Typedef):
            inner = node.type.type if isinstance(node.type, c_ast.TypeDecl) else None
            if isinstance(inner, (c_ast.Struct, c_ast.Union)) and inner.name is None:
                inner.name = node.name
            if node.name not in INTEGERS:
                self.typedefs[node.name] = self.type_of(node.type)
        elif isinstance(node, c_ast.FuncDef):
            one = Function(node, node.decl.name, *self.place(node.decl))
            self.functions.setdefault(one.key, []).append(one)
            self.order.append(("function", one.file, one))
        elif isinstance(node, c_ast.Decl):
            if isinstance(node.type, c_ast.FuncDecl):
                self.prototypes[node.name] = (node.type, (file, line))
            elif isinstance(node.type, (c_ast.Struct, c_ast.Union, c_ast.Enum)):
                self.type_of(node.type)
            elif node.name and "extern" not in node.storage:
                self.tables.setdefault(node.name, []).append((file, node))
                self.order.append(("table", file, node))

    def type_of(self, node: Any) -> Type:
        match node:
            case c_ast.TypeDecl() | c_ast.Typename():
                return self.type_of(node.type)
            case c_ast.PtrDecl():
                inner = self.type_of(node.type)
                return inner if isinstance(inner, tuple) and inner[0] == "fn" else ("ptr", inner)
            case c_ast.ArrayDecl():
                inner = self.type_of(node.type)
                if node.dim is None:
                    return ("arr", inner, None, "")
                value = self.expression(node.dim, Scope())
                if not isinstance(value.const, int):
                    raise self.refuse(node, "an array whose length is not a constant")
                return ("arr", inner, value.const, value.within(UNARY))
            case c_ast.FuncDecl():
                return ("fn", node)
            case c_ast.Struct() | c_ast.Union():
                name = node.name or f"anonymous_{node.coord.line}"
                if node.decls:
                    self.struct_at[name] = self.place(node)
                    self.structs[name] = {one.name: self.type_of(one.type) for one in node.decls}
                    self.struct_places[name] = {one.name: self.place(one) for one in node.decls}
                return ("struct", name)
            case c_ast.Enum():
                return self._enumerated(node)
            case c_ast.IdentifierType():
                name = STANDARD.get(" ".join(node.names), " ".join(node.names))
                if name in INTEGERS or name in ("void", "float", "_Bool"):
                    return name
                if name in self.typedefs:
                    return self.typedefs[name]
        raise self.refuse(node, f"the type {' '.join(getattr(node, 'names', [type(node).__name__]))}")

    def _enumerated(self, node: Any) -> Type:
        value, values = -1, [0]
        file, _ = self.place(node)
        for one in node.values.enumerators if node.values else []:
            value = int(self.expression(one.value, Scope()).const or 0) if one.value else value + 1
            self.enumerators[file, one.name] = value
            self.anywhere.setdefault(one.name, value)
            values.append(value)
        return ("enum", min(values), max(values))

    def _reached(self) -> set[int]:
        """Nodes of the functions and tables that are wanted."""
        every = {id(one.node if kind == "function" else one) for kind, _, one in self.order}
        if not self.roots:
            return every
        todo = [(name, one.file) for name in self.roots for one in self.functions.get(name, [])]
        todo += [(name, file) for name in self.roots for file, _ in self.tables.get(name, [])]
        found: set[int] = set()
        while todo:
            name, file = todo.pop()
            function, table = self._found(name, file), self._table(name, file)
            for node, where in ([(function.node, function.file)] if function else []) + (
                [(table[1], table[0])] if table else []
            ):
                if id(node) not in found:
                    found.add(id(node))
                    todo += [(one, where) for one in identifiers(node)]
        return found

    def expression(self, node: Any, scope: Scope) -> Value:
        method = getattr(self, f"_of_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refuse(node, type(node).__name__)
        value: Value = method(node, scope)
        return value

    def _macro(self, name: str) -> Value:
        value = self.expression(self.macros[name], Scope())
        if value.const is None:
            raise self.refuse(self.macros[name], f"the macro {name}")
        code = f"{name}_" if name in self.anywhere or name in self.functions or name in self.tables else name
        self.macro_names[code] = name
        self.used_constants[code] = value.code
        return replace(value, code=code, level=ATOM)

    def _root(self, one: Any) -> Any:
        while one in self.links and self.links[one] != one:
            one = self.links[one]
        return one

    def _link(self, a: Any, b: Any) -> None:
        a, b = self._root(a), self._root(b)
        if a != b:
            self.links[a] = b

    def _spread(self, t: Type) -> tuple[int, Type]:
        """Entries of an array, and what they are."""
        count = 1
        while isinstance(t, tuple) and t[0] == "arr":
            count *= t[2] or 1
            t = t[1]
        return count, t

    def _count_code(self, t: Type) -> str:
        codes = []
        while isinstance(t, tuple) and t[0] == "arr":
            codes.append(t[3] or str(t[2]))
            t = t[1]
        code = " * ".join(codes) or "1"
        for name in re.findall(r"[A-Za-z_]\w*", code):
            if name in self.macro_names:
                self._macro(self.macro_names[name])
            elif name in self.anywhere:
                self.used_enumerators[name] = str(self.anywhere[name])
        return code

    def _zero(self, t: Type) -> str:
        if t == "float":
            return "f32(0.0)"
        if t == "_Bool":
            return "False"
        if isinstance(t, tuple):
            if t[0] == "struct":
                return f"{self._used(t[1])}()"
            if t[0] == "arr":
                _, entry = self._spread(t)
                code = self._count_code(t)
                if isinstance(entry, tuple) and entry[0] == "struct":
                    return f"[{self._zero(entry)} for _ in range({code})]"
                return f"[{self._zero(entry)}] * {code if ' ' not in code else f'({code})'}"
            if t[0] in ("ptr", "fn"):
                return "None"
        return "0"

    def _used(self, name: str) -> str:
        if name not in self.used_structs:
            if name not in self.structs:
                raise UntranslatedError(f"struct {name} is not defined")
            for t in self.structs[name].values():
                _, entry = self._spread(t)
                if isinstance(entry, tuple) and entry[0] == "struct":
                    self._used(entry[1])
            self.used_structs.append(name)
        return name

    def _line(self, text: str) -> None:
        self.out.append("    " * self._depth + text)
