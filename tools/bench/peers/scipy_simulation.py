"""SciPy: output error in single shooting, `least_squares` on a simulation by Runge-Kutta.

First a tenth of the recording is fitted, then a third, then all: from far off the whole one has too many minima. The
states at the start are unknowns too; all perturbed parameters are simulated at once. Standard errors are those of
`curve_fit`, from the Jacobian and the residuals.
"""

from __future__ import annotations

import numpy as np

from bench.peers.rigs import Fit, Float, Rig, Run, Values, runge_kutta

PACKAGE = ""
RIGS = ("dc_motor", "free_pendulum", "cart_pendulum", "cell")


def simulated(rig: Rig, run: Run, unknowns: Float) -> Float:
    """Outputs over resolutions [n, k] of columns of parameters and first states."""
    p = dict(zip(rig.truth, unknowns, strict=False))
    x, h = np.array(unknowns[len(rig.truth) :]), 1 / rig.rate
    u = run[rig.input] if rig.input else np.zeros(len(run["t"]))
    later = u if rig.held else np.append(u[1:], u[-1])

    def f(x: Float, u: Float) -> Float:
        return np.array(rig.rates(x, u, p, np))

    out = []
    for now, then in zip(u, later, strict=True):
        out.append(np.array(rig.outputs(x, now, p)))
        x = runge_kutta(f, x, now, then, h)
    steps = np.array([rig.sensors[name] for name in rig.sensors if name != rig.input])
    return np.asarray((np.array(out) / steps[:, np.newaxis]).reshape(-1, unknowns.shape[1]))


def fit(rig: Rig, run: Run, guess: Values) -> Fit:
    from scipy.optimize import least_squares

    scale = np.array([*np.abs([*guess.values()]), *np.full(len(rig.start), 0.1)])
    z = np.array([*guess.values(), *rig.start]) / scale
    for part in (10, 3, 1):
        shown = {name: one[: rig.samples // part] for name, one in run.items()}
        measured = np.stack([shown[k] / step for k, step in rig.sensors.items() if k != rig.input], 1).ravel()

        def residuals(z: Float, shown: Run = shown, measured: Float = measured) -> Float:
            return np.nan_to_num(simulated(rig, shown, (z * scale)[:, np.newaxis])[:, 0] - measured, nan=1e6)

        def jacobian(z: Float, shown: Run = shown) -> Float:
            moved = np.stack([z, *(z + 1e-6 * np.eye(len(z)))], 1) * scale[:, np.newaxis]
            all_of = np.nan_to_num(simulated(rig, shown, moved), nan=1e6)
            return (all_of[:, 1:] - all_of[:, :1]) / 1e-6

        with np.errstate(all="ignore"):
            found = least_squares(residuals, z, jacobian, x_scale="jac", max_nfev=30)
        z = found.x
    variance = 2 * found.cost / (len(measured) - len(z))
    errors = np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac)) * variance) * scale
    said = "" if found.success else found.message
    return (dict(zip(guess, z * scale, strict=False)), dict(zip(guess, errors, strict=False)), said)
