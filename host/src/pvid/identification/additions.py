"""Terms that are added to a model for one identification: typed in a command, or as an answer names what is missing."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pvid.base.errors import PvidError
from pvid.identification.answer import Analysis
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import described, path_of, text_with
from pvid.oracle.weak.failures import attempted
from pvid.oracle.weak.identify import identify, ready
from pvid.oracle.weak.naming import terms_of
from pvid.oracle.weak.rows import WeakRows
from pvid.rig.mechanism_file import MechanismRig


@dataclass(frozen=True)
class Additions:
    """Terms for a mechanism, at the scale of a recording.

    Attributes
    ----------
    rig : of the mechanism without them
    terms : as Model.add takes them, with the equation
    sd : of each unknown that they bring: the size at which its term equals the largest one of its equation
    """

    rig: MechanismRig
    terms: tuple[str, ...]
    sd: tuple[float, ...]

    @cached_property
    def model(self) -> CompiledModel:
        """With the values of the rig."""
        return _compiled(self.rig, self.terms, self.sd)

    def text_of(self, answer: Analysis) -> str:
        """The model file with the terms; the values of an answer with them are the guesses."""
        lines, places = (
            [],
            [len(_compiled(self.rig, self.terms[:k], self.sd[:k]).unknowns) for k in range(len(self.sd))],
        )
        for term, sd, k, after in zip(
            self.terms, self.sd, places, [*places[1:], len(self.model.unknowns)], strict=True
        ):
            value = answer.values[self.model.p_names[k]].value if after > k else None
            at = f", guess={value:.4g}, sd={2 * abs(value):.4g}" if value else f", sd={sd:.3g}"
            lines.append(f"add({term!r}{at})")
        return text_with(self.rig.model, lines)


def added(answer: Analysis, rig: MechanismRig, terms: Sequence[str]) -> Additions:
    """Terms for the mechanism of an answer without them.

    A term without its equation goes to the one in which it leaves the smallest residuals.

    Raises PvidError where a term cannot be read or compiled, or the recording does not contain it.
    """
    out = Additions(rig, (), ())
    for term in terms:
        names = [one.name for one in described(rig.model).equations]
        open_ = ":" not in term and len(names) > 1
        tried = [f"{name}: {term}" for name in names] if open_ else [term]
        found, refusals = [], list[PvidError]()
        for one in tried:
            try:
                found.append(_scaled(answer, out, one))
            except PvidError as error:
                refusals.append(error)
        if not found:
            raise refusals[0]
        out = found[0] if len(found) == 1 else min(found, key=lambda one: _misfit(answer, one))
    return out


def _compiled(rig: MechanismRig, terms: Sequence[str] = (), sd: Sequence[float] = ()) -> CompiledModel:
    description = described(rig.model)
    for term, own in zip(terms, sd, strict=True):
        description.add(term, sd=own)
    return rig.applied(description.compiled(path_of(rig.model)[0]))


def _scaled(answer: Analysis, before: Additions, term: str) -> Additions:
    """With one more term, whose size is scaled by the recording."""
    terms = (*before.terms, term)
    model = _compiled(before.rig, terms, (*before.sd, 1.0))
    if len(model.unknowns) == len(before.model.unknowns):
        return replace(before, terms=terms, sd=(*before.sd, 1.0))
    compiled, design = ready(model), answer.found.design
    rows = WeakRows.of(compiled, answer.recording.run, design)
    guess = np.array([one.guess for one in model.unknowns])
    of_first = answer.found.p[list(answer.model.places[0])]  # of several recordings with own parameters
    p = np.append(of_first, guess[len(of_first) :])
    p = np.where(np.isfinite(p), p, guess)
    sizes = []
    for own, at, off in zip(
        rows.columns, compiled.parameters.theta(np.append(p[:-1], 1.0)), compiled.parameters.theta(p), strict=True
    ):
        term_alone = np.einsum("wjk,j->wk", own[:, : len(at)], at - off)
        others = own[:, : len(off) + 1] * np.append(off, 1.0)[:, np.newaxis]
        small, large = np.sqrt(np.mean(term_alone**2)), np.sqrt(np.max(np.mean(others**2, axis=(0, 2))))
        if small > 0 and np.isfinite(large / small):
            sizes.append(float(large / small))
    if not sizes:
        raise PvidError(f"--add {shlex.quote(term)}: the term is 0 in this recording")
    return replace(before, terms=terms, sd=(*before.sd, max(sizes)))


def _misfit(answer: Analysis, one: Additions) -> float:
    recording = answer.recording
    found = attempted(lambda: identify(one.model, recording.run, recording.sample_rate, design=answer.found.design))
    return np.inf if found is None else found.chi2


def to_type(answer: Analysis) -> Iterator[str]:
    """A sentence with the options that add what an answer names as missing; none where it names nothing."""
    named = answer.found.named
    if named is None or not named.complete:
        return
    model, options, without = answer.model, [], []
    taken = {*model.p_names, *(one.name for one in model.signals), *(one.name for one in model.knowns)}
    names = (name for k in range(1, 100) if (name := f"a{k}") not in taken)
    for one in terms_of(answer.found.fit, named):
        if one.typed is None:
            without.append(one.text)
        else:
            options.append(f"--add {shlex.quote(one.typed.format(a=next(names)))}")
    if options:
        yield f"identify with what is named: {' '.join(options)}"
    for text in without if any(one.alarm for one in answer.doubts) else ():
        yield (
            f"a model file has no term for this: {text}; correct the column before the identification, or keep the "
            "motion where it does not matter"
        )
