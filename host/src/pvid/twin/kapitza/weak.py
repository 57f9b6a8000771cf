"""Twin of kapitza_weak_f32.c: theta and its Jacobian in the weak form, with and without the encoder's offset."""

from __future__ import annotations

import numpy as np

from pvid.twin.f32.pattern import Float32, PatternModel

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


def _zeroed_noise(p: Float32, traces: Float32) -> Float32:
    w, d1, d2 = p[0], p[1], p[2]
    two_d2w, w2 = _TWO * (d2 * w), w * w
    mixed = d1 * two_d2w
    s = np.zeros((3, 3, p.shape[1]), np.float32)
    s[0, 0] = (d1 * d1) * traces[0] + ((_TWO * mixed) * traces[1] + (two_d2w * two_d2w) * traces[2])
    s[0, 1] = (d1 * w) * traces[0] + (two_d2w * w) * traces[1]
    s[0, 2] = (d1 * w2) * traces[1] + (two_d2w * w2) * traces[2]
    s[1, 1] = (w * w) * traces[0]
    s[1, 2] = (w * w2) * traces[1]
    s[2, 2] = (w2 * w2) * traces[2]
    return s


def _noise(p: Float32, traces: Float32) -> Float32:
    s = np.zeros((4, 4, p.shape[1]), np.float32)
    s[:3, :3] = _zeroed_noise(p, traces)
    return s


WEAK = PatternModel(
    n_theta=8,
    n_p=4,
    positive=(True, True, True, False),
    c_row=(1, 3, 4, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7, 5, 6, 7),
    c_column=(0, 0, 0, 0, 0, 1, 1, 2, 2, 2, 2, 2, 2, 3, 3, 3),
    theta=_theta,
    jacobian=_jacobian,
    noise=_noise,
)


def _friction_theta(p: Float32) -> Float32:
    return np.concatenate([_theta(p[:4]), p[4:6]])


def _friction_jacobian(p: Float32) -> Float32:
    one = np.ones_like(p[0])
    return np.concatenate([_jacobian(p[:4]), np.stack([one, one])])


def _friction_noise(p: Float32, traces: Float32) -> Float32:
    return _noise(p[:4], traces)


FRICTION = PatternModel(
    n_theta=10,
    n_p=6,
    positive=(True, True, True, False, False, False),
    c_row=(*WEAK.c_row, 8, 9),
    c_column=(*WEAK.c_column, 4, 5),
    theta=_friction_theta,
    jacobian=_friction_jacobian,
    noise=_friction_noise,
    n_gated=4,
)

ZEROED = PatternModel(
    n_theta=5,
    n_p=3,
    positive=(True, True, True),
    c_row=(1, 3, 4, 0, 1, 2, 3, 4),
    c_column=(0, 0, 0, 1, 1, 2, 2, 2),
    theta=_zeroed_theta,
    jacobian=_zeroed_jacobian,
    noise=_zeroed_noise,
)
