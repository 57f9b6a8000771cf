"""An arm of three joints with dry and viscous friction, simulated by MuJoCo; its base parameters are the unknowns."""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from bench.peers.rigs import COUNT, LACKING, OFF, Float, Run

BODY = '<body name="b{k}" pos="{at}" quat="{turned}">{joint}'
JOINT = '<joint name="j{k}" axis="0 0 1" damping="{fv}" frictionloss="{fc}"/>'
INERTIAL = '<inertial pos="{centre}" mass="{mass}" fullinertia="{about}"/>'
BODIES = (
    ("0 0 0.3", "1 0 0 0", 4.0, (0.02, 0.05, -0.06), (0.05, 0.04, 0.03, 0.004, -0.003, 0.005), 0.6, 0.8),
    ("0 0 0", "1 -1 0 0", 3.0, (0.2, 0.02, 0.06), (0.02, 0.07, 0.06, -0.004, 0.006, 0.003), 0.5, 0.6),
    ("0.4 0 0", "1 0 0 0", 1.5, (0.15, -0.03, 0.04), (0.008, 0.025, 0.022, 0.002, -0.003, 0.001), 0.2, 0.3),
)
JOINTS, RATE, SAMPLES, STEPS = 3, 250.0, 3750, 16


def mjcf(scale: Float | None = None, stiffness: float = 0.0) -> str:
    """The arm; every figure of it (mass with inertia, centre, two frictions, of each body) times those of `scale`."""
    text, by = "", np.ones((JOINTS, 4)) if scale is None else scale
    for k, (at, turned, mass, centre, about, fv, fc) in enumerate(BODIES):
        m, c, v, d = by[k]
        text += BODY.format(k=k + 1, at=at, turned=turned, joint=JOINT.format(k=k + 1, fv=fv * v, fc=fc * d))
        numbers = [" ".join(str(x * one) for one in given) for x, given in ((c, centre), (m, about))]
        text += INERTIAL.format(centre=numbers[0], mass=mass * m, about=numbers[1])
    text = text.replace('name="j2"', f'name="j2" stiffness="{stiffness}"') + "</body>" * JOINTS
    motors = "".join(f'<motor name="m{k}" joint="j{k}"/>' for k in (1, 2, 3))
    sensors = "".join(f'<jointpos name="q{k}" joint="j{k}"/>' for k in (1, 2, 3))
    return (
        '<mujoco model="arm3"><compiler angle="radian"/><option timestep="0.004" integrator="RK4">'
        f'<flag contact="disable"/></option><worldbody>{text}</worldbody><actuator>{motors}</actuator>'
        f"<sensor>{sensors}</sensor></mujoco>"
    )


@dataclass(frozen=True)
class Arm:
    """As a Rig; base parameters of bodies are `base` [n, 30] times the standard ones; `model` is a file for pvid."""

    truth: dict[str, float]
    base: Float
    model: Path | None = None
    name: str = "arm3"
    effect: tuple[str, None] = ("a spring at a joint", None)

    def guess(self, seed: int) -> dict[str, Any]:
        """Factors of all figures of the bodies."""
        random = np.random.default_rng(1000 + seed)
        return {"scale": 1 + OFF[seed % 2] * random.choice([-1, 1], (JOINTS, 4))}

    def size(self, name: str) -> float:
        """What errors of a parameter are divided by: small products of inertia by 0.05 of their unit."""
        return max(abs(self.truth[name]), 0.05)

    def named(self, base: Float, friction: Float) -> dict[str, float]:
        """By the names of `truth`: values of the base parameters, and of Fv1, Fc1, Fv2 .. [6]."""
        frictions = {f"F{kind}{k + 1}": 2 * k + place for k in range(JOINTS) for place, kind in enumerate("vc")}
        rest = iter(base)
        return {one: float(friction[frictions[one]] if one in frictions else next(rest)) for one in self.truth}

    def of(self, standard: Float, friction: Float) -> dict[str, float]:
        """Base parameters of standard ones [30] and frictions [6]."""
        return self.named(self.base @ standard, friction)

    def recording(self, seed: int, case: str) -> Run:
        """Each joint follows three sines, held there by a controller; torques are held over a sample."""
        mujoco = import_module("mujoco")

        random = np.random.default_rng(seed)
        model = mujoco.MjModel.from_xml_string(mjcf(stiffness=4.0 if case == LACKING else 0.0))
        model.opt.timestep = 1 / RATE / STEPS
        data = mujoco.MjData(model)
        f, size = (random.uniform(0.1, 1.2, (JOINTS, 3, 1)), random.uniform(0.3, 0.8, (JOINTS, 3, 1)))
        phase = 2 * np.pi * f * (np.arange(SAMPLES) / RATE) + random.uniform(0, 6, (JOINTS, 3, 1))
        wanted, rates = ((size * np.sin(phase)).sum(1), (size * 2 * np.pi * f * np.cos(phase)).sum(1))
        data.qpos[:], data.qvel[:] = wanted[:, 0], rates[:, 0]
        q, tau, gain = (np.empty((JOINTS, SAMPLES)), np.empty((JOINTS, SAMPLES)), np.array([120.0, 120.0, 30.0]))
        for k in range(SAMPLES):
            q[:, k] = data.qpos
            tau[:, k] = gain * (wanted[:, k] - data.qpos) + gain / 8 * (rates[:, k] - data.qvel)
            data.ctrl[:] = tau[:, k]
            mujoco.mj_step(model, data, STEPS)
        step = COUNT / 16  # encoders of 16 bits
        q = step * np.round(q / step + random.normal(0, 0.5, q.shape))
        named = {f"q{k + 1}": q[k] for k in range(JOINTS)} | {f"tau{k + 1}": tau[k] for k in range(JOINTS)}
        return {"t": np.arange(SAMPLES) / RATE} | named


def standard_of(bodies: Any = BODIES) -> Float:
    """Inertial parameters of each body about its joint, in the order of pvid [30]."""
    out = []
    for _, _, mass, centre, about, *_ in bodies:
        c = np.array(centre)
        xx, yy, zz, xy, xz, yz = about
        own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + mass * (c @ c * np.eye(3) - np.outer(c, c))
        out += [mass, *(mass * c), *own[np.triu_indices(3)]]
    return np.array(out)


def write_arm(folder: Path) -> Arm:
    """The model file that `pvid model from` makes, the torques being held, and what `arm_rig` reads."""
    from pvid.model.chain import INERTIAL
    from pvid.models.mechanisms import compiled_of
    from pvid.models.robot_file import model_text

    (folder / "arm3.xml").write_text(mjcf(), encoding="utf-8")
    text = model_text(folder / "arm3.xml").replace("inertial=", 'hold="zoh", inertial=')
    (folder / "arm3.py").write_text(text, encoding="utf-8")
    chain = compiled_of(folder / "arm3.py").chain
    assert chain is not None
    bodies = [one for one in chain.base if chain.standard[one.standard].kind in INERTIAL]
    base = np.zeros((len(bodies), len(INERTIAL) * JOINTS))
    for row, one in zip(base, bodies, strict=True):
        for place, factor in one.parts:
            standard = chain.standard[place]
            row[len(INERTIAL) * standard.joint + INERTIAL.index(standard.kind)] = factor
    empty = Arm(dict.fromkeys(map(chain.name_of, chain.base), 0.0), base)
    truth = empty.of(standard_of(), np.array([body[-2:] for body in BODIES]).ravel())
    (folder / "arm.json").write_text(json.dumps({"truth": truth, "base": base.tolist()}), encoding="utf-8")
    return arm_rig(folder)


def arm_rig(folder: Path) -> Arm:
    """As the product wrote it."""
    told = json.loads((folder / "arm.json").read_text(encoding="utf-8"))
    return Arm(told["truth"], np.array(told["base"]), folder / "arm3.py")
