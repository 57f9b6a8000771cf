"""Plays the weak and the strong form as the compiler of CC makes them, in both cores: a good run first and then what no
sensor sends; for a compiler that checks every access and every operation and ends the program at the first fault.

    python hostile_runs.py            all of it; prints how many ticks
    python hostile_runs.py --planted  reads one byte behind an array, to show that it would be seen
"""

import ctypes
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.codegen.strong_library import strong_native
from pvid.codegen.strong_library_q31 import StrongNativeQ31
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.configuration.strong import strong_design
from pvid.configuration.strong_q31 import fixed_design
from pvid.configuration.weak import config_for_simulated_rig
from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.core.native import Native, Stepper
from pvid.models.mechanisms import compiled_of
from pvid.rig.run import Recording
from pvid.settings.enums import Law
from pvid.settings.parts import GateConfig
from pvid.sim.simulated_run import simulation_of

Samples = npt.NDArray[Any]

TICKS = 3000  # past the work on the first two windows
RANDOM = np.random.default_rng(7)
# Of the estimator, in float32 and in fixed point.
WEAK: tuple[tuple[dict[str, Any], dict[str, Any]], ...] = (
    ({}, {}),
    ({"forgetting_s": 5.0, "divider": 2}, {"forgetting_groups": 8, "divider": 2}),
    ({"kappa_min": 0.0, "noise_margin": 0.0}, {"kappa_min": 0, "noise_margin": 0}),
)
# Of the strong form in float32: law, divider, exact_every and gate.
STRONG = ((Law.STATIONARY, 8, 0, 0.0), (Law.STATIONARY, 1, 8, 6.0), (Law.PSEUDOVELOCITY, 1, 1, 6.0))


def float_samples(run: Mapping[str, Samples]) -> Iterator[tuple[Samples, Samples]]:
    """The run; then no numbers, infinities, what overflows when squared, subnormals, any words, squares, zeros."""
    phi, y = (run[name][:TICKS].astype(np.float32) for name in ("phi", "y"))
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


def played(identifier: Stepper, run: Callable[[Samples], object], parts: Iterator[tuple[Samples, Samples]]) -> int:
    """One after the other through the same identifier, which takes y first; samples are missing after each."""
    done = 0
    for phi, y in parts:
        run(np.stack([y, phi], axis=1))
        identifier.assess()
        identifier.gap()
        done += len(phi)
    return done


def play_all() -> int:
    """Every form, core and setting; returns the ticks."""
    done = 0
    run = simulation_of("kapitza").run(1)
    compiled = compiled_of("kapitza")
    config, weak = config_for_simulated_rig(compiled), weak_q31_for_simulated_rig(compiled)
    y, phi = weak.counts_of({name: run[name][:TICKS] for name in ("phi", "y")}).T
    for in_float, in_fixed in WEAK:
        own = replace(config, estimator=replace(config.estimator, **in_float), range=None)
        identifier = weak_native(compiled, config.design).identifier_of(own)
        done += played(identifier, identifier.run_samples, float_samples(run))
        of_counts = replace(weak.config, estimator=replace(weak.config.estimator, **in_fixed))
        counting = weak_native_q31(weak.made, weak.parameters, of_counts).identifier()
        done += played(counting, counting.run_samples, count_samples(phi, y, 2**12, 2**13))
    recording = Recording(
        run["t"], {name: run[name] for name in ("y", "phi")}, simulation_of("kapitza").rig.sample_rate
    )
    base = strong_design(compiled, recording)
    assert [one.name for one in base.strong.signals] == ["y", "phi"]
    for law, divider, exact_every, sigmas in STRONG:
        estimator = replace(base.config.estimator, law=law, divider=divider, forgetting_s=3.0 if sigmas else 0.0)
        settings = replace(base.config, estimator=estimator, exact_every=exact_every, gate=GateConfig(sigmas, 1.0))
        strong = strong_native(base.strong, settings).identifier_of(settings)
        done += played(strong, strong.run_samples, float_samples(run))
    fixed = fixed_design(compiled, recording, base)
    y_max, phi_max = fixed.strong_q31.config.full_scale
    y, phi = fixed.counts[:TICKS].T
    in_counts = StrongNativeQ31(fixed.strong_q31).started()
    done += played(in_counts, in_counts.run_samples, count_samples(phi, y, phi_max, y_max))
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
        print(f"{play_all()} ticks")
