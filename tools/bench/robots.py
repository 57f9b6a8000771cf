"""Arms of public URDF files, their inertias and frictions redrawn, moved by MuJoCo: errors beside the Cramer-Rao bound.

The files are those of the package example-robot-data, which pip downloads by name. Each recording is of the motion that
`pvid design` makes of the unchanged file; what is compared are base parameters of the changed one.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from bench.case import Advance, Report, columns
from pvid.base.errors import PvidError
from pvid.configuration.robot_motion import Motion, Task, designed_motion
from pvid.core.sources import ROOT
from pvid.identification.bodies import about_centre
from pvid.identification.robot import RobotAnswer, answer_of_robot
from pvid.model.chain import Chain
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.models.robot_file import model_text, prepared_urdf
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]
PACKAGE = "example-robot-data"
ROBOTS = {
    "panda": ("panda_description/urdf/panda.urdf", tuple(f"panda_joint{k}" for k in range(1, 8))),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", ()),
    "kinova": ("kinova_description/robots/kinova.urdf", ()),
    "z1": ("z1_description/urdf/z1.urdf", ()),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", ()),
}
HEADER = columns(
    "robot | joints | base parameters | CPU s of the motion | CPU s of an answer | answered | not determined"
    " | errors over the Cramer-Rao bound, median | worst parameter | within 2 s.e. of noise % | within 2 s.e. %"
    " | worst s.e. | warned"
)
RATE, STEPS, DURATION = 1000.0, 4, 20.0  # [Hz], of MuJoCo in a sample, [s]
STEP, TORQUE = 2 * np.pi / 2**19, 0.002  # of the encoders; noise of the torques, parts of their limits
SPREAD = 0.3  # of the logarithm of the pseudo-inertias
VISCOUS, DRY = (0.02, 0.06), (0.01, 0.04)  # of the largest torque, at the largest speed
STIFF, DAMPED = 400.0, 40.0  # of the controller [1/s^2], [1/s]


def files() -> Path:
    """Folder of the robots."""
    place = ROOT / "build" / "robots"
    if not list(place.glob("*.whl")):
        pip = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary", ":all:"]
        told = subprocess.run([*pip, PACKAGE, "-d", str(place)], capture_output=True, text=True, check=False)
        if told.returncode:
            raise PvidError(f"{PACKAGE} cannot be had: {(told.stderr.strip().splitlines() or ['pip failed'])[-1]}")
    (wheel,) = place.glob("*.whl")
    with zipfile.ZipFile(wheel) as packed:
        names = [one for one in packed.namelist() if one.endswith(tuple(path for path, _ in ROBOTS.values()))]
        packed.extractall(place, names)
    return (place / names[0]).parents[2]


def changed(path: Path, joints: Sequence[str], chain: Chain, random: np.random.Generator) -> Any:
    """MuJoCo's description of the arm with inertias and frictions at random; joints that are not chosen are held."""
    import mujoco

    tree = ElementTree.fromstring(path.read_text(encoding="utf-8"))
    prepared_urdf(tree)
    for one in tree.findall("joint"):
        if (tied := one.find("mimic")) is not None:
            one.remove(tied)
        if joints and one.get("name") not in joints:
            one.set("type", "fixed")
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(tree, encoding="unicode"))
    model = spec.compile()
    for body in spec.bodies[1:]:
        k = model.body(body.name).id
        turned, centre, mass = np.zeros(9), model.body_ipos[k], model.body_mass[k]
        mujoco.mju_quat2Mat(turned, model.body_iquat[k])
        about = turned.reshape(3, 3) @ np.diag(model.body_inertia[k]) @ turned.reshape(3, 3).T
        second = np.trace(about) / 2 * np.eye(3) - about + mass * np.outer(centre, centre)
        sizes, axes = np.linalg.eigh(np.block([[second, mass * centre[:, None]], [mass * centre, np.array([mass])]]))
        root = axes * np.sqrt(np.maximum(sizes, 1e-12))
        drawn = SPREAD * random.normal(size=(4, 4))
        logs, own = np.linalg.eigh((drawn + drawn.T) / 2)
        pseudo = root @ (own * np.exp(logs)) @ own.T @ root.T
        mass, centre, about = about_centre(pseudo)
        body.mass, body.ipos, body.iquat, body.explicitinertial = mass, centre, [1, 0, 0, 0], True
        body.inertia, body.fullinertia = [0, 0, 0], about[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]
    for known in chain.joints:
        joint, most, fastest = spec.joint(known.name), known.torque or 0.0, known.speed or 1.0
        joint.damping[0] = random.uniform(*VISCOUS) * most / fastest
        joint.frictionloss = random.uniform(*DRY) * most
        joint.solref_friction, joint.solimp_friction = [0.0006, 1.0], [0.9999, 0.9999, 0.001, 0.5, 2]
        joint.actfrclimited = False
    return spec


def moved(spec: Any, motion: Motion) -> tuple[Float, Float, Float, Float]:
    """Positions, rates, accelerations and torques [n, samples]; a controller holds the arm on the motion."""
    import mujoco

    spec.option.timestep, spec.option.integrator = 1 / RATE / STEPS, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    flags = mujoco.mjtDisableBit
    spec.option.disableflags |= int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_LIMIT)
    model = spec.compile()
    data, whole = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    _, (q, v, a) = motion.series.samples(RATE * STEPS)
    out = np.zeros((4, model.nv, q.shape[1] // STEPS))
    data.qpos[:], data.qvel[:] = q[:, 0], v[:, 0]
    for k in range(out.shape[2] * STEPS):
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fullM(model, data, whole)
        wanted = a[:, k] + STIFF * (q[:, k] - data.qpos) + DAMPED * (v[:, k] - data.qvel)
        rubbing = model.dof_frictionloss * np.tanh(v[:, k] / 0.02)
        data.qfrc_applied[:] = whole @ wanted + data.qfrc_bias - data.qfrc_passive + rubbing
        sample = out[..., k // STEPS]
        if k % STEPS == 0:
            sample[0], sample[1], sample[3] = data.qpos, data.qvel, data.qfrc_applied
        mujoco.mj_step(model, data)
        if k % STEPS == 0:
            sample[2] = data.qacc
    q, v, a, torque = out
    return q, v, a, torque


def bound(motion: Motion, q: Float, v: Float, a: Float, noise: Float) -> Float:
    """Cramer-Rao bound of one who knows the motion exactly [p]."""
    task, every = Task(motion.model, motion.series, noise), 4
    q, v, a = (one[:, ::every] for one in (q, v, a))
    found = [np.broadcast_to(one, q.shape[1]) for one in task.values(q, v, a)]
    white = task.rows(q, v, found) / noise[:, None, None]
    flat = white.transpose(1, 0, 2).reshape(white.shape[1], -1)
    size = np.linalg.norm(flat, axis=1)
    information = (flat / size[:, None]) @ (flat / size[:, None]).T * every
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))) / size)


def answer(motion: Motion, spec: Any, random: np.random.Generator) -> tuple[RobotAnswer, Float, float]:
    """Of a recording, with the bound and CPU seconds."""
    q, v, a, torque = moved(spec, motion)
    noise = np.array([TORQUE * (one.torque or 0.0) for one in motion.chain.joints])
    read = STEP * np.round(q / STEP + 0.3 * random.normal(size=q.shape))
    felt = torque + noise[:, None] * random.normal(size=q.shape)
    run = {f"q{k + 1}": one for k, one in enumerate(read)} | {f"tau{k + 1}": one for k, one in enumerate(felt)}
    began = time.process_time()
    found = answer_of_robot(Recording(np.arange(q.shape[1]) / RATE, run, RATE), motion.model)
    seconds = time.process_time() - began
    return found, bound(motion, q, v, a, noise), seconds


def row(name: str, place: Path, seeds: int, advance: Advance) -> tuple[list[str], list[str]]:
    """As in HEADER, and what is wrong."""
    path, joints = place / ROBOTS[name][0], ROBOTS[name][1]
    with tempfile.TemporaryDirectory() as folder:
        model, chain = _compiled(Path(folder) / "arm.py", path, joints)
        began = time.process_time()
        motion = designed_motion(model, DURATION, RATE)
        design = time.process_time() - began
        off: list[Float] = []
        scores: list[Float] = []
        warned, cpu, faults, lost, answered = 0, [], [], 0, 0
        for seed in range(seeds):
            random = np.random.default_rng(seed)
            spec = changed(path, joints, chain, random)
            (Path(folder) / "arm.xml").write_text(spec.to_xml(), encoding="utf-8")
            _, other = _compiled(Path(folder) / f"truth{seed}.py", Path(folder) / "arm.xml", joints)
            truth = np.array([other.of_file(one) for one in other.base], np.float64)
            try:
                found, least, seconds = answer(motion, spec, random)
            except PvidError:
                advance()
                continue
            answered += 1
            values = [found.values[one] for one in model.p_names]
            known = np.array([one.value is not None for one in values])
            error = np.array([(one.value or 0.0) - x for one, x in zip(values, truth, strict=True)])
            sizes = np.array([(one.se_noise or np.inf, one.se or np.inf) for one in values])
            off.append(np.where(known, error / least, np.nan))
            scores.append(error[:, None] / sizes)
            warned, lost = warned + bool(found.verdict.reasons), lost + int((~known).sum())
            cpu.append(seconds)
            wrong = (np.abs(scores[-1][:, 1]) > 4) & (np.abs(error) > 0.02 * np.abs(truth))
            told = {name for one in found.verdict.reasons for name in one.of}
            if wrong[[name not in told for name in model.p_names]].any():
                faults.append(f"{name}, {seed}: {np.array(model.p_names)[wrong]} are wrong without a warning")
            advance()
    head = [name, f"{len(chain.joints)}", f"{len(chain.base)}", f"{design:.0f}"]
    if not answered:
        return [*head, "-", f"0 of {seeds}", *["-"] * 7], faults
    ratio = np.sqrt(np.nanmean(np.square(off), axis=0))
    score = np.abs(np.array(scores))
    inside = [f"{100 * float(np.mean(score[..., k] < 2)):.1f}" for k in (0, 1)]
    counted = [f"{np.median(cpu):.1f}", f"{answered} of {seeds}", f"{lost}"]
    shown = [f"{np.median(ratio):.2f}", f"{ratio.max():.2f}", *inside, f"{score[..., 1].max():.1f}", f"{warned}"]
    return [*head, *counted, *shown], faults


def _compiled(out: Path, path: Path, joints: Sequence[str]) -> tuple[CompiledModel, Chain]:
    out.write_text(model_text(path, joints), encoding="utf-8")
    model = compiled_of(out)
    assert model.chain is not None
    return model, model.chain


def report(robot: Sequence[str], seeds: int, advance: Advance) -> Report:
    """As the command prints it."""
    if unknown := set(robot) - set(ROBOTS):
        raise PvidError(f"no such robot: {', '.join(sorted(unknown))}; there are {', '.join(ROBOTS)}")
    found = [row(name, files(), seeds, advance) for name in robot or tuple(ROBOTS)]
    return Report([("robots", HEADER, [one for one, _ in found])], [fault for _, some in found for fault in some])
