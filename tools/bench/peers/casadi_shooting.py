"""CasADi: multiple shooting with IPOPT and the Gauss-Newton Hessian, as its example of system identification has it.

Runge-Kutta a sample, mapped and accumulated over intervals of 25 samples; the nodes start at the smoothed recording.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.peers.rigs import NONE, Fit, Rig, Run, Values, derivatives, runge_kutta

PACKAGE = "casadi==3.8.2 scipy==1.17.1"
RIGS = ("dc_motor", "free_pendulum", "cart_pendulum", "cell")
STEPS = 25


def states(rig: Rig, run: Run) -> Any:
    """First guesses of the states [n, k], from the recording."""
    if rig.name == "cell":
        return np.zeros((1, rig.samples))
    measured = [derivatives(run, name, 31, 1) for name in rig.sensors]
    rates = [one[1] for name, one in zip(rig.sensors, measured, strict=True) if name != "i"]
    return np.array([*(one[0] for one in measured), *rates])


def fit(rig: Rig, run: Run, guess: Values) -> Fit:
    import casadi as ca

    n, h, scale = len(rig.start), 1 / rig.rate, np.abs([*guess.values()])
    x, u, p = ca.MX.sym("x", n), ca.MX.sym("u", 2), ca.MX.sym("p", len(guess))
    named = {name: p[k] * scale[k] for k, name in enumerate(guess)}

    def f(x: Any, u: Any) -> Any:
        return ca.vertcat(*rig.rates(ca.vertsplit(x), u, named, ca))

    steps = [step for name, step in rig.sensors.items() if name != rig.input]
    shown = [one / step for one, step in zip(rig.outputs(ca.vertsplit(x), u[0], named), steps, strict=True)]
    step = ca.Function("step", [x, u, p], [runge_kutta(f, x, u[0], u[1], h), ca.vertcat(*shown)]).expand()
    many = step.mapaccum("many", STEPS)
    count = rig.samples // STEPS
    given = run[rig.input] if rig.input else np.zeros(rig.samples)
    later = given if rig.held else np.append(given[1:], given[-1])
    nodes, unknown = ca.MX.sym("nodes", n, count), ca.MX.sym("unknown", len(guess))
    along = np.stack([given, later])[:, : count * STEPS].reshape(2, count, STEPS)
    inputs = np.concatenate([along[:, k] for k in range(count)], 1)
    ends, outputs = many.map(count, "serial")(nodes, inputs, ca.repmat(unknown, 1, count * STEPS))
    measured = np.stack([run[name] / step for name, step in rig.sensors.items() if name != rig.input])
    residual = ca.vec(outputs - measured[:, : count * STEPS])
    gaps = ca.vec(ends[:, STEPS - 1 :: STEPS][:, :-1] - nodes[:, 1:])
    w = ca.veccat(unknown, nodes)
    jacobian = ca.jacobian(residual, w)
    weight = ca.MX.sym("weight")
    hessian = ca.Function(
        "hessian", [w, ca.MX.sym("none", 0), weight, ca.MX.sym("multipliers", gaps.numel())],
        [weight * ca.triu(ca.mtimes(jacobian.T, jacobian))],
    )  # fmt: skip
    problem = {"x": w, "f": 0.5 * ca.sumsqr(residual), "g": gaps}
    options = {"ipopt.print_level": 0, "print_time": 0, "ipopt.max_iter": 100, "hess_lag": hessian}
    solver = ca.nlpsol("solver", "ipopt", problem, options)
    first = np.concatenate([np.array([*guess.values()]) / scale, states(rig, run)[:, ::STEPS][:, :count].T.ravel()])
    least = np.concatenate([np.full(len(guess), 0.05), np.full(n * count, -np.inf)])  # parameters are positive
    found = solver(x0=first, lbx=least, lbg=0, ubg=0)
    values = np.array(found["x"]).ravel()[: len(guess)] * scale
    said = "" if solver.stats()["success"] else solver.stats()["return_status"]
    return dict(zip(guess, values, strict=True)), dict.fromkeys(guess, NONE), said
