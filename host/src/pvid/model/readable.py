"""Expressions as people write them: i' for the jet i_1, 2 phi'' for 2*phi_2, D²[sin a] for orders of derivative."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import sympy as sp
from sympy.printing.latex import LatexPrinter
from sympy.printing.str import StrPrinter

from pvid.model.compiled import Part
from pvid.model.signals import Jet

_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_LOWERED = {to: chr(of) for of, to in _RAISED.items()}
_IN_LATEX = {"·": r"\,", "Ω": r"\Omega ", "µ": r"\mu "}


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


class _Latex(LatexPrinter):  # type: ignore[misc]
    def _print_Jet(self, jet: Jet) -> str:
        own, dots = latex_name(jet.of), {1: r"\dot", 2: r"\ddot", 3: r"\dddot"}
        if jet.order == 0:
            return own
        return f"{dots[jet.order]}{{{own}}}" if jet.order in dots else f"{own}^{{({jet.order})}}"


def latex(expressions: Iterable[sp.Expr]) -> str:
    """Equations in LaTeX, each of them 0, one below the other."""
    printer = _Latex({"order": "none"})
    return aligned(f"{printer.doprint(one)} &= 0" for one in expressions)


def aligned(lines: Iterable[str]) -> str:
    """Lines of LaTeX below each other, with & at the place that is common."""
    between = r" \\ "
    return rf"\begin{{aligned}} {between.join(lines)} \end{{aligned}}"


def latex_name(name: str) -> str:
    """Of a symbol: the Greek letter that it spells, and an index; of other names, such as m[A], the letters."""
    if re.fullmatch(r"[A-Za-z]\w*", name):
        return str(sp.latex(sp.Symbol(name)))
    escaped = re.sub(r"([_#$%&{}])", r"\\\1", name)
    return rf"\mathrm{{{escaped}}}"


def latex_unit(unit: str) -> str:
    """Of a unit as books print it: kg·m²."""
    text = re.sub("[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+", lambda power: f"^{{{power[0].translate(_LOWERED)}}}", unit)
    for letter, command in _IN_LATEX.items():
        text = text.replace(letter, command)
    return rf"\mathrm{{{text}}}"


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
