"""A run of the paper's pendulum in counts, and its identifier: by hand in numpy and on the core in its literal form."""

import ctypes
from dataclasses import dataclass
from functools import cache, cached_property
from math import frexp
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from pvid.board.replay_image import IN_FLASH
from pvid.core.host_compiler import objects_of, run_compiler
from pvid.core.sources import INCLUDES, sources_of
from pvid.oracle.digits import Digits
from pvid.oracle.paper import Fixed, Paper, Single
from pvid.settings.enums import Core

HERE = Path(__file__).parent
RATE, L1 = 50.0, 0.3
PHI_LSB, Y_LSB = np.float32(2 * np.pi / 2**20), np.float32(5e-6)
TRUTH = np.array([9.5 / 0.3, 8.875, 5.625])  # theory.md 6
START, FACTORS = TRUTH * [1.2, 0.85, 1.2], np.array([0.25, 4.0])  # of the bounds
ROW_SD = 5e5  # what the noise of the sensors makes of Y - N^T theta
MISSING = -(2**15)
SIZES = {"PVID_MAX_P": 3, "PVID_MAX_THETA": 11, "PVID_MAX_MOMENTS": 66}
Counts = npt.NDArray[np.int16]


def drive(t: Any, order: int) -> Any:
    """The pivot of the standard rig [m], or a derivative of it."""
    parts = ((6e-3, 1.1, 0.3), (5e-3, 2.3, 1.7), (4e-3, 4.1, 4.0))
    return sum(
        a * (2 * np.pi * f) ** order * np.sin(2 * np.pi * f * t + phase + order * np.pi / 2) for a, f, phase in parts
    )


def motion(samples: int, seed: int) -> Counts:
    """Counts of phi and y [samples, 2] of the pendulum of (1), with the noise of the standard sensors."""
    w, d1, d2 = TRUTH

    def rates(t: float, x: Any) -> list[float]:
        g = w + drive(t, 2) / L1
        return [x[1], -g * x[0] + (d1 - d2 - 1) * g * x[2], x[3], g * x[0] - (d1 - 1) * g * x[2]]

    t = np.arange(samples) / RATE
    phi = solve_ivp(rates, (0, t[-1]), [0.06, 0, 0.08, 0], "DOP853", t, rtol=1e-10, atol=1e-12).y[2]
    exact = np.stack([phi / PHI_LSB, drive(t, 0) / Y_LSB], axis=1)
    return np.rint(exact + np.random.default_rng(seed).normal(0, (0.5, 0.4), exact.shape)).astype(np.int16)


@dataclass(frozen=True)
class PaperRun:
    """Counts int16 [samples, 2] of phi and y, and what to identify them with; to the float core some are MISSING."""

    counts: Counts

    @cached_property
    def samples(self) -> npt.NDArray[np.float32]:
        """[rad] and [m], as the float core gets them."""
        values = self.counts.astype(np.float32) * np.array([PHI_LSB, Y_LSB])
        return np.where(self.counts == MISSING, np.float32(np.nan), values).astype(np.float32)

    # ---- by hand

    @cached_property
    def fixed_settings(self) -> dict[str, Any]:
        """Those of `Fixed`: formats in which the largest numbers of a clean run have 20 bits."""
        p_bits = [30 - frexp(x)[1] for x in FACTORS[1] * TRUTH]
        y, n = (np.abs(x).max(0) for x in rows())
        n_bits = [20 - frexp(x)[1] for x in n]
        y_bits = 20 - frexp(y)[1]

        def of_p(x: Any) -> list[int]:
            return [round(value * 2**bits) for value, bits in zip(x, p_bits, strict=True)]

        def digits(x: float) -> Digits:
            m, e = frexp(x)
            return Digits(round(m * 2**30), e - 30)

        powers = [1.0, *(RATE**order / 12 for order in range(1, 5))]
        return {
            "start": of_p(START),
            "start_sd": of_p(START / 2),
            "lower": of_p(FACTORS[0] * TRUTH),
            "upper": of_p(FACTORS[1] * TRUTH),
            "row_sd": round(ROW_SD * 2.0 ** (y_bits + 8)),
            "formats": (p_bits, n_bits, y_bits),
            "unit": [[digits(float(lsb) * power) for power in powers] for lsb in (PHI_LSB, Y_LSB / L1)],
        }

    def by_hand(self, core: Core) -> npt.NDArray[np.uint32]:
        """p [samples, 3] after every tick, as words."""
        one: Paper
        if core == "f32":
            one, samples = KeepsRows(), self.samples / np.array([1, L1], np.float32)
        else:
            one, samples = Fixed(**self.fixed_settings), self.counts.astype(object)
        words = np.empty((len(samples), 3), np.uint32)
        for tick, (phi, y) in enumerate(samples):
            one.step(phi, y)
            words[tick] = one.p.view(np.uint32) if core == "f32" else one.p.astype(np.uint32)
        return words

    # ---- on the core

    def config(self, core: Core) -> str:
        """`replay_config` in C."""

        def listed(values: Any) -> str:
            return "{" + ", ".join(f"{x.hex()}f" if isinstance(x, float) else str(x) for x in values) + "}"

        if core == "f32":
            one = KeepsRows()
            arrays = {"start": START.astype(np.float32), "lower": one.lower, "upper": one.upper}
            arrays["start_sd"] = arrays["start"] / np.float32(2)
            fields = {name: listed(map(float, values)) for name, values in arrays.items()}
            fields |= {"row_sd": f"{ROW_SD}f", "correlation": "1.0f", "row_weight": "1.0f", "step_limit": "0.3f"}
            fields |= {"update_rate_hz": f"{RATE}f", "law": "PVID_LAW_PSEUDOVELOCITY"}
            before = f".rate = {RATE}f, .l1 = {np.float32(L1)}f, "
        else:
            settings = dict(self.fixed_settings)
            p_bits, n_bits, y_bits = settings.pop("formats")
            units = (listed(f"{{{x.m}, {x.e}}}" for x in row) for row in settings.pop("unit"))
            before = f".unit = {listed(units)}, "
            fields = {name: listed(x) if isinstance(x, list) else str(x) for name, x in settings.items()}
            fields |= {"p_bits": listed(p_bits), "n_bits": listed(n_bits), "y_bits": str(y_bits)}
            fields |= {"correlation": "65536", "row_weight": "65536", "step_limit": "19661"}
        fields |= {"model": f"&paper_model_{core}", "divider": "1"}
        inner = ", ".join(f".{name} = {value}" for name, value in fields.items())
        return f"static const paper_config_{core} replay_config = {{{before}.estimator = {{{inner}}}}};"

    def on_core(self, core: Core, folder: Path, compiler: str = "gcc", *options: str) -> npt.NDArray[np.uint32]:
        """p [samples, 3] after every tick of the C core on this machine, as words."""
        kind = "float" if core == "f32" else "int32_t"
        (folder / f"{core}.c").write_text(
            f'#include "paper_{core}.h"\n{self.config(core)}\n'
            f"int run(uint32_t ticks, const {kind} samples[], uint32_t p[]);\n"
            f"int run(uint32_t ticks, const {kind} samples[], uint32_t p[])\n{{\n"
            f"    static paper_{core} self;\n"
            f"    const pvid_status status = paper_init_{core}(&self, &replay_config);\n"
            "    for (uint32_t k = 0; (status == PVID_OK) && (k < ticks); k++) {\n"
            f"        (void)paper_step_{core}(&self, &samples[2u * k]);\n"
            "        memcpy(&p[3u * k], self.estimator.p, 3u * sizeof p[0]);\n    }\n"
            "    return (int)status;\n}\n",
            encoding="utf-8",
        )
        compile_with_core(core, folder / f"{core}.c", folder / f"{core}.so", compiler, *options, "-shared", "-fPIC")
        library = ctypes.CDLL(str(folder / f"{core}.so"))
        samples = np.ascontiguousarray(self.samples if core == "f32" else self.counts.astype(np.int32))
        words = np.zeros((len(samples), 3), np.uint32)
        assert library.run(len(samples), *(x.ctypes.data_as(ctypes.c_void_p) for x in (samples, words))) == 0
        return words


def compile_with_core(core: Core, source: Path, target: Path, compiler: str, *options: str) -> None:
    """Of the core what the identifier needs, and `source`."""
    rooms = ("number", "solve", "strong", "keep")
    sources = [path for path in (source, *sources_of(core)) if path == source or path.parent.name in rooms]
    sizes = [f"-D{name}={size}" for name, size in SIZES.items()]
    how = ["-std=c99", "-O2", "-ffp-contract=off", *options, *INCLUDES, f"-I{HERE}", *sizes]
    folder = target.with_name(f"{target.name}-objects")
    folder.mkdir()
    objects = objects_of(compiler, how, sources, folder)
    run_compiler([compiler, *options, *objects, "-lm", "-o", str(target)])


class KeepsRows(Single):
    """The identifier by hand in float32; `rows` are the (Y, N) that it has taken."""

    def __init__(self) -> None:
        start, (lower, upper) = START.astype(np.float32), np.outer(FACTORS, TRUTH)
        super().__init__(start, start / np.float32(2), lower, upper, row_sd=ROW_SD, rate=RATE)
        self.rows_taken: list[tuple[Any, Any]] = []

    def take(self, y: Any, n: Any) -> None:
        self.rows_taken.append((y, n))
        super().take(y, n)

    def after(self, samples: npt.NDArray[np.float32]) -> tuple[Any, Any]:
        """Y [rows] and N [rows, 11] in float64 of samples [ticks, 2] of phi [rad] and y [m]."""
        for phi, y in samples / np.array([1, L1], np.float32):
            self.step(phi, y)
        y, n = zip(*self.rows_taken, strict=True)
        return np.array(y, np.float64), np.array(n, np.float64)


@cache
def clean() -> Counts:
    """A run of 100 s."""
    return motion(5000, seed=1)


@cache
def rows() -> Any:
    """Of its first 20 s."""
    return KeepsRows().after(PaperRun(clean()[:1000]).samples)


MAIN = """
#include <stdio.h>
#include "replay_run.h"
static REPLAY_TYPE self;
int main(void)
{
    uint32_t hash = PVID_FNV_START;
    if (REPLAY_INIT(&self, &replay_config) != PVID_OK) {
        return 1;
    }
    for (uint32_t tick = 0; tick < REPLAY_TICKS; tick++) {
        REPLAY_SAMPLE sample[2];
        for (int i = 0; i < 2; i++) {
            sample[i] = (REPLAY_SAMPLE)replay_samples[tick][i] * replay_lsb[i];
#if REPLAY_IS_FLOAT
            sample[i] = (replay_samples[tick][i] == REPLAY_MISSING) ? (0.0f / 0.0f) : sample[i];
#endif
        }
        hash = REPLAY_HASH(hash, &self.estimator, REPLAY_STEP(&self, sample));
        printf("%lu\\n", (unsigned long)hash);
    }
    return 0;
}
"""


def replay_header(run: PaperRun, core: Core) -> str:
    """replay_run.h for firmware/apps/replay, which reports the hash of p."""
    is_float = core == "f32"
    lsb = [f"{float(x).hex()}f" for x in (PHI_LSB, Y_LSB)] if is_float else ["1", "1"]
    lines = [f"    {{{phi}, {y}}}," for phi, y in run.counts.tolist()]
    defined = {
        "TYPE": f"paper_{core}",
        "INIT": f"paper_init_{core}",
        "STEP": f"paper_step_{core}",
        "HASH": f"paper_hash_{core}",
        "SAMPLE": "float" if is_float else "int32_t",
        "COUNT": "int16_t",
        "CHANNELS": "2u",
        "FAULTS": "pvid_arithmetic_faults_f32()" if is_float else "0u",
        "IS_FLOAT": str(int(is_float)),
        "FORM": '"paper"',
        "TICKS": f"{len(run.counts)}u",
        "MEASURE_FROM": "10u",
        "REPORT_EVERY": "100u",
        "MISSING": f"({MISSING + 1} - 1)",
    }
    return "\n".join(
        [
            "#ifndef REPLAY_RUN_H",
            "#define REPLAY_RUN_H",
            '#include "pvid/arithmetic.h"',
            f'#include "paper_{core}.h"',
            *IN_FLASH,
            *(f"#define REPLAY_{name} {value}" for name, value in defined.items()),
            run.config(core),
            f"static const {defined['SAMPLE']} replay_lsb[2] = {{{', '.join(lsb)}}};",
            "static const int16_t replay_samples[REPLAY_TICKS][2] REPLAY_IN_FLASH = {",
            *lines,
            "};",
            "#endif",
            "",
        ]
    )
