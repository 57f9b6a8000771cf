"""Filter for the second derivative of a signal: exact in a pass band, little noise beyond it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

_GRID = 4001
_EXACT = 1e6  # weight of the pass band, relative to what is wanted there
_LEAST_WANTED = 0.02  # of the pass band's edge: below it the weight grows no more
_NOISE = 1e-6  # weight of white noise


def second_derivative(half: int, pass_band: float) -> Float:
    """Symmetric weights [half + 1], centre first, per squared step.

    Least squares over all frequencies, exact for polynomials to degree 4.

    Parameters
    ----------
    half : steps on each side
    pass_band : highest frequency that is not to be changed [cycles a step], < 0.5
    """
    place = np.arange(half + 1)
    frequency = np.linspace(0.0, 0.5, _GRID)
    response = 2.0 * np.cos(2.0 * np.pi * np.outer(frequency, place))
    response[:, 0] = 1.0
    edge = (2.0 * np.pi * pass_band) ** 2
    inside = frequency < pass_band
    wanted = np.where(inside, -((2.0 * np.pi * frequency) ** 2), 0.0)
    size = np.maximum(np.abs(wanted), _LEAST_WANTED * edge)
    weight = np.where(inside, _EXACT / size**2, _NOISE / edge**2)
    degrees = np.array([0, 2, 4])
    moments = np.where(place == 0, 1.0, 2.0) * (place / half) ** degrees[:, None]
    target = np.array([0.0, 2.0 / half**2, 0.0])
    system = np.block(
        [[(response.T * weight) @ response, moments.T], [moments, np.zeros((degrees.size, degrees.size))]]
    )
    right = np.concatenate([response.T @ (weight * wanted), target])
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(system)), 1.0))
    solution = np.linalg.lstsq(system * np.outer(scale, scale), right * scale, rcond=1e-14)[0] * scale
    return np.asarray(solution[: half + 1])
