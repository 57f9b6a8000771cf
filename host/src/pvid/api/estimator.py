"""`pvid.Estimator`: the C core's estimator on a model of one's own, theta = f(p), fed with rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.settings.enums import Reason, Status

Float = npt.NDArray[np.float64]

_STEP = 1e-6  # of a difference quotient, relative
_MOST_THETA = 255  # that the core can count


@dataclass(frozen=True, eq=False)
class Estimate:
    """p and its standard errors se, both [n_p]; covariance [n_p, n_p]; kappa and residual_sd as in estimator.h."""

    p: Float
    se: Float
    covariance: Float
    kappa: float
    residual_sd: float


class Estimator:
    """Estimates few parameters p from rows Y = N^T theta(p) + noise, in the float32 of the C core.

    Parameters
    ----------
    theta
        p [n_p] -> coefficients theta [n_theta].
    jacobian
        p [n_p] -> d theta / d p [n_theta, n_p]; by differences of theta if None.
    start, start_sd
        The guess and its standard deviation [n_p].
    row_sd
        Expected standard deviation of Y - N^T theta [unit of Y].
    lower, upper
        Bounds of p; a twentieth and twenty times the start for a positive start, +-1e6 times its standard deviation
        for any other by default.
    positive
        Whether each p is positive; that of the start by default.
    rate, forgetting
        Rows a second [Hz], and time constant of forgetting [s]; 0: none.
    drift, drift_s
        p [n_p] -> directions [n_p] or [k, n_p] in which alone p changes in time, and the time constant of what rows
        tell along them [s]. None: there are none.
    constraints
        p [n_p] -> g [m], which is 0 at every estimate; the start is moved there. None: there are none.

    Raises
    ------
    PvidError
        When the model is too large for the installed core, or the core refuses a number.

    Examples
    --------
    >>> motor = pvid.Estimator(lambda p: p, start=[0.01, 0.1], start_sd=[0.01, 0.1], row_sd=0.1)  # doctest: +SKIP
    >>> motor.add(N, Y).estimate.p  # doctest: +SKIP
    """

    def __init__(
        self,
        theta: Callable[[Float], npt.ArrayLike],
        jacobian: Callable[[Float], npt.ArrayLike] | None = None,
        *,
        start: npt.ArrayLike,
        start_sd: npt.ArrayLike,
        row_sd: float,
        lower: npt.ArrayLike | None = None,
        upper: npt.ArrayLike | None = None,
        positive: Sequence[bool] | None = None,
        rate: float = 1.0,
        forgetting: float = 0.0,
        drift: Callable[[Float], npt.ArrayLike] | None = None,
        drift_s: float = 0.0,
        constraints: Callable[[Float], npt.ArrayLike] | None = None,
    ) -> None:
        self._native = Native()
        self._theta, self._jacobian, self._tied, self._drift = theta, jacobian, constraints, drift
        first, spread = (np.atleast_1d(np.asarray(one, np.float64)) for one in (start, start_sd))
        n_p, n_theta = first.size, np.atleast_1d(np.asarray(theta(first), np.float64)).size
        signs = np.asarray(first > 0 if positive is None else positive, bool)
        least = np.where(signs, first / 20, first - 1e6 * spread) if lower is None else np.asarray(lower, np.float64)
        most = np.where(signs, first * 20, first + 1e6 * spread) if upper is None else np.asarray(upper, np.float64)
        self.n_p, self.n_theta = n_p, n_theta
        ffi, library = self._native.headers.ffi, self._native.library
        if n_p > self._most(ffi) or n_theta > _MOST_THETA:
            raise self._too_large()
        self._state, self._callbacks = ffi.new("pvid_estimator_f32 *"), self._functions()
        places = [(row, column) for column in range(n_p) for row in range(n_theta)]
        self._rows = ffi.new("uint8_t[]", [row for row, _ in places])
        self._columns = ffi.new("uint8_t[]", [column for _, column in places])
        self._model = ffi.new("pvid_model_f32 *")
        model = self._model
        model.n_theta, model.n_p, model.n_moments = n_theta, n_p, n_theta * (n_theta + 1) // 2
        model.n_c, model.c_row, model.c_column = len(places), self._rows, self._columns
        model.positive = sum(1 << k for k in range(n_p) if signs[k])
        model.theta, model.jacobian, model.constraints, model.drifts = self._callbacks
        if drift is not None:
            model.n_drifts, model.drift_s = np.size(drift(first)) // n_p, drift_s
        if constraints is not None:
            model.n_constraints = np.size(constraints(first))
        config = ffi.new("pvid_estimator_config_f32 *", library.pvid_estimator_defaults_f32)
        config.model = model
        for name, values in (("start", first), ("start_sd", spread), ("lower", least), ("upper", most)):
            if values.shape != (n_p,):
                raise PvidError(f"{name} has shape {values.shape}, and start {first.shape}")
            for k, value in enumerate(values):
                getattr(config, name)[k] = value
        config.row_sd, config.update_rate_hz, config.forgetting_s = row_sd, rate, forgetting
        status = Status(library.pvid_estimator_init_layout_f32(self._state, config, library.pvid_layout()))
        if drift is not None and not 4.0 <= drift_s * rate <= 1e12:
            raise PvidError(f"drift_s is {drift_s} s, it must be at least four rows: {4 / rate:g} s")
        if status is Status.BAD_MODEL:
            raise self._too_large()
        if status is Status.BAD_START and constraints is not None:
            raise PvidError(
                "no p near the start, within its bounds, meets the constraints: do these contradict each other?"
            )
        if status is not Status.OK:
            raise PvidError(f"the core refused the estimator: {status.text}")

    @staticmethod
    def _most(ffi: Any) -> int:
        """Parameters that a configuration has room for."""
        start = dict(ffi.typeof("pvid_estimator_config_f32").fields)["start"]
        return int(start.type.length)

    def _too_large(self) -> PvidError:
        return PvidError(
            f"{self.n_p} parameters in {self.n_theta} coefficients are more than the installed core has room for: "
            "build it with larger PVID_MAX_P, PVID_MAX_THETA and PVID_MAX_MOMENTS"
        )

    def _functions(self) -> tuple[Any, ...]:
        ffi = self._native.headers.ffi

        def theta(p: Any, out: Any) -> None:
            for k, value in enumerate(np.ravel(np.asarray(self._theta(self._numbers(p)), np.float64))):
                out[k] = value

        def jacobian(p: Any, out: Any) -> None:
            slope = self._slope(self._numbers(p))
            for k, value in enumerate(slope.T.ravel()):
                out[k] = value

        def constraints(p: Any, out: Any) -> None:
            assert self._tied is not None
            at = self._numbers(p)
            g = np.ravel(np.asarray(self._tied(at), np.float64))
            for k, value in enumerate(np.column_stack([g, self._differences(self._tied, at, g.size)]).ravel()):
                out[k] = value

        def drift(p: Any, out: Any) -> None:
            assert self._drift is not None
            for k, value in enumerate(np.ravel(np.asarray(self._drift(self._numbers(p)), np.float64))):
                out[k] = value

        kind = "void(*)(const float *, float *)"
        tied = ffi.NULL if self._tied is None else ffi.callback(kind, constraints)
        moving = ffi.NULL if self._drift is None else ffi.callback(kind, drift)
        return ffi.callback(kind, theta), ffi.callback(kind, jacobian), tied, moving

    def _numbers(self, p: Any) -> Float:
        return np.array([p[k] for k in range(self.n_p)], np.float64)

    def _slope(self, p: Float) -> Float:
        if self._jacobian is not None:
            return np.asarray(self._jacobian(p), np.float64).reshape(self.n_theta, self.n_p)
        return self._differences(self._theta, p, self.n_theta)

    def _differences(self, function: Callable[[Float], npt.ArrayLike], p: Float, size: int) -> Float:
        steps = _STEP * np.maximum(np.abs(p), 1e-3)
        ahead, behind = (np.array([np.ravel(function(p + s * d)) for d in np.diag(steps)], np.float64) for s in (1, -1))
        return ((ahead - behind) / (2 * steps[:, None])).reshape(len(p), size).T

    def step(self, n: npt.ArrayLike, y: float) -> str:
        """One row N [n_theta] and Y: adds it and moves p. Returns the reason in words."""
        row = np.ascontiguousarray(n, np.float32)
        if row.shape != (self.n_theta,):
            raise PvidError(f"a row has {self.n_theta} entries, and this one shape {row.shape}")
        pointer = self._native.headers.ffi.cast("float *", row.ctypes.data)
        return Reason(self._native.library.pvid_estimator_step_f32(self._state, pointer, float(y))).text

    def add(self, n: npt.ArrayLike, y: npt.ArrayLike) -> Estimator:
        """Rows N [rows, n_theta] and Y [rows], one after the other; returns itself."""
        rows, right = np.asarray(n, np.float32), np.asarray(y, np.float32)
        if rows.ndim != 2 or right.shape != rows.shape[:1]:
            raise PvidError(
                f"rows [rows, {self.n_theta}] and right sides [rows] are wanted, not {rows.shape} and {right.shape}"
            )
        for one, value in zip(rows, right, strict=True):
            self.step(one, float(value))
        return self

    @property
    def estimate(self) -> Estimate:
        """The present one."""
        ffi, library = self._native.headers.ffi, self._native.library
        out = ffi.new("pvid_estimate_f32 *")
        library.pvid_estimator_assess_f32(self._state, out)
        p, se = (np.array([getattr(out, name)[k] for k in range(self.n_p)]) for name in ("p", "se"))
        covariance = np.array([[out.covariance[i][j] for j in range(self.n_p)] for i in range(self.n_p)])
        return Estimate(p, se, covariance, float(out.kappa), float(out.residual_sd))
