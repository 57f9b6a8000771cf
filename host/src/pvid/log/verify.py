"""Computes a log again with the numpy twin and compares every estimate and every hash in it, bit for bit.

The log contains everything that the bits depend on: the samples from the session's first tick on, the configuration
and the rig file, which gives the settings and tables of the board's image. After a lost sample the identifier's state
is unknown, and later samples cannot be verified until another session begins. A link failure without a lost sample has
no effect.

A check is an estimate or a hash. A sample counts as verified if a later check that covers it is equal. If the board
hashes its samples, a hash covers all samples before it. An estimate, or a hash without the samples, covers only samples
that the identifier has processed completely: a window is processed up to Schedule.reach ticks after its samples.
Samples after the last check are not verified. If no further check was due there, this is no fault: it is reported, and
the log counts as verified.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.stream_image import StreamImage, settings_number
from pvid.board.stream_rig import stream_rig
from pvid.cases import case_of
from pvid.compare.bits import P_NAMES, Difference
from pvid.link.frames import (
    MAX_P,
    Configuration,
    Configure,
    ConfigureQ31,
    Credit,
    Estimate,
    EstimateQ31,
    Hash,
    Hello,
    Loss,
    Raw,
    RawCount,
    RefinedEstimate,
)
from pvid.link.names import shown_of_refined
from pvid.log.reader import Gap, Record, Restart
from pvid.rig.file import RigFile
from pvid.settings.enums import Reason
from pvid.settings.kinds import Settings
from pvid.settings.record import HASHED_TYPES
from pvid.twin import fnv
from pvid.twin.both_stages import BothStagesTwin
from pvid.twin.weak import WeakTwin
from pvid.twin.weak_q31 import WeakTwinQ31

Check = Estimate | EstimateQ31 | RefinedEstimate | Hash | Credit


class EngineBoard(Protocol):
    """A board that identifies by the weak engine: MechanismBoard of pvid.board, and that in fixed point."""

    @property
    def stream_image(self) -> StreamImage: ...

    @property
    def p_names(self) -> tuple[str, ...]: ...

    @property
    def matrix(self) -> str: ...

    def twin_of(self, frame: Configuration) -> WeakTwin | WeakTwinQ31 | BothStagesTwin: ...


_CONFIGURATIONS = 8  # of the latest sessions; older ones are forgotten
_UPPER = tuple((a, b) for a in range(MAX_P) for b in range(a, MAX_P))


@dataclass
class Stretch:
    """Consecutive ticks of one session and the result of their verification.

    `ticks`: their number, from `first` on. `checked`: estimates and hashes that were equal, up to the `difference` if
    there is one. `verified`: ticks covered by equal checks. `open`: no check of the other ticks was due yet. `why_not`:
    reason why nothing could be verified.
    """

    segment: int
    first: int
    ticks: int
    session: int | None = None
    checked: int = 0
    difference: Difference | None = None
    why_not: str | None = None
    verified: int = 0
    open: bool = False

    @property
    def trailing(self) -> int:
        """Ticks after the last check."""
        return self.ticks - self.verified

    @property
    def text(self) -> str:
        """In one sentence."""
        where = f"segment {self.segment}, ticks {self.first} to {self.first + self.ticks - 1}"
        if self.difference is not None:
            return f"{where}: DIFFERENT at {self.difference}"
        if self.why_not is not None:
            return f"{where}: not verified, {self.why_not}"
        found = f"{where}: {self.checked} estimates and hashes equal in every bit"
        if self.trailing:
            why = "no check of them was due yet" if self.open else "the check of them was lost"
            found += f"; the last {self.trailing} samples are not verified, {why}"
        return found


@dataclass
class Verdict:
    """Results of all stretches, added up."""

    samples: int = 0
    verified: int = 0
    trailing: int = 0  # after the last check of their stretch, if no further check was due
    checked: int = 0
    different: int = 0
    stretches: int = 0
    good: set[int] = field(default_factory=set)  # segments with a verified stretch that has no difference
    bad: set[int] = field(default_factory=set)  # with a difference, or with nothing that could be verified

    def add(self, stretch: Stretch) -> None:
        """Adds the result of the next stretch."""
        self.stretches += 1
        self.samples += stretch.ticks
        self.checked += stretch.checked
        different = stretch.difference is not None
        self.different += different
        if not different:
            self.verified += stretch.verified
            self.trailing += stretch.trailing if stretch.open else 0
        if different or not stretch.verified:
            self.bad.add(stretch.segment)
        else:
            self.good.add(stretch.segment)

    @property
    def left(self) -> int:
        """Samples that cannot be verified, or are not although a check of them was due."""
        return self.samples - self.verified - self.trailing

    @property
    def text(self) -> str:
        """In one sentence."""
        if not self.stretches:
            return "nothing to verify: the log contains no samples"
        parts = [f"{self.checked} estimates and hashes equal in every bit, {self.verified} samples verified"]
        if self.trailing:
            parts.append(f"{self.trailing} behind the last check")
        if self.different:
            parts.append(f"{self.different} of {self.stretches} stretches DIFFERENT")
        if self.left:
            parts.append(f"{self.left} samples not verified")
        if lacking := sorted(self.bad - self.good):
            parts.append(
                f"nothing verified of segment{'' if len(lacking) == 1 else 's'} {', '.join(map(str, lacking))}"
            )
        return "in all: " + "; ".join(parts)


@dataclass
class _Open:
    """A stretch that is still growing.

    `lacks`: a sentence about the samples missing before it, if it does not begin with its session. `session`: 0 if the
    samples do not contain it. `late`: the first samples of the session are missing. `harmed`: data were lost since the
    last check.
    """

    stretch: Stretch
    lacks: str
    session: int
    samples: int  # of a tick
    late: bool = False
    harmed: bool = False
    parts: list[npt.NDArray[Any]] = field(default_factory=list)
    checks: list[tuple[int, Check]] = field(default_factory=list)

    @property
    def next(self) -> int:
        return self.stretch.first + self.stretch.ticks

    def is_of(self, session: int) -> bool:
        """Whether `session` can be the session of this stretch."""
        return 0 in (session, self.session) or session == self.session

    def begin_with(self, configuration: Configure | ConfigureQ31) -> None:
        """Sets `late` when the configuration shows at which tick the session begins."""
        if self.is_of(configuration.session) and self.stretch.first != configuration.first_tick:
            self.late = True
            self.parts.clear()
            self.checks.clear()


class Verifier:
    """Reads the records of a log and yields each stretch when it is complete.

    Parameters
    ----------
    rig
        The board's rig file of the strong form, or its board with the weak engine; None: nothing can be verified.
    progress
        Called with the number of ticks computed so far.

    Memory: the samples of the longest stretch.
    """

    def __init__(self, rig: RigFile | EngineBoard | None, progress: Callable[[int], None] | None = None) -> None:
        self.rig = rig
        self._progress = progress
        self._done = 0
        self._hello: Hello | None = None
        self._configurations: dict[int, Configure | ConfigureQ31] = {}
        self._open: _Open | None = None
        self._before: tuple[int, int] | None = None  # segment and tick where the last samples ended
        self._settings: dict[float, tuple[Settings, int]] = {}
        self._number: int | None = None  # of the board's image

    def stretches(self, records: Iterable[Record]) -> Iterator[Stretch]:
        """The stretches of all records, in order."""
        for record in records:
            yield from self._take(record)
        yield from self._close()

    def _take(self, record: Record) -> Iterator[Stretch]:
        match record.item:
            case Hello() as hello:
                self._hello = hello
            case Configure() | ConfigureQ31() as configuration:
                self._configurations.pop(configuration.session, None)
                self._configurations[configuration.session] = configuration
                if len(self._configurations) > _CONFIGURATIONS:
                    del self._configurations[next(iter(self._configurations))]
                if self._open is not None:
                    self._open.begin_with(configuration)
            case Raw() | RawCount() as raw:
                yield from self._take_samples(record, raw)
            case Estimate() | EstimateQ31() | RefinedEstimate() | Hash() | Credit() as check:
                self._take_check(record.tick, check)
            case Restart():
                yield from self._close()
            case Gap() | Loss():
                if self._open is not None and not (isinstance(record.item, Loss) and record.item.why == "cut"):
                    self._open.harmed = True
            case _:
                pass

    def _take_samples(self, record: Record, raw: Raw | RawCount) -> Iterator[Stretch]:
        opened = self._open
        follows = opened is not None and record.tick == opened.next and raw.samples == opened.samples
        if opened is None or not follows or not opened.is_of(raw.session):
            yield from self._close()
            opened = self._open = _Open(
                Stretch(record.segment, record.tick, 0), self._missing_note(record), raw.session, raw.samples
            )
            if (configuration := self._configurations.get(raw.session)) is not None:
                opened.begin_with(configuration)
        self._before = record.segment, record.tick + raw.count
        opened.stretch.ticks += raw.count
        if not opened.late:  # a late stretch is not computed
            opened.parts.append(raw.values)

    def _take_check(self, tick: int, check: Check) -> None:
        opened = self._open
        if opened is None or opened.late or check.session == 0 or not opened.is_of(check.session):
            return
        if tick > opened.next:  # of samples that were lost
            opened.harmed = True
        elif tick > opened.stretch.first:
            opened.checks.append((tick, check))
            opened.harmed = False

    def _missing_note(self, record: Record) -> str:
        """A sentence about the samples missing before this record."""
        if self._before is None or self._before[0] != record.segment:
            return f"its session began before this segment did, and the samples before tick {record.tick} are not in it"
        first = self._before[1] if self._before[1] < record.tick else 0
        return f"the samples of ticks {first} to {record.tick - 1} were lost, and every bit after them depends on them"

    def _close(self) -> Iterator[Stretch]:
        opened, self._open = self._open, None
        if opened is None:
            return
        try:
            self._verify(opened)
        except PvidError as error:
            opened.stretch.why_not = str(error)
        yield opened.stretch

    def _verify(self, opened: _Open) -> None:
        stretch = opened.stretch
        if not opened.late and opened.checks:
            stretch.session = opened.checks[-1][1].session
        else:
            stretch.session = opened.session or None
        configuration = self._configurations.get(stretch.session or 0)
        if opened.late or (configuration is None and stretch.first != 0):
            raise PvidError(opened.lacks)
        if not opened.checks:
            stretch.open = configuration is not None and not opened.harmed and stretch.ticks <= _pace(configuration)
            raise PvidError(
                "no check of them was due yet" if stretch.open else "the log contains no estimate and no hash for them"
            )
        if configuration is None:
            raise PvidError("the board's configuration is missing")
        with np.errstate(all="ignore"):  # a board may send any number, in samples and in its configuration
            twin, names = self._twin(configuration)
        samples = np.concatenate(opened.parts)
        if samples.shape[1] != twin.samples:
            raise PvidError(f"they are {samples.shape[1]} a tick, and the identifier takes {twin.samples}")
        checks: dict[int, list[Check]] = {}
        for tick, check in opened.checks:
            if check.session == stretch.session:
                checks.setdefault(tick, []).append(check)
        with np.errstate(all="ignore"):
            recomputation = _Recomputation(twin, names, checks, stretch, self._count)
            recomputation.run(samples)
        if stretch.difference is not None and self._is_of_another_image(configuration):
            stretch.difference, stretch.checked = None, 0
            raise PvidError(
                "the board's image was made for other settings or another model than the log's, or by another version"
            )
        stretch.verified = recomputation.covered
        allowed = _pace(configuration) + recomputation.reach
        if recomputation.hashed and configuration.hash_every:
            allowed = configuration.hash_every
        stretch.open = not opened.harmed and stretch.trailing <= allowed

    def _is_of_another_image(self, configuration: Configuration) -> bool:
        """Whether bits may differ because this version, with the log's settings, makes another image of the engine."""
        if self.rig is None or isinstance(self.rig, RigFile):
            return False
        if self._number is None:
            self._number = self.rig.stream_image.number
        return configuration.settings != self._number

    def _count(self) -> None:
        self._done += 1
        if self._progress is not None and self._done % 512 == 0:
            self._progress(self._done)

    def _twin(self, configuration: Configuration) -> tuple[_Twin, tuple[str, ...]]:
        """The twin with the values of the configuration, and the names of p."""
        if self.rig is None:
            raise PvidError("the log holds no rig file: name it with --rig")
        if isinstance(self.rig, RigFile):
            return _StrongTwin(self._config(self.rig, configuration)), P_NAMES
        twin = self.rig.twin_of(configuration)
        if isinstance(twin, BothStagesTwin):
            return _RefinedTwin(twin, self.rig.matrix), self.rig.p_names
        return _EngineTwin(twin, self.rig.matrix), self.rig.p_names

    def _config(self, rig: RigFile, configuration: Configuration) -> Settings:
        """The identifier's settings: those of the rig file, with the values of the configuration."""
        if rig.identifier.form_traits.publishes:
            raise PvidError("the log has no settings of the weak engine: a version before it recorded the log")
        if self._hello is None:
            raise PvidError("the board has not sent its identity (a Hello frame)")
        rate = float(self._hello.sample_rate)
        if rate not in self._settings:
            board = stream_rig(rig, rig.sample_rate or rate)
            self._settings[rate] = (board.config, settings_number(board))
        config, number = self._settings[rate]
        if configuration.settings != number:
            raise PvidError("the board's image was made for other settings than the rig file's")
        return case_of(config).configured(config, configuration)


def _pace(configuration: Configuration) -> int:
    """Ticks from an estimate or a hash to the next."""
    return min((every for every in (configuration.hash_every, configuration.estimate_every) if every), default=0)


class _Twin(Protocol):
    """An identifier that computes a stretch again."""

    samples: int  # of a tick
    reach: int
    matrix: str  # of an estimate
    estimator: Any

    def follow(self, samples: npt.NDArray[Any], after: Callable[[int, npt.NDArray[np.uint8]], None]) -> Any:
        """Steps through samples [ticks, samples]; calls `after` after every tick."""

    def estimate(self) -> Any:
        """What the board says at present."""

    @property
    def both(self) -> BothStagesTwin | None:
        """With a second stage."""


class _StrongTwin:
    """The strong form, in the rig file's core."""

    samples = 2
    both = None

    def __init__(self, config: Settings) -> None:
        case = case_of(config)
        self._twin = case.twin(config)
        self.matrix = case.matrix
        self.reach, self.estimator = self._twin.reach, self._twin.estimator

    def follow(self, samples: npt.NDArray[Any], after: Callable[[int, npt.NDArray[np.uint8]], None]) -> Any:
        return self._twin.follow(samples[:, 0], samples[:, 1], after)

    def estimate(self) -> Any:
        return self.estimator.assess()[0]


class _EngineTwin:
    """The engine of any mechanism, in either arithmetic, which reports what it publishes."""

    both: BothStagesTwin | None = None

    def __init__(self, twin: WeakTwin | WeakTwinQ31, matrix: str) -> None:
        self._twin, self.matrix = twin, matrix
        self.samples, self.reach, self.estimator = twin.samples, twin.reach, twin.estimator

    def follow(self, samples: npt.NDArray[Any], after: Callable[[int, npt.NDArray[np.uint8]], None]) -> Any:
        return self._twin.follow(samples, after)

    def estimate(self) -> Any:
        return self._twin.trust.estimate[0]


class _RefinedTwin(_EngineTwin):
    """The engine with its second stage."""

    def __init__(self, both: BothStagesTwin, matrix: str) -> None:
        super().__init__(both.weak, matrix)
        self.both = both

    def follow(self, samples: npt.NDArray[Any], after: Callable[[int, npt.NDArray[np.uint8]], None]) -> Any:
        assert self.both is not None
        return self.both.follow(samples, after)


class _DifferentError(Exception):
    """Ends a recomputation."""


class _Recomputation:
    """One run of the twin over a stretch. `covered`: samples covered by equal checks. `hashed`: the board hashes its
    samples."""

    def __init__(
        self,
        twin: _Twin,
        p_names: tuple[str, ...],
        checks: dict[int, list[Check]],
        stretch: Stretch,
        count: Callable[[], None],
    ) -> None:
        self.twin = twin
        self._p_names = p_names
        self.reach = twin.reach
        self.covered = 0
        self.hashed = False
        self._checks = checks
        self._stretch = stretch
        self._count = count
        self._hash = fnv.START
        self._sample_hashes = np.empty(0, np.uint32)
        self._verdict = int(Reason.WARMING_UP)

    def run(self, samples: npt.NDArray[Any]) -> None:
        """Runs over samples [ticks, samples] from the session's first tick; writes the result into the stretch."""
        self._sample_hashes = fnv.sample_hashes(samples)
        try:
            self.twin.follow(samples, self._after)
        except _DifferentError:
            pass

    def _after(self, tick: int, reasons: npt.NDArray[np.uint8]) -> None:
        reason = int(reasons[0])
        self._hash = fnv.fold_bytes(self._hash, self._state(reason))
        if self.twin.both is not None:
            self._hash = fnv.fold_bytes(self._hash, self.twin.both.refine.hashed)
        if reason != Reason.ACCUMULATED:
            self._verdict = reason
        self._count()
        done = self._stretch.first + tick + 1
        for check in self._checks.get(done, ()):
            for variable, logged, own in self._compared(check, tick, reason):
                if logged != own:
                    self._stretch.difference = Difference(done, variable, logged, own, "log")
                    raise _DifferentError
            self._stretch.checked += 1
            hashed = isinstance(check, Hash | Credit) and check.sample_hash != 0
            self.hashed = self.hashed or hashed
            self.covered = max(self.covered, tick + 1 - (0 if hashed else self.reach))

    def _state(self, reason: int) -> bytes:
        """The bytes that the hash covers, as in fnv.h."""
        estimator, (narrow, wide) = self.twin.estimator, HASHED_TYPES[self.twin.estimator.p.dtype.kind]
        state: bytes = estimator.p[:, 0].astype(narrow).tobytes() + estimator.sums[:, 0].astype(wide).tobytes()
        if hasattr(estimator, "exponent"):  # of the sums, in fixed point
            state += int(estimator.exponent[0]).to_bytes(4, "little")
        return state + reason.to_bytes(4, "little")

    def _compared(self, check: Check, tick: int, reason: int) -> Iterator[tuple[str, int, int]]:
        """Yields variable, word of the log and word of the twin."""
        if isinstance(check, Hash | Credit) and check.sample_hash != 0:
            yield "hash of the samples", check.sample_hash, int(self._sample_hashes[tick])
        match check:
            case Hash():
                yield "hash", check.hash, self._hash
            case Credit():
                yield "hash", check.hash, self._hash
                yield "status", check.reason, reason
            case Estimate() | EstimateQ31():
                yield from self._compared_estimate(check)
            case RefinedEstimate():
                yield from self._compared_refined(check)

    def _compared_estimate(self, check: Estimate | EstimateQ31) -> Iterator[tuple[str, int, int]]:
        matrix = self.twin.matrix
        if not hasattr(check, matrix):
            raise PvidError("the estimates are of another core than the rig file sets")
        own = self.twin.estimate()
        n_p = len(self.twin.estimator.p)
        upper = tuple((a, b) for a, b in _UPPER if b < n_p)
        for i in range(n_p):
            yield self._p_names[i], _word(check.p[i]), _word(own["p"][i])
        logged = dict(zip(_UPPER, getattr(check, matrix), strict=True))
        for i, se in enumerate(getattr(check, "se", ())[:n_p]):  # where the matrix does not hold them
            yield f"standard error of {self._p_names[i]}", _word(se), _word(own["se"][i])
        for a, b in upper:
            yield (
                f"{matrix} of {self._p_names[a]} and {self._p_names[b]}",
                _word(logged[a, b]),
                _word(own[matrix][a, b]),
            )
        for name in ("kappa", "residual_sd", "weight"):
            yield name.replace("_", " "), _word(getattr(check, name)), _word(own[name])
        yield "updates", check.updates, int(self.twin.estimator.counters["updates"][0])
        yield "status", check.reason, self._verdict

    def _compared_refined(self, check: RefinedEstimate) -> Iterator[tuple[str, int, int]]:
        both = self.twin.both
        if both is None:
            raise PvidError("the estimates are of a second stage, which the rig file does not set")
        (stage, best), refine = both.best(), both.refine
        n_p = len(self.twin.estimator.p)
        for i in range(n_p):
            yield f"published {self._p_names[i]}", _word(check.p[i]), _word(best["p"][i])
        logged = dict(zip(_UPPER, check.covariance, strict=True))
        for a, b in ((a, b) for a, b in _UPPER if b < n_p):
            what = f"published covariance of {self._p_names[a]} and {self._p_names[b]}"
            yield what, _word(logged[a, b]), _word(best["covariance"][a, b])
        own, shape = refine.estimate, refine.shape
        zero = np.zeros(shape.parameters, np.float32)
        shown = shown_of_refined(shape.parameters, shape.widths, shape.place_of_p)
        for name, values in (("r", zero if own is None else own.r), ("se", zero if own is None else own.se)):
            for i, value in enumerate(values[list(shown)]):
                yield f"refined {name}[{i}]", _word(getattr(check, name)[i]), _word(value)
        for name in ("level", "clash"):
            value = np.float32(0) if own is None else getattr(own, name)
            yield f"refined {name}", _word(getattr(check, name)), _word(value)
        yield "number of the refined estimate", check.number, 0 if own is None else refine.published
        yield "stage", check.stage, int(stage)
        yield "status of the refinement", check.reason, int(refine.told)


def _word(value: Any) -> int:
    """The 32 bits of a number; all NaNs are equal."""
    if isinstance(value, float | np.floating):
        word = np.float32(value)
        return 0x7FC00000 if np.isnan(word) else int(word.view(np.uint32))
    return int(value) & 0xFFFFFFFF
