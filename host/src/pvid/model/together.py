"""Parameters with a value of their own in each of several recordings of a mechanism: a payload that is on or off, the
offset of a sensor that starts anew.

An equation has the same columns in every recording. A theta that contains an own parameter becomes one for each
recording, whose column is 0 in all windows of the others: `in_columns`. Simulations are those of one recording, with
its own values: `CompiledModel.alone`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Output, Part, Row, Signal, Together, Unknown
from pvid.model.signals import Integral, Jet


def offsets(model: CompiledModel) -> tuple[str, ...]:
    """Unknowns that shift a sensor: no equation changes when both move alike.

    A positive one is a quantity of the mechanism, such as a length at rest, and no offset; but where the model has an
    integral since the start of the run, it is the sensor's value there.
    """
    since_start = any(one.has(Integral) for one in model.opaque.values())
    return tuple(
        one.name for one in model.unknowns if (not one.positive or since_start) and shifted_sensors(model, one)
    )


def shifted_sensors(model: CompiledModel, unknown: Unknown) -> list[tuple[str, int]]:
    """The sensors that an unknown shifts, each with 1 where the unknown is its reading at the zero of the equations, -1
    where minus that."""
    found = []
    for signal in model.signals:
        if signal.kind != "sensor" or unknown.unit != signal.unit:
            continue
        slopes = [(sp.diff(one, unknown.symbol), sp.diff(one, signal.jet)) for one in model.equations]
        for sign in (1, -1):
            if any(a != 0 for a, _ in slopes) and all(sp.expand(a + sign * b) == 0 for a, b in slopes):
                found.append((signal.name, sign))
    return found


def with_own(model: CompiledModel, own: Iterable[str], recordings: Sequence[str]) -> CompiledModel:
    """The model of several recordings, with `m[A]` and `m[B]` in place of an own parameter m, and likewise of each
    output that contains one.

    Parameters
    ----------
    own : names of unknowns; none: the model as it is
    recordings : a name for each
    """
    chosen = set(own)
    if not chosen:
        return model
    if model.drifts:
        raise PvidError(f"{model.name} has a drift of its unknowns, which are not estimated for each recording apart")
    unknowns: list[Unknown] = []
    values: list[dict[sp.Symbol, sp.Symbol]] = [{} for _ in recordings]
    for one in model.unknowns:
        if one.name not in chosen:
            unknowns.append(one)
            continue
        for name, value in zip(recordings, values, strict=True):
            value[one.symbol] = sp.Symbol(f"{one.name}[{name}]", real=True)
            unknowns.append(replace(one, symbol=value[one.symbol]))
    outputs: list[Output] = []
    for out in model.outputs:
        if out.value.free_symbols.isdisjoint(values[0]):
            outputs.append(out)
        else:
            outputs += [
                Output(f"{out.name}[{name}]", out.unit, out.value.xreplace(value))
                for name, value in zip(recordings, values, strict=True)
            ]
    constraints = dict.fromkeys(one.xreplace(value) for one in model.constraints for value in values)
    together = Together(model.unknowns, model.outputs, tuple(values), model.constraints)
    return replace(
        model, unknowns=tuple(unknowns), outputs=tuple(outputs), together=together, constraints=tuple(constraints)
    )


def in_columns(model: CompiledModel) -> tuple[CompiledModel, tuple[str, ...]]:
    """The model with a column for each recording where theta contains an own parameter, and the names of the new
    signals: 1 in the samples of one recording, 0 in those of the others."""
    if model.together is None:
        return model, ()
    within = tuple(f"#{number}" for number in range(len(model.together.own)))
    rows = tuple(_in_columns(row, model.together, within) for row in model.rows)
    signals = [Signal(Jet(name), "", "input") for name in within]
    return replace(model, rows=rows, signals=(*model.signals, *signals)), within


def _in_columns(row: Row, together: Together, within: Sequence[str]) -> Row:
    theta: list[sp.Expr] = []
    regressors: list[Part] = []
    for one, part in zip(row.theta, row.regressors, strict=True):
        if sp.sympify(one).free_symbols.isdisjoint(together.own[0]):
            theta.append(one)
            regressors.append(part)
            continue
        for name, value in zip(within, together.own, strict=True):
            theta.append(one.xreplace(value))
            regressors.append({order: sp.sympify(psi) * Jet(name) for order, psi in part.items()})
    return replace(row, theta=tuple(theta), regressors=tuple(regressors))
