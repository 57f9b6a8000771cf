"""What the sensors of a random rig record: full equations of motion, then the imperfections of its sensors."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bench.campaign.bound import cramer_rao
from bench.campaign.motion import accelerations, integrate, relative_angle, step_of
from bench.campaign.population import Population, RandomRig
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Run

Float = npt.NDArray[np.float64]

# Changes with anything that changes the data of a rig: kept ones are made anew.
GENERATOR = 1

_ATTEMPTS = 400
_SCALINGS = 12  # of a release, to the angle wanted
_CLOSE = 0.1  # to it, relative
# A motion that is this much larger at some time than in its first two slow periods is in parametric resonance.
_GROWTH = 3.0
# Dry friction is full from this part of the rate on that the angle and the slow mode make.
_SLIP = 0.02


@dataclass(frozen=True, eq=False)
class SimulatedRig:
    """A random rig, the run that its sensors recorded, and the truth.

    Attributes
    ----------
    rig : as drawn
    run : what the sensors recorded
    file : the rig of a user of this rig
    p : the truth's (w, d1, d2), shape (3,)
    bound : Cramer-Rao bound of their relative standard errors from the whole run, shape (3,)
    largest : largest |phi| [rad]
    """

    rig: RandomRig
    run: Run
    file: MechanismRig
    p: Float
    bound: Float
    largest: float


def simulate_rig(native: Native, population: Population, seed: int, index: int) -> SimulatedRig:
    """Rig `index` of a seed: always the same."""
    rig, state, step_s, slip = _moving(native, population, seed, index)
    counts = measure(rig, state, step_s)
    acceleration = accelerations(rig.motion, len(state) - 1, step_s)
    bound = cramer_rao(
        native,
        rig.pendulum,
        state[0],
        acceleration,
        step_s,
        density=rig.sample_rate * step_s,
        noise=rig.phi_lsb * math.sqrt(1 / 12 + rig.phi_noise**2),
        dry=rig.dry,
        slip=slip,
        slant=rig.slant,
    )
    return _assembled(rig, *counts, bound, float(np.abs(state[:, 1] - state[:, 0]).max()))


def _assembled(
    rig: RandomRig, phi: npt.NDArray[np.int32], y: npt.NDArray[np.int32], bound: Float, largest: float
) -> SimulatedRig:
    run = Run(
        t=np.arange(len(phi)) / rig.sample_rate,
        phi=rig.phi_lsb * phi.astype(np.float64),
        y=rig.y_lsb * y.astype(np.float64),
        sample_rate=rig.sample_rate,
    )
    return SimulatedRig(rig, run, rig_file(rig), rig.pendulum.linear, bound, largest)


def rig_file(rig: RandomRig) -> MechanismRig:
    """What a user of this rig knows: rod 1, the sensors' resolution, a guess of body 2, and gravity untilted."""
    return MechanismRig(
        "kapitza",
        rig.sample_rate,
        known={"l1": rig.pendulum.l1},
        sensor={"phi": {"resolution": rig.phi_lsb}, "y": {"resolution": rig.y_lsb}},
        nominal={"l2": rig.guess_l2, "rho2": rig.guess_rho2, "g": 9.8},
    )


def _moving(native: Native, population: Population, seed: int, index: int) -> tuple[RandomRig, Float, float, float]:
    """The first attempt at a rig that moves as it is to: rig, states [n, 4], step [s], slip rate [rad/s]."""
    for attempt in range(_ATTEMPTS):
        rig = population.draw(seed, index, attempt)
        if rig is None:
            continue
        found = _released(native, rig)
        if found is not None:
            return rig, *found
    raise PvidError(
        f"rig {index} of condition {population.condition_of(seed, index)} cannot be drawn: of {_ATTEMPTS} attempts "
        f"none has a sample rate and a drive that fit and a motion of the angle wanted"
    )


def _released(native: Native, rig: RandomRig) -> tuple[Float, float, float] | None:
    """States, step and slip rate with the release scaled so that the largest angle is the one wanted."""
    slow, fast = rig.modes_hz
    slip = _SLIP * rig.angle * 2 * math.pi * slow
    steps, step_s = step_of(rig.pendulum, fast, rig.motion, rig.dry, slip, rig.duration + 1 / rig.sample_rate)
    acceleration = accelerations(rig.motion, steps, step_s)
    scale = rig.angle
    for _ in range(_SCALINGS):
        start = [scale * rig.release[0], scale * rig.release[1], 0.0, 0.0]
        state = integrate(native, rig.pendulum, start, acceleration, step_s, dry=rig.dry, slip=slip, slant=rig.slant)
        if state is None:
            scale *= 0.2
            continue
        angles = np.abs(np.column_stack([state[:, :2], state[:, 1] - state[:, 0]])).max(axis=1)
        largest = float(angles.max())
        if abs(largest / rig.angle - 1) <= _CLOSE and rig.angle_range[0] <= largest <= rig.angle_range[1]:
            early = float(angles[: math.ceil(2 / (slow * step_s))].max())
            return (state, step_s, slip) if largest <= _GROWTH * early else None
        scale *= float(np.clip(rig.angle / largest, 0.2, 5.0))
    return None


def measure(rig: RandomRig, state: Float, step_s: float) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Counts of the encoder and of the pivot's sensor, at a steady sample rate as they believe.

    Every random number is drawn whatever the imperfections, so that one seed gives one noise for all of them.
    """
    random = np.random.default_rng([rig.seed, 2, rig.index])
    t = np.arange(round(rig.duration * rig.sample_rate)) / rig.sample_rate
    phi_noise, y_noise, delay = (random.standard_normal(len(t)) for _ in range(3))
    t = t + rig.jitter / rig.sample_rate * delay
    phi = relative_angle(state, step_s, t) + rig.zero
    phi = phi + rig.eccentricity * (np.sin(phi + rig.eccentric_at) - math.sin(rig.eccentric_at))
    if rig.backlash > 0:
        phi = _play(phi, rig.backlash / 2)
    level = phi / rig.phi_lsb + rig.phi_noise * phi_noise
    if rig.hysteresis > 0:
        level = _play(level, rig.hysteresis)
    height = (1 + rig.gain) * rig.motion.position(t + rig.skew) / rig.y_lsb + rig.y_noise * y_noise
    return np.rint(level).astype(np.int32), np.rint(height).astype(np.int32)


def _play(x: Float, half: float) -> Float:
    """What follows x with a play of +-half: it stands still until x has taken up the play."""
    out = []
    held = float(x[0])
    for value in x.tolist():
        held = min(max(held, value - half), value + half)
        out.append(held)
    return np.array(out)


# ---- kept on disk


def kept_rig(native: Native, population: Population, seed: int, index: int, folder: Path) -> SimulatedRig:
    """`simulate_rig`, from the folder when it was made there before."""
    path = folder / f"{population.hash}-{GENERATOR}-{seed}-{index}.npz"
    if path.exists():
        with np.load(path) as kept:
            rig = population.draw(seed, index, int(kept["attempt"]))
            if rig is not None:
                return _assembled(rig, kept["phi"], kept["y"], kept["bound"], float(kept["largest"]))
    simulated = simulate_rig(native, population, seed, index)
    folder.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(f".{os.getpid()}.npz")
    np.savez(
        unfinished,
        attempt=simulated.rig.attempt,
        phi=np.rint(simulated.run.phi / simulated.rig.phi_lsb).astype(np.int32),
        y=np.rint(simulated.run.y / simulated.rig.y_lsb).astype(np.int32),
        bound=simulated.bound,
        largest=simulated.largest,
    )
    os.replace(unfinished, path)
    return simulated
