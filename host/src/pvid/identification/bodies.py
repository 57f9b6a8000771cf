"""Bodies that are possible, with the base parameters that a robot's run determines, nearest to those of its file.

A body is possible if its pseudo-inertia J = [[tr(I)/2 - I, h], [h^T, m]] is positive definite (P. Wensing, S. Kim,
J.-J. Slotine, IEEE RA-L 3 (2018) 60). J is linear in the inertial parameters s of all bodies, and B s are the base
parameters b, with the covariance C:

    (B s - b)^T C^-1 (B s - b)/2 + g sum_k (tr(J0_k^-1 J_k) - log det(J0_k^-1 J_k) - 4)  ->  min

The second sum is a distance from the file's J0 (T. Lee, P. Wensing, F. Park, IEEE T-RO 36 (2020) 168) and keeps J
positive definite. Both are convex: damped Newton steps from the file converge. g is lowered until b is reached.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.model.chain import INERTIAL, Chain

Float = npt.NDArray[np.float64]
REACHED = 0.1  # standard errors of a base parameter
_LEAST, _LOWER = 1e-6, 10.0  # g, and what it is divided by
_STEPS, _SETTLED, _SHORTEST = 60, 1e-8, 1e-9  # Newton's, of the expected gain, of a step
_RIDGE = 1e-9  # of variances


@dataclass(frozen=True)
class Bodies:
    """Of a robot.

    Attributes
    ----------
    inertial : of each joint's body, in the order of INERTIAL [n, 10]
    base : places of the base parameters that were to be reached [k]
    off : what these bodies have more of each, in its standard errors [k]
    """

    inertial: Float
    base: tuple[int, ...]
    off: Float


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
    inertias, or impossible ones, or no parameter of a body is determined. Milliseconds for 7 joints."""
    own = [k for k, one in enumerate(chain.base) if chain.standard[one.standard].kind in INERTIAL and not lost[k]]
    every = np.array([one.inertial or [np.nan] * len(INERTIAL) for one in chain.joints])
    real = every.any(axis=1)  # of two joints that move one body the first has none
    file = every[real]
    if not (own and len(file) and np.isfinite(file).all() and np.linalg.eigvalsh(pseudo_inertias(file)).min() > 0):
        return None
    shares, p = np.zeros((len(own), every.size)), p.copy()
    for row, k in zip(shares, own, strict=True):
        for place, factor in chain.base[k].parts:
            one = chain.standard[place]
            if one.kind == "Ia":  # a rotor that no torque tells from a body: the file's
                p[k] -= factor * (chain.joints[one.joint].rotor or 0.0)
            else:
                row[len(INERTIAL) * one.joint + INERTIAL.index(one.kind)] = factor
    shares = shares[:, np.repeat(real, len(INERTIAL))]
    sd = np.sqrt(np.diag(covariance)[own])
    related = covariance[np.ix_(own, own)] / np.outer(sd, sd) + _RIDGE * np.eye(len(own))
    root = np.linalg.inv(np.linalg.cholesky(related)) / sd
    a, y = root @ shares, root @ p[own]
    pull = np.einsum("kij,pji->kp", np.linalg.inv(pseudo_inertias(file)), BASIS).ravel()
    found = file.ravel()
    g = 1 + float(np.sum((a @ found - y) ** 2)) / len(own)
    while True:
        found = _nearest(a, y, pull, g, found)
        off = (shares @ found - p[own]) / sd
        if g < _LEAST or np.max(np.abs(off)) < REACHED:
            every[real] = found.reshape(file.shape)
            return Bodies(every, tuple(own), off)
        g /= _LOWER


def _nearest(a: Float, y: Float, pull: Float, g: float, s: Float) -> Float:
    """The minimum, from possible bodies s."""

    def value(s: Float) -> float:
        sizes = np.linalg.eigvalsh(pseudo_inertias(s.reshape(-1, len(INERTIAL))))
        if sizes.min() <= 0:
            return np.inf
        return float(np.sum((a @ s - y) ** 2) / 2 + g * (pull @ s - np.sum(np.log(sizes))))

    for _ in range(_STEPS):
        inverse = np.linalg.inv(pseudo_inertias(s.reshape(-1, len(INERTIAL))))
        slopes = np.einsum("kij,pjl->kpil", inverse, BASIS)
        gradient = a.T @ (a @ s - y) + g * (pull - np.einsum("kpii->kp", slopes).ravel())
        curved = a.T @ a
        for k, one in enumerate(np.einsum("kpij,kqji->kpq", slopes, slopes)):
            own = slice(len(one) * k, len(one) * (k + 1))
            curved[own, own] += g * one
        scale = 1 / np.sqrt(np.diag(curved))
        step = -scale * np.linalg.lstsq(curved * np.outer(scale, scale), scale * gradient, rcond=None)[0]
        gain, part, now = float(-gradient @ step), 1.0, value(s)
        while part > _SHORTEST and not value(s + part * step) <= now - 0.1 * part * gain:
            part /= 2
        if gain < _SETTLED or part <= _SHORTEST:
            break
        s = s + part * step
    return s
