"""A run of a motor whose torque constant is its back-EMF's."""

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.model import Model
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]

TRUTH = {"R": 1.2, "L": 2e-3, "ke": 0.06, "kt": 0.06, "J": 1.5e-4, "b": 2e-4}


@cache
def recording() -> Recording:
    """8 s at 1 kHz of two square waves, exact between the samples."""
    r, inductance, k, _, j, b = TRUTH.values()
    a = np.array([[-r / inductance, -k / inductance], [k / j, -b / j]])
    values, vectors = np.linalg.eig(a * 1e-3)
    step = (vectors * np.exp(values)) @ np.linalg.inv(vectors)
    force = np.linalg.solve(a, (step - np.eye(2)) @ [1 / inductance, 0.0]).real
    t: Float = np.arange(8000, dtype=np.float64) * 1e-3
    v = 6 * np.sign(np.sin(6.9 * t + 0.1)) + 4 * np.sign(np.sin(23.2 * t + 1))
    x = np.zeros((len(t), 2))
    for n, one in enumerate(v[:-1]):
        x[n + 1] = step.real @ x[n] + force * one
    rng = np.random.default_rng(0)
    i, w = x[:, 0] + 0.01 * rng.normal(size=len(t)), x[:, 1] + 0.05 * rng.normal(size=len(t))
    return Recording(np.asarray(t, np.float64), {"w": w, "i": i, "V": v}, 1000.0)


def motor_equations(model: Model, ke: str, kt: str, unknowns: str) -> dict[str, Any]:
    """Its signals and equations, with names of the two constants; returns the unknowns, given as "name:unit:guess"."""
    w = model.sensor("w", "rad/s", noise=0.05, reach=300, gain_sd=0)
    i = model.sensor("i", "A", noise=0.01, reach=10, gain_sd=0)
    v = model.input("V", "V", "zoh", reach=24, gain_sd=0)
    split = (one.split(":") for one in unknowns.split())
    own = {name: model.unknown(name, unit, float(guess)) for name, unit, guess in split}
    model.equation(own["L"] * i.d() + own["R"] * i + own[ke] * w - v)
    model.equation(own["J"] * w.d() + own["b"] * w - own[kt] * i)
    return own
