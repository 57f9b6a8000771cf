"""Signals and their time derivatives as symbols.

A signal z is a family of plain symbols z, z', z'', ... (jets): `z.d(n)` is the nth one, z itself is z.d(0). An
expression in jets has a total derivative by the chain rule; nothing here depends on the time itself.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import sympy as sp

from pvid.model.refusal import ModelError

MAX_ORDER = 8  # of a derivative

TIME = sp.Symbol("t", real=True)  # [s] since the start of a window; only in columns that are free in each window


class Jet(sp.Symbol):  # type: ignore[misc]
    """The nth derivative of the signal `of`: a symbol named z, z_1, z_2, ..."""

    __slots__ = ("of", "order")

    of: str
    order: int

    def __new__(cls, of: str, order: int = 0) -> Jet:
        if order > MAX_ORDER:
            raise ModelError(f"derivative {order} of {of} would be needed: at most {MAX_ORDER} are possible")
        jet: Jet = sp.Symbol.__xnew__(cls, of if order == 0 else f"{of}_{order}", real=True)
        jet.of, jet.order = of, order
        return jet

    def __getnewargs_ex__(self) -> Any:
        return ((self.of, self.order), {})

    def d(self, n: int = 1) -> Jet:
        """The nth time derivative."""
        return Jet(self.of, self.order + n)


class sgn(sp.Function):  # type: ignore[misc] # noqa: N801
    """Sign of a velocity: -1, 0 or 1 (Coulomb friction). Opaque: the compiler never differentiates it in a channel."""

    nargs = 1

    @classmethod
    def eval(cls, argument: sp.Expr) -> sp.Expr | None:
        if argument == 0:
            return sp.Integer(0)
        number, rest = argument.as_coeff_Mul()
        if rest == 1:
            return sp.Integer(1 if number > 0 else -1)
        if number != 1:
            return cls(rest) if number > 0 else -cls(rest)
        return -cls(-argument) if argument.could_extract_minus_sign() else None


class Integral(sp.Function):  # type: ignore[misc]
    """Integral(f, n): the n-fold running integral of a channel f from the start of a window.

    In a definition (`CompiledModel.opaque`) from the start of the run.
    """

    nargs = 2

    def _sympystr(self, printer: Any) -> str:
        return f"Integral({printer.doprint(self.args[0])}, {self.args[1]})"


def jets(expression: Any) -> set[Jet]:
    """All jets in an expression."""
    return set(sp.sympify(expression).atoms(Jet))


def order_of(expression: Any, signals: Iterable[str] | None = None) -> int:
    """Highest order of derivative in an expression, of these signals; 0 where there is none."""
    among = None if signals is None else set(signals)
    return max((jet.order for jet in jets(expression) if among is None or jet.of in among), default=0)


def total_derivative(expression: Any, times: int = 1) -> sp.Expr:
    """d^n/dt^n by the chain rule, expanded; a running integral loses one fold, TIME gives 1."""
    whole = sp.sympify(expression)
    for _ in range(times):
        integrals = {one: sp.Dummy() for one in whole.atoms(Integral)}
        back = {mark: one for one, mark in integrals.items()}
        bare = whole.xreplace(integrals)
        rates = {jet: jet.d() for jet in jets(bare)} | {TIME: sp.Integer(1)}
        for one, mark in integrals.items():
            integrand, fold = one.args
            rates[mark] = integrand if fold == 1 else Integral(integrand, fold - 1)
        whole = sp.expand(sum((sp.diff(bare, of) * rate for of, rate in rates.items()), sp.Integer(0)).xreplace(back))
    return whole
