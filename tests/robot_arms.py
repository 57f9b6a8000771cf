"""Arms, and the torques of rigid bodies by Newton and Euler in the frame of the base, with accelerations: an author of
its own beside the momenta of pvid.model.chain."""

import math

import numpy as np
import numpy.typing as npt

from pvid.model.chain import Chain, Joint, rotation_of

Float = npt.NDArray[np.float64]
H = math.pi / 2
# Modified Denavit and Hartenberg: alpha, a, d of each joint, which turns about z.
DH = {
    "spatial": [(0, 0, 0.3), (-H, 0, 0), (0, 0.4, 0)],
    "puma": [(0, 0, 0), (-H, 0, 0.24), (0, 0.43, -0.09), (H, -0.02, 0.43), (-H, 0, 0), (H, 0, 0)],
    "panda": [
        *[(0, 0, 0.333), (-H, 0, 0), (H, 0, 0.316), (H, 0.0825, 0), (-H, -0.0825, 0.384), (H, 0, 0), (H, 0.088, 0.107)]
    ],
}


def inertial(random: np.random.Generator, mass: float) -> tuple[float, ...]:
    """Of a body that is possible."""
    centre, spread = random.uniform(-0.1, 0.1, 3) + [0.1, 0, 0.05], random.normal(size=(3, 3)) * 0.08
    second = mass * (spread @ spread.T)
    about = np.trace(second) * np.eye(3) - second + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return (mass, *(mass * centre), *about[np.triu_indices(3)])


def arm(name: str, seed: int = 0) -> Chain:
    """One of DH with bodies at random."""
    random = np.random.default_rng(seed)
    joints = [
        Joint(f"j{k}", k - 1, (0.0, 0.0, 1.0), (a, -math.sin(alpha) * d, math.cos(alpha) * d),
              rotation_of((alpha, 0, 0)), inertial=inertial(random, 5.0 / (k + 1)))
        for k, (alpha, a, d) in enumerate(DH[name])
    ]  # fmt: skip
    return Chain(tuple(joints))


def tree(seed: int, joints: int) -> Chain:
    """Any tree: oblique axes, joints that slide, rotors."""
    random = np.random.default_rng(seed)
    out = []
    for k in range(joints):
        axis = random.normal(size=3) if k % 2 else np.eye(3)[random.integers(3)]
        axis = axis / np.linalg.norm(axis)
        out.append(
            Joint(
                f"j{k}",
                int(random.integers(-1, k)) if k else -1,
                (float(axis[0]), float(axis[1]), float(axis[2])),
                tuple(random.uniform(-0.3, 0.3, 3)),
                rotation_of([float(one) for one in random.uniform(-3, 3, 3)]),
                prismatic=k % 3 == 2,
                inertial=inertial(random, 2.0),
                rotor=0.1 * k if k % 2 else None,
            )
        )
    return Chain(tuple(out), (1.0, -2.0, -9.0))


def _turned(axis: Float, angle: Float) -> Float:
    """Rotations about a unit vector [states, 3, 3]."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = (one[:, np.newaxis, np.newaxis] for one in (np.sin(angle), np.cos(angle)))
    return np.asarray(np.eye(3) + s * k + (1 - c) * (k @ k))


def torques(chain: Chain, q: Float, v: Float, a: Float) -> Float:
    """[n, states], without friction."""
    states = q.shape[1]
    zero = np.zeros((states, 3))
    frames: list[tuple[Float, Float, Float, Float, Float]] = []
    for joint, angle, rate, more in zip(chain.joints, q, v[..., np.newaxis], a[..., np.newaxis], strict=True):
        rotation, at, w, dw, acceleration = frames[joint.parent] if joint.parent >= 0 else (
            np.broadcast_to(np.eye(3), (states, 3, 3)), zero, zero, zero, zero - np.array(chain.gravity)
        )  # fmt: skip
        turned = rotation @ np.array(joint.turned)
        axis = turned @ np.array(joint.axis)
        place = rotation @ np.array(joint.origin) + (angle[:, np.newaxis] * axis if joint.prismatic else 0.0)
        moved = acceleration + np.cross(dw, place) + np.cross(w, np.cross(w, place))
        if joint.prismatic:
            moved = moved + 2 * np.cross(w, axis) * rate + axis * more
        else:
            dw = dw + axis * more + np.cross(w, axis) * rate
            w = w + axis * rate
            turned = turned @ _turned(np.array(joint.axis), angle)
        frames.append((turned, at + place, w, dw, moved))
    out = np.array([(one.rotor or 0.0) * more for one, more in zip(chain.joints, a, strict=True)])
    for body, joint in enumerate(chain.joints):
        assert joint.inertial is not None
        mass, *rest = joint.inertial
        turned, at, w, dw, moved = frames[body]
        about = np.zeros((3, 3))
        about[np.triu_indices(3)] = rest[3:]
        about = about + np.triu(about, 1).T
        centre = turned @ (np.array(rest[:3]) / (mass or 1.0))
        force = mass * (moved + np.cross(dw, centre) + np.cross(w, np.cross(w, centre)))
        spin, more = (np.einsum("sij,jk,slk,sl->si", turned, about, turned, one, optimize=True) for one in (w, dw))
        moment = more + np.cross(w, spin) + mass * np.cross(centre, moved)  # about the frame's origin
        above = body
        while above >= 0:
            axis = frames[above][0] @ np.array(chain.joints[above].axis)
            acting = moment + np.cross(at - frames[above][1], force)
            out[above] += np.sum(axis * (force if chain.joints[above].prismatic else acting), axis=1)
            above = chain.joints[above].parent
    return out


def motion(
    joints: int, seconds: float, rate: float, seed: int, stops: float = 0.0
) -> tuple[Float, Float, Float, Float]:
    """Times [s], positions, rates and accelerations [n, samples] of sines; the second joint moves for `stops` s, then
    rests as long."""
    random, t = np.random.default_rng(seed), np.arange(int(seconds * rate)) / rate
    q, v, a = np.zeros((3, joints, len(t)))
    for k in range(joints):
        time, pace, change = t, np.ones(len(t)), np.zeros(len(t))
        if stops and k == 1:
            turn = 2 * math.pi * np.minimum(t % (2 * stops), stops) / stops
            pace, change = 1 - np.cos(turn), 2 * math.pi / stops * np.sin(turn)
            time = stops * (t // (2 * stops) + (turn - np.sin(turn)) / (2 * math.pi))
        for harmonic in range(1, 6):
            w, size, phase = 0.7 * harmonic, random.normal() * 0.5 / harmonic**0.5, random.uniform(0, 2 * math.pi)
            q[k] += size * np.sin(w * time + phase)
            v[k] += size * w * np.cos(w * time + phase) * pace
            a[k] += size * w * (np.cos(w * time + phase) * change - w * np.sin(w * time + phase) * pace**2)
    return t, q, v, a


def log_of(
    chain: Chain,
    seed: int,
    *,
    seconds: float = 20.0,
    rate: float = 500.0,
    bits: int = 16,
    blur: float = 0.3,
    noise: float = 0.02,
    viscous: float = 0.5,
    dry: float = 1.0,
    soft: float = 0.0,
    stops: float = 0.0,
) -> dict[str, Float]:
    """A recording of an arm: encoders with so many bits a turn, white noise of `blur` of their steps, and torques with
    relative noise; `soft`: the speed at which dry friction has tanh(1) of its size; `stops` as of `motion`: at each
    rest, friction carries another part of the load."""  # fmt: skip
    t, q, v, a = motion(len(chain.joints), seconds, rate, seed, *([stops] if stops else []))
    exact = torques(chain, q, v, a)
    exact += viscous * v + dry * (np.tanh(v / soft) if soft else np.sign(v))
    if stops:
        carried = np.random.default_rng(seed + 2000).uniform(-dry, dry, int(seconds / stops) + 1)
        exact[1, v[1] == 0] += carried[(t // (2 * stops)).astype(int)][v[1] == 0]
    random, step = np.random.default_rng(seed + 1000), 2 * math.pi / 2**bits
    positions = np.round((q + blur * step * random.normal(size=q.shape)) / step) * step
    measured = exact + noise * exact.std(axis=1, keepdims=True) * random.normal(size=exact.shape)
    out = {f"q{k + 1}": one for k, one in enumerate(positions)}
    return {"t": t} | out | {f"tau{k + 1}": one for k, one in enumerate(measured)}
