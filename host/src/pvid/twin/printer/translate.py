"""C after its directives -> Python: types, tables and functions, operation by operation."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pycparser import c_ast, c_parser

from pvid.twin.printer import machine
from pvid.twin.printer.directives import KEPT, Unit, UntranslatedError

# A name of _INTEGERS, "float", "_Bool", "void"; ("enum", low, high), ("ptr", type), ("arr", type, length, its code),
# ("struct", name), ("fn", node, name).
Type = Any

_INTEGERS = {
    "int8_t": (8, True), "uint8_t": (8, False), "int16_t": (16, True), "uint16_t": (16, False), "int32_t": (32, True),
    "uint32_t": (32, False), "int64_t": (64, True), "uint64_t": (64, False), "size_t": (64, False),
    "ptrdiff_t": (64, True), "uintptr_t": (64, False),
}  # fmt: skip
_STANDARD = {
    "int": "int32_t",
    "unsigned int": "uint32_t",
    "unsigned": "uint32_t",
    "char": "int8_t",
    "unsigned char": "uint8_t",
}
_SIZE = (1 << 32) - 1  # a size or an index: less, on every processor
_ATOM, _UNARY, _PRODUCT, _SUM, _SHIFT, _AND, _XOR, _OR, _COMPARED, _NOT, _BOTH, _EITHER, _CHOICE = range(13, 0, -1)
_LEVELS = {
    "*": _PRODUCT,
    "/": _PRODUCT,
    "%": _PRODUCT,
    "+": _SUM,
    "-": _SUM,
    "<<": _SHIFT,
    ">>": _SHIFT,
    "&": _AND,
    "^": _XOR,
    "|": _OR,
}
# Names that printed code needs for something else; fields have the methods of structs.
_TAKEN = {
    *keyword.kwlist,
    *(name for name in vars(machine) if not name.startswith("_")),
    "range",
    "int",
    "abs",
    "copy",
    "assign",
}
_NATIVE = {"sqrtf": "float", "fabsf": "float"}
_NUMBERS = re.compile(r"^-?(?:0x[0-9a-fA-F]+|\d+)$")


@dataclass(frozen=True)
class Value:
    """An expression.

    code : in Python; of a pointer and of an array its list, of a pointer to one struct (`single`) the struct
    at : offset of a pointer or an array, in numbers or structs; "*": `code` is a call that returns list and offset
    level : of the outermost operator
    low, high : of an integer
    const : value of a constant
    fresh : a struct that nobody else has
    slot : variable, field, parameter or result that it is
    plain : of a difference of sizes that is wrapped: it without that
    """

    code: str
    type: Type
    level: int = _ATOM
    at: str = "0"
    single: bool = False
    low: int = 0
    high: int = 0
    const: int | float | None = None
    fresh: bool = False
    slot: Any = None
    plain: Value | None = None

    def within(self, level: int) -> str:
        """As an operand of an operator of this level."""
        return self.code if self.level >= level else f"({self.code})"


@dataclass
class Function:
    node: Any
    key: str
    file: str
    line: int


@dataclass
class Scope:
    """Names of a block: C name -> Python name, type, slot, boxed."""

    names: dict[str, tuple[str, Type, Any, bool]] = field(default_factory=dict)

    def inner(self) -> Scope:
        return Scope(dict(self.names))


class Translator:
    """Prints a unit.

    Parameters
    ----------
    unit : as read
    roots : names of functions and tables that are wanted, with all that they need; empty: all

    Raises
    ------
    UntranslatedError
        At a construct without a translation, with its file and line.
    """

    def __init__(self, unit: Unit, roots: Sequence[str] = ()) -> None:
        self.unit, self.roots = unit, roots
        nodes = list(_parsed(unit))
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
        self._file = ""
        self._function: Function | None = None
        self.macro_names: dict[str, str] = {}  # by the names in Python
        self.macros = {node.name: node.init for node in nodes if _file_of(node) == "macros"}
        for node in nodes:
            if _file_of(node) != "macros":
                self._declare(node)
        self._wanted = self._reached()
        self._written = {}

    # ---- places and names

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
        return f"{name}_" if name in _TAKEN else name

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
        return next(own, next((one for one in many if _is_seen(one.file, one.node.decl)), includes))

    def _table(self, name: str, file: str) -> tuple[str, Any] | None:
        """A table that a file sees, as a function, and its own file."""
        many = self.tables.get(name, [])
        own = (one for one in many if one[0] == file)
        includes = many[0] if len(many) == 1 and file.endswith(".h") else None
        return next(own, next((one for one in many if _is_seen(*one)), includes))

    # ---- declarations

    def _declare(self, node: Any) -> None:
        file, line = self.place(node)
        self._file = file
        if isinstance(node, c_ast.Typedef):
            inner = node.type.type if isinstance(node.type, c_ast.TypeDecl) else None
            if isinstance(inner, (c_ast.Struct, c_ast.Union)) and inner.name is None:
                inner.name = node.name
            if node.name not in _INTEGERS:
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
                return ("arr", inner, value.const, value.within(_UNARY))
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
                name = _STANDARD.get(" ".join(node.names), " ".join(node.names))
                if name in _INTEGERS or name in ("void", "float", "_Bool"):
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
                    todo += [(one, where) for one in _identifiers(node)]
        return found

    # ---- the whole

    def printed(self) -> str:
        """The module, without its head."""
        while True:
            before = len(self.flags)
            text = self._pass()
            self._join()
            if len(self.flags) == before:
                return text

    def _pass(self) -> str:
        self.used_structs: list[str] = []
        self.used_constants: dict[str, str] = {}
        self.used_enumerators: dict[str, str] = {}
        sections: dict[str, list[str]] = {}
        late: list[str] = []
        for kind, file, one in self.order:
            node = one.node if kind == "function" else one
            if id(node) not in self._wanted:
                continue
            self.out: list[str] = []
            self._file = file
            if kind == "function":
                self._print_function(one)
            else:
                self._print_table(one)
                if any(self._found(name, file) or self.tables.get(name) for name in _identifiers(one.init) if one.init):
                    late += self.out
                    continue
            sections.setdefault(file, []).extend(self.out)
        classes = self._classes()
        constants = [f"{name} = {code}" for name, code in self._ordered(self.used_constants)]
        names = [f"{name} = {code}" for name, code in self.used_enumerators.items()]
        text = [*names, *constants, *classes]
        for file, lines in sections.items():
            text += ["", "", f"# ---- {_short(file)}", *lines]
        return "\n".join([*text, *(["", "", "# ---- tables of functions", *late] if late else [])]) + "\n"

    def _ordered(self, constants: dict[str, str]) -> Iterator[tuple[str, str]]:
        done: set[str] = set()

        def after(name: str) -> Iterator[tuple[str, str]]:
            if name in done or name not in constants:
                return
            done.add(name)
            for one in re.findall(r"\w+", constants[name]):
                yield from after(one)
            yield name, constants[name]

        for name in constants:
            yield from after(name)

    def _join(self) -> None:
        """Functions that may be called through one pointer have the same parameters."""
        groups: dict[Any, set[Any]] = {}
        for a, b in list(self.links.items()):
            groups.setdefault(self._root(a), set()).update((a, b))
        for root, members in groups.items():
            members.add(root)
            kinds = {(slot[2:], flag) for slot, flag in self.flags if slot[0] == "param" and slot[1] in members}
            results = {flag for slot, flag in self.flags if slot[0] == "result" and slot[1] in members}
            for one in members:
                self.flags |= {(("param", one, *rest), flag) for rest, flag in kinds}
                self.flags |= {(("result", one), flag) for flag in results}

    def _root(self, one: Any) -> Any:
        while one in self.links and self.links[one] != one:
            one = self.links[one]
        return one

    def _link(self, a: Any, b: Any) -> None:
        a, b = self._root(a), self._root(b)
        if a != b:
            self.links[a] = b

    # ---- types in Python

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

    def _classes(self) -> list[str]:
        out: list[str] = []
        for name in list(self.used_structs):
            file, line = self.struct_at[name]
            comments = self.unit.comments.get(file)
            said = comments.alone.get(line - 1, (0, ""))[1] if comments else ""
            out += ["", "", "@struct", f"class {name}:"]
            if said:
                out += _docstring(said, 1)
            for one, t in self.structs[name].items():
                _, entry = self._spread(t)
                if isinstance(t, tuple) and t[0] == "arr":
                    what = entry[1] if isinstance(entry, tuple) and entry[0] == "struct" else self._zero(entry)
                    code = f"Array({what}, {self._count_code(t)})"
                else:
                    code = self._field(t, ("field", name, one))
                where, at = self.struct_places[name][one]
                behind = self.unit.comments[where].behind.get(at, "") if where in self.unit.comments else ""
                out.append(_with_comment(f"    {self._python(one)} = {code}", behind))
                if (("field", name, one), "inside") in self.flags:
                    out.append(f"    {self._python(one)}_at = 0")
        return out

    def _field(self, t: Type, slot: Any) -> str:
        """The attribute of a printed class that is no array."""
        if isinstance(t, tuple) and t[0] == "struct":
            return str(t[1])
        if isinstance(t, tuple) and t[0] == "ptr":
            _, entry = self._spread(t[1])
            if isinstance(entry, tuple) and entry[0] == "struct":
                return f'Pointer("{entry[1]}"{", many=True" if (slot, "list") in self.flags else ""})'
            return f'Pointer("{entry}")' if isinstance(entry, str) and entry != "void" else "None"
        return self._zero(t)

    # ---- tables

    def _print_table(self, node: Any, name: str = "") -> Type:
        t = self._complete(self.type_of(node.type), node.init)
        name = name or self._global(node.name, self._file)
        code = self._zero(t) if node.init is None else self._initial(node.init, t, Scope(), ("table", name))
        comments = self.unit.comments.get(self._file)
        line = self.place(node)[1]
        said = comments.alone.get(line - 1, (0, ""))[1] if comments else ""
        self.out += ["", *(f"# {one}".rstrip() for one in said.split("\n") if said), f"{name} = {code}"]
        return t

    def _complete(self, t: Type, init: Any) -> Type:
        if isinstance(t, tuple) and t[0] == "arr" and t[2] is None:
            if isinstance(init, c_ast.InitList):
                return ("arr", t[1], len(init.exprs), str(len(init.exprs)))
            if isinstance(init, c_ast.Constant):
                return ("ptr", "int8_t")
        return t

    def _initial(self, init: Any, t: Type, scope: Scope, slot: Any) -> str:
        """An initialiser of a type."""
        if not isinstance(init, c_ast.InitList):
            if isinstance(init, c_ast.Constant) and init.type == "string":
                return str(init.value)
            code, _ = self._stored(self.expression(init, scope), t, slot, init)
            return code
        if isinstance(t, tuple) and t[0] == "struct":
            fields = list(self.structs[self._used(t[1])])
            given: dict[str, str] = {}
            place, named = 0, False
            for one in init.exprs:
                if isinstance(one, c_ast.NamedInitializer):
                    place, one, named = fields.index(one.name[0].name), one.expr, True
                name = fields[place]
                key = ("field", t[1], name)
                place += 1
                if isinstance(one, c_ast.InitList):
                    given[name] = self._initial(one, self._complete(self.structs[t[1]][name], one), scope, key)
                else:
                    given[name], at = self._stored(self.expression(one, scope), self.structs[t[1]][name], key, one)
                    if (key, "inside") in self.flags:
                        given[f"{name}_at"], named = at, True
            if named:
                return f"{t[1]}({', '.join(f'{self._python(k)}={v}' for k, v in given.items())})"
            return f"{t[1]}({', '.join(given.values())})"
        if isinstance(t, tuple) and t[0] == "arr":
            entries = self._entries(init, t, scope, slot)
            whole, entry = self._spread(t)
            if len(entries) < whole:
                if isinstance(entry, tuple) and entry[0] == "struct":
                    entries += [self._zero(entry)] * (whole - len(entries))
                else:
                    kept = f"[{', '.join(entries)}] + " if set(entries) - {self._zero(entry)} else ""
                    rest = whole - len(entries) if kept else self._count_code(t)
                    return f"{kept}[{self._zero(entry)}] * {rest if ' ' not in str(rest) else f'({rest})'}"
            return f"[{', '.join(entries)}]"
        return self._initial(init.exprs[0], t, scope, slot)

    def _entries(self, init: Any, t: Type, scope: Scope, slot: Any) -> list[str]:
        out: list[str] = []
        for one in init.exprs:
            if isinstance(one, c_ast.NamedInitializer):
                name = one.name[0]
                at = self.expression(name.expr if isinstance(name, c_ast.ArrayDesignator) else name, scope).const
                count, entry = self._spread(t[1])
                assert isinstance(at, int)
                out += [self._zero(entry)] * (at * count - len(out))
                one = one.expr
            if isinstance(t[1], tuple) and t[1][0] == "arr" and isinstance(one, c_ast.InitList):
                count, entry = self._spread(t[1])
                row = self._entries(one, t[1], scope, slot)
                out += row + [self._zero(entry)] * (count - len(row))
            else:
                out.append(self._initial(one, t[1], scope, slot))
        return out

    # ---- expressions

    def expression(self, node: Any, scope: Scope) -> Value:
        method = getattr(self, f"_of_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refuse(node, type(node).__name__)
        value: Value = method(node, scope)
        return value

    def _integer(self, code: str, t: Type, level: int = _ATOM, **known: Any) -> Value:
        low, high = self._range(t)
        return replace(Value(code, t, level, low=low, high=high), **known)

    @staticmethod
    def _range(t: Type) -> tuple[int, int]:
        if isinstance(t, tuple):
            return (t[1], t[2]) if t[0] == "enum" else (0, 0)
        if t == "_Bool":
            return 0, 1
        if t == "size_t":
            return 0, _SIZE
        if t in _INTEGERS:
            bits, signed = _INTEGERS[t]
            return (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)
        return 0, 0

    def _constant_value(self, value: int, t: Type = "int32_t", code: str | None = None) -> Value:
        return Value(code or str(value), t, _ATOM if value >= 0 else _UNARY, low=value, high=value, const=value)

    def _of_constant(self, node: Any, _: Scope) -> Value:
        text = node.value
        if node.type == "string":
            return Value(text, ("ptr", "int8_t"))
        if node.type == "char":
            return self._constant_value(ord(eval(text)))
        if (
            "float" in node.type
            or "double" in node.type
            or (not text.startswith("0x") and re.search(r"[.eE]|\d[fF]$", text))
        ):
            return self._float_constant(text.rstrip("fFlL"))
        body = text.rstrip("uUlL")
        number = int(body, 8) if re.fullmatch(r"0[0-7]+", body) else int(body, 0)
        unsigned = "u" in text.lower().replace("0x", "")
        long = number > 0xFFFFFFFF or (number > 0x7FFFFFFF and not unsigned and not body.startswith("0x"))
        unsigned = unsigned or (body.startswith("0x") and number > 0x7FFFFFFF)
        t = ("uint64_t" if long else "uint32_t") if unsigned else ("int64_t" if long else "int32_t")
        return self._constant_value(number, t, body.lower() if body.lower().startswith("0x") else str(number))

    @staticmethod
    def _float_constant(text: str) -> Value:
        whole = _nearest(text)
        code = text if float(np.float32(float(text))) == whole else repr(whole)
        code = f"{code}.0" if re.fullmatch(r"\d+", code) else f"{code}0" if code.endswith(".") else code
        return Value(f"f32({code})", "float", const=whole)

    def _of_id(self, node: Any, scope: Scope) -> Value:
        name = node.name
        if name.endswith(KEPT):
            return self._macro(name.removesuffix(KEPT))
        if name in scope.names:
            return self._variable(*scope.names[name])
        if name in ("true", "false"):
            return Value(
                name.capitalize(), "_Bool", low=int(name == "true"), high=int(name == "true"), const=int(name == "true")
            )
        file = self._file
        if (file, name) in self.enumerators or name in self.anywhere:
            number = self.enumerators.get((file, name), self.anywhere.get(name, 0))
            many = {v for (_, n), v in self.enumerators.items() if n == name}
            code = f"{Path(file).stem}_{name}" if len(many) > 1 and (file, name) in self.enumerators else name
            if hasattr(self, "used_enumerators"):
                self.used_enumerators[code] = str(number)
            return self._constant_value(number, "int32_t", code)
        function = self._found(name, file)
        if function is not None or name in self.prototypes:
            key = function.file + ":" + name if function and len(self.functions[name]) > 1 else name
            decl = function.node.decl.type if function else self.prototypes[name][0]
            return Value(self._global(name, function.file if function else file), ("fn", decl, key))
        table = self._table(name, file)
        if table is not None:
            t = self._complete(self.type_of(table[1].type), table[1].init)
            return self._variable(self._global(name, table[0]), t, ("table", name), False)
        raise self.refuse(node, f"the name {name}")

    def _macro(self, name: str) -> Value:
        value = self.expression(self.macros[name], Scope())
        if value.const is None:
            raise self.refuse(self.macros[name], f"the macro {name}")
        code = f"{name}_" if name in self.anywhere or name in self.functions or name in self.tables else name
        self.macro_names[code] = name
        if hasattr(self, "used_constants"):
            self.used_constants[code] = value.code
        return replace(value, code=code, level=_ATOM)

    def _variable(self, name: str, t: Type, slot: Any, boxed: bool) -> Value:
        if boxed:
            return self._lvalue(f"{name}[0]", t, slot)
        return self._lvalue(name, t, slot)

    def _lvalue(self, code: str, t: Type, slot: Any = None) -> Value:
        if isinstance(t, tuple) and t[0] == "ptr":
            _, entry = self._spread(t[1])
            single = isinstance(entry, tuple) and entry[0] in ("struct", "fn") and (slot, "list") not in self.flags
            at = f"{code}_at" if (slot, "inside") in self.flags and not single else "0"
            return Value(code, t, at=at, single=single, slot=slot)
        return self._integer(code, t) if not isinstance(t, tuple) or t[0] == "enum" else Value(code, t, slot=slot)

    def _of_structref(self, node: Any, scope: Scope) -> Value:
        owner = self.expression(node.name, scope)
        if node.type == "->":
            owner = self._target(owner, node)
        if not (isinstance(owner.type, tuple) and owner.type[0] == "struct"):
            raise self.refuse(node, f"the field {node.field.name} of no struct")
        name = node.field.name
        fields = self.structs[self._used(owner.type[1])]
        if name not in fields:
            raise self.refuse(node, f"the field {name}")
        return self._lvalue(f"{owner.within(_ATOM)}.{self._python(name)}", fields[name], ("field", owner.type[1], name))

    def _target(self, pointer: Value, node: Any) -> Value:
        """What a pointer points to."""
        t = pointer.type
        if not (isinstance(t, tuple) and t[0] in ("ptr", "arr")):
            raise self.refuse(node, "a dereference of no pointer")
        pointer = self._unpaired(pointer, node)
        inner = t[1]
        if isinstance(inner, tuple) and inner[0] == "arr":
            return Value(pointer.code, inner, at=pointer.at)
        if pointer.single:
            return Value(pointer.code, inner, pointer.level)
        return self._lvalue(f"{pointer.within(_ATOM)}[{pointer.at}]", inner, ("entry", pointer.slot))

    def _of_arrayref(self, node: Any, scope: Scope) -> Value:
        base = self._unpaired(self.expression(node.name, scope), node)
        place = self.expression(node.subscript, scope)
        if not (isinstance(base.type, tuple) and base.type[0] in ("ptr", "arr")):
            raise self.refuse(node, "a subscript of no array")
        base = self._as_list(base, place)
        inner = base.type[1]
        count, entry = self._spread(inner)
        at = _moved(base.at, self._scaled(place, inner))
        if isinstance(inner, tuple) and inner[0] == "arr":
            return Value(base.code, inner, at=at)
        if base.single:
            return Value(base.code, inner, base.level)
        return self._lvalue(f"{base.within(_ATOM)}[{at}]", inner, ("entry", base.slot))

    def _as_list(self, base: Value, place: Value | None) -> Value:
        """A pointer to one struct becomes one into a list, if it is moved."""
        if base.single and not (place is not None and place.const == 0):
            self.flags.add((base.slot, "list"))
            return replace(base, single=False)
        return base

    def _scaled(self, place: Value, inner: Type) -> str:
        """Offset of an entry `place`, in numbers or structs."""
        code = self._index(place)
        if not (isinstance(inner, tuple) and inner[0] == "arr"):
            return code.code if code.level >= _SUM else f"({code.code})"
        if code.const == 0:
            return "0"
        count = self._count_code(inner)
        return count if code.const == 1 else f"{count} * {code.within(_UNARY)}"

    @staticmethod
    def _index(place: Value) -> Value:
        """Without the wrapping of a difference: an index is never below 0."""
        return place.plain or place

    def _unpaired(self, value: Value, node: Any) -> Value:
        """A call that returns list and offset, in variables."""
        if value.at != "*":
            return value
        if self._conditional:
            raise self.refuse(node, "a pointer from a call within a condition")
        self._temporaries += 1
        name = f"place_{self._temporaries}" if self._temporaries > 1 else "place"
        self._line(f"{name}, {name}_at = {value.code}")
        return replace(value, code=name, at=f"{name}_at")

    _conditional = 0
    _temporaries = 0

    def _of_cast(self, node: Any, scope: Scope) -> Value:
        to = self.type_of(node.to_type.type)
        value = self.expression(node.expr, scope)
        if to == "void":
            return value
        if isinstance(to, tuple) and to[0] == "ptr":
            if value.const == 0:
                return replace(value, code="None", type=to)
            value = self._decayed(value)
            here, there = self._spread(value.type[1])[1], self._spread(to[1])[1]
            if here != there and "void" not in (here, there):
                raise self.refuse(node, "a pointer to another type")
            return replace(value, type=to)
        if isinstance(to, tuple) and to[0] == "enum":
            return replace(
                self._converted(value, "int32_t"),
                low=max(value.low, 0),
                high=min(value.high, max(to[2], 255)) if value.high else to[2],
            )
        return self._converted(value, to)

    def _decayed(self, value: Value) -> Value:
        if isinstance(value.type, tuple) and value.type[0] == "arr":
            return replace(value, type=("ptr", value.type[1]), single=False)
        return value

    def _converted(self, value: Value, to: Type) -> Value:
        """A number as another type."""
        if to == "float":
            if value.type == "float":
                return value
            if value.const is not None:
                return Value(f"f32({value.code})", "float", const=float(np.float32(value.const)))
            return Value(f"f32({value.code})", "float")
        if to == "_Bool":
            if value.type == "_Bool":
                return value
            if isinstance(value.const, int):
                return Value(
                    str(bool(value.const)),
                    "_Bool",
                    low=int(bool(value.const)),
                    high=int(bool(value.const)),
                    const=int(bool(value.const)),
                )
            if isinstance(value.type, tuple) and value.type[0] == "ptr":
                return Value(f"{value.code} is not None", "_Bool", _COMPARED, low=0, high=1)
            return Value(f"{value.within(_OR)} != 0", "_Bool", _COMPARED, low=0, high=1)
        low, high = self._range(to)
        if value.type == "float":
            return self._integer(f"int({value.code})", to)
        if value.type == "_Bool" and value.const is None:
            return Value(f"int({value.code})", to, low=0, high=1)
        if isinstance(to, tuple) or (low <= value.low and value.high <= high):
            return replace(value, type=to if not isinstance(to, tuple) else "int32_t")
        bits, signed = _INTEGERS[to]
        if to == "size_t":
            return (
                self._wrapped(value, 64, to) if value.low < 0 else replace(value, type=to, high=min(value.high, high))
            )
        if not signed:
            return self._wrapped(value, bits, to)
        if isinstance(value.const, int):
            return self._constant_value(machine.signed(value.const, bits), to)
        return Value(f"signed({value.code}, {bits})", to, low=low, high=high)

    def _wrapped(self, value: Value, bits: int, t: Type) -> Value:
        mask = (1 << bits) - 1
        if isinstance(value.const, int):
            return self._constant_value(value.const & mask, t)
        plain = value.plain
        low, high = self._range(t)
        return Value(
            f"{value.within(_ATOM)} & {mask:#x}",
            t,
            _AND,
            low=0,
            high=high,
            plain=plain or (value if t == "size_t" else None),
        )

    def _promoted(self, value: Value) -> Value:
        t = value.type
        if t == "_Bool":
            return self._converted(value, "int32_t")
        if isinstance(t, tuple) and t[0] == "enum":
            return replace(value, type="int32_t")
        if t in _INTEGERS and _INTEGERS[t][0] < 32:
            return replace(value, type="int32_t")
        return value

    def _of_unaryop(self, node: Any, scope: Scope) -> Value:
        op = node.op
        if op == "sizeof":
            return self._size(node, scope)
        if op == "&":
            return self._address(node, scope)
        value = self.expression(node.expr, scope)
        if op == "*":
            if isinstance(value.type, tuple) and value.type[0] == "fn":
                return value
            return self._target(self._decayed(value), node)
        if op == "!":
            if isinstance(value.const, int):
                return self._converted(self._constant_value(int(not value.const)), "_Bool")
            return Value(f"not {self._truth(value).within(_NOT)}", "_Bool", _NOT, low=0, high=1)
        value = self._promoted(value)
        if op == "+":
            return value
        if op == "-":
            if value.type == "float":
                if value.const is not None:
                    return (
                        Value(f"f32(-{value.code[4:-1]})", "float", const=-value.const)
                        if value.code.startswith("f32(") and value.code[4] != "-"
                        else Value(f"-{value.within(_UNARY)}", "float", _UNARY, const=-value.const)
                    )
                return Value(f"-{value.within(_UNARY)}", "float", _UNARY)
            result = Value(
                f"-{value.within(_UNARY)}",
                value.type,
                _UNARY,
                low=-value.high,
                high=-value.low,
                const=None if value.const is None else -value.const,
            )
            return self._fitted(result)
        if op == "~":
            bits, signed = _INTEGERS[value.type]
            if isinstance(value.const, int):
                return self._constant_value(~value.const if signed else ~value.const & ((1 << bits) - 1), value.type)
            result = Value(f"~{value.within(_UNARY)}", value.type, _UNARY, low=-value.high - 1, high=-value.low - 1)
            return self._fitted(result)
        raise self.refuse(node, f"the operator {op} in an expression")

    def _fitted(self, value: Value) -> Value:
        """A result that is unsigned in C: wrapped, where it may be beyond its type."""
        if value.type in _INTEGERS and not _INTEGERS[value.type][1]:
            bits = _INTEGERS[value.type][0]
            if value.low < 0 or value.high >= 1 << bits:
                return self._wrapped(value, bits, value.type)
            return value
        low, high = self._range(value.type)
        if value.low < low or value.high > high:  # a signed result beyond its type is an error in C
            return replace(value, low=max(value.low, low), high=min(value.high, high))
        return value

    def _size(self, node: Any, scope: Scope) -> Value:
        bare, code = self._sized(node, scope)
        if code is None:
            return Value("WHOLE", "size_t", low=0, high=_SIZE)
        return self._constant_value(bare, "size_t", code)

    def _sized(self, node: Any, scope: Scope) -> tuple[int, str | None]:
        """Bytes of sizeof; no code: of a struct."""
        t = (
            self.type_of(node.expr.type)
            if isinstance(node.expr, c_ast.Typename)
            else self.expression(node.expr, scope).type
        )
        count, entry = self._spread(t)
        if isinstance(entry, tuple) and entry[0] in ("struct", "ptr", "fn"):
            if isinstance(t, tuple) and t[0] == "arr":
                return count * 4096, str(count * 4096)  # divided by that of one entry
            return 4096, None
        width = (
            4 if entry == "float" or isinstance(entry, tuple) else 1 if entry == "_Bool" else _INTEGERS[entry][0] // 8
        )
        code = self._count_code(t)
        return count * width, f"{width} * {code}" if count != 1 else str(width)

    def _address(self, node: Any, scope: Scope) -> Value:
        inner = node.expr
        if isinstance(inner, c_ast.ArrayRef):
            base = self._unpaired(self._decayed(self.expression(inner.name, scope)), node)
            place = self.expression(inner.subscript, scope)
            if base.single:
                base = self._as_list(base, place)
                if base.single:
                    return base
            return replace(
                Value(base.code, ("ptr", base.type[1])), at=_moved(base.at, self._scaled(place, base.type[1]))
            )
        if isinstance(inner, c_ast.UnaryOp) and inner.op == "*":
            return self.expression(inner.expr, scope)
        value = self.expression(inner, scope)
        t = value.type
        if isinstance(t, tuple) and t[0] == "struct":
            return Value(value.code, ("ptr", t), value.level, single=True)
        if isinstance(t, tuple) and t[0] == "arr":
            return replace(value, type=("ptr", t))
        if isinstance(t, tuple) and t[0] == "fn":
            return value
        if isinstance(inner, c_ast.StructRef):
            owner, _, name = value.code.rpartition(".")
            return Value(f'Place({owner}, "{name}")', ("ptr", t))
        if isinstance(inner, c_ast.ID) and inner.name in scope.names and scope.names[inner.name][3]:
            return Value(scope.names[inner.name][0], ("ptr", t))
        raise self.refuse(node, "this address")

    def _truth(self, value: Value) -> Value:
        return self._converted(value, "_Bool") if value.type not in ("_Bool", "float") else value

    def _of_binaryop(self, node: Any, scope: Scope) -> Value:
        op = node.op
        if op in ("&&", "||"):
            return self._logical(node, scope)
        a, b = self.expression(node.left, scope), self.expression(node.right, scope)
        if not (_is_number(a) and _is_number(b)):
            return self._of_pointers(node, a, b)
        a, b = self._promoted(a), self._promoted(b)
        if op in ("<<", ">>"):
            return self._shifted(op, a, b)
        t = self._common(a.type, b.type)
        a, b = self._converted(a, t), self._converted(b, t)
        if op in ("<", ">", "<=", ">=", "==", "!="):
            if isinstance(a.const, int) and isinstance(b.const, int) and t != "float":
                known = {
                    "<": a.const < b.const,
                    ">": a.const > b.const,
                    "<=": a.const <= b.const,
                    ">=": a.const >= b.const,
                    "==": a.const == b.const,
                    "!=": a.const != b.const,
                }[op]
                return self._converted(self._constant_value(int(known)), "_Bool")
            return Value(f"{a.within(_SUM)} {op} {b.within(_SUM)}", "_Bool", _COMPARED, low=0, high=1)
        level = _LEVELS[op]
        right = b.within(level + 1)
        if t == "float":
            if op not in "+-*/":
                raise self.refuse(node, f"{op} of floats")
            const = None
            if a.const is not None and b.const is not None and not (op == "/" and b.const == 0):
                x, y = np.float32(a.const), np.float32(b.const)
                with np.errstate(all="ignore"):
                    const = float({"+": x + y, "-": x - y, "*": x * y, "/": x / y if op == "/" else x}[op])
            return Value(f"{a.within(level)} {op} {right}", t, level, const=const)
        signed = _INTEGERS[t][1]
        if op in "/%":
            if isinstance(a.const, int) and isinstance(b.const, int):
                number = machine.quotient(a.const, b.const) if op == "/" else machine.remainder(a.const, b.const)
                code = f"{a.within(level)} {'//' if op == '/' else op} {right}"
                return Value(code, t, level, low=number, high=number, const=number)
            if signed and (a.low < 0 or b.low < 0):
                low, high = self._range(t)
                return Value(f"{'quotient' if op == '/' else 'remainder'}({a.code}, {b.code})", t, low=low, high=high)
            least = max(b.low, 1)
            high = a.high // least if op == "/" else min(a.high, max(b.high - 1, 0))
            return Value(f"{a.within(level)} {'//' if op == '/' else op} {right}", t, level, low=0, high=high)
        code = f"{a.within(level)} {op} {right}"
        low, high = _bounds(op, a, b)
        if a.const == 0 and op == "+":
            return replace(b, type=t)
        const = None
        if isinstance(a.const, int) and isinstance(b.const, int):
            const = {
                "+": a.const + b.const,
                "-": a.const - b.const,
                "*": a.const * b.const,
                "&": a.const & b.const,
                "|": a.const | b.const,
                "^": a.const ^ b.const,
            }[op]
            low = high = const
        plain = None
        if a.plain or b.plain:
            left, without = a.plain or a, b.plain or b
            plain = Value(f"{left.within(level)} {op} {without.within(level + 1)}", t, level)
        return self._fitted(Value(code, t, level, low=low, high=high, const=const, plain=plain))

    def _common(self, a: Type, b: Type) -> Type:
        if "float" in (a, b):
            return "float"
        (bits, signed), (other, _) = _INTEGERS[a], _INTEGERS[b]
        if bits == other:
            return a if not signed else b
        return a if bits > other else b

    def _shifted(self, op: str, a: Value, b: Value) -> Value:
        code = f"{a.within(_SHIFT)} {op} {b.within(_SHIFT + 1)}"
        known = isinstance(a.const, int) and isinstance(b.const, int)
        if op == ">>":
            low, high = a.low >> (max(b.low, 0) if a.low >= 0 else max(b.low, 0)), a.high >> max(b.low, 0)
            const = a.const >> b.const if known else None  # type: ignore[operator]
            return Value(
                code,
                a.type,
                _SHIFT,
                low=min(low, a.low) if const is None else const,
                high=high if const is None else const,
                const=const,
            )
        most = min(max(b.high, 0), 64)
        const = a.const << b.const if known else None  # type: ignore[operator]
        if const is not None:
            return self._fitted(Value(code, a.type, _SHIFT, low=const, high=const, const=const))
        return self._fitted(Value(code, a.type, _SHIFT, low=a.low << most if a.low < 0 else 0, high=a.high << most))

    def _of_pointers(self, node: Any, a: Value, b: Value) -> Value:
        op = node.op
        a, b = self._decayed(a), self._decayed(b)
        if op in ("==", "!="):
            word = "is" if op == "==" else "is not"
            if b.const == 0 or b.code == "None":
                return Value(f"{a.within(_OR)} {word} None", "_Bool", _COMPARED, low=0, high=1)
            if a.const == 0 or a.code == "None":
                return Value(f"{b.within(_OR)} {word} None", "_Bool", _COMPARED, low=0, high=1)
            a, b = self._unpaired(a, node), self._unpaired(b, node)
            if a.at == b.at:
                return Value(f"{a.within(_OR)} {word} {b.within(_OR)}", "_Bool", _COMPARED, low=0, high=1)
            both = "and" if op == "==" else "or"
            return Value(
                f"{a.within(_OR)} {word} {b.within(_OR)} {both} {a.at} {op} {b.at}", "_Bool", _EITHER, low=0, high=1
            )
        if op in ("<", ">", "<=", ">=") and _is_pointer(a) and _is_pointer(b):
            return Value(f"{a.at} {op} {b.at}", "_Bool", _COMPARED, low=0, high=1)
        if op == "-" and _is_pointer(b):
            return self._integer(f"{a.at} - {b.at}", "ptrdiff_t", _SUM)
        if op in ("+", "-") and (_is_pointer(a) or _is_pointer(b)):
            if _is_pointer(b):
                a, b = b, a
            a = self._as_list(self._unpaired(a, node), None)
            offset = self._scaled(b, a.type[1])
            return replace(
                Value(a.code, a.type), at=_moved(a.at, offset) if op == "+" else f"{a.at} - {_operand(offset)}"
            )
        raise self.refuse(node, f"{op} of pointers")

    def _logical(self, node: Any, scope: Scope) -> Value:
        op = node.op
        a = self._truth(self.expression(node.left, scope))
        if isinstance(a.const, int):
            if bool(a.const) == (op == "||"):
                return a
            return self._truth(self.expression(node.right, scope))
        self._conditional += 1
        b = self._truth(self.expression(node.right, scope))
        self._conditional -= 1
        if isinstance(b.const, int) and not _has_call(node.left):
            return b if bool(b.const) == (op == "||") else a
        level = _BOTH if op == "&&" else _EITHER
        return Value(
            f"{a.within(level)} {'and' if op == '&&' else 'or'} {b.within(level + 1)}", "_Bool", level, low=0, high=1
        )

    def _of_ternaryop(self, node: Any, scope: Scope) -> Value:
        condition = self._truth(self.expression(node.cond, scope))
        if isinstance(condition.const, int):
            return self.expression(node.iftrue if condition.const else node.iffalse, scope)
        self._conditional += 1
        a, b = self.expression(node.iftrue, scope), self.expression(node.iffalse, scope)
        self._conditional -= 1
        if _is_pointer(a) or _is_pointer(b):
            return self._chosen_pointer(node, condition, self._decayed(a), self._decayed(b))
        struct = isinstance(a.type, tuple) and a.type[0] == "struct"
        if not struct and not (isinstance(a.type, tuple) and a.type == b.type) and a.type != b.type:
            t = self._common(*(one.type if one.type == "float" else self._promoted(one).type for one in (a, b)))
            if not (a.type == b.type == "_Bool"):
                a, b = (
                    self._converted(self._promoted(a) if a.type != "float" else a, t),
                    self._converted(self._promoted(b) if b.type != "float" else b, t),
                )
        code = f"{a.within(_EITHER)} if {condition.within(_EITHER)} else {b.within(_CHOICE)}"
        return Value(code, a.type, _CHOICE, low=min(a.low, b.low), high=max(a.high, b.high), fresh=a.fresh and b.fresh)

    def _chosen_pointer(self, node: Any, condition: Value, a: Value, b: Value) -> Value:
        t = a.type if _is_pointer(a) else b.type
        if "*" in (a.at, b.at):
            raise self.refuse(node, "a pointer from a call within a condition")
        if a.const == 0 or a.code == "None":
            a = replace(b, code="None", at="0", level=_ATOM)
        if b.const == 0 or b.code == "None":
            b = replace(a, code="None", at="0", level=_ATOM)
        if a.single != b.single:
            a, b = (
                one if one.single else replace(Value(f"{one.within(_ATOM)}[{one.at}]", one.type), single=True)
                for one in (a, b)
            )
        choose = f" if {condition.within(_EITHER)} else "
        code = a.code if a.code == b.code else f"({a.within(_EITHER)}{choose}{b.within(_CHOICE)})"
        at = a.at if a.at == b.at else f"({a.at}{choose}{b.at})"
        return replace(Value(code, t), at=at, single=a.single)

    def _of_compoundliteral(self, node: Any, scope: Scope) -> Value:
        t = self._complete(self.type_of(node.type.type), node.init)
        return replace(Value(self._initial(node.init, t, scope, None), t), fresh=True)

    def _of_exprlist(self, node: Any, scope: Scope) -> Value:
        raise self.refuse(node, "a comma")

    def _of_assignment(self, node: Any, scope: Scope) -> Value:
        raise self.refuse(node, "an assignment in an expression")

    # ---- calls

    def _of_funccall(self, node: Any, scope: Scope) -> Value:
        given = node.args.exprs if node.args else []
        name = node.name.name if isinstance(node.name, c_ast.ID) else ""
        if name in ("memcpy", "memmove", "memset") and name not in self.functions:
            raise self.refuse(node, f"{name} within an expression")
        if name in _NATIVE:
            return Value(f"{name}({', '.join(self.expression(one, scope).code for one in given)})", _NATIVE[name])
        called = self.expression(node.name, scope)
        if isinstance(called.type, tuple) and called.type[0] == "ptr":
            called = self._target(called, node)
        if not (isinstance(called.type, tuple) and called.type[0] == "fn"):
            raise self.refuse(node, "a call of no function")
        decl = called.type[1]
        key = called.type[2] if len(called.type) > 2 else called.slot
        types = [
            self.type_of(one.type)
            for one in (decl.args.params if decl.args else [])
            if not isinstance(one, c_ast.EllipsisParam)
        ]
        types = [] if types == ["void"] else types
        codes: list[str] = []
        for place, (one, t) in enumerate(zip(given, types, strict=True)):
            slot: Any = ("param", key, place)
            t = ("ptr", t[1]) if isinstance(t, tuple) and t[0] == "arr" else t
            value = self.expression(one, scope)
            if value.at == "*" and (slot, "inside") in self.flags:
                codes.append(f"*{value.code}")
                continue
            if isinstance(t, tuple) and t[0] == "fn":
                self._link_function(value, slot)
            code, at = self._stored(value, t, slot, one)
            codes += [code, at] if (slot, "inside") in self.flags else [code]
        result: Type = self.type_of(decl.type)
        code = f"{called.code}({', '.join(codes)})"
        slot = ("result", key)
        if isinstance(result, tuple) and result[0] == "ptr":
            entry = self._spread(result[1])[1]
            single = isinstance(entry, tuple) and entry[0] == "struct" and (slot, "list") not in self.flags
            return Value(
                code, result, at="*" if (slot, "inside") in self.flags and not single else "0", single=single, slot=slot
            )
        value = self._lvalue(code, result, slot)
        return replace(value, fresh=True)

    def _link_function(self, value: Value, slot: Any) -> None:
        if isinstance(value.type, tuple) and value.type[0] == "fn":
            self._link(value.type[2] if len(value.type) > 2 else value.slot, slot)

    def _stored(self, value: Value, t: Type, slot: Any, node: Any) -> tuple[str, str]:
        """A value as it is kept in a variable, a field or a parameter of a type: its code, and its offset."""
        if isinstance(t, tuple) and t[0] == "fn":
            if value.const == 0 or value.code == "None":
                return "None", "0"
            self._link_function(value, slot)
            return value.code, "0"
        if isinstance(t, tuple) and t[0] == "ptr":
            if value.const == 0 or value.code == "None":
                return "None", "0"
            value = self._unpaired(self._decayed(value), node)
            if not _is_pointer(value):
                raise self.refuse(node, "a number as a pointer")
            entry = self._spread(t[1])[1]
            if isinstance(entry, tuple) and entry[0] == "struct" and not value.type[1] == "void":
                as_list = (slot, "list") in self.flags
                if value.single:
                    if as_list and value.slot is not None:
                        self.flags.add((value.slot, "list"))
                    return (f"[{value.code}]" if as_list else value.code), "0"
                if not as_list:
                    return f"{value.within(_ATOM)}[{value.at}]", "0"
            if value.at != "0":
                self.flags.add((slot, "inside"))
            return value.code, value.at
        if isinstance(t, tuple) and t[0] == "struct":
            return value.code, "0"
        if isinstance(t, tuple) and t[0] == "enum":
            return self._converted(value, "int32_t").code, "0"
        return self._converted(value, t).code, "0"

    # ---- functions and statements

    def _line(self, text: str) -> None:
        self.out.append("    " * self._depth + text)

    _depth = 0

    def _print_function(self, function: Function) -> None:
        node = function.node
        name, self._function = node.decl.name, function
        key = function.file + ":" + name if len(self.functions[name]) > 1 else name
        self._key, self._temporaries, self._conditional = key, 0, 0
        self._boxed = _addressed(node.body)
        self._result = self.type_of(node.decl.type.type)
        scope, parameters, first = Scope(), [], []
        written = _changed(node.body)
        self._names: set[str] = set()
        place = 0
        for one in node.decl.type.args.params if node.decl.type.args else []:
            t = self.type_of(one.type)
            if t == "void":
                continue
            t = ("ptr", t[1]) if isinstance(t, tuple) and t[0] == "arr" else t
            slot, python = ("param", key, place), self._python(one.name or f"unused_{place}")
            place += 1
            self._names.add(python)
            struct = isinstance(t, tuple) and t[0] == "struct"
            boxed = one.name in self._boxed and not struct
            scope.names[one.name] = (python, t, slot, boxed)
            parameters.append(python)
            if (slot, "inside") in self.flags:
                parameters.append(f"{python}_at")
            if boxed:
                first.append(f"{python} = [{python}]")
            if struct and (one.name in written or one.name in self._boxed):
                first.append(f"{python} = {python}.copy()")
        self._depth = 0
        self.out += ["", ""]
        self._line(f"def {self._global(name, function.file)}({', '.join(parameters)}):")
        self._depth = 1
        self.out += _docstring(self._said(function), 1)
        for text in first:
            self._line(text)
        self._cursor = function.line
        start = len(self.out)
        if [t for _, t, _, _ in scope.names.values()] == [("ptr", "void"), ("ptr", "void"), "size_t"]:
            self._line(f"share({', '.join(parameters)})")  # the memory of any object
        elif not self._is_of_bits(node, scope):
            self._block(node.body, scope)
        if len(self.out) == start:
            self._line("pass")
        self._depth = 0

    def _is_of_bits(self, node: Any, scope: Scope) -> bool:
        """Prints the body of a function that does nothing but take a float's bits, or the float of these bits."""
        items = node.body.block_items or []
        if not (
            len(items) == 3
            and isinstance(items[0], c_ast.Decl)
            and items[0].init is None
            and isinstance(items[2], c_ast.Return)
        ):
            return False
        call, back = items[1], items[2].expr
        of_memory = isinstance(call, c_ast.FuncCall) and isinstance(call.name, c_ast.ID) and call.name.name == "memcpy"
        if not (of_memory and isinstance(back, c_ast.ID) and back.name == items[0].name and len(scope.names) == 1):
            return False
        ((python, t, _, _),) = scope.names.values()
        if {t, self._result} != {"float", "uint32_t"}:
            return False
        while self.out[-1].strip() == f"{python} = [{python}]":
            self.out.pop()
        self._line(f"return {'bits' if t == 'float' else 'from_bits'}({python})")
        return True

    def _said(self, function: Function) -> str:
        """The comment before a function, or before its declaration."""
        places = [(function.file, function.line)]
        if function.key in self.prototypes:
            places.append(self.prototypes[function.key][1])
        for file, line in places:
            comments = self.unit.comments.get(file)
            if comments and line - 1 in comments.alone:
                return comments.alone[line - 1][1]
        return ""

    def _block(self, node: Any, scope: Scope) -> None:
        items = (node.block_items or []) if isinstance(node, c_ast.Compound) else [node]
        start = len(self.out)
        for one in items:
            self._statement(one, scope)
        if not any(not line.lstrip().startswith("#") for line in self.out[start:]):
            self._line("pass")

    def _statement(self, node: Any, scope: Scope) -> None:
        file, line = self.place(node)
        comments = self.unit.comments.get(file) if file == self._file else None
        if comments is not None:
            for last in range(self._cursor + 1, line):
                if last in comments.alone:
                    for text in comments.alone[last][1].split("\n"):
                        self._line(f"# {text}".rstrip())
            new = line > self._cursor
            self._cursor = max(self._cursor, line)
        at = len(self.out)
        method = getattr(self, f"_do_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refuse(node, type(node).__name__)
        method(node, scope)
        if comments is not None and new and line in comments.behind and len(self.out) > at:
            self.out[at] = _with_comment(self.out[at], comments.behind[line])

    def _do_compound(self, node: Any, scope: Scope) -> None:
        for one in node.block_items or []:
            self._statement(one, scope)

    def _do_emptystatement(self, node: Any, scope: Scope) -> None:
        del node, scope

    def _do_pragma(self, node: Any, scope: Scope) -> None:
        del node, scope

    def _do_decl(self, node: Any, scope: Scope) -> None:
        if isinstance(node.type, (c_ast.Enum, c_ast.Struct, c_ast.Union)) and not node.name:
            self.type_of(node.type)
            return
        t = self._complete(self.type_of(node.type), node.init)
        python = self._python(node.name)
        if node.name in scope.names:
            while python in self._names:
                python += "_"
        self._names.add(python)
        slot = ("local", self._key, python)
        if "static" in node.storage:
            name = f"{self._key.rpartition(':')[2]}_{node.name}"
            body = next(k for k in range(len(self.out) - 1, -1, -1) if self.out[k].startswith("def "))
            before, self.out = self.out[body:], self.out[:body]
            while self.out and not self.out[-1]:
                self.out.pop()
            self._print_table(node, name)
            self.out += ["", "", *before]
            scope.names[node.name] = (name, t, slot, False)
            return
        boxed = node.name in self._boxed and not (isinstance(t, tuple) and t[0] in ("struct", "arr"))
        if node.init is None:
            scope.names[node.name] = (python, t, slot, boxed)
            if boxed:
                self._line(f"{python} = [{self._zero(t)}]")
            elif isinstance(t, tuple) and t[0] in ("struct", "arr"):
                self._line(f"{python} = {self._zero(t)}")
            return
        if isinstance(node.init, c_ast.InitList):
            code = self._initial(node.init, t, scope, slot)
            scope.names[node.name] = (python, t, slot, boxed)
            self._line(f"{python} = [{code}]" if boxed else f"{python} = {code}")
            return
        value = self.expression(node.init, scope)
        scope.names[node.name] = (python, t, slot, boxed)
        if isinstance(t, tuple) and t[0] == "struct":
            self._line(f"{python} = {value.code}" if value.fresh else f"{python} = {value.within(_ATOM)}.copy()")
            return
        if boxed:
            code, _ = self._stored(value, t, slot, node)
            self._line(f"{python} = [{code}]")
            return
        self._set(python, t, slot, value, node)

    def _set(self, target: str, t: Type, slot: Any, value: Value, node: Any) -> None:
        """An assignment to a variable, a field or an entry."""
        inside = (slot, "inside") in self.flags
        if value.at == "*":
            self.flags.add((slot, "inside"))
            self._line(f"{target}, {target}_at = {value.code}")
            return
        code, at = self._stored(value, t, slot, node)
        if not inside:
            self._line(f"{target} = {code}")
        elif code == target:
            self._line(f"{target}_at = {at}")
        elif at in ("0", f"{code}_at") or not re.search(rf"\b{re.escape(target)}\b", at):
            self._line(f"{target}, {target}_at = {code}, {at}")
        else:
            self._line(f"{target}, {target}_at = {code}, {at}")

    def _do_assignment(self, node: Any, scope: Scope) -> None:
        target = self.expression(node.lvalue, scope)
        value = self.expression(node.rvalue, scope)
        if node.op != "=":
            binary = c_ast.BinaryOp(node.op[:-1], node.lvalue, node.rvalue, node.coord)
            value = self.expression(binary, scope)
            short = self._shortened(target, value, node, scope)
            if short:
                self._line(short)
                return
        if isinstance(target.type, tuple) and target.type[0] == "struct":
            self._line(f"{target.within(_ATOM)}.assign({value.code})")
            return
        if isinstance(target.type, tuple) and target.type[0] == "arr":
            raise self.refuse(node, "an assignment of an array")
        self._set(target.code, target.type, target.slot, value, node)

    def _shortened(self, target: Value, value: Value, node: Any, scope: Scope) -> str:
        """x += y, where y is added as it is."""
        code = self._converted(value, target.type).code if not isinstance(target.type, tuple) else ""
        operator = "//=" if node.op == "/=" and target.type != "float" else node.op
        start = f"{target.code} {operator[:-1]} "
        if not code.startswith(start) or code != value.code or " & 0x" in code:
            return ""
        right = code[len(start) :]
        other = self.expression(node.rvalue, scope)
        if right not in (other.code, f"({other.code})"):
            return ""
        return f"{target.code} {operator} {other.code}"

    def _do_unaryop(self, node: Any, scope: Scope) -> None:
        if node.op not in ("p++", "p--", "++", "--"):
            raise self.refuse(node, f"the operator {node.op} as a statement")
        one = c_ast.Constant("unsigned int", "1u")
        target = self.expression(node.expr, scope)
        if _is_pointer(target):
            value = self.expression(c_ast.BinaryOp("+" if "+" in node.op else "-", node.expr, one, node.coord), scope)
            self._set(target.code, target.type, target.slot, value, node)
            return
        self._do_assignment(c_ast.Assignment("+=" if "+" in node.op else "-=", node.expr, one, node.coord), scope)

    def _do_cast(self, node: Any, scope: Scope) -> None:
        if not _has_call(node.expr):
            return  # (void)unused
        self._statement(node.expr, scope)

    def _do_funccall(self, node: Any, scope: Scope) -> None:
        name = node.name.name if isinstance(node.name, c_ast.ID) else ""
        if name in ("memcpy", "memmove"):
            self._copy(node, scope)
        elif name == "memset":
            self._fill(node, scope)
        else:
            self._line(self.expression(node, scope).code)

    def _counted(self, node: Any, entry: Type, scope: Scope) -> str:
        """Entries of a length in bytes that contains one sizeof."""
        if isinstance(node, c_ast.UnaryOp) and node.op == "sizeof":
            t = (
                self.type_of(node.expr.type)
                if isinstance(node.expr, c_ast.Typename)
                else self.expression(node.expr, scope).type
            )
            if self._spread(t)[1] != entry:
                raise self.refuse(node, "a copy of another type")
            return self._count_code(t)
        if isinstance(node, c_ast.BinaryOp) and node.op == "*":
            for sized, factor in ((node.left, node.right), (node.right, node.left)):
                if isinstance(sized, c_ast.UnaryOp) and sized.op == "sizeof":
                    count = self._counted(sized, entry, scope)
                    number = self._index(self.expression(factor, scope))
                    return number.code if count == "1" else f"{number.within(_PRODUCT)} * ({count})"
            inner = (
                self._counted(node.right, entry, scope)
                if _has_size(node.right)
                else self._counted(node.left, entry, scope)
            )
            other = self._index(self.expression(node.left if _has_size(node.right) else node.right, scope))
            return f"{other.within(_PRODUCT)} * ({inner})" if inner != "1" else other.code
        raise self.refuse(node, "a length in bytes without one sizeof")

    def _copy(self, node: Any, scope: Scope) -> None:
        to_node, of_node, length = node.args.exprs
        to, of = (self._unpaired(self._decayed(self.expression(one, scope)), node) for one in (to_node, of_node))
        entry, other = self._spread(to.type[1])[1], self._spread(of.type[1])[1]
        if entry != other:
            if {entry, other} == {"float", "uint32_t"} and not (to.single or of.single):
                call = "bits" if other == "float" else "from_bits"
                self._line(f"{to.code}[{to.at}] = {call}({of.code}[{of.at}])")
                return
            raise self.refuse(node, "a copy to another type")
        struct = isinstance(entry, tuple) and entry[0] == "struct"
        if to.single and of.single:
            self._line(f"{to.within(_ATOM)}.assign({of.code})")
            return
        count = self._counted(length, entry, scope)
        if struct:
            self._line(f"assign_all({to.code}, {to.at}, {of.code}, {of.at}, {count})")
        else:
            self._line(f"{to.code}[{_slice(to.at, count)}] = {of.code}[{_slice(of.at, count)}]")

    def _fill(self, node: Any, scope: Scope) -> None:
        to_node, what, length = node.args.exprs
        if self.expression(what, scope).const != 0:
            raise self.refuse(node, "memset with another value than 0")
        to = self._unpaired(self._decayed(self.expression(to_node, scope)), node)
        entry = self._spread(to.type[1])[1]
        if entry == "void":
            self._line(f"clear({to.code})")
            return
        if to.single:
            self._line(f"{to.within(_ATOM)}.clear()")
            return
        count = self._counted(length, entry, scope)
        if isinstance(entry, tuple) and entry[0] == "struct":
            name = "one"
            self._line(f"for {name} in {to.code}[{_slice(to.at, count)}]:")
            self._line(f"    {name}.clear()")
            return
        self._line(f"{to.code}[{_slice(to.at, count)}] = [{self._zero(entry)}] * {_operand(count)}")

    def _do_return(self, node: Any, scope: Scope) -> None:
        if node.expr is None:
            self._line("return")
            return
        slot, t = ("result", self._key), self._result
        value = self.expression(node.expr, scope)
        if isinstance(t, tuple) and t[0] == "struct":
            local = isinstance(node.expr, c_ast.ID)
            self._line(f"return {value.code}" if value.fresh or local else f"return {value.within(_ATOM)}.copy()")
            return
        if value.at == "*":
            self.flags.add((slot, "inside"))
            self._line(f"return {value.code}")
            return
        code, at = self._stored(value, t, slot, node)
        self._line(f"return {code}, {at}" if (slot, "inside") in self.flags else f"return {code}")

    def _do_if(self, node: Any, scope: Scope, word: str = "if") -> None:
        condition = self._truth(self.expression(node.cond, scope))
        if isinstance(condition.const, int):
            taken = node.iftrue if condition.const else node.iffalse
            if word == "elif":
                if taken is not None:
                    self._line("else:")
                    self._indented(taken, scope)
            elif taken is not None:
                for one in (taken.block_items or []) if isinstance(taken, c_ast.Compound) else [taken]:
                    self._statement(one, scope)
            return
        self._line(f"{word} {condition.code}:")
        self._indented(node.iftrue, scope)
        other = node.iffalse
        if isinstance(other, c_ast.Compound) and not other.block_items:
            return
        if isinstance(other, c_ast.If) and not self._needs_lines(other.cond, scope):
            self._do_if(other, scope, "elif")
        elif other is not None:
            self._line("else:")
            self._indented(other, scope)

    def _needs_lines(self, node: Any, scope: Scope) -> bool:
        """Whether an expression needs statements before it."""
        before = len(self.out)
        temporaries = self._temporaries
        self.expression(node, scope)
        needs = len(self.out) > before
        del self.out[before:]
        self._temporaries = temporaries
        return needs

    def _indented(self, node: Any, scope: Scope) -> None:
        self._depth += 1
        self._block(node, scope.inner())
        self._depth -= 1

    _next: Any = None

    def _do_while(self, node: Any, scope: Scope) -> None:
        before = len(self.out)
        condition = self._truth(self.expression(node.cond, scope))
        if len(self.out) > before:
            raise self.refuse(node, "a pointer from a call within a condition")
        self._line(f"while {condition.code}:")
        outer, self._next = self._next, None
        self._indented(node.stmt, scope)
        self._next = outer

    def _do_dowhile(self, node: Any, scope: Scope) -> None:
        if _has(node.stmt, c_ast.Continue):
            raise self.refuse(node, "continue in do")
        self._line("while True:")
        outer, self._next = self._next, None
        self._indented(node.stmt, scope)
        self._next = outer
        self._depth += 1
        condition = self._truth(self.expression(node.cond, scope))
        self._line(f"if not {condition.within(_NOT)}:")
        self._line("    break")
        self._depth -= 1

    def _do_for(self, node: Any, scope: Scope) -> None:
        inner = scope.inner()
        counted = self._range_of(node, inner)
        outer = self._next
        if counted:
            self._next = None
            self._line(counted)
            self._indented(node.stmt, inner)
            self._next = outer
            return
        for one in node.init.decls if isinstance(node.init, c_ast.DeclList) else [node.init] if node.init else []:
            self._statement(one, inner)
        condition = self._truth(self.expression(node.cond, inner)) if node.cond else Value("True", "_Bool")
        self._next = (node.next, inner)
        self._line(f"while {condition.code}:")
        self._indented(node.stmt, inner)
        self._next = outer
        self._depth += 1
        self._step(node.next, inner)
        self._depth -= 1

    def _step(self, node: Any, scope: Scope) -> None:
        for one in node.exprs if isinstance(node, c_ast.ExprList) else [node] if node else []:
            self._statement(one, scope)

    def _range_of(self, node: Any, scope: Scope) -> str:
        """for NAME in range(...), if the loop counts and its end stays."""
        init, condition, step = node.init, node.cond, node.next
        if not (isinstance(init, c_ast.DeclList) and len(init.decls) == 1 and isinstance(condition, c_ast.BinaryOp)):
            return ""
        one = init.decls[0]
        if not (
            isinstance(condition.left, c_ast.ID)
            and condition.left.name == one.name
            and condition.op in ("<", "<=", ">")
        ):
            return ""
        by = 0
        if isinstance(step, c_ast.UnaryOp) and step.op in ("p++", "++", "p--", "--"):
            by = 1 if "+" in step.op else -1
        elif (
            isinstance(step, c_ast.Assignment) and step.op in ("+=", "-=") and one.name not in _identifiers(step.rvalue)
        ):
            number = self.expression(step.rvalue, scope).const
            by = (number if step.op == "+=" else -number) if isinstance(number, int) else 0
        if by == 0 or (by < 0) != (condition.op == ">") or one.name in _assigned(node.stmt) or one.name in self._boxed:
            return ""
        if self._may_change(condition.right, node.stmt, scope) or not isinstance(self.type_of(one.type), str):
            return ""
        start, end = self.expression(one.init, scope), self.expression(condition.right, scope)
        t = self.type_of(one.type)
        python = self._python(one.name)
        if one.name in scope.names:
            while python in self._names:
                python += "_"
        self._names.add(python)
        scope.names[one.name] = (python, t, ("local", self._key, python), False)
        last = self._index(end)
        until = last.code if condition.op != "<=" else f"{last.within(_SUM)} + 1"
        first = self._index(start)
        parts = (
            [until]
            if first.const == 0 and by == 1
            else [first.code, until]
            if by == 1
            else [first.code, until, str(by)]
        )
        return f"for {python} in range({', '.join(parts)}):"

    def _may_change(self, end: Any, body: Any, scope: Scope) -> bool:
        """Whether a loop's body, or a function that it calls, may change what the loop's end is made of."""
        del scope
        if set(_identifiers(end)) & (_assigned(body) | _addressed(body)):
            return True
        read = {one.field.name for one in _nodes(end) if isinstance(one, c_ast.StructRef)}
        if any(
            isinstance(one, c_ast.ArrayRef) or (isinstance(one, c_ast.UnaryOp) and one.op == "*") for one in _nodes(end)
        ):
            read.add(_ENTRY)
        written = self._writes(body)
        return bool(read) and (_EVERYTHING in written or bool(read & written))

    def _writes(self, node: Any) -> set[str]:
        """Names of the fields that a statement writes, with all that it calls."""
        found = _written_fields(node)
        for one in _nodes(node):
            if not isinstance(one, c_ast.FuncCall):
                continue
            name = one.name.name if isinstance(one.name, c_ast.ID) else ""
            if name in ("memcpy", "memmove", "memset"):
                to = one.args.exprs[0]
                found |= {to.field.name, _ENTRY} if isinstance(to, c_ast.StructRef) else {_ENTRY}
                found |= (
                    {_EVERYTHING}
                    if not isinstance(to, (c_ast.StructRef, c_ast.ArrayRef)) and _is_whole(one.args.exprs[2])
                    else set()
                )
            elif name in self.functions:
                called = self._found(name, self._file)
                found |= self._written_by(f"{called.file if called else ''}:{name}", called)
            elif not name:
                of_numbers = isinstance(one.name, c_ast.StructRef) and self._takes_numbers(one.name.field.name)
                found.add(_ENTRY if of_numbers else _EVERYTHING)
        return found

    _written: dict[Any, set[str]]

    def _takes_numbers(self, name: str) -> bool:
        """Whether the functions behind fields of this name get numbers alone."""
        kinds = [fields[name] for fields in self.structs.values() if name in fields and fields[name][0] == "fn"]
        types = [
            self._spread(self.type_of(p.type)) for kind in kinds for p in (kind[1].args.params if kind[1].args else [])
        ]
        entries = [self._spread(t[1])[1] if isinstance(t, tuple) and t[0] == "ptr" else t for _, t in types]
        return bool(kinds) and all(isinstance(one, str) and one != "void" for one in entries)

    def _written_by(self, key: str, function: Function | None) -> set[str]:
        if key not in self._written:
            self._written[key] = set()  # no recursion in the core
            if function is not None:
                file, self._file = self._file, function.file
                self._written[key] = self._writes(function.node.body)
                self._file = file
        return self._written[key]

    def _do_switch(self, node: Any, scope: Scope) -> None:
        what = self.expression(node.cond, scope)
        subject = what.code
        if not re.fullmatch(r"[\w.]+", subject):
            self._line(f"case = {subject}")
            subject = "case"
        waiting: list[str] = []
        word = "if"
        inner = scope.inner()
        items = node.stmt.block_items or []
        for k, case in enumerate(items):
            last = isinstance(case, c_ast.Default)
            if not isinstance(case, (c_ast.Case, c_ast.Default)):
                raise self.refuse(case, "a statement between cases")
            if not last:
                waiting.append(self.expression(case.expr, scope).code)
            body = list(case.stmts or [])
            while len(body) == 1 and isinstance(body[0], c_ast.Compound):
                body = list(body[0].block_items or [])
            if not body and not last:
                continue
            if last and k + 1 < len(items):
                raise self.refuse(case, "a default before other cases")
            ends = bool(body) and isinstance(body[-1], (c_ast.Break, c_ast.Return, c_ast.Continue))
            if not ends and k + 1 < len(items):
                raise self.refuse(case, "a case that falls into the next")
            if body and isinstance(body[-1], c_ast.Break):
                body = body[:-1]
            if any(_breaks(one) for one in body):
                raise self.refuse(case, "a break within a case")
            if last:
                if not body:
                    return
                self._line("else:" if word == "elif" else "if True:")
            else:
                test = f"{subject} == {waiting[0]}" if len(waiting) == 1 else f"{subject} in ({', '.join(waiting)})"
                self._line(f"{word} {test}:")
            word, waiting = "elif", []
            self._depth += 1
            self._block(c_ast.Compound(body), inner.inner())
            self._depth -= 1

    def _do_break(self, node: Any, scope: Scope) -> None:
        del node, scope
        self._line("break")

    def _do_continue(self, node: Any, scope: Scope) -> None:
        del node, scope
        if self._next is not None:
            step, inner = self._next
            cursor = self._cursor
            self._step(step, inner)
            self._cursor = cursor
        self._line("continue")

    def _do_ternaryop(self, node: Any, scope: Scope) -> None:
        raise self.refuse(node, "a condition as a statement")


_ENTRY, _EVERYTHING = "[]", "*"  # beside names of fields: an entry of an array; a whole struct


def _is_seen(file: str, decl: Any) -> bool:
    """Whether other files see a function or a table."""
    return file.endswith(".h") or "static" not in decl.storage


def _file_of(node: Any) -> str:
    return str(node.coord.file)


def _parsed(unit: Unit) -> Iterator[Any]:
    """The declarations of a unit. Sources are parsed one by one: each has names of its own."""
    names = [*_INTEGERS]
    for first, text in unit.texts():
        known = " ".join(f"typedef int {name};" for name in names)
        try:
            nodes = _nodes_of(f"{known}\n{text}", str(first))
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
    yield from _nodes_of(known + "\n".join(["", *constants]), "macros")


@cache
def _nodes_of(text: str, name: str) -> list[Any]:
    """The declarations of a text behind its first line: the core's are the same for every mechanism."""
    return [one for one in c_parser.CParser().parse(text, name).ext if one.coord.line > 1]


def _is_pointer(value: Value) -> bool:
    return isinstance(value.type, tuple) and value.type[0] in ("ptr", "arr")


def _is_number(value: Value) -> bool:
    return not isinstance(value.type, tuple) or value.type[0] == "enum"


def _nearest(text: str) -> float:
    """The float32 next to a decimal number, as a double: rounded once."""
    exact, near = Fraction(text), np.float32(float(text))
    with np.errstate(over="ignore"):
        close = [np.nextafter(near, end) for end in (np.float32(-np.inf), np.float32(np.inf))]
    finite = [one for one in (near, *close) if np.isfinite(one)]
    return float(min(finite, key=lambda one: (abs(Fraction(float(one)) - exact), int(one.view(np.uint32)) & 1)))


def _bounds(op: str, a: Value, b: Value) -> tuple[int, int]:
    if op == "+":
        return a.low + b.low, a.high + b.high
    if op == "-":
        return a.low - b.high, a.high - b.low
    if op == "*":
        ends = [x * y for x in (a.low, a.high) for y in (b.low, b.high)]
        return min(ends), max(ends)
    if a.low >= 0 and b.low >= 0:
        if op == "&":
            return 0, min(a.high, b.high)
        return 0, (1 << max(a.high.bit_length(), b.high.bit_length())) - 1
    if op == "&" and (a.low >= 0 or b.low >= 0):
        return 0, a.high if a.low >= 0 else b.high
    return min(a.low, b.low, -(1 << 63)), max(a.high, b.high, (1 << 63) - 1)


def _moved(at: str, by: str) -> str:
    """The sum of two offsets."""
    if by == "0":
        return at
    return by if at == "0" else f"{at} + {by}"


def _operand(code: str) -> str:
    return code if re.fullmatch(r"[\w.]+", code) else f"({code})"


def _slice(at: str, count: str) -> str:
    if at == "0":
        return f":{count}"
    if _NUMBERS.match(at) and _NUMBERS.match(count):
        return f"{at}:{int(at) + int(count)}"
    return f"{at} : {at} + {count}"


def _with_comment(line: str, said: str) -> str:
    said = " ".join(said.split())
    return f"{line}  # {said}" if said and len(line) + len(said) + 4 <= 120 else line


def _docstring(said: str, depth: int) -> list[str]:
    if not said:
        return []
    pad = "    " * depth
    lines = said.replace("\\", "\\\\").replace('"""', "'''").split("\n")
    end = " " if lines[-1].endswith('"') else ""
    if len(lines) == 1:
        return [f'{pad}"""{lines[0]}{end}"""']
    return [f'{pad}"""{lines[0]}', *(f"{pad}{one}".rstrip() for one in lines[1:]), f'{pad}"""']


def _short(file: str) -> str:
    parts = Path(file).parts
    return "/".join(parts[-2:])


def _nodes(node: Any) -> Iterator[Any]:
    yield node
    for _, child in node.children():
        yield from _nodes(child)


def _identifiers(node: Any) -> list[str]:
    return [] if node is None else [one.name for one in _nodes(node) if isinstance(one, c_ast.ID)]


def _has(node: Any, kind: type) -> bool:
    return any(isinstance(one, kind) for one in _nodes(node))


def _has_call(node: Any) -> bool:
    return _has(node, c_ast.FuncCall)


def _has_size(node: Any) -> bool:
    return any(isinstance(one, c_ast.UnaryOp) and one.op == "sizeof" for one in _nodes(node))


def _addressed(node: Any) -> set[str]:
    """Variables whose address is taken."""
    return {
        one.expr.name
        for one in _nodes(node)
        if isinstance(one, c_ast.UnaryOp) and one.op == "&" and isinstance(one.expr, c_ast.ID)
    }


def _targets(node: Any) -> Iterator[Any]:
    for one in _nodes(node):
        if isinstance(one, c_ast.Assignment):
            yield one.lvalue
        elif isinstance(one, c_ast.UnaryOp) and one.op in ("p++", "p--", "++", "--"):
            yield one.expr


def _changed(node: Any) -> set[str]:
    """Variables that are written, or a part of them."""
    return {name for one in _targets(node) for name in _identifiers(one)}


def _assigned(node: Any) -> set[str]:
    """Variables that are written as a whole."""
    return {one.name for one in _targets(node) if isinstance(one, c_ast.ID)}


def _written_fields(node: Any) -> set[str]:
    """Names of the fields that are written, "[]" for an entry."""
    return {
        one.field.name if isinstance(one, c_ast.StructRef) else _ENTRY
        for one in _targets(node)
        if not isinstance(one, c_ast.ID)
    }


def _is_whole(length: Any) -> bool:
    """Whether a length in bytes is that of a whole struct."""
    return isinstance(length, c_ast.ID) or (
        isinstance(length, c_ast.UnaryOp) and isinstance(length.expr, c_ast.UnaryOp)
    )


def _breaks(node: Any) -> bool:
    """Whether a break ends what is around a statement."""
    if isinstance(node, c_ast.Break):
        return True
    if isinstance(node, (c_ast.While, c_ast.For, c_ast.DoWhile, c_ast.Switch)):
        return False
    return any(_breaks(child) for _, child in node.children())
