"""The elementary functions of generated code: C and twin have the same bits, also of what is no angle or no number."""

import ctypes
import re
import subprocess
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from pvid.core.sources import FOLDERS, INCLUDES, source
from pvid.twin.printer.program import printed_module

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
FLOATS(tanh_f32, pvid_tanh_f32(x[k]))
INTEGERS(sine_7, pvid_sin_q31(x[k], 7))
INTEGERS(sine_30, pvid_sin_q31(x[k], 30))
INTEGERS(cosine_0, pvid_cos_q31(x[k], 0))
INTEGERS(cosine_26, pvid_cos_q31(x[k], 26))
INTEGERS(sign_q31, pvid_sign_q31(x[k]))
INTEGERS(soft_sign_q31, pvid_soft_sign_q31(x[k] / 2, 12345))
INTEGERS(product, pvid_fixed_product_q31(x[k], 1000003, 30))
INTEGERS(fixed_quotient, pvid_fixed_quotient_q31(1000003, x[k], 9))
INTEGERS(shifted, pvid_fixed_shift_q31(x[k], 5))
NUMBERS(scaled_sine, pvid_scaled_sin_q31(x[k]))
NUMBERS(scaled_cosine, pvid_scaled_cos_q31(x[k]))
NUMBERS(scaled_sign, pvid_scaled_sign_q31(x[k]))
NUMBERS(scaled_magnitude, pvid_scaled_magnitude_q31(x[k]))
NUMBERS(scaled_quotient, pvid_scaled_quotient_q31(x[(k * 7u) % n], x[k]))
"""
OF_FLOATS = ("sine", "cosine", "sign", "magnitude", "soft_sign", "tanh_f32")
NAMES = tuple(re.findall(r"^[A-Z]+\((\w+), pvid", LOOPS, re.MULTILINE))
CORE = tuple(f"{one}.c" for one in ("elementary_f32", "elementary_q31", "scaled_q31", "integer_q31"))
COUNT = 3000
PAIR = np.dtype([("m", np.int32), ("e", np.int32)])


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("elementary")
    (folder / "loops.c").write_text(LOOPS, encoding="utf-8")
    core = [str(source(one)) for one in CORE]
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


def test_the_printed_functions_have_the_bits_of_c(library: ctypes.CDLL, floats: npt.NDArray[np.float32]) -> None:
    """Of floats, integers and numbers of any size."""
    random = np.random.default_rng(2)
    integers = random.integers(-(2**31) + 1, 2**31, COUNT).astype(np.int32)
    integers[:3] = 0, 2**31 - 1, -(2**31) + 1
    twin = printed_module([*map(source, CORE)], FOLDERS, {}, NAMES, {"loops.c": LOOPS})
    for name in NAMES:
        given: list[Any]
        out: list[Any]
        if name in OF_FLOATS:
            x: npt.NDArray[Any] = np.concatenate([floats[-9:], random.choice(floats, COUNT)])
            given, out = list(x), [np.float32(0)] * len(x)
        elif name.startswith("scaled"):
            x = np.zeros(COUNT, PAIR)
            m = random.integers(-(2**30), 2**30 + 1, COUNT)
            short = np.abs(m) < 2**29  # numbers have all their digits, or are 0
            m[short], m[:5] = np.where(m < 0, -1, 1)[short] * 2**29, 0
            x["m"], x["e"] = m, np.where(m == 0, 0, random.integers(-100, -10, COUNT))
            given, out = [twin.pvid_scaled_q31(*one) for one in x.tolist()], [twin.pvid_scaled_q31() for _ in x]
        else:
            x = integers
            given, out = x.tolist(), [0] * len(x)
        with np.errstate(all="ignore"):
            getattr(twin, name)(len(x), given, out)
        found = by_c(library, name, x)
        if name in OF_FLOATS:
            own = np.array(out, np.float32)
            assert np.array_equal(np.isnan(found), np.isnan(own)), name
            numbers = ~np.isnan(own)
            assert found[numbers].tobytes() == own[numbers].tobytes(), name
        elif name.startswith("scaled"):
            assert [(one.m, one.e) for one in out] == found.tolist(), name
        else:
            assert out == found.tolist(), name
