"""Plays every form and core of the library that PVID_NATIVE_LIBRARY names, a good run first and then what no sensor
sends; for a library whose compiler checks every access and every operation, which ends the program at the first fault.

    python hostile_runs.py            all of it; prints how many ticks
    python hostile_runs.py --planted  reads one byte behind an array, to show that it would be seen
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.core import snapshot
from pvid.core.native import Identifier, Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.q31 import WeakConfigQ31
from pvid.setup.f32 import config_of
from pvid.setup.q31 import config_of_q31, counts_of
from pvid.sim.pendulum import simulate, standard_sensors, standard_start

Samples = npt.NDArray[Any]

TICKS = 3000  # past the work on the first two windows
RANDOM = np.random.default_rng(7)
SETTINGS: tuple[dict[str, Any], ...] = (
    {"form": "weak"},
    {"form": "weak", "zero": False, "forgetting_s": 5.0},
    {"form": "weak", "decimation": 1, "window_s": 0.15, "test_functions": 4},
    {"form": "weak", "test_functions": 16},
    {"form": "strong"},
    {"form": "strong", "differentiator": "finite-difference", "stride": 20, "law": "pseudovelocity"},
    {"form": "strong", "differentiator": "finite-difference", "stride": 1, "forgetting_s": 0.1, "divider": 4},
    {"form": "weak", "outlier_gate": 6.0},
    {"form": "strong", "outlier_gate": 6.0, "outlier_patience_s": 0.5},
)
FLOAT_ALONE: tuple[dict[str, Any], ...] = (
    {"form": "weak", "full_angle": True},
    {"form": "weak", "full_angle": True, "damping": True},
)


def rig_of(**identifier: Any) -> RigFile:
    """The standard rig, an encoder of 14 bits for the weak form and of 20 for the strong."""
    rig = RigFile.standard()
    sensor = replace(rig.sensor, phi_lsb=standard_sensors(20 if identifier["form"] == "strong" else 14).phi_lsb)
    return replace(rig, identifier=replace(rig.identifier, **identifier), sensor=sensor)


def float_samples(run: Run) -> Iterator[tuple[Samples, Samples]]:
    """The run; then no numbers, infinities, what overflows when squared, subnormals, any words, squares, zeros."""
    phi, y = run.phi[:TICKS].astype(np.float32), run.y[:TICKS].astype(np.float32)
    yield phi, y
    spoilt = phi.copy()
    spoilt[[0, 3, 700, 1800]] = np.nan, np.inf, -np.inf, 3e38
    yield spoilt, np.roll(spoilt, 5)
    yield 1e30 * phi, -1e30 * y
    yield 1e-42 * phi, 1e-42 * y
    words = RANDOM.integers(0, 2**32, (2, TICKS), np.uint32).view(np.float32)
    yield words[0], words[1]
    yield np.sign(phi), np.sign(y)
    yield np.zeros(TICKS), np.zeros(TICKS)


def count_samples(phi: Samples, y: Samples, phi_max: int, y_max: int) -> Iterator[tuple[Samples, Samples]]:
    """The run; then full scale in and against phase, any words, the largest and smallest, squares, zeros."""
    yield phi, y
    largest = int(np.abs(y).max())
    yield np.where(y > 0, phi_max, -phi_max), y
    yield np.where(y > 0, phi_max, -phi_max) // 4, y * (y_max // largest)
    t = np.arange(TICKS)
    yield phi_max * np.where(t // 50 % 2, 1, -1), y_max * np.where(t // 70 % 2, 1, -1)
    words = RANDOM.integers(-(2**31), 2**31, (2, TICKS))
    yield words[0], words[1]
    within = RANDOM.integers(-phi_max, phi_max + 1, TICKS), RANDOM.integers(-y_max, y_max + 1, TICKS)
    yield within
    yield np.full(TICKS, -(2**31)), np.full(TICKS, 2**31 - 1)
    yield (t * 7) % 2**14 - 2**13, y
    yield np.zeros(TICKS, np.int64), np.zeros(TICKS, np.int64)


def play(identifier: Identifier, samples: Iterator[tuple[Samples, Samples]]) -> int:
    """One after the other through the same identifier, a snapshot and an assessment after each."""
    done = 0
    for phi, y in samples:
        identifier.run(phi, y)
        identifier.assess()
        image = snapshot.save(identifier)
        snapshot.restore(identifier, image[:-1])
        snapshot.restore(identifier, image)
        if not identifier.form == "strong":
            identifier.gap()
        done += len(phi)
    return done


def play_all(native: Native) -> int:
    """Every form, core and setting; returns the ticks."""
    done = 0
    runs = {
        bits: simulate(sensors=standard_sensors(bits), truth="linear", duration=4.0, seed=1).run for bits in (14, 20)
    }
    start = standard_start(3)
    for settings in (*SETTINGS, *FLOAT_ALONE):
        rig = rig_of(**settings)
        run = runs[20 if settings["form"] == "strong" else 14]
        config = config_of(rig, 1000.0, start)
        made = native.identifier(config)
        done += play(made, float_samples(run))
    for settings in SETTINGS:
        rig = rig_of(**settings)
        run = runs[20 if settings["form"] == "strong" else 14]
        fixed = config_of_q31(rig, 1000.0, start)
        phi, y = (counts[:TICKS] for counts in counts_of(rig, run))
        limits = fixed.design if isinstance(fixed, WeakConfigQ31) else fixed.design.bank
        done += play(native.identifier(fixed), count_samples(phi, y, limits.phi_max, limits.y_max))
    return done


def read_behind_an_array(native: Native) -> None:
    """A checksum of one byte more than there is."""
    libc = ctypes.CDLL(None)
    libc.malloc.restype = ctypes.c_void_p
    native.library.pvid_crc32(0, native.headers.ffi.cast("uint8_t *", libc.malloc(16)), 17)


if __name__ == "__main__":
    library = Native()
    if sys.argv[1:] == ["--planted"]:
        read_behind_an_array(library)
    else:
        print(f"{play_all(library)} ticks")
