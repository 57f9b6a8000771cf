"""pysindy's weak form on the mechanisms that it can express: x' = C f(x, u) with measured states x.

It has no ties between equations (k is in both of a motor), no hidden states and no mass matrix. The motor, with a
velocity from a polynomial smoother for a state, and the rigid body are within its reach. The parameters follow from
its coefficients by hand, here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from pvid.base.errors import PvidError
from pvid.rig.run import Recording
from pvid.sim.simulated_run import RigSimulation

Float = npt.NDArray[np.float64]

_SEED = 1
_DOMAINS = 400  # windows at random places
_POWER = 6  # of the bumps (1 - x^2)^p
_TAPS, _DEGREE = 31, 3  # of the velocity
_ITS_RIDGE = 1e-12  # as good as none


@dataclass(frozen=True)
class Form:
    """A mechanism as pysindy takes it.

    Attributes
    ----------
    states : [n, states]
    terms : what else stands on the right, beside 1 and the states [n, terms]
    parameters : of the coefficients [states, 1 + states + terms] those of the mechanism, in its order
    window_s : of a domain [s]
    """

    states: Float
    terms: Float
    parameters: Callable[[Float], Float]
    window_s: float


def identified(simulation: RigSimulation, run: Recording) -> Float:
    """The parameters of a mechanism [n_p].

    Raises
    ------
    PvidError
        When pysindy cannot express it, or is not installed.
    """
    name = simulation.model.name
    if name not in FORMS:
        raise PvidError(f"pysindy's weak form cannot express {name}")
    form = FORMS[name](simulation, run)
    return form.parameters(_coefficients(form, run.t))


def _coefficients(form: Form, t: Float) -> Float:
    """C, shape [states, 1 + states + terms], no term left out."""
    try:
        import pysindy
    except ImportError as error:
        raise PvidError("this comparison needs pysindy: build/venv/bin/python -m pip install pysindy") from error
    library = pysindy.WeakPDELibrary(
        function_library=pysindy.PolynomialLibrary(degree=1, include_bias=True),
        spatiotemporal_grid=t,
        K=_DOMAINS,
        H_xt=[form.window_s / 2],
        p=_POWER,
        is_uniform=True,
    )
    np.random.seed(_SEED)  # pysindy draws the places of its domains from numpy's global numbers
    model = pysindy.SINDy(feature_library=library, optimizer=pysindy.STLSQ(threshold=0.0, alpha=_ITS_RIDGE))
    scale = np.abs(form.terms).max(axis=0)
    model.fit(form.states, t=t, u=form.terms / scale)
    found = np.array(model.coefficients(), dtype=np.float64)
    found[:, 1 + form.states.shape[1] :] /= scale
    return found


def _middle(held: Float) -> Float:
    """The mean of a held input about each sample."""
    return np.concatenate([held[:1], (held[1:] + held[:-1]) / 2])


def _motor(simulation: RigSimulation, run: Recording) -> Form:
    """States i and the velocity; terms V and the sign of the velocity."""
    velocity = savgol_filter(run.signals["phi"], _TAPS, _DEGREE, deriv=1, delta=1 / run.sample_rate)
    sign = np.sign(velocity)

    def parameters(c: Float) -> Float:
        electric, mechanical = c
        inductance = 1 / electric[3]
        resistance, k = -electric[1] * inductance, -electric[2] * inductance
        inertia = k / mechanical[1]
        values = {
            "R": resistance,
            "L": inductance,
            "k": k,
            "J": inertia,
            "b": -mechanical[2] * inertia,
            "Tc": -mechanical[4] * inertia,
            "i0": electric[0] * inductance / resistance,
        }
        return np.array([values[name] for name in simulation.model.p_names])

    states = np.column_stack([run.signals["i"], velocity])
    return Form(states, np.column_stack([_middle(run.signals["V"]), sign]), parameters, window_s=0.2)


def _body(simulation: RigSimulation, run: Recording) -> Form:
    """States the rates; terms their products and the torques. The inertia is the inverse of what torques are worth."""
    gyros = [one.name for one in simulation.model.signals if one.kind == "sensor"]
    torques = [one.name for one in simulation.model.signals if one.kind == "input"]
    w = np.column_stack([run.signals[name] for name in gyros])
    products = [w[:, j] * w[:, k] for j in range(3) for k in range(j, 3)]
    held = [_middle(run.signals[name]) for name in torques]

    def parameters(c: Float) -> Float:
        inertia = np.linalg.inv(c[:, -3:])
        inertia = (inertia + inertia.T) / 2
        places = {"x": 0, "y": 1, "z": 2}
        return np.array([inertia[places[name[1]], places[name[2]]] for name in simulation.model.p_names])

    return Form(w, np.column_stack([*products, *held]), parameters, window_s=0.5)


FORMS: dict[str, Callable[[RigSimulation, Recording], Form]] = {"dc_motor": _motor, "rigid_body": _body}
