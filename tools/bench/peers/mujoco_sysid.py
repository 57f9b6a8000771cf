"""MuJoCo: `mujoco.sysid` on chunks of half a second, whose first states are smoothed from the recording.

Measured times are one step later: its rollout stamps the sensors of a state with the time behind the step. Inertias of
the arm are pseudo-inertias by their logarithmic Cholesky factors.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from bench.peers.arm import BODIES, JOINTS, mjcf, standard_of
from bench.peers.rigs import GRAVITY, Fit, Float, Run, derivatives

PACKAGE = "mujoco[sysid]==4.0.0"
RIGS = ("free_pendulum", "cart_pendulum", "arm3")
CHUNK = 0.5
HEAD = (
    '<mujoco><compiler angle="radian"/><option timestep="0.002" integrator="RK4"><flag contact="disable"/></option>'
    "<worldbody>{}</worldbody><actuator>{}</actuator><sensor>{}</sensor></mujoco>"
)
INERTIA = '<inertial pos="0 0 {}" mass="1" diaginertia="{} {} {}"/>'
HINGE = f'<body name="rod"><joint name="a" axis="0 1 0"/>{INERTIA.format(-0.3, 1e-6, 1e-6, 1e-6)}</body>'
CART = f'<body name="cart"><joint name="x" type="slide" axis="-1 0 0"/>{INERTIA.format(0, 1, 1, 1)}{HINGE}</body>'
JOINT = '<jointpos name="{0}" joint="{1}"/>'
SPECS = {
    "free_pendulum": HEAD.format(HINGE, '<motor joint="a"/>', JOINT.format("q", "a")),
    "cart_pendulum": HEAD.format(CART, '<motor joint="x"/>', JOINT.format("x", "x") + JOINT.format("a", "a")),
}


def free_pendulum(spec: Any, p: Any) -> None:
    """w2, k: a point of 1 kg at g / w2."""
    w2, k = p.value
    spec.body("rod").ipos[2] = -GRAVITY / w2
    spec.joint("a").damping[0] = k * (GRAVITY / w2) ** 2


def cart_pendulum(spec: Any, p: Any) -> None:
    """mt, ml, J, b, bp: nine tenths of the mass hang."""
    mt, ml, J, b, bp = p.value
    mass = 0.9 * mt
    spec.body("cart").mass, spec.body("rod").mass = mt - mass, mass
    spec.body("rod").ipos[2] = -ml / mass
    spec.body("rod").inertia[:] = max(J - ml**2 / mass, 1e-6) * np.array([0.5, 1.0, 0.6])
    spec.joint("x").damping[0], spec.joint("a").damping[0] = b, bp


def arm3(spec: Any, p: Any) -> None:
    """The pseudo-inertia of each body, its two frictions."""
    model_modifier = import_module("mujoco.sysid").model_modifier
    for k, theta in enumerate(p.value.reshape(JOINTS, 12)):
        body, joint, pi = (spec.body(f"b{k + 1}"), spec.joint(f"j{k + 1}"), model_modifier.pi_from_theta(theta[:10]))
        c = pi[1:4] / pi[0]
        about = pi[4:].reshape(3, 3) - pi[0] * (c @ c * np.eye(3) - np.outer(c, c))
        body.mass, body.ipos = pi[0], c
        body.fullinertia = np.array([*np.diag(about), about[0, 1], about[0, 2], about[1, 2]])
        joint.damping[0], joint.frictionloss = theta[10:]


def arm3_start(scale: Float) -> Float:
    """The vector of `arm3` at factors of the bodies' figures."""
    model_modifier = import_module("mujoco.sysid").model_modifier
    start = []
    for (at, turned, mass, centre, about, *friction), (m, c, *f) in zip(BODIES, scale, strict=True):
        body = (at, turned, mass * m, c * np.array(centre), m * np.array(about))
        m_, hx, hy, hz, xx, xy, xz, yy, yz, zz = standard_of([body])
        pi = np.array([m_, hx, hy, hz, xx, xy, xz, xy, yy, yz, xz, yz, zz])
        start += [*model_modifier.theta_from_pseudoinertia(model_modifier.pseudoinertia_from_pi(pi))]
        start += [one * by for one, by in zip(friction, f, strict=True)]
    return np.array(start)


def arm3_values(rig: Any, x: Float) -> dict[str, float]:
    """Base parameters of a vector."""
    model_modifier = import_module("mujoco.sysid").model_modifier
    thetas = x.reshape(JOINTS, 12)
    upper = [0, 1, 2, 3, 4, 5, 6, 8, 9, 12]
    standard = np.concatenate([model_modifier.pi_from_theta(one[:10])[upper] for one in thetas])
    return dict(rig.of(standard, thetas[:, 10:].ravel()))


def fit(rig: Any, run: Run, guess: Any) -> Fit:
    mujoco, sysid = import_module("mujoco"), import_module("mujoco.sysid")

    arm = rig.name == "arm3"
    spec = mujoco.MjSpec.from_string(mjcf() if arm else SPECS[rig.name])
    start = arm3_start(guess["scale"]) if arm else np.array([*guess.values()])
    # Logarithms of sizes, shears and centres within their documented reach; what is positive within a factor of ten.
    free = np.tile([True] * 10 + [False] * 2, JOINTS) if arm else np.zeros(len(start), bool)
    low, high = (np.where(free, start - 1.2, start / 10), np.where(free, start + 1.2, start * 10))
    params = sysid.ParameterDict()
    params.add(sysid.Parameter("p", start, low, high, modifier=globals()[rig.name]))
    model = sysid.apply_param_modifiers(params, spec)
    sensors = [name for name in ("q1", "q2", "q3", "q", "x", "a") if name in run]
    inputs = [run[name] for name in ("tau1", "tau2", "tau3", "F") if name in run] or [np.zeros(len(run["t"]))]
    smooth = np.stack([derivatives(run, name, 21, 1) for name in sensors], 2)
    t, step = run["t"], model.opt.timestep
    size = round(CHUNK / step)
    chunks = [slice(k, k + size + 1) for k in range(0, len(t) - size, size)]
    firsts = [sysid.create_initial_state(model, *smooth[:, one.start]) for one in chunks]
    controls = [sysid.TimeSeries(t[one] - t[one.start], np.stack(inputs, 1)[one]) for one in chunks]
    measured = np.stack([run[name] for name in sensors], 1)
    shown = [
        sysid.TimeSeries.from_names((t[one] - t[one.start] + step)[:-1], measured[one][:-1], model) for one in chunks
    ]
    sequences = sysid.ModelSequences("run", spec, [f"c{k}" for k in range(len(chunks))], firsts, controls, shown)
    residual = sysid.build_residual_fn(models_sequences=[sequences], n_threads=1)
    best, found = sysid.optimize(params, residual, "mujoco", verbose=False, max_iters=50)
    covariance, _ = sysid.calculate_intervals(residual(found.x, best)[0], found.jac)
    values = arm3_values(rig, found.x) if arm else dict(zip(rig.truth, found.x, strict=True))
    if arm:
        moved = [arm3_values(rig, found.x + 1e-6 * one) for one in np.eye(len(start))]
        slopes = np.array([[(one[name] - values[name]) / 1e-6 for name in values] for one in moved])
        covariance = slopes.T @ covariance @ slopes
    errors = dict(zip(values, np.sqrt(np.abs(np.diag(covariance))), strict=True))
    at_bound = np.minimum(found.x - low, high - found.x) < 1e-3 * (high - low)
    return values, errors, f"{at_bound.sum()} at a bound" if at_bound.any() else ""
