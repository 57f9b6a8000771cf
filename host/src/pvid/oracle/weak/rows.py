"""Windows of a run as rows: columns, noise, and whitened rows without nuisances."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.recent import Recent
from pvid.model.compiled import CompiledModel
from pvid.model.corners import with_corners
from pvid.model.drifted import Drifted
from pvid.model.signals import Integral, Jet
from pvid.model.together import in_columns
from pvid.oracle.weak.channels import Channels, Record
from pvid.oracle.weak.design import DOUBT, WeakDesign
from pvid.oracle.weak.front import grid_of, longest_of_each, samples_of, segments_of, with_jumps
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.noise import NoiseFilters, NoiseModel, ReversalNoise
from pvid.oracle.weak.parameters import Parameters
from pvid.oracle.weak.whitener import Holders, Whitener
from pvid.oracle.weak.work import of_pass
from pvid.rig.run import NUMBER

# Rows that are numerically dependent get this part of the mean variance.
_RIDGE = 1e-10

_REST = 0.9  # of the steps of a half window: the noise of a velocity passes the limit of doubt in a few


class Compiled:
    """A model made ready for numbers, once: channels, noise filters, theta(p).

    Attributes
    ----------
    bare : as compiled
    model : its rows with the corners of sampled signals, and with columns for each recording
    jumps : name of a signal in them -> what it is made of
    within : names of signals in them that are 1 in one recording, of each
    number : of the object in this process
    """

    _numbers = itertools.count()

    def __init__(self, model: CompiledModel) -> None:
        model.refuse_robot()
        self.number = next(Compiled._numbers)
        self.bare = model
        model, self.jumps = with_corners(model)
        self.model, self.within = in_columns(model)
        model = self.model
        self.channels = Channels(model)
        self.filters = NoiseFilters(self.channels)
        self.parameters = Parameters(model)


ready = Recent(Compiled)  # a model with its functions


@dataclass(frozen=True)
class EquationError:
    """White noise of the equation itself in one row kind: variance (per step) of D^order of it."""

    variance: float = 0.0
    order: int = 0


@dataclass(frozen=True)
class Unexplained:
    """What a theta leaves of one row kind: residuals with unit covariance, nuisances projected out.

    Attributes
    ----------
    residuals : [windows, K]
    whitener : of every window
    free : rows less nuisances, of all windows
    """

    residuals: Float
    whitener: Whitener
    free: int

    @property
    def unlikelihood(self) -> float:
        """Minus twice the logarithm of their likelihood, but for a constant."""
        return float(np.sum(self.residuals**2)) + self.whitener.log_determinant() * self.free / self.residuals.size


@dataclass(frozen=True)
class WhiteRows:
    """Rows of a group of kinds with unit covariance, nuisances projected out; R is the number of rows of a window.

    Attributes
    ----------
    kinds : of the group
    regressors : of all thetas of the group [windows, thetas, R]
    known : [windows, R]
    whitener : of every window
    free : rows less nuisances, of all windows
    """

    kinds: tuple[int, ...]
    regressors: Float
    known: Float
    whitener: Whitener
    free: int

    def only(self, windows: slice | npt.NDArray[np.bool_]) -> WhiteRows:
        """Some of the windows."""
        n = self.regressors[windows]
        free = round(self.free * len(n) / len(self.regressors))
        return WhiteRows(self.kinds, n, self.known[windows], self.whitener.only(windows), free)

    def moments(self) -> tuple[Float, Float]:
        """M [thetas, thetas] and B [thetas]."""
        flat = self.regressors.transpose(1, 0, 2).reshape(self.regressors.shape[1], -1)
        return flat @ flat.T, flat @ self.known.reshape(-1)

    def residuals(self, theta: Sequence[Float]) -> Float:
        """At the thetas of all kinds [windows, R]."""
        own = np.concatenate([theta[kind] for kind in self.kinds])
        return np.asarray(self.known - np.einsum("wjk,j->wk", self.regressors, own))

    def slopes(self, jacobian: Sequence[Float]) -> Float:
        """d rows / d step, from d theta / d step of all kinds [windows, R, n_p]."""
        own = np.concatenate([jacobian[kind] for kind in self.kinds])
        return np.asarray(self.regressors.transpose(0, 2, 1) @ own)


def _decided(record: Record, windows: int) -> npt.NDArray[np.bool_]:
    """Of each window, whether no sign of friction is in doubt for too long [windows]."""
    hop = record.grid.design.hop
    doubt = np.any([one.stuck for one in record.signs], axis=0)
    halves = doubt[: (windows + 1) * hop].reshape(windows + 1, hop).sum(axis=1) * DOUBT <= hop
    return np.asarray(halves[:-1] & halves[1:])


def _at_rest(record: Record, windows: int) -> npt.NDArray[np.bool_]:
    """Of each window, whether every equation has a friction, and all signs are in doubt nearly all the time: there it
    holds the mechanism with any force up to its own, which no equation contains [windows]."""
    hop, signs = record.grid.design.hop, record.channels.signs_of_rows
    if not record.signs or not all(signs):
        return np.zeros(windows, bool)
    stuck = np.all([record.signs[k].stuck for k in set().union(*signs)], axis=0)
    halves = stuck[: (windows + 1) * hop].reshape(windows + 1, hop).mean(axis=1)
    return np.asarray((halves[:-1] > _REST) & (halves[1:] > _REST))


def record_of(
    compiled: Compiled,
    run: Mapping[str, npt.ArrayLike],
    design: WeakDesign,
    times: Mapping[Jet, float] | None = None,
    like: Record | None = None,
) -> Record:
    """Channels of a run (name -> samples) at every step; a segment between missing samples is a run of its own. What
    they have in common with those `like` them, or else the last ones, is taken from there.

    A model with an integral since the start of the run has one segment of each recording, its longest: behind a gap
    nobody knows the integral.
    """
    last = like or compiled.channels.last
    whole = with_jumps(run, compiled.jumps, design.sample_rate, None if last is None else last.grid)
    for number, name in enumerate(compiled.within):
        whole[name] = (np.asarray(run[NUMBER]) == number).astype(np.float64)
    samples = samples_of(compiled.model, whole)
    segments = segments_of(samples)
    if any(one.has(Integral) for one in compiled.channels.opaque.values()):
        segments = longest_of_each(segments, run)
    size = len(next(iter(samples.values())))
    if times is not None or (last is not None and last.grid.raw_size != size) or len(segments) > 1:
        last = None
    records, firsts = [], []
    refused = PvidError("no window of the run is whole: every one has a missing sample")
    for part in segments:
        own = samples if len(segments) == 1 and part == slice(0, size) else {k: x[part] for k, x in samples.items()}
        try:
            grid = grid_of(compiled.model, own, design, compiled.channels.needed, None if last is None else last.grid)
        except PvidError as error:
            refused = error
            continue
        channels = compiled.channels
        records.append(channels.record(grid, times) if last is None else channels.record_like(grid, last))
        firsts.append(part.start)
    if not records:
        raise refused
    return Record.joined(records, firsts, size)


class WeakRows:
    """All windows of a run.

    Attributes
    ----------
    compiled : the model
    record : channels at every step
    columns : of each row kind [windows, columns, K]; theta's, then Y, then the nuisances
    numbers : of the windows in the run; those with a missing sample are left out
    recordings : of each window, of a run of several, the number of its own
    noise, reversals : covariances
    groups : of kinds that are whitened together
    """

    def __init__(self, compiled: Compiled, record: Record) -> None:
        self.compiled, self.record = compiled, record
        self.functions = record.grid.design.test_functions
        columns = record.columns(self.functions)
        whole = np.all([np.isfinite(one).all(axis=(1, 2)) for one in columns], axis=0)
        whole[record.grid.across] = False
        if record.grid.design.reversals == "decided" and record.signs:
            whole &= _decided(record, len(whole))
        moving = whole & ~_at_rest(record, len(whole))
        whole = moving if moving.any() else whole
        if not whole.any():
            raise PvidError("no window of the run is whole: every one has a missing sample")
        self.numbers = np.flatnonzero(whole)
        self.recordings = np.zeros(len(self.numbers), np.int64)
        self.columns = [one[whole] for one in columns]
        if compiled.bare.drifted is not None:
            self._take_off(compiled.bare.drifted)
        self.noise = NoiseModel(compiled.filters, record)
        self.reversals = ReversalNoise(compiled.channels, record)
        alone = [(kind,) for kind in range(len(columns))]
        self._holders: dict[tuple[int, ...], list[Holders]] = {}
        self.groups: list[tuple[int, ...]] = [tuple(range(len(columns)))] if record.grid.design.joint else [*alone]

    @classmethod
    def of(cls, compiled: Compiled, run: Mapping[str, npt.ArrayLike], design: WeakDesign) -> WeakRows:
        """Those of a run: name -> samples."""
        rows = cls(compiled, record_of(compiled, run, design))
        compiled.channels.last = rows.record if len(rows.record.grid.parts) == 1 else None
        if NUMBER in run:
            grid = rows.record.grid
            rows.recordings = np.asarray(run[NUMBER])[grid.places[grid.design.hop * rows.numbers]].astype(np.int64)
        return rows

    def _take_off(self, drifted: Drifted) -> None:
        """The way of theta from each window to the end of a drift."""
        parameters = self.compiled.parameters
        centres = self.end_times() - self.functions.hop * self.functions.dt
        p = np.tile(parameters.guess, (self.windows + 1, 1))
        p[:, [parameters.names.index(one) for one in drifted.names]] = [*drifted.at(centres), drifted.p[-1]]
        theta = [parameters.theta(one) for one in p]
        for kind, columns in enumerate(self.columns):
            of_kind = np.array([one[kind] for one in theta])
            n = of_kind.shape[1]
            columns[:, n] -= np.einsum("wck,wc->wk", columns[:, :n], of_kind[:-1] - of_kind[-1])

    @property
    def windows(self) -> int:
        """Whole ones."""
        return len(self.columns[0])

    @property
    def work(self) -> float:
        """Units of whitening all windows once (pvid.oracle.weak.work)."""
        rows = self.functions.count * (self.kinds if len(self.groups) == 1 else 1)
        columns = sum(one.shape[1] for one in self.columns)
        entries = len(self.reversals.windows) * self.windows / (int(self.numbers[-1]) + 1)
        return of_pass(self.windows, rows, columns, entries)

    @property
    def kinds(self) -> int:
        """Row kinds."""
        return len(self.columns)

    def only(self, windows: slice | npt.NDArray[np.bool_]) -> WeakRows:
        """Some of the windows; the noise stays that of the run."""
        out = copy.copy(self)
        out.columns = [one[windows] for one in self.columns]
        out.numbers, out.recordings = self.numbers[windows], self.recordings[windows]
        out._holders = {}
        return out

    def parts(self, count: int) -> npt.NDArray[np.int64]:
        """In which part of its recording each window lies, of so many of equal length [windows]: a part of the run has
        windows of every recording."""
        out = np.empty(self.windows, np.int64)
        for number in np.unique(self.recordings):
            own = np.flatnonzero(self.recordings == number)
            out[own] = np.arange(own.size) * count // own.size
        return out

    def end_times(self) -> Float:
        """Time [s] of the last sample of each window, from the run's first one."""
        grid, functions = self.record.grid, self.functions
        first = grid.places[functions.hop * self.numbers] / grid.design.sample_rate
        return np.asarray(first + functions.dt * functions.hop * 2)

    def covariance(self, kinds: Sequence[int], theta: Sequence[Float], errors: Sequence[EquationError]) -> Float:
        """R0(p) and the equations' errors [R, R]; located reversals come on top, in each window its own."""
        blocks = [[self.noise.covariance(a, theta[a], b, theta[b]) for b in kinds] for a in kinds]
        for place, kind in enumerate(kinds):
            error = errors[kind]
            blocks[place][place] = blocks[place][place] + error.variance * self.functions.gram(error.order, error.order)
        return np.block(blocks)

    def with_next(self, kinds: Sequence[int], theta: Sequence[Float], errors: Sequence[EquationError]) -> Float:
        """The same between a window and the next one [R, R]."""
        blocks = [[self.noise.with_next(a, theta[a], b, theta[b]) for b in kinds] for a in kinds]
        for place, kind in enumerate(kinds):
            error = errors[kind]
            blocks[place][place] = blocks[place][place] + error.variance * self.functions.overlap(
                error.order, error.order
            )
        return np.block(blocks)

    def holders(self, kinds: tuple[int, ...]) -> list[Holders]:
        """Windows that hold entries of `reversals` in rows of these kinds."""
        if kinds not in self._holders:
            self._holders[kinds] = self.reversals.holders(kinds, self.numbers)
        return self._holders[kinds]

    def doubts(self, kinds: tuple[int, ...]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Entries of `reversals` in rows of these kinds, and the window that holds each."""
        entries, windows = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        for one in self.holders(kinds):
            there = one.entries >= 0
            entries.append(one.entries[there])
            windows.append(np.repeat(one.windows, there.sum(axis=1)))
        return np.concatenate(entries), np.concatenate(windows)

    def whitener(self, kinds: tuple[int, ...], theta: Sequence[Float], errors: Sequence[EquationError]) -> Whitener:
        """Of the covariance of every window; rows of a model without noise are scaled to their size."""
        directions = self.reversals.directions(kinds, theta) if self.holders(kinds) else None
        return self._whitener(kinds, self.covariance(kinds, theta, errors), directions)

    def _whitener(self, kinds: tuple[int, ...], r: Float, directions: Float | None) -> Whitener:
        k = self.functions.count
        diagonal = np.diag(r).reshape(len(kinds), k).mean(axis=1)
        for place, kind in enumerate(kinds):
            if diagonal[place] == 0.0:
                diagonal[place] = float(np.mean(self.columns[kind][:, :-1] ** 2)) * 1e-12
                own = slice(place * k, (place + 1) * k)
                r[own, own] += diagonal[place] * self.functions.gram(0, 0)
        r = r + np.diag(np.repeat(_RIDGE * diagonal, k))
        return Whitener.of_covariance(r, self.windows, directions, self.holders(kinds))

    def unexplained(self, kind: int, theta: Sequence[Float]) -> Callable[[EquationError], Unexplained]:
        """What a theta leaves of one kind, by the error of its equation: what does not depend on it is formed once."""
        kinds, k, thetas = (kind,), self.functions.count, self.compiled.channels.rows[kind].thetas
        columns = self.columns[kind]
        left = columns[:, thetas] - np.tensordot(columns[:, :thetas], theta[kind], (1, 0))
        nuisances = columns[:, thetas + 1 :]
        plain = self.covariance(kinds, theta, [EquationError()] * self.kinds)
        directions = self.reversals.directions(kinds, theta) if self.holders(kinds) else None

        def under(error: EquationError) -> Unexplained:
            gram = self.functions.gram(error.order, error.order)
            whitener = self._whitener(kinds, plain + error.variance * gram, directions)
            e = whitener.of(left[:, np.newaxis])
            gone = 0
            if nuisances.shape[1]:
                q, gone = _basis(whitener.of(nuisances))
                e -= (e @ q) @ q.transpose(0, 2, 1)
            return Unexplained(e[:, 0], whitener, self.windows * k - gone)

        return under

    def white(self, kinds: tuple[int, ...], theta: Sequence[Float], errors: Sequence[EquationError]) -> WhiteRows:
        """Whitened rows of a group at the thetas of all kinds."""
        whitener = self.whitener(kinds, theta, errors)
        k, plans = self.functions.count, [self.compiled.channels.rows[kind] for kind in kinds]
        parts = self._whitened(kinds, whitener)
        regressors = _joined([x[:, : row.thetas] for x, row in zip(parts, plans, strict=True)])
        known = np.asarray(sum(x[:, row.thetas] for x, row in zip(parts, plans, strict=True)))
        nuisances = _joined([x[:, row.thetas + 1 :] for x, row in zip(parts, plans, strict=True)])
        gone = 0
        if nuisances.shape[1]:
            q, gone = _basis(nuisances)
            regressors = regressors - (regressors @ q) @ q.transpose(0, 2, 1)
            known = known - np.einsum("wkn,wn->wk", q, np.einsum("wkn,wk->wn", q, known))
        return WhiteRows(tuple(kinds), regressors, known, whitener, self.windows * len(kinds) * k - gone)

    def white_nuisances(self, kinds: Sequence[int], whitener: Whitener) -> Float:
        """Nuisance columns of a group [windows, nuisances, R]."""
        firsts = [self.compiled.channels.rows[kind].thetas + 1 for kind in kinds]
        return _joined(self._whitened(kinds, whitener, firsts))

    def _whitened(self, kinds: Sequence[int], whitener: Whitener, firsts: Sequence[int] = ()) -> list[Float]:
        """Columns of each kind, from the first that is wanted on [windows, columns, R]: they fill the kind's own
        rows."""
        k, chosen = self.functions.count, [self.columns[kind] for kind in kinds]
        if firsts:
            chosen = [one[:, first:] for one, first in zip(chosen, firsts, strict=True)]
        return [whitener.of(one, slice(place * k, (place + 1) * k)) for place, one in enumerate(chosen)]


def _basis(nuisances: Float) -> tuple[Float, int]:
    """Of what nuisances [windows, nuisances, R] span [windows, R, nuisances], and how many dimensions that has in all
    windows."""
    q, r = np.linalg.qr(nuisances.transpose(0, 2, 1))
    live = np.abs(np.diagonal(r, axis1=1, axis2=2)) > 1e-12 * np.max(np.abs(r), axis=(1, 2))[:, np.newaxis]
    return q * live[:, np.newaxis], int(live.sum())


def _joined(columns: Sequence[Float]) -> Float:
    """Columns [windows, columns, R] of several kinds beside each other."""
    return columns[0] if len(columns) == 1 else np.concatenate(columns, axis=1)
