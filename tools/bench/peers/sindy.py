"""pysindy: the weak form, with a library of the terms that the equations have; states that are not measured by
Savitzky and Golay."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.peers.rigs import NONE, Fit, Float, Rig, Run, Values, centred, derivatives

PACKAGE = "pysindy==2.1.0"
RIGS = ("dc_motor", "free_pendulum")


def coefficients(states: Float, u: Float | None, functions: list[Any], t: Float) -> Float:
    """Of the library's terms in the rates of the states [k, terms]."""
    import pysindy as ps

    with np.errstate(all="ignore"):
        library = ps.WeakPDELibrary(
            ps.CustomLibrary(library_functions=functions, interaction_only=False),
            spatiotemporal_grid=t,
            K=400,
            H_xt=[0.1],
        )
        model = ps.SINDy(optimizer=ps.STLSQ(threshold=0.0, alpha=0.0), feature_library=library)
        model.fit(states, t=t, u=u)
    return np.asarray(model.coefficients())


def fit(rig: Rig, run: Run, guess: Values) -> Fit:
    np.random.seed(0)  # the places of its domains
    if rig.name == "dc_motor":
        states = np.stack([run["i"], derivatives(run, "phi", 15)[1]], 1)
        (i, w, V), _ = coefficients(states, centred(run["V"])[:, np.newaxis], [lambda x: x], run["t"])
        _, (k, b) = coefficients(states, None, [lambda x: x], run["t"])  # no voltage in the shaft's equation
        values = dict(L=1 / V, R=-i / V, k=-w / V, J=-w / V / k, b=b * w / V / k)
    else:
        q, w, _ = derivatives(run, "q", 21)
        _, found = coefficients(np.stack([q, w], 1), None, [lambda x: x, lambda x: np.sin(x)], run["t"])
        values = dict(w2=-found[2], k=-found[1])
    return values, dict.fromkeys(values, NONE), ""
