"""The lines of a generated header that name every input, channel, theta, regressor and parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from pvid.codegen.functions import ModelFunctions, Term
from pvid.model.compiled import Part
from pvid.model.refusal import ModelError
from pvid.model.units import NUMBER, PER_SECOND, Dimension, dimension_of, dimension_of_unit


def everything(functions: ModelFunctions) -> list[str]:
    """All names, with what they mean and their units."""
    return [
        "Units: SI. D(c) is the time derivative of a channel c, D2(c) the second derivative.",
        "",
        "Parameters:",
        *parameters(functions),
        "Inputs:",
        *inputs(functions),
        *(["Integrands:", *integrands(functions)] if functions.integrands.labels else []),
        "Channels:",
        *channels(functions),
        *rows(functions),
    ]


def parameters(functions: ModelFunctions) -> list[str]:
    """p: name, unit, range."""
    rows = [
        (f"p[{k}]", one.name, f"[{one.unit or '1'}]", f"{one.low:.9g}..{one.high:.9g}", f"guess {one.guess:.9g}")
        for k, one in enumerate(functions.model.unknowns)
    ]
    return table(rows)


def inputs(functions: ModelFunctions) -> list[str]:
    """Inputs of channels: meaning, unit."""
    return table([(f"in[{k}]", one.meaning, f"[{one.unit or '1'}]") for k, one in enumerate(functions.inputs)])


def channels(functions: ModelFunctions) -> list[str]:
    """What each channel is."""
    return table([(f"channel[{k}]", label) for k, label in enumerate(functions.channels.labels)])


def integrands(functions: ModelFunctions) -> list[str]:
    """What is integrated, and how often."""
    places = [k for k, one in enumerate(functions.inputs) if one.fold]
    labels = zip(functions.integrands.labels, places, strict=True)
    return table([(f"integrand[{k}]", label, f"of in[{place}]") for k, (label, place) in enumerate(labels)])


def rows(functions: ModelFunctions) -> list[str]:
    """Each kind of row: its theta with their regressors, and Y."""
    lines = []
    dimensions = _dimensions(functions)
    for number, (kind, row) in enumerate(zip(functions.kinds, functions.model.rows, strict=True)):
        lines.append(f"Row {number}, {kind.name}:")
        found = []
        for offset, (place, theta, part) in enumerate(zip(kind.theta, row.theta, row.regressors, strict=True)):
            units = _unit_of(theta, dimensions), _unit_of_part(part, dimensions)
            column = regressor(functions, kind.columns[offset])
            found.append((f"theta[{place}]", str(theta), units[0], f"N[{offset}]", units[1], column))
        found.append(("", "", "", "Y", _unit_of_part(row.known, dimensions), regressor(functions, kind.known)))
        for k in range(kind.nuisances):
            found.append(("", "free in each window", "", "", "", regressor(functions, kind.known + 1 + k)))
        lines += table(found)
    return lines


def _dimensions(functions: ModelFunctions) -> dict[str, Dimension]:
    """Of signals, parameters, constants and defined signals by name."""
    model = functions.model
    named = {one.name: dimension_of_unit(one.unit) for one in model.signals}
    named |= {one.name: dimension_of_unit(one.unit) for one in model.unknowns}
    named |= {one.name: dimension_of_unit(one.unit) for one in model.knowns}
    for jet, value in model.opaque.items():
        named[jet.of] = dimension_of(value, named) or NUMBER
    return named


def _unit_of(expression: sp.Expr, dimensions: Mapping[str, Dimension]) -> str:
    """As in [kg*m^2]; nothing where the description's units do not agree."""
    try:
        return f"[{dimension_of(expression, dimensions) or NUMBER}]"
    except ModelError:
        return ""


def _unit_of_part(part: Part, dimensions: Mapping[str, Dimension]) -> str:
    for order, psi in part.items():
        try:
            found = dimension_of(sp.sympify(psi), dimensions) or NUMBER
        except ModelError:
            return ""
        return f"[{found * PER_SECOND.power(sp.Integer(order))}]"
    return ""


def regressor(functions: ModelFunctions, column: int) -> str:
    """As in D2(phi) - 2 D(channel); D2 is the second derivative, which acts on the test functions."""
    text = ""
    for term in functions.terms:
        if term.column == column:
            text += _term(functions, term, first=not text)
    return text or "0"


def _term(functions: ModelFunctions, term: Term, first: bool) -> str:
    label = functions.channels.labels[term.channel]
    operator = {0: "", 1: "D"}.get(term.order, f"D{term.order}")
    size = abs(term.factor)
    sign = "-" if term.factor < 0 else "+"
    head = ("-" if sign == "-" else "") if first else f" {sign} "
    factor = str(size) if size.denominator < 1000 else f"{float(size):.9g}"
    return f"{head}{'' if size == 1 else f'{factor} '}{operator}({label})"


def table(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Columns under one another."""
    if not rows:
        return []
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]) - 1)]
    return [
        "  " + "  ".join([*(cell.ljust(width) for cell, width in zip(row, widths, strict=False)), row[-1]]).rstrip()
        for row in rows
    ]
