"""pvid: the equations as in a model file, and `identify`."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.peers.rigs import COUNT, NONE, Fit, Rig, Run, Values

PACKAGE = ""
RIGS = ("dc_motor", "free_pendulum", "cart_pendulum", "cell", "arm3")


def dc_motor(model: Any, start: Values) -> None:
    V = model.input("V", "V", hold="zoh", reach=12, gain_sd=0)
    i = model.sensor("i", "A", resolution=10 / 2**12, reach=5, gain_sd=0)
    phi = model.sensor("phi", "rad", resolution=COUNT, reach=1000)
    R, L = model.unknown("R", "ohm", start["R"]), model.unknown("L", "H", start["L"])
    k, J = (model.unknown("k", "N*m/A", start["k"]), model.unknown("J", "kg*m^2", start["J"]))
    b = model.unknown("b", "N*m*s", start["b"])
    model.equation(L * i.d() + R * i + k * phi.d() - V)
    model.equation(J * phi.d(2) + b * phi.d() - k * i)


def free_pendulum(model: Any, start: Values) -> None:
    from pvid.model import sin

    q = model.sensor("q", "rad", resolution=COUNT, reach=4)
    w2, k = (model.unknown("w2", "1/s^2", start["w2"]), model.unknown("k", "1/s", start["k"]))
    model.equation(q.d(2) + k * q.d() + w2 * sin(q))


def cart_pendulum(model: Any, start: Values) -> None:
    from pvid.model import cos

    F = model.input("F", "N", hold="zoh", reach=20, gain_sd=0)
    x, a = (
        model.sensor("x", "m", resolution=2e-5, reach=1, gain_sd=0),
        model.sensor("a", "rad", resolution=COUNT, reach=4),
    )
    mt, ml = (model.unknown("mt", "kg", start["mt"]), model.unknown("ml", "kg*m", start["ml"]))
    J, b = (model.unknown("J", "kg*m^2", start["J"]), model.unknown("b", "N*s/m", start["b"]))
    bp = model.unknown("bp", "N*m*s", start["bp"])
    g = model.known("g", "m/s^2", 9.81)
    T = mt * x.d() ** 2 / 2 + ml * cos(a) * x.d() * a.d() + J * a.d() ** 2 / 2
    model.lagrange(T + ml * g * cos(a), [x, a], [F - b * x.d(), -bp * a.d()])


def cell(model: Any, start: Values) -> None:
    v = model.sensor("v", "V", resolution=1e-3, reach=5, gain_sd=0)
    i = model.sensor("i", "A", resolution=1e-4, reach=12, driven=True, gain_sd=0)
    h = model.unmeasured("h", "V")
    R0, R1 = (model.unknown("R0", "ohm", start["R0"]), model.unknown("R1", "ohm", start["R1"]))
    T1, E = (model.unknown("T1", "s", start["T1"]), model.unknown("E", "V", start["E"], sd=0.2))
    model.equation(v - E + R0 * i + h)
    model.equation(T1 * h.d() + h - R1 * i)


def fit(rig: Rig, run: Run, guess: Values, refine: bool = False) -> Fit:
    import pvid

    model = getattr(rig, "model", None) or pvid.Model(rig.name)
    if isinstance(model, pvid.Model):
        globals()[rig.name](model, guess)
    answer = pvid.identify(run, model=model, refine=refine)
    if not answer.identified:
        return {}, {}, answer.status
    values = {name: answer[name].value for name in rig.truth}
    errors = {name: answer[name].se if np.isfinite(answer[name].se) else NONE for name in rig.truth}
    said = [] if answer.verdict == "good" else [answer.verdict]
    return (values, errors, "; ".join([*said, *([answer.warning] if answer.warning else [])]))
