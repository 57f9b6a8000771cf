"""Mutated rig files and runs."""

from __future__ import annotations

import math
import random
from dataclasses import MISSING, fields
from pathlib import Path

import numpy as np

from pvid.rig.file import Identifier, Nominal, RigFile, Sensor
from pvid.rig.run import Run, write_run

# What a key may be told that it does not expect, or hardly.
_ODD = (
    *("0", "-0.0", "1", "-1", "nan", "-nan", "inf", "-inf", "1e-300", "5e-324", "1e308", "1e-6", "1e6", "1e12", "0.5"),
    *("2", "3", "12", "16", "1000", "65535", "65536", "2147483648", "9007199254740993", "1e-3", "1e3", "0.999"),
    *("'weak'", "'strong'", "'f32'", "'q31'", "'f64'", "'stationary'", "'pseudovelocity'", "'savitzky-golay'"),
    *("'finite-difference'", "true", "false", "[]", "{}", "[1,2]", "{a=1}", "1979-05-27", "07:32:00", "'\\u0000'"),
    *('"\\u202e\\u001b[31m"', "0x7fffffff", "1_000", "''"),
)
_USUAL = {"l1": 0.3, "sample_rate": 400.0, "phi_lsb": 3.8e-4, "y_lsb": 5e-6, "l2": 0.1, "rho2": 0.1, "g": 9.8}
_FASTEST_HZ = 5e4
_LEAST = 1e-9  # drawn where a range begins with 0
_CSV_BYTES = b",;\n\r\t\"' .-+eE0123456789naif\x00\xff"
_SUFFIXES = (".csv", ".csv.gz", ".npz", ".parquet")
_APPENDED = ("[sensor]\n", "l1=2\n", "[[identifier]]\n", "x.y.z=1\n", "\ufeff", "[identifier.window_s]\na=1\n")


def rig_text(draw: random.Random) -> bytes:
    """A rig file whose keys have values from their ranges, at the ends of them and beyond; some are not TOML."""
    lines = []
    for owner, table in ((RigFile, ""), (Sensor, "sensor"), (Nominal, "nominal"), (Identifier, "identifier")):
        keys = [one for one in fields(owner) if one.metadata or one.type == "bool"]
        if table:
            lines.append(f"[{table}]")
            keys = draw.sample(keys, draw.randint(0, min(len(keys), draw.choice((1, 1, 2, 3, 6)))))
        for key in keys:
            usual = key.name in ("l1", "sample_rate") and draw.random() < 0.85
            text = repr(_USUAL[key.name]) if usual else _value(key.name, dict(key.metadata), key.default, draw)
            lines.append(f"{key.name} = {text}")
    text = "\n".join(lines) + "\n"
    kind = draw.random()
    if kind < 0.04:
        noisy = bytearray(text.encode())
        for _ in range(draw.randint(1, 5)):
            noisy[draw.randrange(len(noisy))] = draw.randrange(256)
        return bytes(noisy)
    if kind < 0.06:
        text += draw.choice(_APPENDED)
    return text.encode()


def _value(name: str, limits: dict[str, object], default: object, draw: random.Random) -> str:
    kind = draw.random()
    if kind < 0.2:
        return draw.choice(_ODD)
    if "choices" in limits:
        choices = limits["choices"]
        assert isinstance(choices, tuple)
        return f"'{draw.choice(choices)}'"
    if "low" not in limits:
        return draw.choice(("true", "false"))
    low, high = (float(str(limits[end])) for end in ("low", "high"))
    if name == "sample_rate":
        high = _FASTEST_HZ  # a design for a megahertz simulates millions of samples
    whole = default is not MISSING and type(default) is int
    if kind < 0.4:
        value = draw.choice((low, high))
    elif kind < 0.7:
        value = math.copysign(10 ** draw.uniform(math.log10(max(low, _LEAST)), math.log10(high)), 1.0)
    else:
        value = min(_USUAL.get(name, 1.0) * 10 ** draw.uniform(-1, 1), high)
    return str(round(value)) if whole else repr(float(value))


def written_runs(run: Run, folder: Path) -> dict[str, bytes]:
    """The run in each format, by suffix."""
    found = {}
    for suffix in _SUFFIXES:
        path = folder / f"original{suffix}"
        write_run(path, run)
        found[suffix] = path.read_bytes()
        path.unlink()
    return found


def distorted_run(run: Run, draw: random.Random) -> bytes:
    """CSV of a run whose signals are what other rigs, other units and broken sensors make of them."""
    signals = {"t": run.t.copy(), "phi": run.phi.copy(), "y": run.y.copy()}
    count = len(run)
    for _ in range(draw.choice((1, 1, 2, 3))):
        name = draw.choice(("phi", "phi", "y", "y", "t"))
        data = signals[name]
        first = draw.randrange(count)
        part = slice(first, min(count, first + draw.choice((1, 2, 50, count))))
        size = draw.choice((1.0, -1.0)) * 10 ** draw.choice((0, 1, 3, 6, -3, -9, draw.uniform(-320, 300)))
        with np.errstate(all="ignore"):
            kind = draw.randrange(8)
            if kind == 0:
                data *= size
            elif kind == 1:
                data += size
            elif kind == 2:
                data[part] = size
            elif kind == 3:
                data[part] = draw.choice((math.nan, math.inf, -math.inf, 0.0))
            elif kind == 4:
                data[:] = data[::-1].copy()
            elif kind == 5:
                data[:] = np.round(data / size) * size
            elif kind == 6:
                data[:] = signals[draw.choice(("t", "phi", "y"))]
            else:
                data += size * np.random.default_rng(draw.randrange(1 << 30)).standard_normal(count)
    rows = zip(*(map(repr, one.tolist()) for one in signals.values()), strict=True)
    return "\n".join(["t,phi,y", *map(",".join, rows), ""]).encode()


def mutated_run(original: bytes, draw: random.Random) -> bytes:
    """With bytes changed, dropped, doubled or put in, anywhere or near the ends, where formats have their tables."""
    data = bytearray(original)
    for _ in range(draw.choice((1, 1, 2, 5, 50))):
        near = min(600, len(data))
        where = draw.random()
        at = draw.randrange(len(data) if where < 0.5 else near)
        if where > 0.75:
            at = len(data) - 1 - at
        kind = draw.random()
        if kind < 0.5:
            data[at] = draw.randrange(256)
        elif kind < 0.6:
            del data[at : at + draw.randint(1, 20)]
        elif kind < 0.7:
            data[at:at] = bytes(draw.choices(_CSV_BYTES, k=draw.randint(1, 9)))
        elif kind < 0.75:
            del data[at + 1 :]
        elif kind < 0.8:
            data[at:at] = data[at : at + draw.randint(1, 400)]
        else:
            data[at] ^= 1 << draw.randrange(8)
        data = data or bytearray(b"x")
    return bytes(data)
