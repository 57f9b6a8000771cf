"""What is missing in words, for sentences and for programs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from pvid.base.rounding import percent
from pvid.base.wording import listed, with_unit
from pvid.model.compiled import CompiledModel
from pvid.model.signals import Integral, total_derivative
from pvid.oracle.weak.errors import Uncertainty
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.missing import VISIBLE, Explained, Missing, word_of
from pvid.oracle.weak.solve import Fit
from pvid.oracle.weak.terms import CONSTANT, SOFT, Act, Candidate, Course, Law
from pvid.oracle.weak.verdict import Name, Reason, of_some

_GROSS = 100.0  # chi^2, from which motion that is left unexplained is a doubt
# Terms that explain less than this part of the rest, or of equations that explain less than this of their motion, are
# no hint at the cause.
_HINT = 0.5


@dataclass(frozen=True)
class Term:
    """A term that is missing.

    Attributes
    ----------
    where : the equation, or the signal that is not what was recorded
    law : as typed in a model file, without its factor; None: it is no law
    size : factor of the law in the equation as written, or the number of the clause; None: equations were combined
    se : standard error of it
    unit : of a number of a signal; a law's is that of the equation over the law
    text : a clause
    typed : what `identify --add` takes, with {a} for the name of the unknown; None: the model language does not have it
    instead : clauses, of terms that explain the run alike
    """

    where: str
    law: str | None
    size: float | None
    se: float | None
    unit: str | None
    text: str
    typed: str | None
    instead: tuple[str, ...]


def terms_of(fit: Fit, found: Explained) -> tuple[Term, ...]:
    """All that were named.

    Parameters
    ----------
    fit : the estimate that lacks them
    """
    model = fit.rows.compiled.bare
    scale = {row.name: scale_of(model, kind, fit.p) for kind, row in enumerate(model.rows)}
    out = []
    for one in found.named:
        term = one.chosen
        law: str | None = None
        typed: str | None = None
        unit: str | None = ""
        factor: float | None = 1.0
        if isinstance(term.kind, Act):
            unit = {"signal": model.signal(term.signal).unit, "time": "s", "part": "", "percent": ""}[term.kind.measure]
            if term.kind.typed:
                typed = f"{term.signal}: {term.kind.typed.replace('{u}', term.signal)}"
        elif isinstance(term.kind, Course):
            unit = _unit_of(model, term, term.kind)
            factor = scale[term.where] if term.kind.measure == "equation" else 1 / term.top
        elif term.kind is not SOFT:
            law, unit = _law(term), None
            own = "{a}" if term.kind is CONSTANT else f"{{a}}*{law}"
            parts = _parts(term, scale)
            factor, typed = (1 / parts[0][1], _typed(parts, own)) if parts else (None, own)
        out.append(
            Term(
                where=term.where,
                law=law,
                size=_over(term.number, factor),
                se=_over(one.error, abs(factor) if factor else factor),
                unit=unit,
                text=in_words(model, term, scale),
                typed=typed,
                instead=tuple(in_words(model, other, scale) for other in one.rivals),
            )
        )
    return tuple(out)


def _over(number: float, factor: float | None) -> float | None:
    return number / factor if factor and np.isfinite(number) else None


def of_missing(fit: Fit, lacking: Missing, found: Explained, r2: float, lost: Sequence[int] = ()) -> list[Reason]:
    """The doubt about an estimate and its cause; "unknown" where no cause explains it.

    Parameters
    ----------
    r2 : least of the equations
    lost : parameters that the run does not determine without the cause
    """
    model, p, terms = fit.rows.compiled.bare, fit.p, terms_of(fit, found)
    relative = lacking.error / np.maximum(np.abs(p), 1e-300)
    worst = [k for k in np.argsort(-relative) if lacking.visible[k]]
    of_visible = of_some(model, [int(k) for k in worst])
    causes = listed(told_once([one.text for one in terms]) or ["nothing"])
    if not found.complete:
        if not worst:
            return []
        biased = listed(f"{model.p_names[k]} by {percent(relative[k])}" for k in worst)
        text = f"The equations lack something, or a signal is not what was recorded: it may bias {biased}. "
        best = f"of what was tried most is explained by this, {percent(found.share)}: {causes}."
        hint = terms and min(found.share, r2) > _HINT
        text += f"The cause is unknown: {best if hint else 'no term that was tried explains it.'}"
        return [Reason("unexplained", text, of=of_visible)]
    if terms[0].text.startswith(("equation", "the ")):  # a signal's name keeps its letters
        causes = causes[0].upper() + causes[1:]
    now = found.fit.p
    worst += [k for k in lost if k not in worst]
    of_visible = of_some(model, [int(k) for k in worst])
    moved = [k for k in worst if abs(now[k] - p[k]) > VISIBLE / 2 * abs(p[k])] or worst[:1]
    values = [
        f"{model.p_names[k]} would be {with_unit(now[k], model.unknowns[k].unit, 4)} in place of {p[k]:.4g}"
        for k in moved
    ]
    text = f"{causes}: with that {listed(values)}." if values else f"{causes}: that moves no parameter visibly."
    if terms[0].instead:
        text += f" The run does not distinguish it from these: {listed(terms[0].instead, 'or')}."
    return [Reason(_name_of(found.named[0].chosen), text, alarm=bool(moved), of=of_visible)]


def told_once(texts: Sequence[str]) -> list[str]:
    """Each text once; a lag behind a lag of about the same length is that lag, 2 times."""
    count = {one: texts.count(one) for one in texts}
    return [one if many == 1 else f"{one} ({many} times)" for one, many in count.items()]


def of_unexplained(model: CompiledModel, found: Uncertainty, lacking: Missing) -> list[Reason]:
    """Motion that neither the equations nor a term that was tried explains."""
    left = 1 - min(found.r2)
    if lacking.there or found.chi2 < _GROSS or left < VISIBLE:
        return []
    row = model.rows[int(np.argmin(found.r2))].name
    many = percent(left) if left < 1 else "more than 100 %"
    leaves, its = ("leave", "their") if row.startswith("equations") else ("leaves", "its")
    text = f"{row[0].upper()}{row[1:]} {leaves} {many} of {its} motion unexplained, and no term that was tried "
    text += "explains it: the cause is unknown. The standard errors contain how far each quarter of the run moves p."
    return [Reason("unexplained", text)]


def _name_of(one: Candidate) -> Name:
    if isinstance(one.kind, Act):
        return "sensor"
    return "friction" if one.kind is SOFT or one.kind.text.startswith("sgn({x}.d())") else "missing"


def in_words(model: CompiledModel, one: Candidate, scale: Mapping[str, float | None]) -> str:
    """A term, with its size.

    Parameters
    ----------
    scale : of each row, see scale_of
    """
    kind = one.kind
    if kind is SOFT:
        return kind.text.format(x=one.signal, w=f"{one.level:.2g}")
    if isinstance(kind, Course):
        return _of_course(model, one, kind, scale)
    if isinstance(kind, Law):
        law, parts = _law(one), _parts(one, scale)
        lacks = f"{one.where} {'seem' if one.where.startswith('equations') else 'seems'} to lack"
        if not parts:
            return f"{lacks} a {'constant' if kind is CONSTANT else f'term in {law}'}"
        sizes = [(name, f"{factor * one.size:.3g}") for name, factor in parts]
        if kind is CONSTANT:
            return f"{lacks} a constant of {sizes[0][1]}"
        others = [f" and {name} {size}*{law}" for name, size in sizes[1:]]
        return f"{lacks} {sizes[0][1]}*{law}{''.join(others)}"
    signal = model.signal(one.signal)
    amount = abs(one.number)
    size = {
        "signal": with_unit(amount, signal.unit, 3),
        "time": with_unit(amount, "s", 2),
        "part": f"{amount:.2g}",
        "percent": percent(amount),
    }[kind.measure]
    text = kind.text.format(size=size, word=word_of(one), u=one.signal, top=f"{one.top:.3g}")
    return f"{one.signal} seems to be {text[3:]}" if text.startswith("is ") else f"{one.signal} {text}"


def _of_course(model: CompiledModel, one: Candidate, kind: Course, scale: Mapping[str, float | None]) -> str:
    amount = one.size / (scale[one.where] or 1.0) if kind.measure == "equation" else one.size * one.top
    size = percent(amount) if kind.measure == "percent" else with_unit(amount, _unit_of(model, one, kind), 3)
    when = f"at {with_unit(one.level, 's', 3)}" if one.level else "in the course of the run"
    return f"{kind.text.format(name=one.where, size=size)} {when}"


def _unit_of(model: CompiledModel, one: Candidate, kind: Course) -> str:
    """Of the change; "" of an equation's, which has the unit of its terms."""
    if kind.measure == "parameter":
        return next(own.unit for own in model.unknowns if own.name == one.where)
    return model.signal(one.signal).unit if kind.measure == "signal" else ""


def _parts(one: Candidate, scale: Mapping[str, float | None]) -> list[tuple[str, float]]:
    """Rows of a law, with what its size is to be multiplied by in their equations as written; [] where one is none."""
    factors = [(name, sign, scale[name]) for name, sign in one.rows]
    return [] if any(of is None for _, _, of in factors) else [(name, sign / of) for name, sign, of in factors if of]


def _typed(parts: Sequence[tuple[str, float]], term: str) -> str:
    ratios = [f"{factor / parts[0][1]:.6g}*" for _, factor in parts]
    signs = [{"1*": "", "-1*": "-"}.get(one, one) for one in ratios]
    return "; ".join(f"{name}: {sign}{term}" for (name, _), sign in zip(parts, signs, strict=True))


def _law(one: Candidate) -> str:
    law = one.kind.text
    if one.signal.startswith("("):  # a deflection: its derivative is that of its sensors
        law = law.replace("({x})", "{x}").replace("({x}.d())", "{x}.d()")
        for order in (".d()", ".d(2)"):
            law = law.replace("{x}" + order, re.sub(r"[A-Za-z_]\w*", rf"\g<0>{order}", one.signal))
    return law.format(x=one.signal, w=f"{one.level:.2g}")


def scale_of(model: CompiledModel, kind: int, p: Float) -> float | None:
    """A row over the equation that the user wrote, at p; None where the row is no multiple of it."""
    integrals = sum(one.has(Integral) for one in model.opaque.values())  # whose rates are equations, too
    if len(model.rows) + integrals != len(model.equations):
        return None
    row, equation = model.rows[kind], model.equations[kind]
    parts = [(theta, part) for theta, part in zip(row.theta, row.regressors, strict=True)] + [(-1, row.known)]
    whole = sum(
        sp.sympify(theta) * total_derivative(psi, order) for theta, part in parts for order, psi in part.items()
    )
    of_first = p[list(model.places[0])]  # of several recordings: the row has the symbols of one
    at_p = dict(zip(model.alone.p, map(sp.Float, of_first), strict=True))
    whole, equation = (model.with_knowns(sp.sympify(one)).xreplace(at_p) for one in (whole, equation))
    symbols = sorted(whole.free_symbols | equation.free_symbols, key=str)
    random = np.random.default_rng(1)
    ratios = []
    for _ in range(3):
        at = {one: sp.Float(value) for one, value in zip(symbols, random.uniform(0.5, 1.5, len(symbols)), strict=True)}
        try:
            ratios.append(float(whole.xreplace(at)) / float(equation.xreplace(at)))
        except (TypeError, ZeroDivisionError):
            return None
    return ratios[0] if np.allclose(ratios, ratios[0], rtol=1e-6) else None
