"""Twin of models/kapitza/full_angle_f32.c: the remainder of a window's linear rows, in every lane."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.f32 import WeakConfig

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
f = np.float32

Y, A, B, C1, C2 = 8, 9, 10, 11, 12
_FUNCTIONS_PER_STAGE, _SAMPLES_PER_STAGE = 6, 4
_L2_MIN = f(0.05)
_SETTLED_GROUPS, _SETTLED_STEP, _SETTLED_ERROR, _LOST_ERROR = 4, f(0.02), f(0.05), f(0.2)


_SIXTH, _PART_120, _PART_5040 = f(1) / f(6), f(1) / f(120), f(1) / f(5040)
_HALF, _PART_24, _PART_720 = f(0.5), f(1) / f(24), f(1) / f(720)


def _sine_remainder(x: Float32) -> Float32:
    x2 = x * x
    series: Float32 = _SIXTH - x2 * (_PART_120 - x2 * _PART_5040)
    return (x * x2) * series


def _versine(x: Float32) -> Float32:
    x2 = x * x
    series: Float32 = _HALF - x2 * (_PART_24 - x2 * _PART_720)
    return x2 * series


class _Integral:
    """Trapezoid integrals of every lane; `step` returns the double integral less dt^2/6 f."""

    def __init__(self, dt: np.float32) -> None:
        self.dt = dt
        self.before: Float32 | np.float32 = f(0)
        self.once: Float32 | np.float32 = f(0)
        self.twice: Float32 | np.float32 = f(0)

    def step(self, first: bool, value: Float32) -> Float32:
        half_dt = f(0.5) * self.dt
        once = self.once + ((self.before + value) * half_dt)
        twice = self.twice + ((self.once + once) * half_dt)
        self.once = np.zeros_like(value) if first else once
        self.twice = np.zeros_like(value) if first else twice
        self.before = value
        return self.twice - (((self.dt * self.dt) / f(6)) * value)


class Angle:
    """pvid_weak_angle_f32 of every lane."""

    def __init__(self, config: WeakConfig, lanes: int) -> None:
        self.config = config
        self.channels = 3 if config.friction else 1
        self.dt = f(config.design.decimation) / f(config.sample_rate)
        self.inverse_l1_square = f(1) / (f(config.l1) * f(config.l1))
        self.on = np.zeros(lanes, np.bool_)
        self.p = np.zeros((3, lanes), np.float32)

    @property
    def stages(self) -> int:
        """Stages of a window."""
        design = self.config.design
        fit = -(-design.functions // _FUNCTIONS_PER_STAGE)
        sweep = (design.window + _SAMPLES_PER_STAGE - 2) // _SAMPLES_PER_STAGE
        return self.config.passes * (fit + 1 + sweep) + 1

    def correct(self, x: Float32, p: Float32, theta: Float32, phi: Float32, u: Float32) -> Float32:
        """Columns x [13, K, lanes] with the remainder subtracted from Y and the columns of friction filled in, from a
        window's samples phi, u [W]; p [n_p, lanes], theta [n_theta, lanes]."""
        functions, lanes = x.shape[1:]
        self.p = p[:3].copy()
        zero = p[3] if len(p) > 3 else np.zeros(lanes, np.float32)
        friction = p[4:6] if self.config.friction else np.zeros((2, lanes), np.float32)
        l2 = (p[1] - p[2]) - f(1)
        physical = l2 > _L2_MIN
        l1 = p[2] / np.where(physical, l2, f(1))
        remainder = np.zeros((functions, 3, lanes), np.float32)
        for _ in range(self.config.passes):
            a, b = self._fit(x, theta, friction, remainder)
            remainder = self._sweep(zero, l1, l2, a, b, phi, u)
        total = np.zeros(lanes, np.float32)
        for k in range(functions):
            for j in range(3):
                total = total + remainder[k, j] * remainder[k, j]
        on = self.on & physical & np.isfinite(total)
        out = x.copy()
        out[Y] = x[Y] - np.where(on, remainder[:, 0], f(0))
        out[C1] = np.where(on, remainder[:, 1], f(0))
        out[C2] = np.where(on, remainder[:, 2], f(0))
        return out

    @staticmethod
    def _fit(x: Float32, theta: Float32, friction: Float32, remainder: Float32) -> tuple[Float32, Float32]:
        n = np.zeros((5, x.shape[2]), np.float32)
        for k in range(x.shape[1]):
            a, b, e = x[A, k], x[B, k], x[Y, k]
            for i in range(min(len(theta), 8)):
                e = e - x[i, k] * theta[i]
            e = e - remainder[k, 0]
            e = e - friction[0] * remainder[k, 1]
            e = e - friction[1] * remainder[k, 2]
            n = n + np.stack([a * a, a * b, b * b, a * e, b * e])
        product = n[0] * n[2]
        determinant = product - n[1] * n[1]
        regular = determinant > f(1.0e-5) * product
        inverse = f(1) / np.where(regular, determinant, f(1))
        zero = np.zeros_like(inverse)
        return (
            np.where(regular, (n[3] * n[2] - n[4] * n[1]) * inverse, zero),
            np.where(regular, (n[4] * n[0] - n[3] * n[1]) * inverse, zero),
        )

    def _sweep(
        self, zero: Float32, l1: Float32, l2: Float32, a: Float32, b: Float32, phi: Float32, u: Float32
    ) -> Float32:
        """The remainder and the columns of friction [K, 3, lanes]."""
        design, dt = self.config.design, self.dt
        w, d1, d2 = self.p
        chi2 = np.asarray(design.chi, np.float32)[:, 1]
        motion, integral = _Integral(dt), [_Integral(dt) for _ in range(3)]
        out = np.zeros((design.functions, 3, len(a)), np.float32)
        for index in range(design.window - 1):
            first = index == 0
            before = phi[0] if first else phi[index - 1]
            rate = (phi[index + 1] - before) / (dt if first else f(2) * dt)
            g = w + u[index]
            angle = phi[index] - zero
            force = g * angle
            t = dt * (f(index) - (f(0.5) * f(design.window - 1)))
            i2 = motion.step(first, force)
            q = ((a + (b * t)) - (d1 * phi[index])) - (d2 * i2)
            q_rate = (b - (d1 * rate)) - (d2 * motion.once)
            k = d1 - f(1)
            a1 = q + (k * angle)
            v1 = q_rate + (k * rate)
            e = np.zeros((3, 2, len(a)), np.float32)
            if self.config.full_angle:
                a2, v2 = a1 + angle, v1 + rate
                acceleration1 = (l2 * force) - (g * a1)
                acceleration2 = -(d2 * force)
                sine, lift = angle - _sine_remainder(angle), _versine(angle)
                e[0, 0] = (g * _sine_remainder(a1)) + (((lift * acceleration2) + (sine * (v2 * v2))) / l1)
                e[0, 1] = (g * _sine_remainder(a2)) + ((lift * acceleration1) - (sine * (v1 * v1)))
            e[1, 0] = -(v1 * self.inverse_l1_square)
            e[2, 0] = rate * self.inverse_l1_square
            e[2, 1] = -(l1 * e[2, 0])
            for j in range(self.channels):
                difference = e[j, 1] - e[j, 0]
                m1 = ((d1 - f(1)) * difference) - e[j, 0]
                row = m1 + (g * integral[j].step(first, d2 * difference))
                if not first:
                    out[:, j] = out[:, j] + chi2[index][:, None] * row
        return out

    def switch(self, lanes: Mask, p: Float32, worst: Float32, groups: int) -> Mask:
        """pvid_weak_angle_switch_f32 in the given lanes; returns the lanes in which it was enabled."""
        moved = np.zeros(p.shape[1], np.float32)
        for i in range(3):
            step = (p[i] / self.p[i]) - f(1)
            size = np.where(step < 0, -step, step)
            moved = np.where(size <= moved, moved, size)
        was_on = self.on
        settled = (groups >= _SETTLED_GROUPS) & (moved < _SETTLED_STEP) & (worst < _SETTLED_ERROR)
        self.on = np.where(lanes, np.where(was_on, worst <= _LOST_ERROR, settled), was_on)
        return np.asarray(self.on & ~was_on)
