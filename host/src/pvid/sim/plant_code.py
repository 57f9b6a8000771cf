"""The C text of a plant: its equations as straight-line code, and an integrator that locates the reversals of sharp
friction."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files

import sympy as sp

from pvid.sim.motion import Motion

_DIGITS = 20  # of pi and the like


def plant_code(motion: Motion) -> str:
    """C99 that exports plant_run; see integrator.c for its arguments."""
    n, nx, nu, ns = len(motion.highest), len(motion.states), len(motion.inputs), len(motion.signs)
    names: dict[sp.Expr, sp.Symbol] = {}
    for letter, symbols in (
        ("x", motion.states),
        ("u", motion.inputs),
        ("p", motion.constants),
        ("s", motion.signs),
        ("h", motion.highest),
    ):
        for place, symbol in enumerate(symbols):
            names.setdefault(symbol, sp.Symbol(f"{letter}[{place}]"))
    system = [(f"A[{i}][{j}]", motion.matrix[i, j]) for i in range(n) for j in range(n)]
    system += [(f"h[{i}]", motion.right[i]) for i in range(n)]
    rates = [(f"d[{i}]", rate) for i, rate in enumerate(motion.rates)]
    arguments = [(f"a[{i}]", argument) for i, argument in enumerate(motion.arguments)]
    states = list(motion.states)
    places = [states.index(one) if one in states else -1 for one in motion.arguments] or [-1]
    slopes = [
        (f"g[{i}]", sum((motion.slopes[i, j] * sp.Symbol(f"d[{j}]") for j in range(nx)), sp.Integer(0)))
        for i in range(ns)
    ]
    return "\n".join(
        [
            f"enum {{ N = {n}, NX = {nx}, NU = {nu}, NS = {ns} }};",
            f"static const int STATE_OF[] = {{{', '.join(map(str, places))}}};",
            _function("system", "double A[N][N], double *h", system, names),
            _function("rates", "const double *h, double *d", rates, names),
            _function("arguments", "double *a", arguments, names),
            _function("slopes", "const double *d, double *g", slopes, names),
            (files("pvid.sim") / "integrator.c").read_text(encoding="utf-8"),
        ]
    )


def _function(name: str, out: str, assignments: Sequence[tuple[str, sp.Expr]], names: dict[sp.Expr, sp.Symbol]) -> str:
    shared, reduced = sp.cse(
        [sp.sympify(value) for _, value in assignments], symbols=sp.numbered_symbols("cse_"), order="none"
    )

    def text(value: sp.Expr) -> str:
        numbers = {one: one.evalf(_DIGITS) for one in value.atoms(sp.NumberSymbol)}
        return str(sp.ccode(value.xreplace({**names, **numbers}), math_macros={}))  # C99 has no M_PI, no M_SQRT2

    lines = [f"  const double {mark} = {text(value)};" for mark, value in shared]
    lines += [f"  {place} = {text(value)};" for (place, _), value in zip(assignments, reduced, strict=True)]
    given = "const double *x, const double *u, const double *p, const double *s"
    unused = "  (void)x; (void)u; (void)p; (void)s;"
    return "\n".join([f"static void equations_{name}({given}, {out}) {{", unused, *lines, "}"])
