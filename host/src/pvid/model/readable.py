"""Expressions as people write them: i' for the jet i_1, 2 phi'' for 2*phi_2, D²[sin a] for orders of derivative."""

from __future__ import annotations

from typing import Any

import sympy as sp
from sympy.printing.str import StrPrinter

from pvid.model.compiled import Part
from pvid.model.signals import Jet

_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


class _Printer(StrPrinter):  # type: ignore[misc]
    def _print_Jet(self, jet: Jet) -> str:
        if jet.order <= 3:
            return jet.of + "'" * jet.order
        return f"{jet.of}{raised(jet.order, brackets=True)}"

    def _print_Pow(self, power: sp.Pow, rational: bool = False) -> Any:
        if power.exp.is_Integer and power.exp > 1:
            plain = power.base.is_Symbol and not (isinstance(power.base, Jet) and power.base.order)
            base = self._print(power.base)
            return (base if plain else f"({base})") + raised(int(power.exp))
        return super()._print_Pow(power, rational)

    def _print_Abs(self, one: sp.Abs) -> str:
        return f"|{self._print(one.args[0])}|"


def raised(n: int, brackets: bool = False) -> str:
    """As an exponent; in brackets: an order of derivative."""
    text = str(n).translate(_RAISED)
    return f"⁽{text}⁾" if brackets else text


def readable(expression: sp.Expr) -> str:
    """As in "R*(i - i0) + k*phi'"."""
    return str(_Printer({"order": "none"}).doprint(expression)).replace("**", "^")


def readable_part(part: Part) -> str:
    """As in "D²[sin(a)] + g*sin(a)"; 0 of an empty one."""
    out = []
    for m in sorted(part, reverse=True):
        for term in sp.Add.make_args(sp.expand(part[m])):
            negative = term.could_extract_minus_sign()
            text = readable(-term if negative else term)
            order = "D" if m == 1 else f"D{raised(m)}"
            out.append((" - " if negative else " + ") + (f"{order}[{text}]" if m else text))
    whole = "".join(out)
    return whole.removeprefix(" + ").replace(" - ", "-", 1) if whole.startswith(" - ") else whole[3:] or "0"
