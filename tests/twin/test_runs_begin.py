"""Integrals since the start of a run that does not begin at rest: what came before the first step counts."""

from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from pvid.codegen.weak_library import weak_native
from pvid.compare.weak import compare_counts, compare_recording, compare_samples
from pvid.configuration.weak import samples_of, weak_config
from pvid.configuration.weak_q31 import weak_q31_for_run
from pvid.identification.analysis import analysed
from pvid.identification.core import identify_in_c
from pvid.model import Integral, Model
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.design import WeakDesign
from pvid.rig.run import Recording
from pvid.settings.enums import Core

Float = npt.NDArray[np.float64]

TRUTH = {"R0": 0.02, "R1": 0.015, "T1": 20.0, "s": 2e-5, "E": 3.7}


def cell() -> CompiledModel:
    model = Model("cell")
    v = model.sensor("v", "V", resolution=1e-3, reach=5)
    i = model.sensor("i", "A", resolution=5e-3, reach=12, driven=True, gain_sd=0)
    z, h = model.define("z", "A*s", Integral(i, 1)), model.unmeasured("h", "V")
    R0, R1, T1 = model.unknown("R0", "ohm", 0.02), model.unknown("R1", "ohm", 0.015), model.unknown("T1", "s", 20.0)
    s, E = model.unknown("s", "V/(A*s)", 2e-5), model.unknown("E", "V", 3.7, sd=1.0)
    model.equation(v - E + s * z + R0 * i + h)
    model.equation(T1 * h.d() + h - R1 * i)
    return model.compiled("cell")


@cache
def loaded_from_the_start() -> Recording:
    """At 1 Hz; the current changes between samples, and is large in the first half minute."""
    rng, n, parts = np.random.default_rng(7), 6000, 4
    i = np.repeat(rng.normal(0.0, 3.0, n // 15 + 1), 15 * parts)[: n * parts]
    i[: 40 * parts] = np.repeat([6.0, 1.0, 7.0, 2.0], 10 * parts)
    i = np.roll(i, -2)
    z = np.concatenate([[0.0], np.cumsum(i)[:-1]]) / parts
    h = np.zeros(n * parts)
    fade = np.exp(-1 / (parts * TRUTH["T1"]))
    for k in range(n * parts - 1):
        h[k + 1] = fade * h[k] + (1 - fade) * TRUTH["R1"] * i[k]
    v = TRUTH["E"] - TRUTH["s"] * z - TRUTH["R0"] * i - h

    def read(x: Float, lsb: float) -> Float:
        return np.asarray(np.rint(x[::parts] / lsb + rng.normal(0.0, 0.5, n)) * lsb)

    return Recording(np.arange(n, dtype=np.float64), {"v": read(v, 1e-3), "i": read(i, 5e-3)}, 1.0)


def design_of(decimation: int, taps: int) -> WeakDesign:
    return WeakDesign(1.0, 600.0, functions=16, decimation=decimation, taps=taps, degree=4)


@pytest.mark.parametrize("core", ["f32", "q31"])
def test_a_cell_that_is_loaded_from_the_start_has_the_right_voltage(core: Core) -> None:
    """The integral was a rectangle of the current at the first step: E was 15 standard errors off."""
    answer = analysed(loaded_from_the_start(), cell())
    found = identify_in_c(answer, core).values
    for name in ("E", "s"):
        one = found[name]
        assert one.value is not None and one.se_noise is not None
        assert abs(one.value - TRUTH[name]) < 4 * one.se_noise, name
    assert compare_recording(cell(), loaded_from_the_start(), core).equal


@pytest.mark.parametrize(("decimation", "taps"), [(1, 1), (1, 9), (3, 25), (8, 61)])
def test_the_integral_begins_at_the_first_sample_whatever_a_step_is(decimation: int, taps: int) -> None:
    """Up to 38 s before the first step, in which 100 As flow: 2 mV of E. Every bit is that of the twin."""
    recording = loaded_from_the_start()
    config = weak_config(cell(), recording.signals, design_of(decimation, taps))
    samples = samples_of(config, recording.signals)
    assert config.design.decimation == decimation
    assert compare_samples(cell(), config, samples).equal
    identifier = weak_native(cell(), config.design).identifier_of(config)
    identifier.run_samples(samples, sums=False)
    place = cell().p_names.index("E")
    estimate = identifier.estimate
    error = float(estimate["p"][place]) - TRUTH["E"]
    # behind steps of 8 s the filter of the first step's current is not that of the outputs before it: 5 As
    assert abs(error) < max(4 * float(estimate["covariance"][place][place]) ** 0.5, 1.5e-4 if decimation == 8 else 0.0)
    fixed = weak_q31_for_run(cell(), recording.signals, design_of(decimation, taps))
    assert compare_counts(fixed, fixed.counts_of(recording.signals)).equal


def test_an_integral_of_a_product_with_a_rate_has_the_bits_of_the_twin() -> None:
    """Its derivative is not known before the first step: there it is that of the first step."""
    model = Model("work of a force")
    F, x = model.sensor("F", "N", resolution=1e-3, reach=10, driven=True, gain_sd=0), model.sensor("x", "m", noise=1e-3)
    w, y = model.define("w", "N*m", Integral(F * x.d(), 1)), model.sensor("y", "N*m", noise=1e-3, reach=20)
    g, y0 = model.unknown("g", "", 1.0), model.unknown("y0", "N*m", 0.0, positive=False, sd=1.0)
    k = model.unknown("k", "N", 2.0)
    model.equation(y - g * w - y0 - k * x)
    compiled = model.compiled("work")
    t, rng = np.arange(4000) * 0.01, np.random.default_rng(3)
    force = 2 * np.cos(0.7 * t)
    place = np.sin(1.3 * t)
    work = np.concatenate([[0.0], np.cumsum(force[1:] * np.diff(place))])
    noise = rng.normal(0.0, 1e-3, (2, len(t)))
    signals = {"F": force, "x": place + noise[0], "y": 1.2 * work + 0.3 + 2.1 * place + noise[1]}
    config = weak_config(compiled, signals, WeakDesign(100.0, 6.0, decimation=2, taps=15, degree=4))
    assert compare_samples(compiled, config, samples_of(config, signals)).equal
