"""A first-order plant with a drag that its model lacks, as a recording, for tests of what answers contain."""

import numpy as np
import numpy.typing as npt

from pvid.model import Model
from pvid.model.compiled import CompiledModel

Float = npt.NDArray[np.float64]

RATE, T, K, DRAG = 200.0, 0.35, 2.0, 0.04


def lag(factor: int = 1) -> CompiledModel:
    """T y' + y = K u, with the gain of a slow output; a factor of the equation is one of the term that it lacks."""
    model = Model("lag")
    u = model.input("u", "V", hold="zoh", reach=4, gain_sd=0)
    y = model.sensor("y", "V", resolution=1e-3, noise=1e-3, reach=6)
    time, gain = model.unknown("T", "s", 0.2), model.unknown("K", "", 1)
    model.equation(factor * (time * y.d() + y - gain * u))
    model.output("pole", "1/s", 1 / time)
    return model.compiled("lag")


def signals(drag: float, noise: float = 1e-3, hand: float | None = None) -> dict[str, Float]:
    """T y' + y + drag |y| y = K u + a random push (None: none is drawn), in 20 steps a sample."""
    random = np.random.default_rng(5)
    u = random.uniform(-2, 2, 40).repeat(100)
    push = np.zeros(len(u)) if hand is None else hand * random.normal(0, 2, len(u) // 20).repeat(20)
    y, h = np.zeros(len(u)), 1 / RATE / 20
    for place in range(1, len(u)):
        now, force = y[place - 1], K * u[place - 1] + push[place - 1]
        for _ in range(20):
            middle = now + h / 2 * (force - now - drag * abs(now) * now) / T
            now += h * (force - middle - drag * abs(middle) * middle) / T
        y[place] = now
    return {"u": u, "y": np.round((y + random.normal(0, noise, len(u))) / 1e-3) * 1e-3}
