"""A rig without a recording: a simulated run of its guess, and the design of the weak identifier for it.

The run is that of the shipped rig, scaled to the guess (pvid.sim.scaled_rig). So is the design: windows are as many
slow periods long, steps and filters as large a part of the fast one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pvid.base.errors import PvidError
from pvid.configuration.weak import design_for_recording
from pvid.configuration.weak_tables import for_core
from pvid.model.compiled import CompiledModel
from pvid.models.drive import Sines
from pvid.models.simulated_rig import SimulatedRig, simulated_rig
from pvid.oracle.weak.choice import Scored, score_of
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import ready
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.sim.scaled_rig import ScaledRig, scaled_rig
from pvid.sim.simulated_run import RigSimulation

_FASTER = 1.35  # fast motion of a design over that of the guess, which may be slower than the rig
_FEWEST = 5  # test functions


@dataclass(frozen=True, eq=False)
class NominalRun:
    """A rig's model, a run of its guess and a design for it.

    Attributes
    ----------
    compiled : the mechanism with the values of the rig
    recording : of the guess
    chosen : a design that the identifier has, with its predicted errors
    p : the guess [n_p]
    """

    compiled: CompiledModel
    recording: Recording
    chosen: Scored
    p: Float


def nominal_run(
    rig: MechanismRig, tones: Sequence[tuple[float, float, float]] = (), duration: float | None = None
) -> NominalRun:
    """The run of a rig's guess.

    Raises PvidError without a sample rate, with tones for a mechanism that has not one drive, or where there is no such
    run (see `scaled_rig`).

    Parameters
    ----------
    tones : of another drive, as in Sines; none: the shipped rig's, scaled
    duration : [s]; None: the shipped rig's, scaled
    """
    if rig.sample_rate is None:
        raise PvidError("sample_rate is required in the rig file: the board samples on its own clock")
    compiled = rig.compiled()
    most = {name: keys["reach"] for name, keys in rig.sensor.items() if "reach" in keys}
    scaled = scaled_rig(compiled, rig.sample_rate, most)
    run = _driven(scaled.simulation, tones, duration).run()
    recording = Recording(run.pop("t"), run, rig.sample_rate)
    p = np.array([one.guess for one in compiled.unknowns])
    return NominalRun(compiled, recording, _design(compiled, recording, p, scaled), p)


def _driven(
    simulation: RigSimulation, tones: Sequence[tuple[float, float, float]], duration: float | None
) -> RigSimulation:
    rig = simulation.rig
    if tones:
        if len(rig.drive) != 1:
            raise PvidError(f"{rig.model} has {len(rig.drive)} drives: --tone is for a mechanism with one")
        rig = replace(rig, drive=dict.fromkeys(rig.drive, Sines(tuple(tones))))
    if duration is not None:
        rig = replace(rig, duration=duration)
    return simulation if rig is simulation.rig else RigSimulation.of(simulation.model, rig)


def _design(compiled: CompiledModel, recording: Recording, p: Float, scaled: ScaledRig) -> Scored:
    """The shipped rig's, scaled; where that does not suit the guess, the one with the least predicted errors."""
    model = ready(compiled)
    try:
        like = _scaled(simulated_rig(compiled.name), recording.sample_rate, scaled.longer, scaled.slower / _FASTER)
        found = score_of(model, recording.signals, for_core(like), p, False)
    except PvidError:  # a design that there is not, as with few samples in a window
        found = None
    if found is not None and found.known:
        return found
    return design_for_recording(model, recording.signals, recording.sample_rate)


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
        comb=of.comb and decimation > 1,
    )
