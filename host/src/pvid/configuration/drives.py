"""Which standard errors a drive will give, before anything is built: each drive is simulated and identified."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.oracle.weak.choice import ranked
from pvid.oracle.weak.identify import identify, ready
from pvid.oracle.weak.verdict import partner_of
from pvid.sim.simulated_run import RigSimulation

Float = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """What a drive tells of a mechanism.

    Attributes
    ----------
    drive : its name
    relative : standard error of each parameter over its value, of one of either sign over the sd of its guess [n_p];
        inf where the simulation or the identification failed
    worst, partner : the parameter with the largest one, and the one that imitates it best; "" : none does
    failure : why there is no prediction; "": there is one
    """

    drive: str
    relative: Float
    worst: str = ""
    partner: str = ""
    failure: str = ""

    @property
    def score(self) -> float:
        """Geometric mean of the relative errors."""
        return float(np.exp(np.mean(np.log(self.relative))))


def predicted(name: str, simulation: RigSimulation) -> Prediction:
    """Of one drive, from a simulated run at the rig's truth."""
    model = simulation.model
    try:
        run = simulation.run(0)
        run.pop("t")
        found = identify(model, run, simulation.rig.sample_rate, start=simulation.truth)
    except (PvidError, np.linalg.LinAlgError) as error:
        return Prediction(name, np.full(len(model.unknowns), np.inf), failure=str(error))
    relative = found.se / _sizes(simulation)
    worst = int(np.argmax(relative))
    partner = partner_of(found.fit, worst)
    return Prediction(name, relative, model.p_names[worst], "" if partner is None else model.p_names[partner])


def predicted_in_core(simulation: RigSimulation) -> Prediction:
    """Of one drive, by the best design of those that the weak form in C has for a commissioning."""
    try:
        run = simulation.run(0)
        run.pop("t")
        sample_rate = simulation.rig.sample_rate
        found = ranked(ready(simulation.model), run, sample_rate, simulation.truth, reversals="decided")[0]
    except (PvidError, np.linalg.LinAlgError) as error:
        return Prediction("", np.full(len(simulation.truth), np.inf), failure=str(error))
    relative = found.error / _sizes(simulation)
    return Prediction("", relative, simulation.model.p_names[int(np.argmax(relative))])


def _sizes(simulation: RigSimulation) -> Float:
    """What an error of each parameter is compared with [n_p]."""
    unknowns = zip(simulation.model.unknowns, simulation.truth, strict=True)
    return np.array([abs(p) if one.positive else one.sd for one, p in unknowns])


def advice(found: list[Prediction]) -> str:
    """One sentence: the best drive, the parameter that it determines worst, and what imitates it."""
    able = [one for one in found if not one.failure]
    if not able:
        return "No drive of the list could be simulated and identified: " + found[0].failure
    best = min(able, key=lambda one: one.score)
    error = 100 * float(np.max(best.relative))
    text = f"Best drive: {best.drive}. Its worst parameter is {best.worst}, with a standard error of {error:.2g} %"
    if best.partner:
        text += f"; a change of {best.partner} imitates one of {best.worst} best"
    worst = max(able, key=lambda one: one.score)
    ratio = worst.score / best.score
    return f"{text}. The least informative drive, {worst.drive}, gives {ratio:.2g} times larger errors in the mean."
