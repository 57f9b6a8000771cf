"""The strong form of every mechanism through the core's estimator: C and twin have the same bits, and it converges."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from generated import WARNINGS

from pvid.base.errors import PvidError
from pvid.codegen import files_strong
from pvid.codegen.strong import StrongFunctions, renamed, strong_functions_of
from pvid.codegen.strong_twin import StrongModelConfig, StrongModelTwin, row_of
from pvid.core.native import Native
from pvid.core.sources import INCLUDES, sources_of
from pvid.design.fir import savitzky_golay
from pvid.model import Model
from pvid.model.strong import strong_form
from pvid.models import mechanisms
from pvid.oracle import strong as oracle
from pvid.settings.enums import Reason
from pvid.settings.f32 import EstimatorConfig
from pvid.sim.simulated_run import simulation_of

Float = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]

TICKS = 400
GAP = 180  # a sample of the run that is no number
SIZES = ("-DPVID_MAX_P=8", "-DPVID_MAX_THETA=16", "-DPVID_MAX_MOMENTS=136")
DRIVER = """
#include "{name}.h"
#include <string.h>
int run(uint32_t ticks, const float *sample, uint16_t half, uint16_t stride, const float *weights, float rate,
        const float *row_sd, const float *start, const float *start_sd, const float *lower, const float *upper,
        uint16_t divider, float *p, uint8_t *reason, float *se);
static {name}_f32 identifier;
int run(uint32_t ticks, const float *sample, uint16_t half, uint16_t stride, const float *weights, float rate,
        const float *row_sd, const float *start, const float *start_sd, const float *lower, const float *upper,
        uint16_t divider, float *p, uint8_t *reason, float *se)
{{
    {name}_config_f32 config = {{.bank = {{half, stride, weights}}, .sample_rate_hz = rate}};
    config.estimator = pvid_estimator_defaults_f32;
    config.estimator.divider = divider;
    memcpy(config.row_sd, row_sd, sizeof config.row_sd);
    memcpy(config.estimator.start, start, {upper}_P * sizeof(float));
    memcpy(config.estimator.start_sd, start_sd, {upper}_P * sizeof(float));
    memcpy(config.estimator.lower, lower, {upper}_P * sizeof(float));
    memcpy(config.estimator.upper, upper, {upper}_P * sizeof(float));
    const pvid_status status = {name}_init_f32(&identifier, &config);
    for (uint32_t k = 0; (k < ticks) && (status == PVID_OK); k++) {{
        reason[k] = (uint8_t){name}_step_f32(&identifier, &sample[k * {upper}_SIGNALS]);
        memcpy(&p[k * {upper}_P], identifier.estimator.p, {upper}_P * sizeof(float));
    }}
    pvid_estimate_f32 estimate;
    pvid_estimator_assess_f32(&identifier.estimator, &estimate);
    memcpy(se, estimate.se, {upper}_P * sizeof(float));
    return (int)status;
}}
"""


@cache
def strong_of(name: str) -> StrongFunctions:
    return renamed(strong_functions_of(strong_form(mechanisms.compiled_of(name))))


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The float core with room for every mechanism."""
    folder = tmp_path_factory.mktemp("core")
    command = ["gcc", "-std=c99", "-O1", "-fPIC", *SIZES, *INCLUDES, "-c", *map(str, sources_of("f32"))]
    subprocess.run(command, check=True, cwd=folder)
    library = folder / "core.a"
    subprocess.run(["ar", "rcs", str(library), *map(str, folder.glob("*.o"))], check=True)
    return library


@dataclass
class Steps:
    """What C returns: p [ticks, n_p], reason [ticks], standard errors [n_p]."""

    p: Float32
    reason: npt.NDArray[np.uint8]
    se: Float32


class InC:
    """The generated strong form, compiled with the project's warnings as errors."""

    def __init__(self, strong: StrongFunctions, core: Path, folder: Path) -> None:
        functions = strong.functions
        self.n_p = len(functions.model.unknowns)
        name = functions.name
        files = {
            f"{name}.h": files_strong.header(strong, "test"),
            f"{name}.c": files_strong.source(strong, "test"),
            "driver.c": DRIVER.format(name=name, upper=name.upper()),
        }
        for one, text in files.items():
            (folder / one).write_text(text, encoding="utf-8")
        options = ["-std=c99", "-O2", "-shared", "-fPIC", *WARNINGS, *SIZES, *INCLUDES, f"-I{folder}"]
        sources = [str(folder / f"{name}.c"), str(folder / "driver.c"), str(core)]
        subprocess.run(["gcc", *options, *sources, "-o", str(folder / "strong.so"), "-lm"], check=True)
        header = str(folder / f"{name}.h")
        subprocess.run(["g++", "-fsyntax-only", "-Wall", "-x", "c++", *SIZES, *INCLUDES, header], check=True)
        self._library = ctypes.CDLL(str(folder / "strong.so"))

    def run(self, samples: Float32, config: StrongModelConfig) -> Steps:
        ticks = len(samples)
        out = Steps(np.empty((ticks, self.n_p), np.float32), np.empty(ticks, np.uint8), np.empty(self.n_p, np.float32))
        one = config.estimator
        arrays = [np.ascontiguousarray(x, np.float32) for x in (one.start, one.start_sd, one.lower, one.upper)]
        sd = np.array(config.row_sd, np.float32)
        given = np.ascontiguousarray(samples)

        def at(array: npt.NDArray[np.generic]) -> ctypes.c_void_p:
            return ctypes.c_void_p(array.ctypes.data)

        bank = (ctypes.c_uint16(config.weights.shape[1]), ctypes.c_uint16(config.stride), at(config.weights))
        rate = ctypes.c_float(config.sample_rate)
        results = (ctypes.c_uint16(one.divider), at(out.p), at(out.reason), at(out.se))
        status = self._library.run(ctypes.c_uint32(ticks), at(given), *bank, rate, at(sd), *map(at, arrays), *results)
        assert status == 0
        return out


def recorded(name: str) -> tuple[Float32, Float]:
    """Samples of the shipped rig [ticks, signals], and the true p."""
    simulation = simulation_of(name)
    run = simulation.run(seed=1)
    return np.stack([run[one.name] for one in strong_of(name).signals], 1).astype(np.float32), simulation.truth


def theta_at(strong: StrongFunctions, p: Float) -> Float:
    """theta of the SymPy expressions [n_theta]."""
    values = dict(zip(strong.functions.model.p, p, strict=True))
    return np.array([float(one.subs(values)) for one in strong.functions.theta.expressions])


def config_of(name: str, samples: Float32, truth: Float, window: int = 61, divider: int = 5) -> StrongModelConfig:
    """Started 30 % off, rows weighted by their residuals at the truth."""
    strong, rig = strong_of(name), simulation_of(name).rig
    unknowns = strong.functions.model.unknowns
    bank = savitzky_golay(window, 6)
    start = np.where([one.positive for one in unknowns], 1.3 * truth, 0.0)
    spread = np.where([one.positive for one in unknowns], 0.5 * start, [one.sd for one in unknowns])
    estimator = EstimatorConfig(
        start=start.astype(np.float32),
        start_sd=spread.astype(np.float32),
        lower=np.array([truth[k] / 50 if one.positive else one.low for k, one in enumerate(unknowns)], np.float32),
        upper=np.array([truth[k] * 50 if one.positive else one.high for k, one in enumerate(unknowns)], np.float32),
        row_sd=1.0,
        divider=divider,
    )
    plain = (1.0,) * len(strong.functions.kinds)
    given = StrongModelConfig(rig.sample_rate, bank.weights32, bank.stride, plain, estimator)
    columns, ready = StrongModelTwin(strong, given).columns(samples)
    theta = theta_at(strong, truth)
    sd = []
    for kind in strong.functions.kinds:
        n = columns[kind.columns.start : kind.known, ready].astype(np.float64)
        sd.append(float(np.std(columns[kind.known, ready] - theta[kind.theta.start : kind.theta.stop] @ n)))
    return replace(given, row_sd=tuple(sd))


@pytest.mark.parametrize("name", mechanisms.names())
def test_c_and_twin_have_the_same_bits(name: str, core: Path, tmp_path: Path) -> None:
    samples, truth = recorded(name)
    samples = samples[:TICKS].copy()
    config = config_of(name, samples, truth)
    samples[GAP, 0] = np.nan
    in_c, twin = InC(strong_of(name), core, tmp_path), StrongModelTwin(strong_of(name), config)
    want = twin.run(samples)
    want_p, want_reason = want.p, want.reason
    got = in_c.run(samples, config)
    assert (got.reason == want_reason).all()
    assert (got.p.view(np.uint32) == want_p.view(np.uint32)).all()
    assert want_reason[GAP] == Reason.REJECTED_NOT_FINITE and want_reason[GAP + 40] == Reason.WARMING_UP
    assert (want_reason == Reason.UPDATED).sum() > 20
    assert len(np.unique(want_p, axis=0)) > 20


def test_rigid_body_and_motor_are_identified_from_derivatives(core: Path, tmp_path: Path) -> None:
    """Where the signals are smooth and measured at the order that the row needs; on the shipped rigs' noise."""
    for name, among, bound in (("rigid_body", None, 2e-3), ("dc_motor", ("R", "k"), 5e-3)):
        folder = tmp_path / name
        folder.mkdir()
        samples, truth = recorded(name)
        names = strong_of(name).functions.model.p_names
        found = InC(strong_of(name), core, folder).run(samples, config_of(name, samples, truth, divider=50))
        for p, true, one in zip(found.p[-1], truth, names, strict=True):
            if among is None or one in among:
                assert abs(p / true - 1) < bound, one  # measured: 7e-4 and 8e-4
        assert (found.se > 0).all() and np.isfinite(found.se).all()


def test_the_pendulums_row_is_the_hand_made_one(native: Native) -> None:
    """Kapitza's pendulum without an unknown zero: 11 entries, 18 non-zeros, and the residuals of the core's row."""
    model = Model("pendulum")
    u = model.input("u", "1/s^2", hold="sampled", reach=30)
    phi = model.sensor("phi", "rad", resolution=1e-3)
    x, w = model.unmeasured("phi1", "rad"), model.unknown("w", "1/s^2", 31.67)
    d1, d2 = model.unknown("d1", "", 8.875), model.unknown("d2", "", 5.625)
    g = w + u
    model.equation(x.d(2) + g * x - (d1 - d2 - 1) * g * phi)
    model.equation(phi.d(2) - g * x + (d1 - 1) * g * phi)
    strong = strong_functions_of(strong_form(model.compiled("pendulum")))
    assert len(strong.functions.theta.labels) == 11 and len(strong.functions.c_row) == 18
    random = np.random.default_rng(3)
    phis, us = random.normal(size=(200, 5)), random.normal(size=(200, 3))
    n, y = native.strong_rows(phis, us)
    p = np.array([31.67, 8.875, 5.625])
    hand = oracle.BINOMIAL * oracle.theta(p)
    jets = {"phi": phis.astype(np.float32), "u": us.astype(np.float32)}
    given = np.stack([jets[one.symbol.of][:, one.symbol.order] for one in strong.functions.inputs])
    columns = row_of(strong)(given).astype(np.float64)
    theta = theta_at(strong, p)
    ours = columns[-1] - theta @ columns[:-1]
    theirs = y.astype(np.float64) - n.astype(np.float64) @ hand
    size = np.abs(y) + np.abs(n.astype(np.float64)) @ np.abs(hand)
    sign = np.sign(ours[0] * theirs[0])
    assert (np.abs(ours - sign * theirs) <= 1e-6 * size).all()  # a few roundings to float32


def test_a_row_that_is_integrated_by_parts_is_refused() -> None:
    with pytest.raises(PvidError, match="dc_motor: a row is integrated by parts; give its strong form"):
        strong_functions_of(mechanisms.compiled_of("dc_motor"))


def test_the_header_names_the_sizes_that_it_needs() -> None:
    header = files_strong.header(strong_of("dc_motor"), "test")
    assert '#error "compile pvid and this file with -DPVID_MAX_P=7 -DPVID_MAX_THETA=9 -DPVID_MAX_MOMENTS=25"' in header
    for line in ("sample[0]  V    [V]    held until the next", "sample[2]  phi  [rad]", "phi, derivative 2"):
        assert line in header
