"""C after its directives -> Python: a unit's functions, tables, constants and structs, in their order."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from pycparser import c_ast

from pvid.twin.printer.loops import Loops
from pvid.twin.printer.syntax import addressed, changed, identifiers
from pvid.twin.printer.term import Function, Scope, Type, docstring, short, with_comment


class Translator(Loops):
    """Prints a unit: `printed` returns the module without its head."""

    def printed(self) -> str:
        """The module, without its head."""
        while True:
            before = len(self.flags)
            text = self._pass()
            self._join()
            if len(self.flags) == before:
                return text

    def _pass(self) -> str:
        self.used_structs, self.used_constants, self.used_enumerators = [], {}, {}
        sections: dict[str, list[str]] = {}
        late: list[str] = []
        for kind, file, one in self.order:
            node = one.node if kind == "function" else one
            if id(node) not in self._wanted:
                continue
            self.out = []
            self._file = file
            if kind == "function":
                self._print_function(one)
            else:
                self._print_table(one)
                if any(self._found(name, file) or self.tables.get(name) for name in identifiers(one.init) if one.init):
                    late += self.out
                    continue
            sections.setdefault(file, []).extend(self.out)
        classes = self._classes()
        constants = [f"{name} = {code}" for name, code in self._ordered(self.used_constants)]
        names = [f"{name} = {code}" for name, code in self.used_enumerators.items()]
        text = [*names, *constants, *classes]
        for file, lines in sections.items():
            text += ["", "", f"# ---- {short(file)}", *lines]
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

    def _classes(self) -> list[str]:
        out: list[str] = []
        for name in list(self.used_structs):
            file, line = self.struct_at[name]
            comments = self.unit.comments.get(file)
            said = comments.alone.get(line - 1, (0, ""))[1] if comments else ""
            out += ["", "", "@struct", f"class {name}:"]
            if said:
                out += docstring(said, 1)
            for one, t in self.structs[name].items():
                _, entry = self._spread(t)
                if isinstance(t, tuple) and t[0] == "arr":
                    what = entry[1] if isinstance(entry, tuple) and entry[0] == "struct" else self._zero(entry)
                    code = f"Array({what}, {self._count_code(t)})"
                else:
                    code = self._field(t, ("field", name, one))
                where, at = self.struct_places[name][one]
                behind = self.unit.comments[where].behind.get(at, "") if where in self.unit.comments else ""
                out.append(with_comment(f"    {self._python(one)} = {code}", behind))
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

    def _print_function(self, function: Function) -> None:
        node = function.node
        name = node.decl.name
        key = function.file + ":" + name if len(self.functions[name]) > 1 else name
        self._key, self._temporaries, self._conditional = key, 0, 0
        self._boxed = addressed(node.body)
        self._result = self.type_of(node.decl.type.type)
        scope, parameters, first = Scope(), [], []
        written = changed(node.body)
        self._names = set()
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
        self.out += docstring(self._said(function), 1)
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
