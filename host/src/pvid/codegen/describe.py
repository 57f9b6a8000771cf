"""The lines of a generated header that name every input, channel, theta, regressor and parameter."""

from __future__ import annotations

from collections.abc import Sequence

from pvid.codegen.functions import ModelFunctions, Term
from pvid.model.signals import Integral


def parameters(functions: ModelFunctions) -> list[str]:
    """p: name, unit, range."""
    rows = [
        (f"p[{k}]", one.name, f"[{one.unit or '1'}]", f"{one.low:.9g}..{one.high:.9g}", f"guess {one.guess:.9g}")
        for k, one in enumerate(functions.model.unknowns)
    ]
    return _table(rows)


def inputs(functions: ModelFunctions) -> list[str]:
    """Inputs of channels: meaning, unit."""
    return _table([(f"in[{k}]", one.meaning, f"[{one.unit or '1'}]") for k, one in enumerate(functions.inputs)])


def channels(functions: ModelFunctions) -> list[str]:
    """What each channel is."""
    return _table([(f"channel[{k}]", label) for k, label in enumerate(functions.channels.labels)])


def integrands(functions: ModelFunctions) -> list[str]:
    """What is integrated, and how often."""
    folds = [one.symbol.args[1] for one in functions.inputs if isinstance(one.symbol, Integral)]
    labels = zip(functions.integrands.labels, folds, strict=True)
    return _table([(f"integrand[{k}]", f"{label}, {fold}-fold") for k, (label, fold) in enumerate(labels)])


def rows(functions: ModelFunctions) -> list[str]:
    """Each kind of row: its theta with their regressors, and Y."""
    lines = []
    for number, kind in enumerate(functions.kinds):
        lines.append(f"Row {number}, {kind.name}:")
        table = []
        for offset, place in enumerate(kind.theta):
            column = kind.columns[offset]
            table.append(
                (f"theta[{place}]", functions.theta.labels[place], f"N[{offset}]", regressor(functions, column))
            )
        table.append(("", "", "Y", regressor(functions, kind.known)))
        for k in range(kind.nuisances):
            table.append(("", "free in each window", "", regressor(functions, kind.known + 1 + k)))
        lines += _table(table)
    return lines


def regressor(functions: ModelFunctions, column: int) -> str:
    """As in D2[phi] - 2 D[channel]; D2 is the second derivative, which acts on the test functions."""
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
    return f"{head}{'' if size == 1 else f'{size} '}{operator}[{label}]"


def _table(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Columns under one another."""
    if not rows:
        return []
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]) - 1)]
    return [
        "  " + "  ".join([*(cell.ljust(width) for cell, width in zip(row, widths, strict=False)), row[-1]]).rstrip()
        for row in rows
    ]
