"""The twin of a C core: its C printed as Python, stepped through runs, beside what the C is compiled to."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import is_
from threading import Lock
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.core.headers import Placed
from pvid.core.model_library import NATIVE, ModelSources, core_of
from pvid.core.refusals import refused
from pvid.core.sources import FOLDERS, public_headers
from pvid.settings.enums import Reason, Stage, Status
from pvid.settings.record import Record, standing_word
from pvid.settings.refine import RefineConfig
from pvid.twin import fnv
from pvid.twin.printer.program import printed_module
from pvid.twin.printer.values import filled, numbers
from pvid.twin.state import take_over

Progress = Callable[[int], None]

_PROGRESS_TICKS = 512
_HASHING = Lock()  # a printed module is shared by all threads


def _public(room: str, core: str) -> list[str]:
    """The functions of an identifier that the public headers declare."""
    text = "".join(one.read_text(encoding="utf-8") for one in public_headers())
    return sorted(set(re.findall(rf"\bpvid_{room}_\w+_{core}(?=\()", text)))


def printed(sources: ModelSources) -> ModuleType:
    """The printed module of a mechanism's core: the public functions of its identifier and what they need."""
    core, room = sources.build.name, sources.build.room
    roots = [*_public(room, core), f"pvid_fnv_estimator_{core}"]
    if sources.refined:
        roots += [*_public("refine", "f32"), "pvid_refiner_f32", "pvid_fnv_refine_f32"]
    roots += [f"{sources.name}_{room}_{core}", f"{sources.name}_settings_{core}", f"{sources.name}_config_{core}"]
    macros = {name: str(value) for name, value in sources.sizes.items()}
    return printed_module(core_of(sources.build, sources.refined), [*FOLDERS, NATIVE], macros, roots, sources.texts)


@dataclass(frozen=True)
class SecondStage:
    """What the second stage did, one entry a tick.

    Attributes
    ----------
    told : reason of its last block, uint8 [ticks]
    r, se : published parameters and standard errors, float32 [ticks, parameters]; 0 where there is none
    """

    told: npt.NDArray[np.uint8]
    r: npt.NDArray[np.float32]
    se: npt.NDArray[np.float32]


class PrintedTwin:
    """An identifier of the weak form, in either arithmetic, with or without its second stage.

    Raises PvidError when the core refuses the settings.

    Parameters
    ----------
    sources : of its library
    config : its settings, as the library's identifier gets them
    refine : settings of the second stage; None: without
    start : p in the formats of the fixed-point core [n_p]; None: that of the settings

    Attributes
    ----------
    state : pvid_weak_<core> as printed
    samples : numbers of a tick
    reach : ticks from a sample until the identifier has processed it completely, at most
    running_hash : FNV-1a after the last tick
    second : of the last run; None without a second stage
    """

    def __init__(
        self, sources: ModelSources, config: Any, refine: RefineConfig | None = None, start: Sequence[int] | None = None
    ) -> None:
        self._core = core = sources.build.name
        self.module = module = printed(sources)
        self.fixed = core == "q31"
        kind = f"pvid_weak_config_{core}"
        self.refinement: Any = None
        if self.fixed:
            given = getattr(module, f"{sources.name}_config_q31").copy()
            settings = filled(module, type(given.estimator).__name__, config.estimator)
            given.estimator.assign(settings)
            if start is not None:
                given.estimator.start[: len(start)] = [int(one) for one in start]
        else:
            given = filled(module, kind, config)
            given.design.model = getattr(module, f"{sources.name}_weak_f32")
        if refine is not None:
            self.refinement = module.pvid_refine_f32()
            second = filled(module, "pvid_refine_config_f32", refine)
            stage = next(one for name, one in vars(module).items() if name.startswith("pvid_refiner_f32"))
            given.refine = module.pvid_weak_refine_f32(stage, self.refinement, second)
        self.state = getattr(module, f"pvid_weak_{core}")()
        self._step = getattr(module, f"pvid_weak_step_{core}")
        status = Status(getattr(module, f"pvid_weak_init_{core}")(self.state, given))
        if status is not Status.OK:
            raise PvidError(refused(status, config, in_counts=self.fixed))
        self.samples = int(config.design.model.samples)
        self.reach = int(config.design.ticks_needed if self.fixed else config.ticks_needed)
        self.running_hash = fnv.START
        self.second: SecondStage | None = None

    @property
    def estimator(self) -> Any:
        """pvid_estimator_<core> in it."""
        return self.state.estimator

    @property
    def n_p(self) -> int:
        """Parameters."""
        return int(self.estimator.model.n_p)

    @property
    def counters(self) -> Mapping[str, int]:
        """pvid_counters by name."""
        counters = self.estimator.counters
        return {name: int(getattr(counters, name)) for name in type(counters).__slots__}

    @property
    def is_published(self) -> bool:
        """Whether an estimate has been published yet."""
        return bool(self.state.trust.published)

    @property
    def estimate(self) -> Any:
        """The published estimate (before the first one the start): pvid_estimate_<core> as printed."""
        return self.state.trust.estimate

    @property
    def refined(self) -> Any:
        """pvid_refine_latest_f32: the published estimate of the second stage; None: there is none."""
        return self.module.pvid_refine_latest_f32(self.refinement)

    @property
    def best(self) -> tuple[Stage, Any]:
        """pvid_refine_best_f32: whose estimate is published, and the estimate."""
        estimate = self.module.pvid_estimate_f32()
        stage = self.module.pvid_refine_best_f32(self.refinement, self.estimate, estimate)
        return Stage(stage), estimate

    @property
    def told(self) -> Reason:
        """Reason of the second stage's last block."""
        return Reason(self.module.pvid_refine_reason_f32(self.refinement))

    def take_over(self, placed: Sequence[Placed], running_hash: int) -> None:
        """Goes on from the state and the running hash of a compiled identifier with the same settings."""
        take_over(self.state, placed[0])
        for one in placed[1:]:
            take_over(self.refinement, one)
        self.running_hash = running_hash

    def freeze(self, frozen: bool) -> None:
        """pvid_weak_freeze_<core>."""
        getattr(self.module, f"pvid_weak_freeze_{self._core}")(self.state, frozen)

    def gap(self) -> None:
        """pvid_weak_gap_<core>."""
        getattr(self.module, f"pvid_weak_gap_{self._core}")(self.state)

    def run(self, samples: npt.ArrayLike, progress: Progress | None = None) -> Record:
        """Steps through samples [ticks, samples]: floats as a board would read them, in fixed point counts.

        Returns
        -------
        Record
            As that of the compiled core: p, sums, reasons, published p and standard errors, and the running hash, which
            goes on from one call to the next.
        """
        given = np.asarray(samples)
        flat = numbers(given, 0 if self.fixed else np.float32(0))
        step, state, width, second = self._step, self.state, given.shape[1], self.refinement
        estimator, information = self.estimator, self.estimator.information
        watched = (
            _Watched(self._of_core),
            _Watched(self._of_published),
            _Watched(self._of_standing),
            _Watched(self._of_second),
            _Watched(self._latest),
        )
        lists = [estimator.p, *([information.sums] if self.fixed else [information.high, information.low])]
        of_second = [] if second is None else [second.linear, second.work.state]
        places = np.zeros((len(watched), len(given)), np.int64)
        reasons, told = np.empty(len(given), np.uint8), np.zeros(len(given), np.uint8)
        with np.errstate(all="ignore"):
            for tick in range(len(given)):
                reasons[tick] = step(state, flat[tick * width : (tick + 1) * width])
                places[0, tick] = watched[0].place(lists, information.exponent if self.fixed else 0)
                places[1, tick] = watched[1].place([], state.trust.mark.version)
                places[2, tick] = watched[2].place([], state.trust.mark.version)
                if second is not None:
                    places[3, tick] = watched[3].place(of_second, second.level)
                    places[4, tick] = watched[4].place([], (second.mark.version, second.mark.number[0]))
                    told[tick] = self.module.pvid_refine_reason_f32(second)
                if progress is not None and tick % _PROGRESS_TICKS == 0:
                    progress(tick)
        return self._record(watched, places, reasons, told)

    # ---- words of the state, where it has changed

    def _hashed(self, function: str, *given: Any) -> list[int]:
        """The words that a hash of the core covers, but for the reason at its end."""
        words: list[int] = []
        module = vars(self.module)

        def keep(_: int, word: int) -> int:
            words.append(word)
            return 0

        with _HASHING:
            own, module["pvid_fnv_word"] = module["pvid_fnv_word"], keep
            try:
                module[function](0, *given, 0)
            finally:
                module["pvid_fnv_word"] = own
        return words[:-1]

    def _of_core(self) -> list[int]:
        return self._hashed(f"pvid_fnv_estimator_{self._core}", self.estimator)

    def _of_second(self) -> list[int]:
        return self._hashed("pvid_fnv_refine_f32", self.refinement)

    def _of_published(self) -> list[Any]:
        return [*self.estimate.p[: self.n_p], *self.estimate.se[: self.n_p]]

    def _of_standing(self) -> list[int]:
        return [standing_word(self.estimate.standing)]

    def _latest(self) -> list[Any]:
        one = self.refined
        return [np.float32(0)] * (2 * len(self.refinement.linear)) if one is None else [*one.r, *one.se]

    def _record(
        self,
        watched: Sequence[_Watched],
        places: npt.NDArray[np.int64],
        reasons: npt.NDArray[np.uint8],
        told: npt.NDArray[np.uint8],
    ) -> Record:
        number = np.int32 if self.fixed else np.float32
        words, shown = watched[0].at(places[0], np.uint32), watched[1].at(places[1], number)
        hashed = [words, reasons[:, None].astype(np.uint32)]
        if self.refinement is not None:
            latest = watched[4].at(places[4], np.float32)
            half = latest.shape[1] // 2
            self.second = SecondStage(told, latest[:, :half], latest[:, half:])
            hashed += [watched[3].at(places[3], np.uint32), told[:, None].astype(np.uint32)]
        hashes = fnv.of_words(np.concatenate(hashed, axis=1), self.running_hash)
        self.running_hash = int(hashes[-1]) if len(hashes) else self.running_hash
        sums = np.ascontiguousarray(words[:, self.n_p : words.shape[1] - self.fixed])
        return Record(
            p=np.ascontiguousarray(words[:, : self.n_p]).view(number),
            sums=sums.view(np.int64 if self.fixed else np.float32),
            reason=reasons,
            exponent=words[:, -1].astype(np.uint8) if self.fixed else np.empty(0, np.uint8),
            published=shown[:, : self.n_p],
            published_se=shown[:, self.n_p :],
            standing=watched[2].at(places[2], np.uint32)[:, 0],
            hash=hashes,
        )


class _Watched:
    """Rows of a state that changes at few ticks. `made` returns the present one."""

    def __init__(self, made: Callable[[], list[Any]]) -> None:
        self.rows: list[list[Any]] = []
        self._made, self._last, self._mark = made, list[list[Any]](), object()

    def place(self, lists: list[list[Any]], mark: Any) -> int:
        """The row's place: a new row where a number has been written, or the mark is not what it was."""
        same = self._mark is mark or self._mark == mark
        if not (same and all(all(map(is_, now, last)) for now, last in zip(lists, self._last, strict=True))):
            self._last, self._mark = [one[:] for one in lists], mark
            self.rows.append(self._made())
        return len(self.rows) - 1

    def at(self, places: npt.NDArray[np.int64], number: type[np.generic]) -> npt.NDArray[Any]:
        """The rows at these places [places, row]."""
        rows = self.rows or [self._made()]
        return np.array(rows, number)[places]
