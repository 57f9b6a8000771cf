"""Bodies that are possible, with the base parameters that a robot's run determines, nearest to those of its file.

A body is possible if its pseudo-inertia J = [[tr(I)/2 - I, h], [h^T, m]] is positive definite (P. Wensing, S. Kim,
J.-J. Slotine, IEEE RA-L 3 (2018) 60). J is linear in the inertial parameters s of all bodies, and B s are the base
parameters b, with the covariance C:

    (B s - b)^T C^-1 (B s - b)/2 + g sum_k (tr(J0_k^-1 J_k) - log det(J0_k^-1 J_k) - 4)  ->  min

The second sum is a distance from the file's J0 (T. Lee, P. Wensing, F. Park, IEEE T-RO 36 (2020) 168) and keeps J
positive definite. Both are convex: damped Newton steps from the file converge, in the coordinates X of J = L X L^T
with J0 = L L^T. g is lowered until b is reached. A rotor's inertia in b is that of the file.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.model.chain import INERTIAL, Chain

Float = npt.NDArray[np.float64]
REACHED = 0.1  # standard errors of a base parameter
_LEAST, _LOWER = 1e-6, 10.0  # g, and what it is divided by
_LARGE = 1000.0  # times the bodies of the file
_STEPS, _SETTLED, _SHORTEST = 60, 1e-6, 1e-9  # Newton's, of the expected gain over g, of a step
_ROUNDED = 1e-13  # of a value
_INSIDE = 0.9  # of the way to where a body is impossible
_RIDGE = 1e-9  # of variances


@dataclass(frozen=True)
class Bodies:
    """Of a robot.

    Attributes
    ----------
    inertial : of each joint's body, in the order of INERTIAL [n, 10]
    base : places of the base parameters that were to be reached [k]
    off : what these bodies have more of each, in its standard errors [k]
    impossible : no possible bodies have the values, within a thousand times those of the file
    """

    inertial: Float
    base: tuple[int, ...]
    off: Float
    impossible: bool


def _basis() -> Float:
    """dJ/ds of a body [10, 4, 4]."""
    out = np.zeros((len(INERTIAL), 4, 4))
    out[0, 3, 3] = 1
    for k in range(3):
        out[1 + k, 3, k] = out[1 + k, k, 3] = 1
    for place, (i, j) in enumerate(zip(*np.triu_indices(3), strict=True), 4):
        out[place, i, j] = out[place, j, i] = -1
        out[place, :3, :3] += np.eye(3) / 2 * (i == j)
    return out


BASIS = _basis()


def pseudo_inertias(inertial: Float) -> Float:
    """J of bodies, from their INERTIAL [n, 10] -> [n, 4, 4]."""
    return np.asarray(np.einsum("kp,pij->kij", inertial, BASIS))


def bodies_of(chain: Chain, p: Float, covariance: Float, lost: npt.NDArray[np.bool_]) -> Bodies | None:
    """From base parameters [p], their covariance, and which of them are not determined; None: the file has no
    inertias, impossible ones, or ones too far from the run's, or no parameter of a body is determined. About 0.2 s."""
    own = [k for k, one in enumerate(chain.base) if chain.standard[one.standard].kind in INERTIAL and not lost[k]]
    every = np.array([one.inertial or [np.nan] * len(INERTIAL) for one in chain.joints])
    real = every.any(axis=1)  # of two joints that move one body the first has none
    file = every[real]
    if not (own and len(file) and np.isfinite(file).all() and np.linalg.eigvalsh(pseudo_inertias(file)).min() > 0):
        return None
    shares, known = np.zeros((len(own), every.size)), np.zeros(len(own))
    for row, k in enumerate(own):
        for place, factor in chain.base[k].parts:
            one = chain.standard[place]
            if one.kind in INERTIAL:
                shares[row, len(INERTIAL) * one.joint + INERTIAL.index(one.kind)] = factor
            else:  # a rotor that no torque tells from a body: the file's
                known[row] += factor * (chain.joints[one.joint].rotor or 0.0)
    shares = shares[:, np.repeat(real, len(INERTIAL))]
    wanted, sd = p[own] - known, np.sqrt(np.diag(covariance)[own])
    related = covariance[np.ix_(own, own)] / np.outer(sd, sd) + _RIDGE * np.eye(len(own))
    scaled = _coordinates(file)
    try:
        root = np.linalg.inv(np.linalg.cholesky(related)) / sd
        a, y = root @ shares @ scaled, root @ wanted
        found = np.tile(inertial_of(np.eye(4)), len(file))
        g = 1 + float(np.sum((a @ found - y) ** 2)) / len(own)
        while True:
            found, gain = _nearest(a, y, g, found)
            if gain > max(g, REACHED**2 / 2):
                return None  # the steps end before the minimum
            off = (shares @ scaled @ found - wanted) / sd
            if g < _LEAST or np.max(np.abs(off)) < REACHED:
                far = float(np.sum((a @ found - y) ** 2)) / 2
                impossible = far > max(REACHED**2 / 2, 2 * (gain + 4 * _LARGE * g * len(file)))
                every[real] = (scaled @ found).reshape(file.shape)
                return Bodies(every, tuple(own), off, impossible)
            g /= _LOWER
    except np.linalg.LinAlgError:
        return None


def _coordinates(inertial: Float) -> Float:
    """ds/dx of s with J = L X L^T and L L^T that of bodies [n, 10] -> [10 n, 10 n]."""
    out = np.zeros((inertial.size, inertial.size))
    for k, one in enumerate(np.linalg.cholesky(pseudo_inertias(inertial))):
        place = slice(len(INERTIAL) * k, len(INERTIAL) * (k + 1))
        out[place, place] = np.array([inertial_of(one @ part @ one.T) for part in BASIS]).T
    return out


def inertial_of(j: Float) -> Float:
    """Of a pseudo-inertia [10]."""
    about = np.trace(j[:3, :3]) * np.eye(3) - j[:3, :3]
    return np.array([j[3, 3], *j[:3, 3], *about[np.triu_indices(3)]])


def about_centre(j: Float) -> tuple[float, Float, Float]:
    """Mass, centre [3] and inertia about the centre [3, 3] of a pseudo-inertia."""
    mass, centre = float(j[3, 3]), j[:3, 3] / j[3, 3]
    second = j[:3, :3] - mass * np.outer(centre, centre)
    return mass, centre, np.trace(second) * np.eye(3) - second


def _nearest(a: Float, y: Float, g: float, s: Float) -> tuple[Float, float]:
    """The minimum, from possible bodies s, and what another step would gain."""
    size = len(s) // len(INERTIAL)
    pull = np.tile(np.einsum("pii->p", BASIS), size)  # of the trace, and of log det at I
    curvature = np.kron(np.eye(size), np.einsum("pij,qji->pq", BASIS, BASIS))

    def value(s: Float) -> float:
        sizes = np.linalg.eigvalsh(pseudo_inertias(s.reshape(-1, len(INERTIAL))))
        if sizes.min() <= 0:
            return np.inf
        return float(np.sum((a @ s - y) ** 2) / 2 + g * (pull @ s - np.sum(np.log(sizes))))

    for _ in range(_STEPS):
        turned = _coordinates(s.reshape(-1, len(INERTIAL)))  # J = I at s
        own = a @ turned
        gradient = own.T @ (a @ s - y) + g * (turned.T @ pull - pull)
        curved = own.T @ own + g * curvature
        scale = 1 / np.sqrt(np.diag(curved))
        step = -scale * np.linalg.solve(curved * np.outer(scale, scale), scale * gradient)
        lowest = -float(np.linalg.eigvalsh(pseudo_inertias(step.reshape(-1, len(INERTIAL)))).min())
        gain, part, now = float(-gradient @ step), min(1.0, _INSIDE / max(lowest, _INSIDE)), value(s)
        step = turned @ step
        while part > _SHORTEST and not value(s + part * step) <= now - 0.1 * part * gain + _ROUNDED * abs(now):
            part /= 2
        if gain < _SETTLED * g or part <= _SHORTEST:
            break
        s = s + part * step
    return s, gain
