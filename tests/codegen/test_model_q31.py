"""Every mechanism's generated theta and C in the fixed-point estimator: C and twin have the same integers, and p is
found."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from block_models import Q31InC
from generated import WARNINGS, exactly, functions_by_name
from printed_estimator import PrintedEstimator, printed_core

from bench.kinds import KINDS
from pvid.codegen import files_functions
from pvid.codegen.fixed_model import FixedModel, fixed_model
from pvid.codegen.formats import bits_of
from pvid.codegen.generated import GeneratedModel
from pvid.core.native import Native
from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, core_sources
from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31

Float = npt.NDArray[np.float64]

SIZES = {"PVID_MAX_P": 8, "PVID_MAX_THETA_Q31": 16, "PVID_MAX_MOMENTS_Q31": 136, "PVID_MAX_C_Q31": 40}
OPTIONS = ["-std=c99", *(f"-D{name}={size}" for name, size in SIZES.items())]
ROW_SD = 1e-3
Y_BITS = 22
GROUPS = 24


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Objects of the fixed-point core with room for every mechanism."""
    folder = tmp_path_factory.mktemp("core")
    sources = [str(path) for path in core_sources() if not path.stem.endswith("_f32")]
    subprocess.run(["gcc", *OPTIONS, "-O1", "-fPIC", *INCLUDES, "-c", *sources], check=True, cwd=folder)
    return [str(path) for path in folder.glob("*.o")]


def texts_of(fixed: FixedModel) -> dict[str, str]:
    """The generated model."""
    model = GeneratedModel(fixed.functions.model, "test")
    return files_functions.printed_f32(model) | files_functions.printed_q31(model)


def native_of(fixed: FixedModel, core: list[str], folder: Path) -> Native:
    """The core with the generated model in it."""
    name = fixed.functions.name
    for file, text in texts_of(fixed).items():
        (folder / file).write_text(text, encoding="utf-8")
    library = folder / "libmodel.so"
    made = [*OPTIONS, *WARNINGS, "-O1", "-shared", "-fPIC", *INCLUDES, str(folder / f"{name}_q31.c"), *core]
    subprocess.run(["gcc", *made, "-o", str(library)], check=True)
    plain = folder / "plain"
    plain.mkdir()
    for header in ("stdbool", "stddef", "stdint", "string", "math"):
        (plain / f"{header}.h").touch()
    text = f'#include "pvid/estimator_q31.h"\nextern const pvid_model_q31 {name}_model_q31;\n'
    (folder / "all.h").write_text(text, encoding="utf-8")
    options = [*OPTIONS, "-E", "-P", "-nostdinc", f"-I{plain}", *PUBLIC_INCLUDES, str(folder / "all.h")]
    subprocess.run(["gcc", *options, "-o", str(folder / "pvid.i")], check=True)
    return Native(library)


def config_of(fixed: FixedModel, size: Float) -> EstimatorConfigQ31:
    """The start is a tenth off; size: of the entries of N, of which 2^28 is eight times."""
    unknowns = fixed.functions.model.unknowns
    off = [0.1 * (abs(one.guess) or one.sd) for one in unknowns]
    bits = [bits_of((0.0, 10 * (abs(one.guess) + 3 * d))) for one, d in zip(unknowns, off, strict=True)]

    def integers(values: list[float]) -> tuple[int, ...]:
        return tuple(round(value * 2.0**places) for value, places in zip(values, bits, strict=True))

    return EstimatorConfigQ31(
        start=integers([one.guess + d for one, d in zip(unknowns, off, strict=True)]),
        start_sd=integers([3 * d for d in off]),
        lower=integers([0.01 * one.guess if one.positive else -10 * d for one, d in zip(unknowns, off, strict=True)]),
        upper=integers([5 * one.guess if one.positive else 10 * d for one, d in zip(unknowns, off, strict=True)]),
        p_bits=tuple(bits),
        n_bits=tuple(int(np.floor(25 - np.log2(one))) for one in size),
        y_bits=Y_BITS,
        row_sd=round(ROW_SD * 2 ** (Y_BITS + 8)),
    )


@pytest.mark.parametrize("name", KINDS)
def test_core_and_twin_have_the_same_integers_and_find_p(name: str, core: list[str], tmp_path: Path) -> None:
    fixed = fixed_model(functions_by_name(name))
    functions = fixed.functions
    native = native_of(fixed, core, tmp_path)
    truth = np.array([one.guess for one in functions.model.unknowns])
    theta = np.array(exactly(functions, functions.theta, truth[:, None]))[:, 0]
    size = 1 / np.maximum(np.abs(theta), 1e-2 * np.abs(theta).max())  # each N theta is about 1
    config = config_of(fixed, size)
    pointer = native.headers.ffi.addressof(native.library, f"{functions.name}_model_q31")
    c = Q31InC(native, pointer, config)
    texts = {file: text for file, text in texts_of(fixed).items() if not file.endswith("_f32.c")}
    module = printed_core("q31", SIZES, texts, [f"{name}_model_q31"])
    twin = PrintedEstimator(native, module, getattr(module, f"{functions.name}_model_q31"), config)
    random = np.random.default_rng(6)
    n_scale = 2.0 ** np.array(config.n_bits)
    for _ in range(GROUPS):
        for kind, rows in enumerate(functions.kinds):
            own = slice(rows.theta.start, rows.theta.stop)
            for _ in range(4):
                n = np.round(np.clip(random.standard_normal(len(rows.theta)), -5, 5) * size[own] * n_scale[own])
                y = round((n / n_scale[own] @ theta[own] + ROW_SD * random.standard_normal()) * 2.0**Y_BITS)
                integers = n.astype(np.int64)
                assert c.add(kind, integers, y) == twin.add(kind, integers, y) == Reason.ACCUMULATED
        assert c.update() == twin.update()
        assert c.iterate() == twin.iterate()
        assert np.array_equal(c.p, twin.p)
        assert np.array_equal(c.sums, twin.sums)
    estimate, n_p = c.assess(), len(truth)
    assert estimate.tobytes() == twin.assess().tobytes()
    unit = 2.0 ** -np.array(config.p_bits, np.float64)
    error, se = c.p * unit - truth, estimate["se"][:n_p] * unit
    assert np.all(np.abs(error) < 5 * se), (error / se).round(1)
    # the rows' noise explains the residuals: theta's 30 digits are finer
    assert abs(int(estimate["residual_sd"]) / config.row_sd - 1) < 0.2
