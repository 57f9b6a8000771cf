"""Declarations of variables, assignments, copies of memory, conditions and returns."""

from __future__ import annotations

import re
from typing import Any

from pycparser import c_ast

from pvid.twin.printer.expressions import Expressions
from pvid.twin.printer.syntax import has_call, has_size
from pvid.twin.printer.term import ATOM, PRODUCT, Scope, Type, Value, is_pointer, operand, slice_of, with_comment


class Statements(Expressions):
    """Statements but for loops and switches."""

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
            self.out[at] = with_comment(self.out[at], comments.behind[line])

    def _indented(self, node: Any, scope: Scope) -> None:
        self._depth += 1
        self._block(node, scope.inner())
        self._depth -= 1

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
            self._line(f"{python} = {value.code}" if value.fresh else f"{python} = {value.within(ATOM)}.copy()")
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
            self._line(f"{target.within(ATOM)}.assign({value.code})")
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
        if is_pointer(target):
            value = self.expression(c_ast.BinaryOp("+" if "+" in node.op else "-", node.expr, one, node.coord), scope)
            self._set(target.code, target.type, target.slot, value, node)
            return
        self._do_assignment(c_ast.Assignment("+=" if "+" in node.op else "-=", node.expr, one, node.coord), scope)

    def _do_cast(self, node: Any, scope: Scope) -> None:
        if not has_call(node.expr):
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
                    return number.code if count == "1" else f"{number.within(PRODUCT)} * ({count})"
            inner = (
                self._counted(node.right, entry, scope)
                if has_size(node.right)
                else self._counted(node.left, entry, scope)
            )
            other = self._index(self.expression(node.left if has_size(node.right) else node.right, scope))
            return f"{other.within(PRODUCT)} * ({inner})" if inner != "1" else other.code
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
            self._line(f"{to.within(ATOM)}.assign({of.code})")
            return
        count = self._counted(length, entry, scope)
        if struct:
            self._line(f"assign_all({to.code}, {to.at}, {of.code}, {of.at}, {count})")
        else:
            self._line(f"{to.code}[{slice_of(to.at, count)}] = {of.code}[{slice_of(of.at, count)}]")

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
            self._line(f"{to.within(ATOM)}.clear()")
            return
        count = self._counted(length, entry, scope)
        if isinstance(entry, tuple) and entry[0] == "struct":
            name = "one"
            self._line(f"for {name} in {to.code}[{slice_of(to.at, count)}]:")
            self._line(f"    {name}.clear()")
            return
        self._line(f"{to.code}[{slice_of(to.at, count)}] = [{self._zero(entry)}] * {operand(count)}")

    def _do_return(self, node: Any, scope: Scope) -> None:
        if node.expr is None:
            self._line("return")
            return
        slot, t = ("result", self._key), self._result
        value = self.expression(node.expr, scope)
        if isinstance(t, tuple) and t[0] == "struct":
            local = isinstance(node.expr, c_ast.ID)
            self._line(f"return {value.code}" if value.fresh or local else f"return {value.within(ATOM)}.copy()")
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

    def _do_ternaryop(self, node: Any, scope: Scope) -> None:
        raise self.refuse(node, "a condition as a statement")
