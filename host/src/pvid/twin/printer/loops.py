"""Loops and switches; a loop that counts to an end which stays is a range."""

from __future__ import annotations

import re
from typing import Any

from pycparser import c_ast

from pvid.twin.printer.statements import Statements
from pvid.twin.printer.syntax import (
    ENTRY,
    EVERYTHING,
    addressed,
    assigned,
    breaks,
    has,
    identifiers,
    is_whole,
    walked,
    written_fields,
)
from pvid.twin.printer.term import NOT, SUM, Function, Scope, Value


class Loops(Statements):
    """Loops and switches."""

    _next: Any = None  # what a `continue` does before it

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
        if has(node.stmt, c_ast.Continue):
            raise self.refuse(node, "continue in do")
        self._line("while True:")
        outer, self._next = self._next, None
        self._indented(node.stmt, scope)
        self._next = outer
        self._depth += 1
        condition = self._truth(self.expression(node.cond, scope))
        self._line(f"if not {condition.within(NOT)}:")
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
            isinstance(step, c_ast.Assignment) and step.op in ("+=", "-=") and one.name not in identifiers(step.rvalue)
        ):
            number = self.expression(step.rvalue, scope).const
            by = (number if step.op == "+=" else -number) if isinstance(number, int) else 0
        if by == 0 or (by < 0) != (condition.op == ">") or one.name in assigned(node.stmt) or one.name in self._boxed:
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
        until = last.code if condition.op != "<=" else f"{last.within(SUM)} + 1"
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
        if set(identifiers(end)) & (assigned(body) | addressed(body)):
            return True
        read = {one.field.name for one in walked(end) if isinstance(one, c_ast.StructRef)}
        if any(
            isinstance(one, c_ast.ArrayRef) or (isinstance(one, c_ast.UnaryOp) and one.op == "*") for one in walked(end)
        ):
            read.add(ENTRY)
        written = self._writes(body)
        return bool(read) and (EVERYTHING in written or bool(read & written))

    def _writes(self, node: Any) -> set[str]:
        """Names of the fields that a statement writes, with all that it calls."""
        found = written_fields(node)
        for one in walked(node):
            if not isinstance(one, c_ast.FuncCall):
                continue
            name = one.name.name if isinstance(one.name, c_ast.ID) else ""
            if name in ("memcpy", "memmove", "memset"):
                to = one.args.exprs[0]
                found |= {to.field.name, ENTRY} if isinstance(to, c_ast.StructRef) else {ENTRY}
                found |= (
                    {EVERYTHING}
                    if not isinstance(to, (c_ast.StructRef, c_ast.ArrayRef)) and is_whole(one.args.exprs[2])
                    else set()
                )
            elif name in self.functions:
                called = self._found(name, self._file)
                found |= self._written_by(f"{called.file if called else ''}:{name}", called)
            elif not name:
                of_numbers = isinstance(one.name, c_ast.StructRef) and self._takes_numbers(one.name.field.name)
                found.add(ENTRY if of_numbers else EVERYTHING)
        return found

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
            if any(breaks(one) for one in body):
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
