"""Twin of kapitza_weak_f32.c: theta and its Jacobian in the weak form, with and without the encoder's zero."""

from __future__ import annotations

import numpy as np

from pvid.twin.pattern import Float32, PatternModel

_TWO = np.float32(2)


def _zeroed_theta(p: Float32) -> Float32:
    w, d1, d2 = p[0], p[1], p[2]
    d2w = d2 * w
    return np.stack([d1, d1 * w, d2, d2w, d2w * w])


def _theta(p: Float32) -> Float32:
    w, d2c = p[0], p[2] * p[3]
    d2cw = d2c * w
    return np.concatenate([_zeroed_theta(p), np.stack([d2c, d2cw, d2cw * w])])


def _zeroed_jacobian(p: Float32) -> Float32:
    w, d1, d2 = p[0], p[1], p[2]
    one = np.ones_like(w)
    return np.stack([d1, d2, _TWO * (d2 * w), one, w, one, w, w * w])


def _jacobian(p: Float32) -> Float32:
    w, d1, d2, c = p
    w2 = w * w
    d2c = d2 * c
    one = np.ones_like(w)
    of_w = [d1, d2, _TWO * (d2 * w), d2c, _TWO * (d2c * w)]
    of_d1 = [one, w]
    of_d2 = [one, w, w2, c, c * w, c * w2]
    of_c = [d2, d2 * w, d2 * w2]
    return np.stack([*of_w, *of_d1, *of_d2, *of_c])


WEAK = PatternModel(
    n_theta=8,
    n_p=4,
    positive=(True, True, True, False),
    c_row=(1, 3, 4, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7, 5, 6, 7),
    c_column=(0, 0, 0, 0, 0, 1, 1, 2, 2, 2, 2, 2, 2, 3, 3, 3),
    theta=_theta,
    jacobian=_jacobian,
)

ZEROED = PatternModel(
    n_theta=5,
    n_p=3,
    positive=(True, True, True),
    c_row=(1, 3, 4, 0, 1, 2, 3, 4),
    c_column=(0, 0, 0, 1, 1, 2, 2, 2),
    theta=_zeroed_theta,
    jacobian=_zeroed_jacobian,
)
