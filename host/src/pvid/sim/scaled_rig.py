"""The shipped simulated rig of a mechanism, scaled to other constants and parameters.

What differs is time and the size of the drives. The natural rates of the equations at rest (pvid.sim.linearised) say
how much longer the slow motion and how much slower the fast one takes; drives are stretched by the geometric mean of
both, and are so large that they act as strongly on the highest derivatives, so that coordinates move as far as there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel
from pvid.model.signals import Jet
from pvid.models.drive import Drive, Scaled
from pvid.models.mechanisms import compiled_of
from pvid.models.registry import names
from pvid.models.simulated_rig import Servo, SimulatedRig, simulated_rig
from pvid.sim.linearised import Linearised
from pvid.sim.simulated_run import RigSimulation, simulation_of

_DETUNED = (1.0, 1.07, 0.93, 1.15, 0.87, 1.25, 0.8)  # of the drive, away from a resonance of the guess
_GROWN = 4.0  # largest motion of a sensor that no resonance drives, over that of the shipped rig
_MOST_SAMPLES = 100_000


@dataclass(frozen=True)
class ScaledRig:
    """A simulated rig like the shipped one.

    Attributes
    ----------
    simulation : of the rig
    longer, slower : times of the slow and of the fast motion over those of the shipped rig
    """

    simulation: RigSimulation
    longer: float
    slower: float


def scaled_rig(compiled: CompiledModel, sample_rate: float, most: Mapping[str, float] | None = None) -> ScaledRig:
    """A rig whose truth is the guess of a shipped mechanism's model.

    Raises PvidError where the mechanism has no simulated rig, the samples are too slow for its motion, or no drive
    keeps the simulation within bounds.

    Parameters
    ----------
    most : largest value of a drive, by name, where the rig has one
    """
    if compiled.name not in names():
        raise PvidError(
            f"{compiled.name} has no simulated rig: name a recording of it with --run, from which the design is made"
        )
    shipped, standard = simulated_rig(compiled.name), compiled_of(compiled.name)
    guess, knowns = {one.name: one.guess for one in compiled.unknowns}, {one.name: one.value for one in compiled.knowns}
    usual = Linearised.of(standard, [shipped.truth[name] for name in standard.p_names], shipped.knowns)
    own = Linearised.of(compiled, list(guess.values()), knowns)
    longer, slower = _times(usual, own, sample_rate)
    faster = 1.0 / math.sqrt(longer * slower)
    start = _start(shipped, usual, own, faster)
    gains = _gains(shipped, (usual, own), start, faster, most or {})
    like = replace(
        shipped,
        truth=guess,
        start=start,
        sample_rate=sample_rate,
        duration=min(shipped.duration * longer, _MOST_SAMPLES / sample_rate),
        substeps=max(1, math.ceil(shipped.sample_rate * shipped.substeps / (sample_rate * slower))),
        friction_width=shipped.friction_width * faster,
        knowns=knowns,
    )
    smallest, best = math.inf, None
    for factor in _DETUNED:
        drive = {name: _scaled(one, gains[name], factor * faster) for name, one in shipped.drive.items()}
        simulation = RigSimulation.of(compiled, replace(like, drive=drive))
        grown = _grown(simulation)
        if grown < smallest:
            smallest, best = grown, simulation
        if grown < _GROWN:
            break
    if best is None:
        raise PvidError(
            f"{compiled.title}: a simulation with the guess of the rig goes beyond all bounds: name a recording with "
            "--run, from which the design is made"
        )
    return ScaledRig(best, longer, slower)


def _times(usual: Linearised, own: Linearised, sample_rate: float) -> tuple[float, float]:
    """How much longer the slow motion and how much slower the fast one is."""
    there, here = usual.natural_hz(), own.natural_hz()
    if there is None or here is None or there[2] != here[2]:
        return 1.0, 1.0
    if here[2] and here[1] > sample_rate / 2:
        raise PvidError(
            f"a sample rate of {sample_rate:g} Hz does not show a motion of {here[1]:.3g} Hz, which the guess of the "
            "rig has: is sample_rate in Hz, and are constants and guesses in the units of the model?"
        )
    return there[0] / here[0], there[1] / here[1]


def _start(shipped: SimulatedRig, usual: Linearised, own: Linearised, faster: float) -> dict[str, float]:
    """As far from rest as there; a coordinate that follows a reference starts where it does there."""
    follows = {one.coordinate for one in shipped.drive.values() if isinstance(one, Servo)}
    start = {}
    for symbol, moved in zip(own.motion.states, own.rest() - usual.rest(), strict=True):
        name, order = str(symbol), symbol.order if isinstance(symbol, Jet) else 0
        there = shipped.start.get(name, 0.0)
        start[name] = there if name in follows else float(there * faster**order + moved)
    return start


def _gains(
    shipped: SimulatedRig,
    equations: tuple[Linearised, Linearised],
    start: Mapping[str, float],
    faster: float,
    most: Mapping[str, float],
) -> dict[str, float]:
    """How much larger each drive is than the shipped rig's (equations: there, and here)."""
    found = {}
    for name, drive in shipped.drive.items():
        there, here = (
            one.strength(name, of, rate)
            for one, of, rate in zip(equations, (shipped.start, start), (1.0, faster), strict=True)
        )
        acts = (there > 0) & (here > 0)
        gain = float(np.exp(np.mean(np.log(there[acts] / here[acts])))) if acts.any() else 1.0
        if name in most and not isinstance(drive, Servo):
            t = np.arange(round(shipped.duration * shipped.sample_rate)) / shipped.sample_rate
            gain = min(gain, most[name] / float(np.abs(drive.values(t)).max()))
        found[name] = gain
    return found


def _scaled(drive: Drive | Servo, gain: float, faster: float) -> Drive | Servo:
    if not isinstance(drive, Servo):
        return Scaled(drive, gain, faster)
    tones = tuple((size, hz * faster, phase) for size, hz, phase in drive.reference.tones)
    reference = replace(drive.reference, tones=tones)
    others = {name: gain / faster ** name.endswith("_1") * one for name, one in drive.others.items()}
    return replace(drive, reference=reference, kp=gain * drive.kp, kd=gain / faster * drive.kd, others=others)


def _grown(simulation: RigSimulation) -> float:
    """Largest motion of a sensor that nothing sets, over that of the shipped rig; NaN where it has no bounds."""
    shipped = simulation_of(simulation.model.name)
    with np.errstate(all="ignore"):
        moved = [
            np.ptp(simulation.motion()[one.name]) / np.ptp(shipped.motion()[one.name])
            for one in simulation.model.signals
            if one.kind == "sensor" and not one.driven
        ]
    return float(np.max(moved))
