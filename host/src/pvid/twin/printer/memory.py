"""Variables, fields, arrays and pointers: a list and an offset, or the struct itself; initialisers and tables."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pycparser import c_ast

from pvid.twin.printer.arithmetic import Arithmetic
from pvid.twin.printer.term import (
    ATOM,
    CHOICE,
    COMPARED,
    EITHER,
    INTEGERS,
    LARGEST_SIZE,
    OR,
    SUM,
    UNARY,
    Scope,
    Type,
    Value,
    is_pointer,
    moved,
    operand,
)


class Memory(Arithmetic):
    """What pointers, arrays, fields and variables are."""

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
        return self._lvalue(f"{owner.within(ATOM)}.{self._python(name)}", fields[name], ("field", owner.type[1], name))

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
        return self._lvalue(f"{pointer.within(ATOM)}[{pointer.at}]", inner, ("entry", pointer.slot))

    def _of_arrayref(self, node: Any, scope: Scope) -> Value:
        base = self._unpaired(self.expression(node.name, scope), node)
        place = self.expression(node.subscript, scope)
        if not (isinstance(base.type, tuple) and base.type[0] in ("ptr", "arr")):
            raise self.refuse(node, "a subscript of no array")
        base = self._as_list(base)
        inner = base.type[1]
        count, entry = self._spread(inner)
        at = moved(base.at, self._scaled(place, inner))
        if isinstance(inner, tuple) and inner[0] == "arr":
            return Value(base.code, inner, at=at)
        if base.single:
            return Value(base.code, inner, base.level)
        return self._lvalue(f"{base.within(ATOM)}[{at}]", inner, ("entry", base.slot))

    def _as_list(self, base: Value) -> Value:
        """A pointer to one struct becomes one into a list, where it is moved or has a subscript, even 0."""
        if base.single:
            self.flags.add((base.slot, "list"))
            return replace(base, single=False)
        return base

    def _scaled(self, place: Value, inner: Type) -> str:
        """Offset of an entry `place`, in numbers or structs."""
        code = self._index(place)
        if not (isinstance(inner, tuple) and inner[0] == "arr"):
            return code.code if code.level >= SUM else f"({code.code})"
        if code.const == 0:
            return "0"
        count = self._count_code(inner)
        return count if code.const == 1 else f"{count} * {code.within(UNARY)}"

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

    def _address(self, node: Any, scope: Scope) -> Value:
        inner = node.expr
        if isinstance(inner, c_ast.ArrayRef):
            base = self._unpaired(self._decayed(self.expression(inner.name, scope)), node)
            place = self.expression(inner.subscript, scope)
            base = self._as_list(base)
            return replace(
                Value(base.code, ("ptr", base.type[1])), at=moved(base.at, self._scaled(place, base.type[1]))
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

    def _size(self, node: Any, scope: Scope) -> Value:
        bare, code = self._sized(node, scope)
        if code is None:
            return Value("WHOLE", "size_t", low=0, high=LARGEST_SIZE)
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
            4 if entry == "float" or isinstance(entry, tuple) else 1 if entry == "_Bool" else INTEGERS[entry][0] // 8
        )
        code = self._count_code(t)
        return count * width, f"{width} * {code}" if count != 1 else str(width)

    def _of_pointers(self, node: Any, a: Value, b: Value) -> Value:
        op = node.op
        a, b = self._decayed(a), self._decayed(b)
        if op in ("==", "!="):
            word = "is" if op == "==" else "is not"
            if b.const == 0 or b.code == "None":
                return Value(f"{a.within(OR)} {word} None", "_Bool", COMPARED, low=0, high=1)
            if a.const == 0 or a.code == "None":
                return Value(f"{b.within(OR)} {word} None", "_Bool", COMPARED, low=0, high=1)
            a, b = self._unpaired(a, node), self._unpaired(b, node)
            if a.at == b.at:
                return Value(f"{a.within(OR)} {word} {b.within(OR)}", "_Bool", COMPARED, low=0, high=1)
            both = "and" if op == "==" else "or"
            return Value(
                f"{a.within(OR)} {word} {b.within(OR)} {both} {a.at} {op} {b.at}", "_Bool", EITHER, low=0, high=1
            )
        if op in ("<", ">", "<=", ">=") and is_pointer(a) and is_pointer(b):
            return Value(f"{a.at} {op} {b.at}", "_Bool", COMPARED, low=0, high=1)
        if op == "-" and is_pointer(b):
            return self._integer(f"{a.at} - {b.at}", "ptrdiff_t", SUM)
        if op in ("+", "-") and (is_pointer(a) or is_pointer(b)):
            if is_pointer(b):
                a, b = b, a
            a = self._as_list(self._unpaired(a, node))
            offset = self._scaled(b, a.type[1])
            return replace(
                Value(a.code, a.type), at=moved(a.at, offset) if op == "+" else f"{a.at} - {operand(offset)}"
            )
        raise self.refuse(node, f"{op} of pointers")

    def _chosen_pointer(self, node: Any, condition: Value, a: Value, b: Value) -> Value:
        t = a.type if is_pointer(a) else b.type
        if "*" in (a.at, b.at):
            raise self.refuse(node, "a pointer from a call within a condition")
        if a.const == 0 or a.code == "None":
            a = replace(b, code="None", at="0", level=ATOM)
        if b.const == 0 or b.code == "None":
            b = replace(a, code="None", at="0", level=ATOM)
        if a.single != b.single:
            a, b = (
                one if one.single else replace(Value(f"{one.within(ATOM)}[{one.at}]", one.type), single=True)
                for one in (a, b)
            )
        choose = f" if {condition.within(EITHER)} else "
        code = a.code if a.code == b.code else f"({a.within(EITHER)}{choose}{b.within(CHOICE)})"
        at = a.at if a.at == b.at else f"({a.at}{choose}{b.at})"
        return replace(Value(code, t), at=at, single=a.single)

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
            if not is_pointer(value):
                raise self.refuse(node, "a number as a pointer")
            entry = self._spread(t[1])[1]
            if isinstance(entry, tuple) and entry[0] == "struct" and not value.type[1] == "void":
                as_list = (slot, "list") in self.flags
                if value.single:
                    if as_list and value.slot is not None:
                        self.flags.add((value.slot, "list"))
                    return (f"[{value.code}]" if as_list else value.code), "0"
                if not as_list:
                    return f"{value.within(ATOM)}[{value.at}]", "0"
            if value.at != "0":
                self.flags.add((slot, "inside"))
            return value.code, value.at
        if isinstance(t, tuple) and t[0] == "struct":
            return value.code, "0"
        if isinstance(t, tuple) and t[0] == "enum":
            return self._converted(value, "int32_t").code, "0"
        return self._converted(value, t).code, "0"

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

    def _print_table(self, node: Any, name: str = "") -> Type:
        t = self._complete(self.type_of(node.type), node.init)
        name = name or self._global(node.name, self._file)
        code = self._zero(t) if node.init is None else self._initial(node.init, t, Scope(), ("table", name))
        comments = self.unit.comments.get(self._file)
        line = self.place(node)[1]
        said = comments.alone.get(line - 1, (0, ""))[1] if comments else ""
        self.out += ["", *(f"# {one}".rstrip() for one in said.split("\n") if said), f"{name} = {code}"]
        return t
