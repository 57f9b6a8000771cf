"""Counts that no mechanism makes."""

import numpy as np
import numpy.typing as npt

Counts = npt.NDArray[np.int64]

HOSTILE = (
    "square waves",
    "slow square waves",
    "steps",
    "stuck",
    "wrap",
    "zeros",
    "random words",
    "random counts",
    "full scale in phase",
    "one count",
    "beyond full scale",
)


def hostile(name: str, full_scale: tuple[int, int], swing: Counts, turn: int) -> tuple[Counts, Counts]:
    """phi and y of one of HOSTILE for sensors that end at `full_scale`; `swing` [ticks]: a pivot that a rig could have,
    `turn`: of the encoder."""
    phi_max, y_max = full_scale
    ticks = len(swing)
    random = np.random.default_rng(7)
    t = np.arange(ticks)
    words = random.integers(-(2**31), 2**31, (2, ticks))
    beyond = np.where(t == 5 * ticks // 8, phi_max + 1, swing // 4), np.where(t == 7 * ticks // 8 + 1, -(2**31), swing)
    made = {
        "square waves": (phi_max * np.where(t // 50 % 2, 1, -1), y_max * np.where(t // 70 % 2, 1, -1)),
        "slow square waves": (phi_max * np.where(t // 125 % 2, 1, -1), swing),
        "steps": (phi_max * (t > ticks // 2), np.where(t > 3 * ticks // 4, y_max, 0)),
        "stuck": (np.full(ticks, phi_max), swing),
        "wrap": (t * 7 * turn // 2**14 % turn - turn // 2, swing),
        "zeros": (np.zeros(ticks), np.zeros(ticks)),
        "random words": (words[0], words[1]),
        "random counts": (random.integers(-phi_max, phi_max + 1, ticks), swing),
        "full scale in phase": (np.where(swing > 0, phi_max, -phi_max), swing),
        "one count": (t // 150 % 2, swing),
        "beyond full scale": beyond,
    }
    phi, y = made[name]
    return np.asarray(phi, np.int64), np.asarray(y, np.int64)
