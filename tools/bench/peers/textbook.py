"""The recipe of the textbook: derivatives by Savitzky and Golay, then linear least squares with its standard errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from bench.peers.rigs import GRAVITY, Fit, Float, Rig, Run, Values, centred, derivatives

PACKAGE = ""
RIGS = ("dc_motor", "free_pendulum", "cart_pendulum", "cell")


def regression(columns: Sequence[Float], y: Float) -> tuple[Float, Float]:
    """Coefficients and their covariance; the ends, where the filter extrapolates, are left out."""
    rows, right = np.stack(columns, 1)[40:-40], y[40:-40]
    inverse = np.linalg.inv(rows.T @ rows)
    found = inverse @ rows.T @ right
    return found, inverse * (right - rows @ found).var() * len(right) / (len(right) - rows.shape[1])


def of_ratios(f: Callable[[Float], Float], theta: Float, covariance: Float) -> tuple[Float, Float]:
    """Parameters and standard errors, by differences."""
    slopes = [(f(theta + step) - f(theta - step)) / (2 * step.sum()) for step in np.diag(1e-6 * np.abs(theta))]
    jacobian = np.stack(slopes, 1)
    return f(theta), np.sqrt(np.diag(jacobian @ covariance @ jacobian.T))


def dc_motor(run: Run) -> tuple[Float, Float]:
    i, di = derivatives(run, "i", 5, 1)
    _, w, dw = derivatives(run, "phi", 51)
    (L, R, k), of_circuit = regression(
        [di, i, derivatives(run, "phi", 5)[1]], derivatives({**run, "V": centred(run["V"])}, "V", 5, 0)[0]
    )
    i = derivatives(run, "i", 51, 0)[0]
    (J, b), of_shaft = regression([dw, w], k * i)
    values = np.array([R, L, k, J, b])
    variances = np.array([of_circuit[1, 1], of_circuit[0, 0], of_circuit[2, 2], of_shaft[0, 0], of_shaft[1, 1]])
    return values, np.sqrt(variances)


def free_pendulum(run: Run) -> tuple[Float, Float]:
    q, w, dw = derivatives(run, "q", 81)
    found, covariance = regression([-np.sin(q), -w], dw)
    return found, np.sqrt(np.diag(covariance))


def cart_pendulum(run: Run) -> tuple[Float, Float]:
    _, v, dv = derivatives(run, "x", 81)
    a, w, dw = derivatives(run, "a", 81)
    none, ends = np.zeros(len(v)), np.concatenate
    cart = [dv, np.cos(a) * dw - np.sin(a) * w**2, none, v, none]
    hinge = [none, np.cos(a) * dv + GRAVITY * np.sin(a), dw, none, w]
    # The second equation alone has no force: its rows are scaled to those of the first one.
    size = 1 / 0.05
    found, covariance = regression(
        [ends([c, size * h]) for c, h in zip(cart, hinge, strict=True)],
        ends([derivatives({**run, "F": centred(run["F"])}, "F", 81, 0)[0], none]),
    )
    return found, np.sqrt(np.diag(covariance))


def cell(run: Run) -> tuple[Float, Float]:
    v, dv = derivatives(run, "v", 7, 1)
    i, di = derivatives(run, "i", 7, 1)
    theta, covariance = regression([-v, np.ones(len(v)), -di, -i], dv)  # T1 v' + v = E - R0 T1 i' - (R0 + R1) i

    def parameters(c: Float) -> Float:
        return np.array([c[2], c[3] / c[0] - c[2], 1 / c[0], c[1] / c[0]])

    return of_ratios(parameters, theta, covariance)


def fit(rig: Rig, run: Run, guess: Values) -> Fit:
    found, errors = globals()[rig.name](run)
    return (dict(zip(rig.truth, found, strict=True)), dict(zip(rig.truth, errors, strict=True)), "")
