"""Computes a log again and compares every estimate and every hash in it, bit for bit.

Where there is a C compiler, the core compiled on this computer computes the whole log. The printed twin computes the
begin of a session from its own init on, then one piece of every 64 from the core's state, and each piece in which the
core and the log differ: a difference is reported only if the twin finds it as well. If the twin finds other bits than
the core, or there is no compiler, the twin alone computes the whole log.

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

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.stream_image import StreamImage
from pvid.compare.bits import Difference
from pvid.core.model_library import compiled_by
from pvid.link.frames import (
    NO_STANDING,
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
    pairs,
)
from pvid.log.reader import Gap, Record, Restart
from pvid.log.witness import Core, CoreWitness, Twin, TwinWitness, Witness
from pvid.twin import fnv
from pvid.twin.printer.machine import bits

Check = Estimate | EstimateQ31 | RefinedEstimate | Hash | Credit


class ReplayableBoard(Protocol):
    """A board of pvid.board: by the weak form, in fixed point too, or by the strong form."""

    @property
    def stream_image(self) -> StreamImage: ...

    @property
    def p_names(self) -> tuple[str, ...]: ...

    @property
    def matrix(self) -> str: ...

    def twin_of(self, frame: Configuration) -> Twin: ...

    def core_of(self, frame: Configuration) -> Core: ...


_CONFIGURATIONS = 8  # of the latest sessions; older ones are forgotten
_PIECE = 2048  # ticks
_EVERY = 64  # pieces: the twin computes the first of so many as well
_FIRST = 16_384  # ticks of a session: and the first so many, from its own init on, at least two windows


@dataclass
class Stretch:
    """Consecutive ticks of one session and the result of their verification.

    `ticks`: their number, from `first` on. `checked`: estimates and hashes that were equal, up to the `difference` if
    there is one. `verified`: ticks covered by equal checks. `open`: no check of the other ticks was due yet. `why_not`:
    reason why nothing could be verified. `by_core`, `by_twin`: ticks that the compiled core and the twin computed.
    `alone`: why the core did not.
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
    by_core: int = 0
    by_twin: int = 0
    alone: str | None = None

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
    by_core: int = 0
    by_twin: int = 0
    alone: str | None = None  # of the last stretch without the core

    def add(self, stretch: Stretch) -> None:
        """Adds the result of the next stretch."""
        self.stretches += 1
        self.samples += stretch.ticks
        self.checked += stretch.checked
        self.by_core += stretch.by_core
        self.by_twin += stretch.by_twin
        self.alone = stretch.alone or self.alone
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
    def computed(self) -> str:
        """In one sentence, which computed how much."""
        core = f"{self.by_core} ticks by the core compiled here ({compiled_by()}), " if self.by_core else ""
        why = f"; {self.alone}" if self.alone else ""
        return f"computed again: {core}{self.by_twin} ticks by the printed twin{why}"

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
    board : what sent the log; None: nothing can be verified
    progress : called with the number of ticks computed so far
    twin_alone : the twin computes everything, and the core nothing

    Memory: the samples of the longest stretch.
    """

    def __init__(
        self,
        board: ReplayableBoard | None,
        progress: Callable[[int], None] | None = None,
        *,
        twin_alone: bool = False,
    ) -> None:
        self.board = board
        self._twin_alone = twin_alone
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
        samples = np.concatenate(opened.parts)
        checks: dict[int, list[Check]] = {}
        for tick, check in opened.checks:
            if check.session == stretch.session:
                checks.setdefault(tick - stretch.first, []).append(check)
        with np.errstate(all="ignore"):  # a board may send any number, in samples and in its configuration
            found = self._recomputed(configuration, samples, checks, stretch)
        stretch.checked, stretch.difference = found.checked, found.difference
        if stretch.difference is not None and self._is_of_another_image(configuration):
            stretch.difference, stretch.checked = None, 0
            raise PvidError(
                "the board's image was made for other settings or another model than the log's, or by another version"
            )
        stretch.verified = found.covered
        allowed = _pace(configuration) + found.reach
        if found.hashed and configuration.hash_every:
            allowed = configuration.hash_every
        stretch.open = not opened.harmed and stretch.trailing <= allowed

    def _is_of_another_image(self, configuration: Configuration) -> bool:
        """Whether bits may differ because this version, with the log's settings, makes another image of the core."""
        if self.board is None:
            return False
        if self._number is None:
            self._number = self.board.stream_image.number
        return configuration.settings != self._number

    def _count(self, ticks: int) -> None:
        before, self._done = self._done, self._done + ticks
        if self._progress is not None and self._done // 512 > before // 512:
            self._progress(self._done)

    def _recomputed(
        self,
        configuration: Configuration,
        samples: npt.NDArray[Any],
        checks: Mapping[int, list[Check]],
        stretch: Stretch,
    ) -> _Recomputation:
        """With the values of the configuration."""
        board = self.board
        if board is None and configuration.form == Form.STRONG:
            raise PvidError("version 0.1 verifies logs of its own strong form; export and identify read them")
        if board is None:
            raise PvidError("the log holds no settings of an identifier: name its rig file with --rig")
        twin = _twin_of(board, configuration)
        if samples.shape[1] != twin.samples:
            raise PvidError(f"they are {samples.shape[1]} a tick, and the identifier takes {twin.samples}")
        found = _Recomputation(stretch, samples, checks, board.p_names, self._count, twin.reach)
        witness, core = TwinWitness(twin, board), None
        if not self._twin_alone:
            try:  # after the twin, whose init has read every table of the log to its end
                core = CoreWitness(board.core_of(configuration), board)
            except (PvidError, IndexError, OverflowError) as error:
                stretch.alone = str(error)
        try:
            found.run(witness, core)
        except _OtherBitsError as error:
            stretch.alone = str(error)
            witness, core = TwinWitness(_twin_of(board, configuration), board), None
            found.run(witness, None)
        stretch.by_core, stretch.by_twin = 0 if core is None else core.ticks, witness.ticks
        return found


def _twin_of(board: ReplayableBoard, configuration: Configuration) -> Twin:
    try:
        return board.twin_of(configuration)
    except (IndexError, TypeError, ValueError) as error:
        raise PvidError(f"the settings of the identifier in the log are damaged: {error}") from error


def _pace(configuration: Configuration) -> int:
    """Ticks from an estimate or a hash to the next."""
    return min((every for every in (configuration.hash_every, configuration.estimate_every) if every), default=0)


class _OtherBitsError(Exception):
    """The twin finds other bits than the compiled core."""


@dataclass
class _Recomputation:
    """Of samples [ticks, samples] of a stretch. `checks`: by the number of samples before them.

    `checked`: estimates and hashes that were equal, up to the `difference` if there is one. `covered`: samples covered
    by equal checks. `hashed`: the board hashes its samples. `reach`: of the identifier.
    """

    stretch: Stretch
    samples: npt.NDArray[Any]
    checks: Mapping[int, list[Check]]
    p_names: tuple[str, ...]
    count: Callable[[int], None]
    reach: int
    checked: int = 0
    covered: int = 0
    hashed: bool = False
    difference: Difference | None = None

    def __post_init__(self) -> None:
        self._sample_hashes = fnv.sample_hashes(self.samples)
        self._ticks = sorted(self.checks)

    def run(self, twin: TwinWitness, core: CoreWitness | None) -> None:
        """From the session's first tick to the last check, or to the first one that is different."""
        self.checked, self.covered, self.hashed = 0, 0, False
        for number, first in enumerate(range(0, self._ticks[-1], _PIECE)):
            last = min(first + _PIECE, self._ticks[-1])
            before = None if core is None else core.state
            self.difference, equal = self._through(core or twin, first, last)
            again = self.difference is not None or first < max(_FIRST, 2 * self.reach) or number % _EVERY == 0
            if core is not None and before is not None and again:
                if twin.ticks != first:  # else its state is its own, from its own init on
                    twin.take_over(before)
                same = self._through(twin, first, last) == (self.difference, equal)
                if not same or twin.running_hash != core.running_hash:
                    at = self.stretch.first
                    raise _OtherBitsError(
                        f"the core compiled here computes other bits than it between ticks {at + first} and {at + last}"
                    )
            self.count(last - first)
            self.checked += len(equal)
            for tick, hashed in equal:
                self.hashed = self.hashed or hashed
                self.covered = max(self.covered, tick - (0 if hashed else self.reach))
            if self.difference is not None:
                return

    def _through(self, witness: Witness, first: int, last: int) -> tuple[Difference | None, list[tuple[int, bool]]]:
        """Goes on over samples first to last - 1, or to the first difference, which is returned with the checks that
        were equal: the number of samples before them, and whether they cover those."""
        equal: list[tuple[int, bool]] = []
        due = self._ticks[bisect_right(self._ticks, first) : bisect_right(self._ticks, last)]
        for tick in due if due and due[-1] == last else [*due, last]:
            witness.run(self.samples[first:tick])
            first = tick
            for check in self.checks.get(tick, ()):
                for variable, logged, own in self._compared(check, tick, witness):
                    if logged != own:
                        return Difference(self.stretch.first + tick, variable, logged, own, "log"), equal
                equal.append((tick, isinstance(check, Hash | Credit) and check.sample_hash != 0))
        return None, equal

    def _compared(self, check: Check, tick: int, witness: Witness) -> Iterator[tuple[str, int, int]]:
        """Yields variable, word of the log and word of the witness."""
        if isinstance(check, Hash | Credit) and check.sample_hash != 0:
            yield "hash of the samples", check.sample_hash, int(self._sample_hashes[tick - 1])
        match check:
            case Hash():
                yield "hash", check.hash, witness.running_hash
            case Credit():
                yield "hash", check.hash, witness.running_hash
                yield "status", check.reason, witness.reason
            case Estimate() | EstimateQ31():
                yield from self._compared_estimate(check, witness)
            case RefinedEstimate():
                yield from self._compared_refined(check, witness)

    def _compared_estimate(self, check: Estimate | EstimateQ31, witness: Witness) -> Iterator[tuple[str, int, int]]:
        matrix = witness.matrix
        if not hasattr(check, matrix):
            raise PvidError("the estimates are of another core than the rig file sets")
        check.refuse_fewer(self.p_names)
        own, n_p = witness.estimate(), len(self.p_names)
        for i in range(n_p):
            yield self.p_names[i], _word(check.p[i]), _word(own["p"][i])
        logged = dict(zip(pairs(check.places), getattr(check, matrix), strict=True))
        for i, se in enumerate(getattr(check, "se", ())[:n_p]):  # where the matrix does not hold them
            yield f"standard error of {self.p_names[i]}", _word(se), _word(own["se"][i])
        for a, b in pairs(n_p):
            yield (
                f"{matrix} of {self.p_names[a]} and {self.p_names[b]}",
                _word(logged[a, b]),
                _word(own[matrix][a, b]),
            )
        for name in ("kappa", "residual_sd", "weight"):
            yield name.replace("_", " "), _word(getattr(check, name)), _word(own[name])
        yield "updates", check.updates, witness.updates
        if check.standing != NO_STANDING:
            yield "standing", check.standing, own["standing"]
        yield "status", check.reason, witness.verdict

    def _compared_refined(self, check: RefinedEstimate, witness: Witness) -> Iterator[tuple[str, int, int]]:
        own = witness.refined()
        if own is None:
            raise PvidError("the estimates are of a second stage, which the rig file does not set")
        check.refuse_fewer(self.p_names)
        n_p, latest = len(self.p_names), own.latest
        for i in range(n_p):
            yield f"published {self.p_names[i]}", _word(check.p[i]), _word(own.best["p"][i])
        logged = dict(zip(pairs(check.places), check.covariance, strict=True))
        for a, b in pairs(n_p):
            what = f"published covariance of {self.p_names[a]} and {self.p_names[b]}"
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
        return bits(value) if value == value else 0x7FC00000  # noqa: PLR0124
    return int(value) & 0xFFFFFFFF
