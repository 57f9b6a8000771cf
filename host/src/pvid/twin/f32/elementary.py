"""Twin of elementary_f32.c: sine, cosine and sign, element by element."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]

F = np.float32
ANGLE_LIMIT = F(16384)

_INVERSE_PI = F(0.318309886)
_PI = (F(3.140625), F(9.67502594e-04), F(1.50995803e-07))
_MAGIC = F(12582912)


def _nearest(x: Float32) -> Float32:
    rounded: Float32 = (x + _MAGIC) - _MAGIC
    return rounded


def _reduced(x: Float32, turns: Float32) -> Float32:
    rest: Float32 = ((x - turns * _PI[0]) - turns * _PI[1]) - turns * _PI[2]
    return rest


def _sine_of_reduced(r: Float32) -> Float32:
    z = r * r
    p = F(2.5999791e-06) * z - F(1.98065813e-04)
    p = p * z + F(8.33301712e-03)
    p = p * z - F(1.66666567e-01)
    sine: Float32 = r + (r * z) * p
    return sine


def _is_odd(integer: Float32) -> npt.NDArray[np.bool_]:
    odd: npt.NDArray[np.bool_] = (integer.astype(np.int32) & 1) != 0
    return odd


def _angles(x: npt.ArrayLike) -> tuple[Float32, npt.NDArray[np.bool_]]:
    """x with 0 in place of what is no angle, and where it is one."""
    given = np.asarray(x, np.float32)
    inside = np.abs(given) <= ANGLE_LIMIT
    return np.where(inside, given, F(0)), inside


def sine(x: npt.ArrayLike) -> Float32:
    """pvid_sin_f32 of x [rad]; NaN beyond ANGLE_LIMIT."""
    angle, inside = _angles(x)
    turns = _nearest(angle * _INVERSE_PI)
    found = _sine_of_reduced(_reduced(angle, turns))
    return np.where(inside, np.where(_is_odd(turns), -found, found), F("nan"))


def cosine(x: npt.ArrayLike) -> Float32:
    """pvid_cos_f32 of x [rad]; NaN beyond ANGLE_LIMIT."""
    angle, inside = _angles(x)
    turns = _nearest(angle * _INVERSE_PI - F(0.5))
    found = _sine_of_reduced(_reduced(angle, turns + F(0.5)))
    return np.where(inside, np.where(_is_odd(turns), found, -found), F("nan"))


def sign(v: npt.ArrayLike) -> Float32:
    """pvid_sign_f32: -1, 0 or 1; 0 of NaN."""
    given = np.asarray(v, np.float32)
    return np.where(given > 0, F(1), np.where(given < 0, F(-1), F(0)))


def magnitude(x: npt.ArrayLike) -> Float32:
    """pvid_magnitude_f32."""
    given = np.asarray(x, np.float32)
    return np.where(given < 0, -given, given)


def soft_sign(v: npt.ArrayLike, width: np.float32) -> Float32:
    """pvid_soft_sign_f32 of v, 1/2 at v = width."""
    given = np.asarray(v, np.float32)
    found: Float32 = given / (magnitude(given) + width)
    return found


_TANH_END = F(7)


def tanh(x: npt.ArrayLike) -> Float32:
    """pvid_tanh_f32."""
    given = np.asarray(x, np.float32)
    z = given * given
    above = F(3.99569171e-06) * z + F(2.29304517e-03)
    above = above * z + F(1.23220012e-01)
    above = above * z + F(9.99998987e-01)
    below = F(1.43980025e-04) * z + F(2.11513992e-02)
    below = below * z + F(4.56545591e-01)
    below = below * z + F(1)
    inside = (given * above) / below
    return np.where(given > _TANH_END, F(1), np.where(given < -_TANH_END, F(-1), inside)).astype(np.float32, copy=False)


_SINE = (F(-1.66666546e-1), F(8.33216087e-3), F(1.95152959e-4))
_COSINE = (F(-0.5), F(4.16666456e-2), F(-1.38873163e-3), F(2.44331571e-5))


def sincos(x: npt.ArrayLike) -> tuple[Float32, Float32]:
    """pvid_sincos_f32: sine and cosine of x [rad]."""
    given = np.asarray(x, np.float32)
    far = (given > F(0.7854)) | (given < F(-0.7854))
    total = np.where(far, given * F(0.636619772) + _MAGIC, _MAGIC)
    turns = total - _MAGIC
    r = np.where(far, (given - turns * F(1.5703125)) - turns * F(4.83826797e-4), given)
    quarter = np.where(far, np.ascontiguousarray(total).view(np.uint32) & 3, 0)
    z = r * r
    sine = r + (r * z) * (_SINE[0] + z * (_SINE[1] - z * _SINE[2]))
    cosine = F(1) + z * (_COSINE[0] + z * (_COSINE[1] + z * (_COSINE[2] + z * _COSINE[3])))
    odd, turned = (quarter & 1) != 0, (quarter & 2) != 0
    one, other = np.where(odd, cosine, sine), np.where(odd, -sine, cosine)
    return np.where(turned, -one, one), np.where(turned, -other, other)
