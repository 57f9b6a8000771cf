"""A pendulum's rig file without a recording: a simulated run of its guess, and the design of the engine for it.

The run and the design are those of the shipped rig, scaled to the guess. Each tone of the drive stands to the slow and
the fast mode of the guess as there, and accelerates the pivot as much in relation to gravity; windows are as many slow
periods long, steps and filters as large a part of the fast one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel
from pvid.models import mechanisms
from pvid.models.drive import Sines
from pvid.models.model import Mechanism
from pvid.models.simulated_rig import SimulatedRig, simulated_rig
from pvid.oracle.weak.choice import score_of
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import ready
from pvid.rig.described import described, refuse_strong
from pvid.rig.file import RigFile
from pvid.run.engine_design import Run, design_for_recording
from pvid.run.mechanism import model_of
from pvid.setup.weak import for_engine
from pvid.sim.pendulum import standard_sensors
from pvid.sim.simulated_run import RigSimulation

_STEPS = 200.0  # of the integration in a period of the fast mode, at least
_DETUNED = (1.0, 1.07, 0.93, 1.15, 0.87, 1.25, 0.8)  # of the drive, away from a resonance of the guess
_GROWN = 4.0  # largest angle of a run that no resonance drives, over that of the release
_SHOWN = 0.2  # largest angle of the run [rad]
_FASTER = 1.35  # fast mode of a design over that of the guess, which may be slower than the rig
_FEWEST = 5  # test functions
_PHI_REACH, _Y_REACH = 0.5, 0.1  # where the rig file has no range [rad], [l1]


@dataclass(frozen=True, eq=False)
class NominalRun:
    """A rig file's model, a run of its guess and a design for it.

    Attributes
    ----------
    compiled : the description of the mechanism with the values of the rig file
    run : name of each signal -> samples [n]
    design : that the engine has
    p : the guess [n_p]
    """

    compiled: CompiledModel
    run: Run
    design: WeakDesign
    p: Float


def model_of_rig_file(rig: RigFile) -> CompiledModel:
    """The description of the mechanism with the values of a rig file; where that has no resolution of a sensor it is
    that of the simulated one."""
    standard, own = standard_sensors(), rig.sensor
    sensor = replace(own, phi_lsb=own.phi_lsb or standard.phi_lsb, y_lsb=own.y_lsb or standard.y_lsb)
    compiled = model_of(described(replace(rig, sensor=sensor)))
    reach = {"phi": own.phi_range or _PHI_REACH, "y": own.y_range or _Y_REACH * rig.l1}
    return replace(compiled, signals=tuple(replace(one, reach=reach[one.name]) for one in compiled.signals))


@cache
def nominal_run(rig: RigFile) -> NominalRun:
    """The run of a rig file's guess.

    Raises
    ------
    PvidError
        Without a sample rate, with one that does not show the modes of the guess, or with a law that the weak form does
        not have.
    """
    refuse_strong(rig)
    if rig.sample_rate is None:
        raise PvidError("sample_rate is required in the rig file: the board samples on its own clock")
    compiled = model_of_rig_file(rig)
    p = np.array([one.guess for one in compiled.unknowns])
    modes = _modes(rig, p)
    released = simulated_rig(rig.model.name).start
    for simulated in _rigs(rig, compiled, modes):
        largest = float(np.abs(RigSimulation.of(compiled, simulated).motion()["phi"]).max())
        if largest < _GROWN * released["phi"]:
            break
    larger = {name: angle * _SHOWN / largest for name, angle in released.items()}  # the equations are linear
    run = RigSimulation.of(compiled, replace(simulated, start=larger)).run()
    run["phi"] = run["phi"] + rig.sensor.phi_zero
    return NominalRun(compiled, run, _design(rig, compiled, run, p, modes), p)


def _modes(rig: RigFile, p: Float) -> tuple[float, ...]:
    """Of the guess [Hz], the slow one first."""
    modes = rig.mechanism.model.modes_hz(p)
    if not modes:
        raise PvidError("the guess of the rig file is that of no pendulum: it has no mode")
    assert rig.sample_rate is not None
    if modes[-1] > rig.sample_rate / 2:
        raise PvidError(
            f"a sample rate of {rig.sample_rate:g} Hz shows no mode of {modes[-1]:.3g} Hz, which the guess of the rig "
            "file has: is sample_rate in Hz, and are the lengths in metres?"
        )
    return modes


def _shipped_modes(rig: RigFile, shipped: SimulatedRig) -> tuple[CompiledModel, Float, tuple[float, ...]]:
    """The shipped rig's model, parameters and modes."""
    standard = mechanisms.compiled_of(rig.model.name)
    p = np.array([shipped.truth[name] for name in standard.p_names])
    return standard, p, rig.mechanism.model.modes_hz(p)


def _rigs(rig: RigFile, compiled: CompiledModel, modes: tuple[float, ...]) -> Iterator[SimulatedRig]:
    """With the guess as the truth, but an encoder without offset; each with the drive's frequencies by another
    factor."""
    shipped = simulated_rig(rig.model.name)
    standard, p, (slow, fast) = _shipped_modes(rig, shipped)
    gravity = Mechanism(rig.mechanism.model, {one.name: one.value for one in standard.knowns}).physical(p)[0]
    drive = shipped.drive["y"]
    assert isinstance(drive, Sines) and rig.sample_rate is not None
    stretched = math.log(modes[1] / modes[0]) / math.log(fast / slow)
    for factor in _DETUNED:
        tones = []
        for amplitude, hz, phase in drive.tones:
            own = factor * modes[0] * (hz / slow) ** stretched
            tones.append((float(amplitude * rig.nominal.g / gravity * (hz / own) ** 2), own, phase))
        yield replace(
            shipped,
            truth={one.name: one.guess if one.positive else 0.0 for one in compiled.unknowns},
            drive={"y": Sines(tuple(tones))},
            sample_rate=rig.sample_rate,
            duration=shipped.duration * slow / modes[0],
            substeps=max(1, math.ceil(_STEPS * modes[1] / rig.sample_rate)),
            knowns={one.name: one.value for one in compiled.knowns},
        )


def _design(rig: RigFile, compiled: CompiledModel, run: Run, p: Float, modes: tuple[float, ...]) -> WeakDesign:
    """The shipped rig's, scaled; where that does not suit the guess, the one with the least predicted errors."""
    shipped = simulated_rig(rig.model.name)
    slow, fast = _shipped_modes(rig, shipped)[2]
    assert rig.sample_rate is not None
    try:
        scaled = for_engine(_scaled(shipped, rig.sample_rate, slow / modes[0], fast / (_FASTER * modes[1])))
        found = score_of(ready(compiled), run, scaled, p, False)
    except PvidError:  # a design that there is not, as with few samples in a window
        found = None
    if found is not None and found.known:
        return found.design
    return design_for_recording(ready(compiled), run, rig.sample_rate).design


def _scaled(shipped: SimulatedRig, rate: float, longer: float, slower: float) -> WeakDesign:
    """The shipped rig's design with windows that are `longer`, and steps and filters that are `slower`, than there."""
    of = WeakDesign(shipped.sample_rate, shipped.window_s, **shipped.design)  # type: ignore[arg-type]
    raw = slower * rate / shipped.sample_rate  # samples a sample of the shipped rig
    decimation = max(1, round(raw * of.decimation))
    band = of.highest * longer / slower  # harmonics up to the same multiple of the fast mode
    return replace(
        of,
        sample_rate=rate,
        window_s=longer * of.window_s,
        functions=max(2 * round(band - of.power // 2) + 1, _FEWEST),
        decimation=decimation,
        taps=max(round(decimation * of.taps / of.decimation) | 1, of.degree + 3) if decimation > 1 else 1,
        rate_taps=max(round(raw * of.rate_taps) | 1, of.rate_degree + 3),
        comb=decimation > 1,
    )
