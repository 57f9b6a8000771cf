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

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.stream_image import StreamImage
from pvid.compare.bits import Difference
from pvid.link.frames import (
    MAX_P,
    Configuration,
    Configure,
    ConfigureQ31,
    Credit,
    Estimate,
    EstimateQ31,
    Form,
    Hash,
    Loss,
    Raw,
    RawCount,
    RefinedEstimate,
)
from pvid.log.reader import Gap, Record, Restart
from pvid.settings.enums import Reason
from pvid.settings.record import Record as Steps
from pvid.twin import fnv
from pvid.twin.printed import PrintedTwin

Check = Estimate | EstimateQ31 | RefinedEstimate | Hash | Credit


class EngineTwin(Protocol):
    """PrintedTwin of the weak form, or StrongModelTwin of the strong form."""

    samples: int  # of a tick
    reach: int
    running_hash: int
    refinement: Any

    @property
    def n_p(self) -> int: ...

    @property
    def estimate(self) -> Any: ...

    @property
    def counters(self) -> Mapping[str, int]: ...

    def run(self, samples: npt.NDArray[Any]) -> Steps:
        """Goes on over samples [ticks, samples]."""


class EngineBoard(Protocol):
    """A board of pvid.board: by the weak form, in fixed point too, or by the strong form."""

    @property
    def stream_image(self) -> StreamImage: ...

    @property
    def p_names(self) -> tuple[str, ...]: ...

    @property
    def matrix(self) -> str: ...

    def twin_of(self, frame: Configuration) -> EngineTwin: ...


_CONFIGURATIONS = 8  # of the latest sessions; older ones are forgotten
_PIECE = 8192  # ticks that are computed at a time
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
    board
        What sent the log; None: nothing can be verified.
    progress
        Called with the number of ticks computed so far.

    Memory: the samples of the longest stretch.
    """

    def __init__(self, board: EngineBoard | None, progress: Callable[[int], None] | None = None) -> None:
        self.board = board
        self._progress = progress
        self._done = 0
        self._configurations: dict[int, Configure | ConfigureQ31] = {}
        self._open: _Open | None = None
        self._before: tuple[int, int] | None = None  # segment and tick where the last samples ended
        self._number: int | None = None  # of the board's image

    def stretches(self, records: Iterable[Record]) -> Iterator[Stretch]:
        """The stretches of all records, in order."""
        for record in records:
            yield from self._take(record)
        yield from self._close()

    def _take(self, record: Record) -> Iterator[Stretch]:
        match record.item:
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
        if self.board is None:
            return False
        if self._number is None:
            self._number = self.board.stream_image.number
        return configuration.settings != self._number

    def _count(self, ticks: int) -> None:
        before, self._done = self._done, self._done + ticks
        if self._progress is not None and self._done // 512 > before // 512:
            self._progress(self._done)

    def _twin(self, configuration: Configuration) -> tuple[_Twin, tuple[str, ...]]:
        """The twin with the values of the configuration, and the names of p."""
        board = self.board
        if board is None and configuration.form == Form.STRONG:
            raise PvidError("version 0.1 verifies logs of its own strong form; export and identify read them")
        if board is None:
            raise PvidError("the log holds no settings of an identifier: name its rig file with --rig")
        return _Twin(board.twin_of(configuration), board.matrix, getattr(board, "shown", ())), board.p_names


def _pace(configuration: Configuration) -> int:
    """Ticks from an estimate or a hash to the next."""
    return min((every for every in (configuration.hash_every, configuration.estimate_every) if every), default=0)


# Called after a tick that is checked: the tick, its reason, the last reason that reports something, the running hash.
_After = Callable[[int, int, int, int], None]


@dataclass(frozen=True)
class _Refined:
    """best : the published estimate. latest : r, se, level, clash, number: of the second stage."""

    stage: int
    best: Mapping[str, Any]
    latest: Mapping[str, Any]
    told: int


class _Twin:
    """An identifier that computes a stretch again.

    Parameters
    ----------
    shown : refined parameters that the board sends, with a second stage
    """

    def __init__(self, twin: EngineTwin, matrix: str, shown: Sequence[int]) -> None:
        self._twin, self.matrix, self._shown = twin, matrix, shown
        self.samples, self.reach, self.n_p = twin.samples, twin.reach, twin.n_p

    def follow(
        self, samples: npt.NDArray[Any], ticks: Sequence[int], after: _After, count: Callable[[int], None]
    ) -> None:
        """Steps through samples [ticks, samples] up to the last one of `ticks`; calls `after` after each of them, and
        `count` with the number of ticks since its last call."""
        first, verdict, reason = 0, int(Reason.WARMING_UP), int(Reason.WARMING_UP)
        for tick in ticks:
            while first <= tick:
                last = min(first + _PIECE, tick + 1)
                reasons = self._twin.run(samples[first:last]).reason
                reported = reasons[reasons != Reason.ACCUMULATED]
                verdict = int(reported[-1]) if len(reported) else verdict
                reason = int(reasons[-1])
                count(last - first)
                first = last
            after(tick, reason, verdict, self._twin.running_hash)

    def estimate(self) -> Mapping[str, Any]:
        """What the board says at present."""
        return self._fields(self._twin.estimate)

    def _fields(self, estimate: Any) -> Mapping[str, Any]:
        matrix = getattr(estimate, self.matrix)
        found = {name: getattr(estimate, name) for name in ("p", "se", "kappa", "residual_sd", "weight")}
        return found | {self.matrix: np.reshape(np.array(matrix), (len(estimate.p), -1))}

    @property
    def updates(self) -> int:
        """Steps of p."""
        return self._twin.counters["updates"]

    def refined(self) -> _Refined | None:
        """The estimates of the second stage at the last tick; None: there is no second stage."""
        twin = self._twin
        if not isinstance(twin, PrintedTwin) or twin.refinement is None:
            return None
        (stage, best), own, state = twin.best, twin.refined, twin.refinement
        zeros = [np.float32(0)] * len(state.linear)
        latest = {
            "r": [(zeros if own is None else own.r)[place] for place in self._shown],
            "se": [(zeros if own is None else own.se)[place] for place in self._shown],
            "level": 0.0 if own is None else own.level,
            "clash": 0.0 if own is None else own.clash,
            "number": 0 if own is None else state.mark.number[0],
        }
        return _Refined(int(stage), self._fields(best), latest, twin.module.pvid_refine_reason_f32(state))


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
        count: Callable[[int], None],
    ) -> None:
        self.twin = twin
        self._p_names = p_names
        self.reach = twin.reach
        self.covered = 0
        self.hashed = False
        self._checks = checks
        self._stretch = stretch
        self._count = count
        self._sample_hashes = np.empty(0, np.uint32)

    def run(self, samples: npt.NDArray[Any]) -> None:
        """Runs over samples [ticks, samples] from the session's first tick; writes the result into the stretch."""
        self._sample_hashes = fnv.sample_hashes(samples)
        ticks = sorted(done - self._stretch.first - 1 for done in self._checks)
        try:
            self.twin.follow(samples, ticks, self._after, self._count)
        except _DifferentError:
            pass

    def _after(self, tick: int, reason: int, verdict: int, running: int) -> None:
        done = self._stretch.first + tick + 1
        for check in self._checks[done]:
            for variable, logged, own in self._compared(check, tick, reason, verdict, running):
                if logged != own:
                    self._stretch.difference = Difference(done, variable, logged, own, "log")
                    raise _DifferentError
            self._stretch.checked += 1
            hashed = isinstance(check, Hash | Credit) and check.sample_hash != 0
            self.hashed = self.hashed or hashed
            self.covered = max(self.covered, tick + 1 - (0 if hashed else self.reach))

    def _compared(
        self, check: Check, tick: int, reason: int, verdict: int, running: int
    ) -> Iterator[tuple[str, int, int]]:
        """Yields variable, word of the log and word of the twin."""
        if isinstance(check, Hash | Credit) and check.sample_hash != 0:
            yield "hash of the samples", check.sample_hash, int(self._sample_hashes[tick])
        match check:
            case Hash():
                yield "hash", check.hash, running
            case Credit():
                yield "hash", check.hash, running
                yield "status", check.reason, reason
            case Estimate() | EstimateQ31():
                yield from self._compared_estimate(check, verdict)
            case RefinedEstimate():
                yield from self._compared_refined(check)

    def _compared_estimate(self, check: Estimate | EstimateQ31, verdict: int) -> Iterator[tuple[str, int, int]]:
        matrix = self.twin.matrix
        if not hasattr(check, matrix):
            raise PvidError("the estimates are of another core than the rig file sets")
        own = self.twin.estimate()
        n_p = self.twin.n_p
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
        yield "updates", check.updates, self.twin.updates
        yield "status", check.reason, verdict

    def _compared_refined(self, check: RefinedEstimate) -> Iterator[tuple[str, int, int]]:
        own = self.twin.refined()
        if own is None:
            raise PvidError("the estimates are of a second stage, which the rig file does not set")
        n_p, latest = self.twin.n_p, own.latest
        for i in range(n_p):
            yield f"published {self._p_names[i]}", _word(check.p[i]), _word(own.best["p"][i])
        logged = dict(zip(_UPPER, check.covariance, strict=True))
        for a, b in ((a, b) for a, b in _UPPER if b < n_p):
            what = f"published covariance of {self._p_names[a]} and {self._p_names[b]}"
            yield what, _word(logged[a, b]), _word(own.best["covariance"][a, b])
        for name in ("r", "se"):
            for i, value in enumerate(latest[name]):
                yield f"refined {name}[{i}]", _word(getattr(check, name)[i]), _word(value)
        for name in ("level", "clash"):
            yield f"refined {name}", _word(getattr(check, name)), _word(latest[name])
        yield "number of the refined estimate", check.number, latest["number"]
        yield "stage", check.stage, own.stage
        yield "status of the refinement", check.reason, own.told


def _word(value: Any) -> int:
    """The 32 bits of a number; all NaNs are equal."""
    if isinstance(value, float | np.floating):
        word = np.float32(value)
        return 0x7FC00000 if np.isnan(word) else int(word.view(np.uint32))
    return int(value) & 0xFFFFFFFF
