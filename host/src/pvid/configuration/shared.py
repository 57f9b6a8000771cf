"""The shared errors of a board's estimate (trust.h): from a design's motion, or from the analysis of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel, Unknown
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.gate import gated
from pvid.oracle.weak.identify import Identified
from pvid.oracle.weak.library import Library
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.shared import Cause, of_scale, of_signals, or_nan
from pvid.oracle.weak.solve import Fit

Run = Mapping[str, npt.ArrayLike]
Bools = npt.NDArray[np.bool_]

_MOST = 100.0  # of a parameter, also where a number ran away: nothing is known of it
_LARGEST = 1e9  # of trust.h
CLASH = 3.0  # standard errors of noise by which the core and the analysis disagree
_NAMED, _LEAST = 3, 0.1  # causes of an error, and how much of it each is at least
_RELATIVE_BITS, _CORRELATION_BITS = 24, 30  # of trust_q31.h


@dataclass(frozen=True, eq=False)
class Shared:
    """Errors that all windows of a rig share.

    Attributes
    ----------
    p : where they were computed [n_p]
    positive : parameters whose errors are relative to p [n_p]
    sd, correlation : [n_p], [n_p, n_p]
    causes : that they are made of
    """

    p: Float
    positive: Bools
    sd: Float
    correlation: Float
    causes: tuple[Cause, ...]

    @classmethod
    def of(cls, p: Float, positive: Bools, causes: Sequence[Cause], more: Float | float = 0.0) -> Shared:
        """more: standard deviations besides, which no two parameters share [n_p]."""
        scale = np.where(positive, np.maximum(np.abs(p), 1e-300), 1.0)
        most = np.where(positive, _MOST, _MOST * np.maximum(np.abs(p), 1.0))
        moves = np.array([np.clip(np.nan_to_num(one.moves / scale, nan=np.inf), -most, most) for one in causes])
        own = np.clip(np.nan_to_num(more / scale, nan=np.inf), 0.0, most)
        covariance = moves.T @ moves + np.diag(np.broadcast_to(own, scale.shape) ** 2)
        sd = np.sqrt(np.diag(covariance))
        inverse = 1 / np.where(sd > 0, sd, np.inf)
        correlation = np.clip(covariance * np.outer(inverse, inverse), -1.0, 1.0)
        return cls(p, positive, sd, correlation, tuple(one for one in causes if np.any(one.moves)))

    @classmethod
    def of_design(cls, run: Run, design: WeakDesign, fit: Fit) -> Shared:
        """Of a run that the design is for, and that no sensor of the rig has shown."""
        library = Library(run, design, fit)
        causes = [*of_scale(library), *of_signals(library), *_of_signs(run, design, fit)]
        return cls.of(fit.p, fit.rows.compiled.parameters.positive, causes)

    @classmethod
    def of_answer(cls, found: Identified, fit: Fit) -> Shared:
        """Of a recording: the parts of the answer's standard errors that a longer run does not reduce, which are those
        of scale and of the model, and by how much its noise is more than that of its rows.

        Parameters
        ----------
        fit : of the board's form to the recording; its distance belongs to the model's part where noise explains none
        """
        causes = list(found.causes)
        model = np.abs(found.shifts)
        if len(model):
            largest = found.shifts[int(np.argmax(np.sum(np.square(model / np.maximum(found.se, 1e-300)), axis=1)))]
            causes.append(Cause("the model", largest))
        apart = fit.p - found.p
        rows = np.maximum(found.predicted, found.clustered)
        rest = found.noise**2 - rows**2 + found.by_model**2 - (causes[-1].moves ** 2 if len(model) else 0.0)
        causes.append(Cause("the core's form", np.where(np.abs(apart) > CLASH * found.noise, apart, 0.0)))
        # the board has these as positive, also where the analysis found one near 0 on a scale of its own
        positive = fit.rows.compiled.parameters.positive
        return cls.of(found.fit.p, positive, causes, np.sqrt(np.maximum(rest, 0.0)))

    @classmethod
    def of_part(cls, compiled: CompiledModel, part: float) -> Shared:
        """A relative error that all positive parameters have at once, as in logs before there were others."""
        positive = np.array([one.positive for one in compiled.unknowns])
        both = positive & (part > 0)
        return cls(np.ones(len(positive)), positive, part * positive, np.outer(both, both).astype(np.float64), ())

    def lines(self, unknowns: Sequence[Unknown]) -> tuple[str, ...]:
        """What the error of each parameter is, and its largest causes: "R 1.1 %: gain of V 1 %, gain of i 0.5 %"."""
        scale = np.where(self.positive, np.maximum(np.abs(self.p), 1e-300), 1.0)
        out = []
        for k, one in enumerate(unknowns):
            unit = 100.0 if self.positive[k] else 1.0
            name = "%" if self.positive[k] else one.unit
            sizes = sorted(((abs(float(x.moves[k] / scale[k])), x) for x in self.causes), key=lambda pair: -pair[0])
            texts = [f"{x.text} {unit * size:.2g} {name}".rstrip() for size, x in sizes if size > _LEAST * self.sd[k]]
            if texts:
                out.append(f"{one.name} {unit * self.sd[k]:.2g} {name}".rstrip() + f": {', '.join(texts[:_NAMED])}")
        return tuple(out)

    @property
    def triangle(self) -> npt.NDArray[np.float32] | None:
        """`shared` of trust.h; None: there are none."""
        table = self._table(np.minimum(self.sd, _LARGEST), self.correlation)
        return table.astype(np.float32) if table.any() else None

    def counts(self, p_bits: Sequence[int]) -> tuple[int, ...] | None:
        """`shared` of trust_q31.h, with parameters in these formats."""
        bits = np.where(self.positive, _RELATIVE_BITS, p_bits)
        table = self._table(np.minimum(np.ldexp(self.sd, bits), 2.0**31 - 1), self.correlation * 2.0**_CORRELATION_BITS)
        return tuple(round(float(one)) for one in table) if table.any() else None

    def _table(self, sd: Float, correlation: Float) -> Float:
        table = correlation.copy()
        np.fill_diagonal(table, sd)
        return np.asarray(np.where(self.sd.any(), table[np.triu_indices(len(sd))], 0.0))


def _of_signs(run: Run, design: WeakDesign, fit: Fit) -> Iterator[Cause]:
    """The core takes the mean of a noisy rate's sign over a step: how far p is from that with located reversals."""
    if fit.rows.compiled.channels.signs and design.reversals == "averaged":
        rows = WeakRows.of(fit.rows.compiled, run, replace(design, reversals="located"))
        yield Cause("signs of a noisy rate", fit.p - or_nan(fit, lambda: gated(rows, fit.p).p))
