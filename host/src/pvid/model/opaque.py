"""sgn(..), |..| and roots as auxiliary signals, so that operators can act on them without differentiating."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import sympy as sp

from pvid.model.compiled import Part, Row
from pvid.model.lower import OPAQUE
from pvid.model.readable import readable
from pvid.model.refusal import ModelError
from pvid.model.signals import Jet, jets
from pvid.model.terms import added, is_opaque, product, terms_of


class Opaque:
    """Auxiliary signals and what they stand for."""

    def __init__(self, hidden: Collection[str], p: Collection[sp.Symbol]) -> None:
        self.hidden, self.p = set(hidden), set(p)
        self.stands_for: dict[Jet, sp.Expr] = {}

    def hide(self, expression: sp.Expr) -> sp.Expr:
        """Each term's factor of measured signals that contains sgn, |..| or a root becomes one jet.

        Raises ModelError where one of these takes a coordinate that is not measured.
        """
        return added(self._term(term) for term in terms_of(expression))

    def shown(self, row: Row) -> Row:
        """The expressions in place of the auxiliary signals; what would be a derivative of one stays."""
        return replace(
            row,
            regressors=tuple(self._shown(part) for part in row.regressors),
            known=self._shown(row.known),
            nuisances=tuple(self._shown(part) for part in row.nuisances),
        )

    def _shown(self, part: Part) -> dict[int, sp.Expr]:
        return {m: sp.expand(psi.xreplace(self.stands_for)) for m, psi in part.items()}

    def _term(self, term: sp.Expr) -> sp.Expr:
        if not is_opaque(term):
            return term
        inside: list[sp.Expr] = []
        outside: list[sp.Expr] = []
        for factor in sp.Mul.make_args(term):
            own = jets(factor)
            unmeasured = {jet.of for jet in own} & self.hidden
            if unmeasured and is_opaque(factor):
                names = " and ".join(sorted(unmeasured))
                raise ModelError(
                    f"{names} cannot be eliminated: {readable(factor)} is not linear in it; a sensor for "
                    f"{names} would help"
                )
            (inside if own and not unmeasured and not factor.free_symbols & self.p else outside).append(factor)
        if not any(map(is_opaque, inside)):
            return term
        return product(outside) * self._jet(product(inside))

    def _jet(self, expression: sp.Expr) -> Jet:
        for jet, known in self.stands_for.items():
            if known == expression:
                return jet
        jet = Jet(f"{OPAQUE}{len(self.stands_for)}")
        self.stands_for[jet] = expression
        return jet
