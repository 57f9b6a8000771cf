"""Windows of a run as rows: columns, noise, and whitened rows without nuisances."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel
from pvid.model.corners import with_corners
from pvid.oracle.fourier.channels import Channels, Record
from pvid.oracle.fourier.corners import with_jumps
from pvid.oracle.fourier.design import FourierDesign
from pvid.oracle.fourier.front import grid_of
from pvid.oracle.fourier.functions import Float
from pvid.oracle.fourier.noise import NoiseFilters, NoiseModel, ReversalNoise
from pvid.oracle.fourier.parameters import Parameters

# Rows that are numerically dependent get this part of the mean variance.
_RIDGE = 1e-10


class Compiled:
    """A model made ready for numbers, once: channels, noise filters, theta(p).

    Attributes
    ----------
    bare : as compiled
    model : its rows with the corners of sampled signals
    jumps : name of a signal in them -> input whose scaled jump it is
    """

    def __init__(self, model: CompiledModel) -> None:
        self.bare = model
        model, self.jumps = with_corners(model)
        self.model = model
        self.channels = Channels(model)
        self.filters = NoiseFilters(self.channels)
        self.parameters = Parameters(model)


@dataclass(frozen=True)
class EquationError:
    """White noise of the equation itself in one row kind: variance (per step) of D^order of it."""

    variance: float = 0.0
    order: int = 0


@dataclass(frozen=True)
class WhiteRows:
    """Rows of one kind with unit covariance, nuisances projected out.

    Attributes
    ----------
    regressors : [windows, thetas, K]
    known : [windows, K]
    whitener : L^-1 with R = L L^T [windows, K, K]
    free : rows less nuisances, of all windows
    """

    regressors: Float
    known: Float
    whitener: Float
    free: int

    def only(self, windows: slice) -> WhiteRows:
        """Some of the windows."""
        n = self.regressors[windows]
        free = round(self.free * len(n) / len(self.regressors))
        return WhiteRows(n, self.known[windows], self.whitener[windows], free)

    def moments(self, windows: slice | npt.NDArray[np.bool_] = slice(None)) -> tuple[Float, Float]:
        """M [thetas, thetas] and B [thetas] of some windows."""
        n, y = self.regressors[windows], self.known[windows]
        flat = n.transpose(1, 0, 2).reshape(n.shape[1], -1)
        return flat @ flat.T, flat @ y.reshape(-1)


class WeakRows:
    """All windows of a run.

    Attributes
    ----------
    compiled : the model
    record : channels at every step
    columns : of each row kind [windows, columns, K]; theta's, then Y, then the nuisances
    numbers : of the windows in the run; those with a missing sample are left out
    noise : covariances
    """

    def __init__(self, compiled: Compiled, record: Record) -> None:
        self.compiled, self.record = compiled, record
        self.functions = record.grid.design.test_functions
        columns = record.columns(self.functions)
        whole = np.all([np.isfinite(one).all(axis=(1, 2)) for one in columns], axis=0)
        if not whole.any():
            raise PvidError("no window of the run is whole: every one has a missing sample")
        self.numbers = np.flatnonzero(whole)
        self.columns = [one[whole] for one in columns]
        self.noise = NoiseModel(compiled.filters, record)
        self.reversals = [ReversalNoise(compiled.channels, record, kind) for kind in range(len(columns))]

    @classmethod
    def of(cls, compiled: Compiled, run: Mapping[str, npt.ArrayLike], design: FourierDesign) -> WeakRows:
        """Those of a run: name -> samples."""
        whole = with_jumps(run, compiled.jumps, design.sample_rate)
        grid = grid_of(compiled.model, whole, design, compiled.channels.needed)
        return cls(compiled, compiled.channels.record(grid))

    @property
    def windows(self) -> int:
        """Whole ones."""
        return len(self.columns[0])

    @property
    def kinds(self) -> int:
        """Row kinds."""
        return len(self.columns)

    def only(self, windows: slice | npt.NDArray[np.bool_]) -> WeakRows:
        """Some of the windows; the noise stays that of the run."""
        out = copy.copy(self)
        out.columns = [one[windows] for one in self.columns]
        out.numbers = self.numbers[windows]
        return out

    def end_times(self) -> Float:
        """Time [s] of the last sample of each window, from the run's first one."""
        grid = self.record.grid
        first = grid.places[0] / grid.design.sample_rate
        return np.asarray(first + self.functions.dt * self.functions.hop * (2 + self.numbers))

    def covariance(self, kind: int, theta: Float, error: EquationError) -> Float:
        """R0(p), the equation's error and that of located reversals [windows, K, K]."""
        run = self.noise.covariance(kind, theta) + error.variance * self.noise.gram(error.order, error.order)
        return run + self.reversals[kind].covariance(theta, self.numbers)

    def with_next(self, kind: int, theta: Float, error: EquationError) -> Float:
        """The same between each window and the next one [windows, K, K]; the last one is of no use."""
        run = self.noise.with_next(kind, theta) + error.variance * self.noise.overlap(error.order, error.order)
        return run + self.reversals[kind].with_next(theta, self.numbers)

    def whitener(self, kind: int, theta: Float, error: EquationError) -> Float:
        """L^-1 [windows, K, K] of the covariance; rows of a model without noise are scaled to their size."""
        r = self.covariance(kind, theta, error)
        mean = float(np.mean(np.einsum("wkk->wk", r)))
        if mean == 0.0:
            r = r + float(np.mean(self.columns[kind][:, :-1] ** 2)) * 1e-12 * self.noise.gram(0, 0)
            mean = float(np.mean(np.einsum("wkk->wk", r)))
        r = r + _RIDGE * mean * np.eye(r.shape[1])
        return np.asarray(np.linalg.inv(np.linalg.cholesky(r)))

    def white(self, kind: int, theta: Float, error: EquationError) -> WhiteRows:
        """Whitened rows at theta."""
        row = self.compiled.channels.rows[kind]
        whitener = self.whitener(kind, theta, error)
        x = self.columns[kind] @ whitener.transpose(0, 2, 1)
        kept = x[:, : row.thetas + 1]
        if row.nuisances:
            q, r = np.linalg.qr(x[:, row.thetas + 1 :].transpose(0, 2, 1))
            live = np.abs(np.diagonal(r, axis1=1, axis2=2)) > 1e-12 * np.max(np.abs(r), axis=(1, 2))[:, np.newaxis]
            q = q * live[:, np.newaxis]
            kept = kept - (kept @ q) @ q.transpose(0, 2, 1)
            gone = int(live.sum())
        else:
            gone = 0
        return WhiteRows(
            kept[:, : row.thetas], kept[:, row.thetas], whitener, self.windows * self.functions.count - gone
        )
