"""Expressions, operator by operator, and calls."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pycparser import c_ast

from pvid.twin.printer import machine
from pvid.twin.printer.directives import KEPT
from pvid.twin.printer.memory import Memory
from pvid.twin.printer.syntax import has_call
from pvid.twin.printer.term import (
    BOTH,
    CHOICE,
    COMPARED,
    EITHER,
    INTEGERS,
    LEVELS,
    NATIVE,
    NOT,
    SUM,
    UNARY,
    Scope,
    Type,
    Value,
    bounds,
    is_number,
    is_pointer,
)


class Expressions(Memory):
    """Expressions."""

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
            return Value(f"not {self._truth(value).within(NOT)}", "_Bool", NOT, low=0, high=1)
        value = self._promoted(value)
        if op == "+":
            return value
        if op == "-":
            if value.type == "float":
                if value.const is not None:
                    return (
                        Value(f"f32(-{value.code[4:-1]})", "float", const=-value.const)
                        if value.code.startswith("f32(") and value.code[4] != "-"
                        else Value(f"-{value.within(UNARY)}", "float", UNARY, const=-value.const)
                    )
                return Value(f"-{value.within(UNARY)}", "float", UNARY)
            result = Value(
                f"-{value.within(UNARY)}",
                value.type,
                UNARY,
                low=-value.high,
                high=-value.low,
                const=None if value.const is None else -value.const,
            )
            return self._fitted(result)
        if op == "~":
            bits, signed = INTEGERS[value.type]
            if isinstance(value.const, int):
                return self._constant_value(~value.const if signed else ~value.const & ((1 << bits) - 1), value.type)
            result = Value(f"~{value.within(UNARY)}", value.type, UNARY, low=-value.high - 1, high=-value.low - 1)
            return self._fitted(result)
        raise self.refuse(node, f"the operator {op} in an expression")

    def _of_binaryop(self, node: Any, scope: Scope) -> Value:
        op = node.op
        if op in ("&&", "||"):
            return self._logical(node, scope)
        a, b = self.expression(node.left, scope), self.expression(node.right, scope)
        if not (is_number(a) and is_number(b)):
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
            return Value(f"{a.within(SUM)} {op} {b.within(SUM)}", "_Bool", COMPARED, low=0, high=1)
        level = LEVELS[op]
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
        signed = INTEGERS[t][1]
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
        low, high = bounds(op, a, b)
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
        if isinstance(b.const, int) and not has_call(node.left):
            return b if bool(b.const) == (op == "||") else a
        level = BOTH if op == "&&" else EITHER
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
        if is_pointer(a) or is_pointer(b):
            return self._chosen_pointer(node, condition, self._decayed(a), self._decayed(b))
        struct = isinstance(a.type, tuple) and a.type[0] == "struct"
        if not struct and not (isinstance(a.type, tuple) and a.type == b.type) and a.type != b.type:
            t = self._common(*(one.type if one.type == "float" else self._promoted(one).type for one in (a, b)))
            if not (a.type == b.type == "_Bool"):
                a, b = (
                    self._converted(self._promoted(a) if a.type != "float" else a, t),
                    self._converted(self._promoted(b) if b.type != "float" else b, t),
                )
        code = f"{a.within(EITHER)} if {condition.within(EITHER)} else {b.within(CHOICE)}"
        return Value(code, a.type, CHOICE, low=min(a.low, b.low), high=max(a.high, b.high), fresh=a.fresh and b.fresh)

    def _of_compoundliteral(self, node: Any, scope: Scope) -> Value:
        t = self._complete(self.type_of(node.type.type), node.init)
        return replace(Value(self._initial(node.init, t, scope, None), t), fresh=True)

    def _of_exprlist(self, node: Any, scope: Scope) -> Value:
        raise self.refuse(node, "a comma")

    def _of_assignment(self, node: Any, scope: Scope) -> Value:
        raise self.refuse(node, "an assignment in an expression")

    def _of_funccall(self, node: Any, scope: Scope) -> Value:
        given = node.args.exprs if node.args else []
        name = node.name.name if isinstance(node.name, c_ast.ID) else ""
        if name in ("memcpy", "memmove", "memset") and name not in self.functions:
            raise self.refuse(node, f"{name} within an expression")
        if name in NATIVE:
            return Value(f"{name}({', '.join(self.expression(one, scope).code for one in given)})", NATIVE[name])
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
