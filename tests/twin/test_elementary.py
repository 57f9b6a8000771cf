"""The elementary functions of generated code: C and twin have the same bits, also of what is no angle or no number."""

from __future__ import annotations

import ctypes
import subprocess
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from pvid.core.sources import INCLUDES, source
from pvid.twin.f32 import elementary
from pvid.twin.q31 import elementary as elementary_q31
from pvid.twin.q31.scaled import Scaled, scaled

LOOPS = """
#include "pvid/elementary.h"
#include "pvid/elementary_q31.h"
#define EVERY(name, type, call)                                                                             \
    void name(unsigned n, const type *x, type *out) { for (unsigned k = 0; k < n; k++) { out[k] = call; } }
#define FLOATS(name, call) EVERY(name, float, call)
#define INTEGERS(name, call) EVERY(name, int32_t, call)
#define NUMBERS(name, call) EVERY(name, pvid_scaled_q31, call)
FLOATS(sine, pvid_sin_f32(x[k]))
FLOATS(cosine, pvid_cos_f32(x[k]))
FLOATS(sign, pvid_sign_f32(x[k]))
FLOATS(magnitude, pvid_magnitude_f32(x[k]))
FLOATS(soft_sign, pvid_soft_sign_f32(x[k], 0.75f))
FLOATS(tanh, pvid_tanh_f32(x[k]))
INTEGERS(sine_7, pvid_sin_q31(x[k], 7))
INTEGERS(sine_30, pvid_sin_q31(x[k], 30))
INTEGERS(cosine_0, pvid_cos_q31(x[k], 0))
INTEGERS(cosine_26, pvid_cos_q31(x[k], 26))
INTEGERS(sign_q31, pvid_sign_q31(x[k]))
INTEGERS(soft_sign_q31, pvid_soft_sign_q31(x[k] / 2, 12345))
INTEGERS(product, pvid_fixed_product_q31(x[k], 1000003, 30))
INTEGERS(quotient, pvid_fixed_quotient_q31(1000003, x[k], 9))
INTEGERS(shifted, pvid_fixed_shift_q31(x[k], 5))
NUMBERS(scaled_sine, pvid_scaled_sin_q31(x[k]))
NUMBERS(scaled_cosine, pvid_scaled_cos_q31(x[k]))
NUMBERS(scaled_sign, pvid_scaled_sign_q31(x[k]))
NUMBERS(scaled_magnitude, pvid_scaled_magnitude_q31(x[k]))
NUMBERS(scaled_quotient, pvid_scaled_quotient_q31(x[(k * 7u) % n], x[k]))
"""
PAIR = np.dtype([("m", np.int32), ("e", np.int32)])


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("elementary")
    (folder / "loops.c").write_text(LOOPS, encoding="utf-8")
    core = [str(source(f"{one}.c")) for one in ("elementary_f32", "elementary_q31", "scaled_q31", "integer_q31")]
    options = ["-std=c99", "-O2", "-shared", "-fPIC", "-ffp-contract=off", *INCLUDES]
    target = folder / "loops.so"
    subprocess.run(["gcc", *options, str(folder / "loops.c"), *core, "-o", str(target), "-lm"], check=True)
    return ctypes.CDLL(str(target))


def by_c(library: ctypes.CDLL, name: str, x: npt.NDArray[Any]) -> npt.NDArray[Any]:
    out = np.empty_like(x)
    getattr(library, name)(len(x), ctypes.c_void_p(x.ctypes.data), ctypes.c_void_p(out.ctypes.data))
    return out


@pytest.fixture(scope="module")
def floats() -> npt.NDArray[np.float32]:
    """Of every size and sign, near multiples of pi / 2, and the special ones."""
    random = np.random.default_rng(1)
    sizes = random.uniform(-1, 1, 50_000) * 10.0 ** random.uniform(-40, 39, 50_000)
    angles = random.uniform(-17000, 17000, 50_000)
    quarters = np.arange(-12000, 12000) * (np.pi / 2)
    special = [0.0, -0.0, np.inf, -np.inf, np.nan, 16384, -16384, 16384.002, 1.4e-45]
    with np.errstate(over="ignore"):
        return np.concatenate([sizes, angles, quarters, special]).astype(np.float32)


@pytest.mark.parametrize("name", ["sine", "cosine", "sign", "magnitude", "soft_sign", "tanh"])
def test_floats(name: str, library: ctypes.CDLL, floats: npt.NDArray[np.float32]) -> None:
    with np.errstate(all="ignore"):
        twin = (
            elementary.soft_sign(floats, np.float32(0.75)) if name == "soft_sign" else getattr(elementary, name)(floats)
        )
    found = by_c(library, name, floats)
    assert (np.isnan(found) == np.isnan(twin)).all()
    numbers = ~np.isnan(twin)
    assert (found[numbers].view(np.uint32) == twin[numbers].view(np.uint32)).all()


def test_integers(library: ctypes.CDLL) -> None:
    random = np.random.default_rng(2)
    x = random.integers(-(2**31) + 1, 2**31, 100_000).astype(np.int32)
    x[:3] = 0, 2**31 - 1, -(2**31) + 1
    wide = x.astype(np.int64)
    half = np.sign(wide) * (np.abs(wide) // 2)  # C divides towards 0
    for name, twin in {
        "sine_7": elementary_q31.sine(wide, 7),
        "sine_30": elementary_q31.sine(wide, 30),
        "cosine_0": elementary_q31.cosine(wide, 0),
        "cosine_26": elementary_q31.cosine(wide, 26),
        "sign_q31": elementary_q31.sign(wide),
        "soft_sign_q31": elementary_q31.soft_sign(half, 12345),
        "product": elementary_q31.product(wide, 1000003, 30),
        "quotient": elementary_q31.quotient(1000003, wide, 9),
        "shifted": elementary_q31.shift(wide, 5),
    }.items():
        assert (by_c(library, name, x) == twin).all(), name


def test_numbers_of_any_size(library: ctypes.CDLL) -> None:
    random = np.random.default_rng(3)
    m = random.integers(-(2**30), 2**30 + 1, 100_000)
    m[:5] = 0
    x = scaled(m, random.integers(-70, 20, len(m)))
    pairs = np.empty(len(m), PAIR)
    pairs["m"], pairs["e"] = x.m, x.e
    turned = np.arange(len(m)) * 7 % len(m)
    for name, twin in {
        "scaled_sine": elementary_q31.scaled_sine(x),
        "scaled_cosine": elementary_q31.scaled_cosine(x),
        "scaled_sign": elementary_q31.scaled_sign(x),
        "scaled_magnitude": elementary_q31.scaled_magnitude(x),
        "scaled_quotient": elementary_q31.scaled_quotient(Scaled(x.m[turned], x.e[turned]), x),
    }.items():
        found = by_c(library, name, pairs)
        assert (found["m"] == twin.m).all() and (found["e"] == twin.e).all(), name
