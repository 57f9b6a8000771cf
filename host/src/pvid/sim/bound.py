"""The Cramer-Rao bound of one who assumes nothing from window to window: the state at each window's start is free."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.model.signals import Jet
from pvid.models.simulated_rig import Servo
from pvid.sim.simulated_run import SOFT, RigSimulation

Float = npt.NDArray[np.float64]

_NUDGE = 1e-4  # of a value or of a state's span: sensitivities are right to its square
_DEPENDENT = 1e-13  # of the largest: a combination of starts that the sensors do not show


def bound(simulation: RigSimulation, window_s: float | None = None, windows: int | None = None) -> Float:
    """Least standard errors of the unknowns [n_p] from the rig's run, inf where it does not show one.

    Frictions are soft, of the rig's width; the sensors' noise is that of `Signal.sd`; what a drive sets is known
    exactly, and so are running integrals of it.

    Parameters
    ----------
    window_s : length of the windows [s]; the rig's own by default
    windows : how many of the run's first ones; all by default
    """
    information = information_of(simulation, window_s, windows)
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    shown = size > 0
    scaled = information[np.ix_(shown, shown)] / np.outer(size[shown], size[shown])
    out = np.full(len(size), np.inf)
    out[shown] = np.sqrt(np.diag(np.linalg.inv(scaled))) / size[shown]
    return out


def information_of(simulation: RigSimulation, window_s: float | None = None, windows: int | None = None) -> Float:
    """Fisher's information on the unknowns [n_p, n_p], summed over the windows."""
    rig, plant = simulation.rig, simulation.plant
    truth = simulation.truth
    trajectory = simulation.motion(SOFT)
    n = round((window_s or rig.window_s) * rig.sample_rate)
    known = {jet.of for jet in simulation.model.opaque}  # integrals of what is driven, from the start of the run
    free = [place for place, one in enumerate(plant.motion.states) if isinstance(one, Jet) and one.of not in known]
    span = np.ptp(trajectory.states, axis=0) + 1e-9
    steps = _NUDGE * np.where(truth != 0.0, np.abs(truth), 1.0)
    total = np.zeros((len(truth), len(truth)))
    for first in range(0, simulation.samples - n + 1, n)[:windows]:
        window = _Window(simulation, first, n)
        start = trajectory.states[first]
        slopes = [_slope(window, truth, start, p=place, step=step) for place, step in enumerate(steps)]
        for place in free:
            slopes.append(_slope(window, truth, start, x=place, step=_NUDGE * span[place]) * span[place])
        stacked = np.array(slopes)
        whole = stacked @ stacked.T
        q = len(truth)
        inverse = np.linalg.pinv(whole[q:, q:], rcond=_DEPENDENT, hermitian=True)
        total += whole[:q, :q] - whole[:q, q:] @ inverse @ whole[q:, :q]
    return total


class _Window:
    """Whitened readings of a window as a function of the unknowns and of its start."""

    def __init__(self, simulation: RigSimulation, first: int, samples: int) -> None:
        rig, plant = simulation.rig, simulation.plant
        self.simulation = simulation
        self.samples = samples
        drives = {name: one for name, one in rig.drive.items() if not isinstance(one, Servo)}
        if len(drives) == len(rig.drive):
            self.inputs = plant.inputs(drives, first, samples, rig.sample_rate, rig.substeps)
        else:
            self.inputs = simulation.motion(SOFT).inputs[first : first + samples]
        sensors = [one for one in simulation.model.signals if one.kind == "sensor" and not one.driven]
        names = [str(one) for one in (*plant.motion.states, *plant.motion.highest)]
        self.places = [names.index(one.name) for one in sensors]
        self.sd = np.array([one.sd for one in sensors])

    def readings(self, p: Float, start: Float) -> Float:
        """Over their standard deviations, flat."""
        simulation, rig, plant = self.simulation, self.simulation.rig, self.simulation.plant
        out = plant.advance(
            start.copy(),
            plant.modes(),
            True,
            self.inputs,
            plant.constants(p, rig.knowns),
            rig.sample_rate,
            self.samples,
            rig.substeps,
            simulation.friction(SOFT),
        )
        return np.ravel(np.asarray(out[:, self.places] / self.sd))


def _slope(window: _Window, truth: Float, start: Float, *, step: float, p: int = -1, x: int = -1) -> Float:
    """Derivative of the readings with respect to an unknown or an entry of the start."""
    ends = []
    for sign in (1.0, -1.0):
        constants, state = truth.copy(), start.copy()
        if p >= 0:
            constants[p] += sign * step
        else:
            state[x] += sign * step
        ends.append(window.readings(constants, state))
    return (ends[0] - ends[1]) / (2.0 * step)
