"""The weak identifier as a board has it: its settings are made once for a rig, then it runs from any start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.codegen.weak_q31 import WeakQ31
from pvid.configuration.weak import samples_of, weak_config
from pvid.configuration.weak_q31 import weak_q31_for_run
from pvid.core.native import Publisher
from pvid.core.weak_native import WeakIdentifier, WeakNative
from pvid.core.weak_native_q31 import WeakIdentifierQ31, WeakNativeQ31
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.design import WeakDesign
from pvid.settings.enums import Core, Reason
from pvid.settings.record import Record
from pvid.settings.weak import WeakConfig
from pvid.settings.weak_q31 import WeakConfigQ31

Float = npt.NDArray[np.float64]
Signals = Mapping[str, npt.ArrayLike]

PUBLISHED = (Reason.UPDATED, Reason.MISFIT)


@dataclass(frozen=True, eq=False)
class Answer:
    """What a run has led to.

    Attributes
    ----------
    p, se : published; before the first publication those of the start [n_p]
    correlation : of their errors [n_p, n_p]
    history, errors : p and standard errors that are published after every tick [ticks, n_p]
    reasons : of every tick, Reason [ticks]
    """

    p: Float
    se: Float
    correlation: Float
    history: Float
    errors: Float
    reasons: npt.NDArray[np.uint8]

    @property
    def published(self) -> bool:
        """Whether anything was."""
        return bool(np.isin(self.reasons, PUBLISHED).any())

    @property
    def alarm(self) -> bool:
        """Whether the last publication had residuals beyond the sensors' noise."""
        of_publications = self.reasons[np.isin(self.reasons, PUBLISHED)]
        return bool(of_publications.size and of_publications[-1] == Reason.MISFIT)

    @property
    def last(self) -> Reason:
        """Of the last window."""
        ends = self.reasons[~np.isin(self.reasons, (Reason.WARMING_UP, Reason.ACCUMULATED))]
        return Reason(int(ends[-1])) if len(ends) else Reason.WARMING_UP


class BoardWeak(Protocol):
    """An arithmetic of the identifier."""

    def answer(self, run: Signals, start: Float) -> Answer:
        """Steps through a run from a start [n_p]."""


@dataclass(frozen=True, eq=False)
class FloatBoard:
    """In float32."""

    compiled: CompiledModel
    config: WeakConfig

    @cached_property
    def library(self) -> WeakNative:
        """Of the mechanism."""
        return weak_native(self.compiled, self.config.design)

    def config_from(self, start: Float) -> WeakConfig:
        """With another start [n_p]."""
        return replace(self.config, estimator=replace(self.config.estimator, start=np.asarray(start, np.float32)))

    def identifier(self, start: Float) -> WeakIdentifier:
        """Initialised."""
        return self.library.identifier_of(self.config_from(start))

    def samples(self, run: Signals) -> npt.NDArray[np.float32]:
        """As `step` takes them [ticks, samples]."""
        return samples_of(self.config, run)

    def answer(self, run: Signals, start: Float) -> Answer:
        """Steps through a run from a start [n_p]."""
        identifier = self.identifier(start)
        record = identifier.run_samples(self.samples(run), sums=False, hashes=False)
        p, se = _published(identifier, record)
        p, se, history, errors = (x.astype(np.float64) for x in (p, se, record.published, record.published_se))
        covariance = identifier.estimate["covariance"].astype(np.float64)[: len(p), : len(p)]
        return Answer(p, se, covariance / np.outer(se, se), history, errors, record.reason)


@dataclass(frozen=True, eq=False)
class FixedBoard:
    """In fixed point."""

    weak: WeakQ31

    @cached_property
    def library(self) -> WeakNativeQ31:
        """Of the mechanism with its settings."""
        return weak_native_q31(self.weak.made, self.weak.parameters, self.weak.config)

    def config_from(self, start: Float) -> WeakConfigQ31:
        """With another start [n_p]."""
        config, integers = self.weak.config, tuple(self.weak.integers(start).tolist())
        return replace(config, estimator=replace(config.estimator, start=integers))

    def identifier(self, start: Float) -> WeakIdentifierQ31:
        """Initialised."""
        return self.library.identifier(self.config_from(start).estimator.start)

    def samples(self, run: Signals) -> npt.NDArray[np.int32]:
        """As `step` takes them [ticks, samples]."""
        return self.weak.counts_of(run)

    def answer(self, run: Signals, start: Float) -> Answer:
        """Steps through a run from a start [n_p]."""
        identifier = self.identifier(start)
        record = identifier.run_samples(self.samples(run), sums=False, hashes=False)
        p, se = map(self.weak.values, _published(identifier, record))
        correlation = identifier.estimate["correlation"][: len(p), : len(p)] * 2.0**-30
        values = self.weak.values
        return Answer(p, se, correlation, values(record.published), values(record.published_se), record.reason)


def _published(identifier: Publisher, record: Record) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    n_p = record.published.shape[1]
    return identifier.estimate["p"][:n_p], identifier.estimate["se"][:n_p]


def board_of(
    compiled: CompiledModel, run: Signals, design: WeakDesign, p: Float, core: Core, shared: bool = False
) -> FloatBoard | FixedBoard:
    """Settings from a run of the rig, at parameters near its own [n_p]; shared: as of weak_config."""
    if core == "q31":
        return FixedBoard(weak_q31_for_run(compiled, run, design, p, shared=shared))
    return FloatBoard(compiled, weak_config(compiled, run, design, p, shared=shared))
