"""An expression that was typed in a command, in the words of a model file."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from typing import Any

import sympy as sp

from pvid.model.refusal import ModelError
from pvid.model.signals import Jet, sgn

_FUNCTIONS: dict[str, Any] = {"sgn": sgn, "sin": sp.sin, "cos": sp.cos, "abs": sp.Abs, "exp": sp.exp, "sqrt": sp.sqrt}
_OPERATORS: dict[type, Any] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}


def typed_expression(text: str, names: Mapping[str, sp.Symbol]) -> sp.Expr:
    """Of numbers, names, + - * / **, `x.d()` and sgn, sin, cos, abs, exp, sqrt; nothing else is run.

    Raises ModelError naming what is none of these.

    Parameters
    ----------
    names : signals and symbols by name; another name is a new real symbol
    """
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except SyntaxError as error:
        raise ModelError(f'"{text.strip()}" is no expression: {error.msg}') from None
    return sp.sympify(_of(tree.body, names))


def _of(node: ast.expr, names: Mapping[str, sp.Symbol]) -> sp.Expr:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return sp.sympify(number)
        case ast.Name(id=name):
            return names.get(name, sp.Symbol(name, real=True))
        case ast.UnaryOp(op=ast.USub(), operand=one):
            return -_of(one, names)
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
            return _OPERATORS[type(operator)](_of(left, names), _of(right, names))
        case ast.Call(func=ast.Name(id=name), args=[one], keywords=[]) if name in _FUNCTIONS:
            return _FUNCTIONS[name](_of(one, names))
        case ast.Call(func=ast.Attribute(value=of, attr="d"), args=orders, keywords=[]) if len(orders) <= 1:
            signal, order = _of(of, names), [_of(one, names) for one in orders] or [sp.Integer(1)]
            if isinstance(signal, Jet) and order[0].is_Integer and order[0] > 0:
                return signal.d(int(order[0]))
    known = ", ".join(_FUNCTIONS)
    raise ModelError(f'"{ast.unparse(node)}" is not for a term: numbers, names, + - * / **, x.d() and {known} are')
