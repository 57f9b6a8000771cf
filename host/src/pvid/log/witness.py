"""An identifier that computes a log again: the printed twin, or the core compiled on this computer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pvid.core.headers import Placed
from pvid.core.weak_native import RefinedIdentifier
from pvid.settings.enums import Reason, Stage
from pvid.settings.record import standing_word
from pvid.twin.printed import PrintedTwin

Samples = npt.NDArray[Any]
Reasons = npt.NDArray[np.uint8]


class Identifier(Protocol):
    """What the twin and the core have in common."""

    running_hash: int

    @property
    def estimate(self) -> Any: ...

    @property
    def counters(self) -> Mapping[str, int]: ...


class Twin(Identifier, Protocol):
    """PrintedTwin of the weak form, or StrongModelTwin of the strong form."""

    samples: int  # of a tick
    reach: int

    def run(self, samples: Samples) -> Any:
        """Goes on over samples [ticks, samples]."""

    def take_over(self, placed: Sequence[Placed], running_hash: int) -> None:
        """Goes on from the state of the compiled core."""


class Core(Identifier, Protocol):
    """The identifier in C."""

    @property
    def placed(self) -> list[Placed]: ...

    def run_samples(self, samples: Samples, *, sums: bool = True) -> Any: ...


class Board(Protocol):
    """What an estimate contains."""

    @property
    def matrix(self) -> str: ...


@dataclass(frozen=True)
class State:
    """Of the core after a tick."""

    placed: Sequence[Placed]
    running_hash: int
    reason: int
    verdict: int


@dataclass(frozen=True)
class Refined:
    """best : the published estimate. latest : r, se, level, clash, number: of the second stage."""

    stage: Stage
    best: Mapping[str, Any]
    latest: Mapping[str, Any]
    told: Reason


class Witness:
    """Steps an identifier and reads what its board would send.

    Attributes
    ----------
    ticks : stepped through
    reason, verdict : of the last tick, and the last one that reports something
    """

    def __init__(self, own: Identifier, board: Board) -> None:
        self._identifier, self.matrix = own, board.matrix
        self._shown: tuple[int, ...] = getattr(board, "shown", ())  # refined parameters that the board sends
        self.ticks = 0
        self.reason = self.verdict = int(Reason.WARMING_UP)

    def run(self, samples: Samples) -> None:
        """Goes on over samples [ticks, samples]."""
        reasons = self._reasons(samples)
        reported = reasons[reasons != Reason.ACCUMULATED]
        self.verdict = int(reported[-1]) if len(reported) else self.verdict
        self.reason = int(reasons[-1])
        self.ticks += len(samples)

    def _reasons(self, samples: Samples) -> Reasons:
        raise NotImplementedError

    @property
    def running_hash(self) -> int:
        """After the last tick."""
        return self._identifier.running_hash

    @property
    def updates(self) -> int:
        """Steps of p."""
        return self._identifier.counters["updates"]

    def estimate(self) -> Mapping[str, Any]:
        """What the board reports at present."""
        return self._fields(self._identifier.estimate)

    def _fields(self, estimate: Any) -> Mapping[str, Any]:
        found = {name: _of(estimate, name) for name in ("p", "se", "kappa", "residual_sd", "weight")}
        matrix = np.array(_of(estimate, self.matrix))
        found["standing"] = standing_word(_of(estimate, "standing"))
        return found | {self.matrix: np.reshape(matrix, (len(found["p"]), -1))}

    def refined(self) -> Refined | None:
        """The estimates of the second stage; None: there is no second stage."""
        own = self._identifier
        if not isinstance(own, PrintedTwin | RefinedIdentifier) or own.refinement is None:
            return None
        stage, best = own.best
        latest: dict[str, Any] = {"number": int(own.refinement.mark.number[0])}
        for name in ("r", "se", "level", "clash"):
            value = None if own.refined is None else _of(own.refined, name)
            if name in ("r", "se"):
                latest[name] = [np.float32(0) if value is None else value[place] for place in self._shown]
            else:
                latest[name] = 0.0 if value is None else value
        return Refined(stage, self._fields(best), latest, own.told)


class TwinWitness(Witness):
    """The printed twin."""

    def __init__(self, twin: Twin, board: Board) -> None:
        super().__init__(twin, board)
        self._twin = twin

    def _reasons(self, samples: Samples) -> Reasons:
        return self._twin.run(samples).reason  # type: ignore[no-any-return]

    def take_over(self, state: State) -> None:
        """Goes on from a state of the core."""
        self.reason, self.verdict = state.reason, state.verdict
        self._twin.take_over(state.placed, state.running_hash)


class CoreWitness(Witness):
    """The core compiled on this computer."""

    def __init__(self, core: Core, board: Board) -> None:
        super().__init__(core, board)
        self._core = core

    def _reasons(self, samples: Samples) -> Reasons:
        core = self._core
        if isinstance(core, RefinedIdentifier):
            return core.run_both(samples).reason
        return core.run_samples(samples, sums=False).reason  # type: ignore[no-any-return]

    @property
    def state(self) -> State:
        """At present."""
        return State(self._core.placed, self.running_hash, self.reason, self.verdict)


def _of(one: Any, name: str) -> Any:
    """A field of a printed struct, or of a record of numpy."""
    return one[name] if isinstance(one, np.void) else getattr(one, name)
