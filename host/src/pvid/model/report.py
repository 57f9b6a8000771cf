"""What `pvid model check` prints: rows, coefficients, what is identifiable, and advice."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from pvid.base.wording import listed
from pvid.model.compiled import CompiledModel, Row
from pvid.model.corners import feedthroughs, slopes
from pvid.model.identifiability import Identifiability, Shift, identifiable
from pvid.model.readable import readable, readable_part
from pvid.model.signals import jets
from pvid.model.symmetry import Symmetry

__all__ = ["Identifiability", "check_report", "identifiable", "verdict"]


def check_report(compiled: CompiledModel) -> str:
    """The whole text, in lines of at most about 120 characters where terms allow it."""
    found = identifiable(compiled)
    blocks = [
        _head(compiled), *(_row(row) for row in compiled.rows), verdict(found), _tied(compiled), *_advice(compiled)
    ]  # fmt: skip
    return "\n\n".join(block for block in blocks if block)


def robot_report(compiled: CompiledModel) -> str:
    """The same of a robot: its base parameters in closed form, with their values in its file."""
    chain = compiled.chain
    assert chain is not None
    names = {chain.standard[place].name for one in chain.base for place, _ in one.parts}
    none = [one.name for one in chain.standard if one.name not in names]
    program, _ = chain.program([one.standard for one in chain.base])
    lines = [
        f"{compiled.title}: {chain.extent}, {len(chain.base)} base parameters, "
        f"{chain.inertial} of them of the bodies; {program.cost} a sample.",
        "Identifiable: all base parameters, given enough excitation. A parameter with _R is a combination:",
        "",
    ]
    for one in chain.base:
        value, form = chain.of_file(one), chain.closed_form(one)
        unit = chain.standard[one.standard].unit
        shown = "" if value is None else f", {value:.6g} {unit} in the file"
        lines.append(f"  {chain.name_of(one)} [{unit}]{f' = {form}' if len(one.parts) > 1 else ''}{shown}")
    return "\n".join([*lines, *(["", f"No torque depends on {listed(none)}."] if none else [])])


def _tied(compiled: CompiledModel) -> str:
    """Which unknowns the constraints tie, and which drift."""
    lines, count = [], len(compiled.constraints)
    if count:
        own = {one for value in compiled.constraints for one in value.free_symbols}
        names = listed([one.name for one in compiled.unknowns if one.symbol in own])
        lines.append(f"{count} constraint{'s tie' if count > 1 else ' ties'} {names}.")
    for rates in compiled.drifts:
        moving = listed([one.name for one, rate in zip(compiled.unknowns, rates, strict=True) if rate != 0])
        lines.append(f"{moving} drift together, with a memory of {compiled.drift_s:g} s.")
    return "\n".join(lines)


def verdict(found: Identifiability) -> str:
    """In one sentence for each group of unknowns."""
    lines = []
    if found.identifiable:
        lines.append(f"Identifiable: all {found.unknowns} unknowns, given enough excitation.")
    else:
        lines.append(f"Not identifiable: {found.rank} functions of the {found.unknowns} unknowns are determined.")
        lines += [_shift(one) for one in found.shifts]
    lines += [_symmetry(one) for one in found.symmetries]
    return "\n".join(lines)


def _shift(one: Shift) -> str:
    names = listed(one.unknowns)
    shown = ", ".join(_in_order(value, one.unknowns) for value in one.combinations)
    if not one.combinations and one.kind == "coefficients":
        return f"  {names} can change together while the data stay the same: {one.cure}."
    if not one.combinations:
        return f"  {names}: not determined at all."
    only = f"only {shown}" if one.kind != "coefficients" else f"only what follows from {shown}"
    return f"  {names}: {only} can be identified; {one.cure}."


def _in_order(value: sp.Expr, names: Sequence[str]) -> str:
    """A sum in the order in which the unknowns are declared."""
    if not value.is_Add:
        return readable(value)
    rank = {name: k for k, name in enumerate(names)}
    terms = sorted(value.args, key=lambda term: min(rank.get(str(one), len(rank)) for one in term.free_symbols))
    text = "".join(f" - {readable(-one)}" if one.could_extract_minus_sign() else f" + {readable(one)}" for one in terms)
    return text.removeprefix(" + ") if text.startswith(" + ") else "-" + text.removeprefix(" - ")


def _symmetry(one: Symmetry) -> str:
    if one.swapped:
        what = listed([f"{a} with {b}" for a, b in one.swapped])
        text = f"The same data allow a second solution that exchanges {what}"
    else:
        text = f"The same data allow a second solution with the opposite sign of {listed(one.negated)}"
    cure = "; the ranges exclude it." if one.excluded else ": give ranges (low, high) that exclude it."
    return f"Warning: {text}{cure}" if not one.excluded else f"{text}{cure}"


def _head(compiled: CompiledModel) -> str:
    lines = [f"{compiled.name}: {compiled.title}"]
    lines.append("measured   " + ", ".join(f"{one.name} [{one.unit or 1}]" for one in compiled.signals))
    if compiled.opaque:
        lines.append("computed   " + ", ".join(f"{jet} = {readable(value)}" for jet, value in compiled.opaque.items()))
    hidden = [jet.of for jet in compiled.hidden if jet not in compiled.opaque]
    if hidden:
        lines.append("eliminated " + ", ".join(hidden))
    lines.append("unknown    " + ", ".join(f"{one.name} [{one.unit or 1}]" for one in compiled.unknowns))
    lines += [f"constraint {readable(one)} = 0" for one in compiled.constraints]
    if compiled.knowns:
        values = (f"{one.name} = {one.value:g} {one.unit}".strip() for one in compiled.knowns)
        lines.append("known      " + ", ".join(values))
    return "\n".join(lines)


def _row(row: Row) -> str:
    lines = [f"{row.name}: sum of theta * N = Y, {len(row.theta)} theta, derivatives up to order {row.top}"]
    width = min(40, max(len(readable(one)) for one in row.theta))
    lines.append(f"  {'Y':{width}}   {readable_part(row.known)}")
    for theta, part in zip(row.theta, row.regressors, strict=True):
        lines.append(f"  {readable(theta):{width}}   {readable_part(part)}")
    lines += [f"  {'(free)':{width}}   {readable_part(part)}" for part in row.nuisances]
    return "\n".join(lines)


def _advice(compiled: CompiledModel) -> list[str]:
    """Remarks on what the rows need of the sensors."""
    lines = [
        f"{sensor} has a corner at every step of {name}: rows get a channel for it, with the factor {readable(slope)}."
        for (sensor, name), slope in slopes(compiled).items()
    ]
    lines += [
        f"{sensor} jumps with {name} by {readable(ratio)}: a recording shows on which side it is sampled."
        for (sensor, name), ratio in feedthroughs(compiled).items()
    ]
    for row in compiled.rows:
        psis = [psi for part in (*row.regressors, row.known) for psi in part.values()]
        needs = sorted({jet for psi in psis for jet in jets(psi) if jet.order > 0}, key=str)
        if needs:
            lines.append(f"{row.name}: smoothed derivatives are needed: {', '.join(map(readable, needs))}.")
        if not row.known:
            lines.append(f"{row.name}: no term is free of unknowns; another row fixes the scale.")
        if row.top >= 4:
            lines.append(f"{row.name}: test functions are differentiated {row.top} times; the sensor must be fine.")
    return ["\n".join(lines)] if lines else []
