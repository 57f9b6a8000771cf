"""Motion of a random rig by an integrator of its own: its rates as C, Runge-Kutta in fine steps, each stop and reversal
of a dry friction located; sensors with white noise and steps; the Cramer-Rao bound of the recording.

A held input changes behind the sample of its instant: the sensors are read, then the value is set.
"""

from __future__ import annotations

import ctypes
import math
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bench.random_rigs import Driven, RandomRig
from pvid.core.host_compiler import host_compiler

Float = npt.NDArray[np.float64]

_FINE = 0.05  # of a step times the fastest rate
_SUBS = (4, 400)  # steps between two samples
_SAMPLES = (2000, 5000)
_SLOWEST = 1 / 150  # slower modes than this part of the fastest one are taken for drifts
_NOISE = 0.5  # standard deviation in steps of a sensor, the default of model.sensor
_ODD_STEP = 1e-4  # of differences, relative to a parameter or to its scale

_C = """
#include <math.h>
#include <string.h>
enum {{ X = {states}, U = {drives}, Y = {outputs}, S = {signs} }};
static const int slid[] = {{ {slid} }};
static double sign(double v) {{ return (v > 0) - (v < 0); }}
static double shrunk(double f, double most) {{ return f > most ? f - most : f < -most ? f + most : 0; }}
static void free_rates(const double *x, const double *u, const double *p, const double *s, double *dx)
{{
    {rates}
}}
void rates(const double *x, const double *u, const double *p, const double *s, double *dx)
{{
    free_rates(x, u, p, s, dx);
    for (int k = 0; k < S; k++) if (s[k] == 0) dx[slid[k]] = 0;
}}
static void outputs(const double *x, const double *u, const double *p, const double *s, const double *dx, double *y)
{{
    {sensed}
}}
static void feedback(const double *x, const double *u, const double *p, const double *s, const double *dx, double *more)
{{
    {fed}
}}
static void between(const double *u, double at, double *now) /* u [3, U]: at 0, 1/2 and 1 of a step */
{{
    for (int j = 0; j < U; j++)
        now[j] = u[j] * (2 * at * at - 3 * at + 1) + u[U + j] * 4 * at * (1 - at) + u[2 * U + j] * (2 * at * at - at);
}}
static void runge_kutta(double h, double from, double to, const double *x, const double *u, const double *p,
                        const double *s, double *out)
{{
    const double part[4] = {{0, 0.5, 0.5, 1}}, weight[4] = {{1, 2, 2, 1}};
    double dx[X + 1] = {{0}}, sum[X + 1] = {{0}}, z[X + 1], now[U + 1];
    const double length = h * (to - from);
    for (int q = 0; q < 4; q++) {{
        for (int j = 0; j < X; j++) z[j] = x[j] + part[q] * length * dx[j];
        between(u, from + part[q] * (to - from), now);
        rates(z, now, p, s, dx);
        for (int j = 0; j < X; j++) sum[j] += weight[q] * dx[j];
    }}
    for (int j = 0; j < X; j++) out[j] = x[j] + length * sum[j] / 6;
}}
static void decide(const double *x, const double *u, const double *p, double *s)
{{
    double dx[X + 1], other[X + 1];
    for (int k = 0; k < S; k++) {{
        if (s[k] != 0) continue;
        if (x[slid[k]] != 0) {{ s[k] = sign(x[slid[k]]); continue; }}
        free_rates(x, u, p, s, dx);
        s[k] = 1;
        free_rates(x, u, p, s, other);
        const double jump = fabs(dx[slid[k]] - other[slid[k]]);
        s[k] = dx[slid[k]] > jump ? 1 : dx[slid[k]] < -jump ? -1 : 0;
    }}
}}
static int reversed(const double *x, const double *s)
{{
    for (int k = 0; k < S; k++) if (s[k] * x[slid[k]] < 0) return 1;
    return 0;
}}
static void step(double h, double *x, const double *u, const double *p, double *s)
{{
    double from = 0, z[X + 1], now[U + 1];
    for (int guard = 0; guard < 100 && from < 1; guard++) {{
        between(u, from, now);
        decide(x, now, p, s);
        runge_kutta(h, from, 1, x, u, p, s, z);
        double to = 1;
        if (reversed(z, s)) {{
            double low = from;
            for (int k = 0; k < 50; k++) {{
                const double middle = (low + to) / 2;
                runge_kutta(h, from, middle, x, u, p, s, z);
                if (reversed(z, s)) to = middle; else low = middle;
            }}
            runge_kutta(h, from, to, x, u, p, s, z);
            for (int k = 0; k < S; k++) if (s[k] * z[slid[k]] < 0) {{ z[slid[k]] = 0; s[k] = 0; }}
        }}
        memcpy(x, z, sizeof(double) * X);
        from = to;
    }}
}}
/* u [n, subs, 3, U]; y [n, Y + U]: sensors, then the drives as set behind the sample; stuck: samples at rest */
int simulate(int n, int subs, double h, double *x, double *u, const double *p, double *y)
{{
    double s[S + 1] = {{0}}, dx[X + 1] = {{0}}, more[U + 1] = {{0}}, before[U + 1] = {{0}};
    int stuck = 0;
    memcpy(before, u, sizeof(double) * U);
    decide(x, before, p, s);
    for (int k = 0; k < n; k++) {{
        double *own = u + (long)k * subs * 3 * U;
        for (int j = 0; j < U; j++) if (!{held}[j]) before[j] = own[j];
        rates(x, before, p, s, dx);
        outputs(x, before, p, s, dx, y);
        for (int j = 0; j < S; j++) if (s[j] == 0) {{ stuck++; break; }}
        feedback(x, before, p, s, dx, more);
        for (int q = 0; q < subs * 3; q++) for (int j = 0; j < U; j++) own[q * U + j] += more[j];
        memcpy(y + Y, own, sizeof(double) * U);
        for (int q = 0; q < subs; q++) step(h / subs, x, own + q * 3 * U, p, s);
        memcpy(before, own + (subs * 3 - 1) * U, sizeof(double) * U);
        y += Y + U;
    }}
    return stuck;
}}
"""


class _Plant:
    """The rates of a rig, compiled."""

    def __init__(self, rig: RandomRig, folder: Path) -> None:
        self.rig = rig
        fed = "".join(f"more[{j}] = {one.feedback};" for j, one in enumerate(rig.driven) if one.feedback)
        held = "".join(f"{int(one.held)}," for one in rig.driven)
        text = _C.format(
            states=len(rig.start),
            drives=len(rig.driven),
            outputs=len(rig.sensed),
            signs=len(rig.slid),
            slid=", ".join(map(str, rig.slid)) or "0",
            rates="\n    ".join(f"dx[{j}] = {one};" for j, one in enumerate(rig.rates)),
            sensed="\n    ".join(f"y[{j}] = {one.code};" for j, one in enumerate(rig.sensed)),
            fed=fed,
            held=f"((const int[]){{{held}0}})",
        )
        source, library = folder / "plant.c", folder / "plant.so"
        source.write_text(text, encoding="utf-8")
        command = [host_compiler("the bench"), "-std=c99", "-O1", "-w", "-shared", "-fPIC", str(source), "-o"]
        subprocess.run([*command, str(library), "-lm"], check=True)
        self._c = ctypes.CDLL(str(library))

    def rates(self, x: Float) -> Float:
        """With large drives, every speed moving forwards [states]."""
        u = np.array([one.mean + one.amplitude for one in self.rig.driven] + [0.0])
        s, out = np.ones(len(self.rig.slid) + 1), np.empty(len(x))
        self._c.rates(*map(_pointer, (x.copy(), u, np.array([*self.rig.values, 0.0]), s, out)))
        return out

    def run(self, values: Float, start: Float, u: Float, rate: float) -> tuple[Float, int]:
        """Sensors, then drives at each sample [n, sensors + drives]; how many samples a friction is at rest."""
        n, subs = u.shape[:2]
        out = np.empty((n, len(self.rig.sensed) + len(self.rig.driven)))
        given = [np.append(start, 0.0), np.append(u.ravel(), 0.0), np.append(values, 0.0)]
        stuck = self._c.simulate(n, subs, ctypes.c_double(1 / rate), *map(_pointer, (*given, out)))
        return out, int(stuck)


def _pointer(values: Float) -> ctypes.c_void_p:
    return ctypes.c_void_p(values.ctypes.data)


@dataclass(frozen=True, eq=False)
class RandomRun:
    """A recording of a random rig.

    Attributes
    ----------
    rig : with the resolutions of its sensors
    signals : as recorded, t included [n]
    bound : least standard error that any unbiased estimate has, by unknown
    stuck : part of the samples in which a friction is at rest
    """

    rig: RandomRig
    signals: dict[str, Float]
    rate: float
    bound: dict[str, float]
    stuck: float


def random_run(rig: RandomRig, seed: int, folder: Path) -> RandomRun:
    """Simulates a rig with its sensors; the plant's library is left in the folder."""
    source = np.random.default_rng([47, seed])
    plant = _Plant(rig, folder)
    fast, slow = _modes(plant, rig)
    rate = fast * source.uniform(6, 16)
    lasts = rig.lasts or source.uniform(15, 40) / slow
    n = int(np.clip(rate * lasts, *_SAMPLES))
    if rig.lasts is not None:
        rate = n / lasts
    rate = float(f"{rate:.3g}")
    subs = int(np.clip(math.ceil(fast / rate / _FINE), *_SUBS))
    u = np.empty((n, subs, 3, len(rig.driven)))
    for j, one in enumerate(rig.driven):
        u[..., j] = _drive(one, source, n, subs, rate, fast, max(slow, 3 * rate / n))
    values, start = np.array(rig.values, float), np.array(rig.start, float)
    clean, stuck = plant.run(values, start, u, rate)
    sensed = []
    signals = {"t": np.arange(n) / rate}
    for j, sensor in enumerate(rig.sensed):
        span = float(np.ptp(clean[:, j])) or 1.0
        resolution = float(f"{span / 2**sensor.bits:.2g}")
        sensed.append(replace(sensor, resolution=resolution, reach=1.2 * float(np.abs(clean[:, j]).max()) or 1.0))
        noisy = clean[:, j] + _NOISE * resolution * source.standard_normal(n)
        signals[sensor.name] = np.rint(noisy / resolution) * resolution
    for j, drive in enumerate(rig.driven):
        if not drive.sensor and not drive.internal:
            signals[drive.name] = clean[:, len(rig.sensed) + j].copy()
    whole = rig.with_sensors(sensed)
    return RandomRun(whole, signals, rate, _bound(plant, whole, u, rate), stuck / n)


def _modes(plant: _Plant, rig: RandomRig) -> tuple[float, float]:
    """Fastest and slowest rate of the linearised motion [1/s]."""
    if rig.pace is not None:
        return rig.pace, rig.pace / 10
    x = np.array(rig.start, float)
    scale = np.maximum(np.abs(x), 1e-3)
    slopes = np.empty((len(x), len(x)))
    for j in range(len(x)):
        step = np.zeros(len(x))
        step[j] = 1e-6 * scale[j]
        slopes[:, j] = (plant.rates(x + step) - plant.rates(x - step)) / (2 * step[j])
    found = np.abs(np.linalg.eigvals(slopes))
    fast = float(found.max())
    kept = found[found > _SLOWEST * fast]
    return fast, float(kept.min())


def _drive(one: Driven, source: np.random.Generator, n: int, subs: int, rate: float, fast: float, slow: float) -> Float:
    """Values at 0, 1/2 and 1 of every step [n, subs, 3]."""
    t = (np.arange(n)[:, None, None] + (np.arange(subs)[:, None] + np.array([0, 0.5, 1])) / subs) / rate
    low, high = slow / (2 * math.pi) / 3, min(fast / 3, rate / 6) / (2 * math.pi)
    high = max(high, 2 * low)
    if one.held:
        t = np.broadcast_to(t[:, :1, :1], t.shape)
    if one.shape == "sines":
        hz = np.geomspace(low, high, 6) * source.uniform(0.9, 1.1, 6)
        phase, size = source.uniform(0, 2 * math.pi, 6), source.uniform(0.5, 1, 6)
        wave = sum(a * np.sin(2 * math.pi * f * t + b) for f, b, a in zip(hz, phase, size, strict=True))
    elif one.shape == "chirp":
        length = n / rate
        growth = math.log(high / low) / length
        wave = np.sin(2 * math.pi * low * np.expm1(growth * t) / growth)
    else:
        length = n / rate
        many = math.ceil(length * fast) + 2
        lasts = np.exp(source.uniform(math.log(max(1 / fast, 2 / rate)), math.log(max(1 / slow, 4 / rate)), many))
        levels = source.uniform(-1, 1, many) if one.shape == "steps" else source.choice((-1.0, 1.0), many)
        begins = np.broadcast_to(t[..., :1], t.shape)  # a measured step comes between two samples, but within no step
        wave = levels[np.searchsorted(np.cumsum(lasts), begins)]
    return np.asarray(one.mean + one.amplitude * wave / max(float(np.abs(wave).max()), 1e-300))


def _bound(plant: _Plant, rig: RandomRig, u: Float, rate: float) -> dict[str, float]:
    """Cramer-Rao, with the start of the motion unknown; inf: the recording does not determine it."""
    values, start = np.array(rig.values, float), np.array(rig.start, float)
    sd = np.array([one.resolution * math.hypot(_NOISE, 12**-0.5) for one in rig.sensed])
    free = [j for j, one in enumerate(rig.sensed) if not one.code.startswith("u[")]
    names = list(rig.truth)
    span = np.array([max(abs(v), rig.small.get(name, 0.0)) for name, v in rig.truth.items()])
    columns = []
    starts = [k for k in range(len(start)) if k not in rig.counted]
    for k, size in [*enumerate(span), *((len(values) + k, max(abs(start[k]), 1e-3)) for k in starts)]:
        ends = []
        for direction in (1, -1):
            moved = np.concatenate([values, start])
            moved[k] += direction * _ODD_STEP * size
            y, _ = plant.run(moved[: len(values)], moved[len(values) :], u.copy(), rate)
            ends.append((y[:, free] / sd[free]).ravel())
        columns.append((ends[0] - ends[1]) / (2 * _ODD_STEP))
    slopes = np.stack(columns, 1)
    if not np.isfinite(slopes).all():
        return dict.fromkeys(names, math.inf)
    size = np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    inverse = np.linalg.pinv(slopes / size, rcond=1e-10)
    error = np.sqrt((inverse**2).sum(1)) / size
    seen = size[: len(names)] > 1e-12 * size.max()
    return {name: float(error[k] * span[k]) if seen[k] else math.inf for k, name in enumerate(names)}
