"""Fixed-point weak identifiers of the shipped mechanisms: formats, runs as counts, and their C as a library."""

import ctypes
import subprocess
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.codegen import files_weak_q31
from pvid.codegen.weak import weak_functions_of, weak_model_of
from pvid.codegen.weak_q31 import FixedWeak, JetReaches, fixed_parameters, fixed_weak
from pvid.configuration.weak_formats_q31 import config_of_q31, row_formats
from pvid.configuration.weak_tables import design_tables, for_core
from pvid.core.sources import INCLUDES, sources_of
from pvid.design.weak_q31 import Sensing, fixed_design
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.channels import running_integrals
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.rows import WeakRows, record_of
from pvid.settings.weak import Source
from pvid.settings.weak_q31 import WeakConfigQ31, WeakDesignQ31
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import RigSimulation

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]

# Designs that the identifier has; those of the rigs but for long windows, which would make the tests slow.
DESIGNS = {
    "kapitza": WeakDesign(1000.0, 1.28, 9, 6, decimation=16, taps=61, rate_taps=101, rate_degree=6),
    "dc_motor": WeakDesign(1000.0, 0.4, 16, 6, rate_taps=21, rate_degree=3),
    "cart_pendulum": WeakDesign(1000.0, 0.96, 12, 6, decimation=4, taps=41, rate_taps=41, rate_degree=4),
    "furuta": WeakDesign(1000.0, 0.96, 12, 6, decimation=4, taps=41, rate_taps=41, rate_degree=4),
    "two_link_arm": WeakDesign(1000.0, 0.96, 12, 6, decimation=8, taps=61, rate_taps=61, rate_degree=6),
    "two_mass_drive": WeakDesign(1000.0, 0.48, 16, 8, decimation=2, rate_taps=31, rate_degree=4),
    "rigid_body": WeakDesign(1000.0, 0.96, 12, 6, decimation=8, taps=31, degree=4),
    "battery_2rc": WeakDesign(1.0, 1200.0, 16, 6),
}
_HIGHEST = 2.0  # reach of a jet over the largest of the run


class Rig:
    """A mechanism, its run in counts, and its fixed-point weak form."""

    def __init__(self, name: str, samples: int, seed: int = 0) -> None:
        simulation = RigSimulation.of(compiled_of(name), simulated_rig(name))
        run = simulation.run(seed, Imperfections())
        compiled = compiled_of(name)
        self.name, self.compiled = name, ready(compiled)
        self.oracle_design = for_core(DESIGNS[name])
        self.run = {key: np.asarray(x, np.float64)[:samples] for key, x in run.items()}
        self.made = weak_functions_of(compiled)
        known = {one.name: one for one in compiled.signals}
        # inputs are known exactly: as counts of 16 bits
        self.lsb = tuple(known[one].resolution or known[one].reach / 2**15 for one in self.made.samples)
        self.counts = np.array(
            [np.rint(self.run[one] / lsb) for one, lsb in zip(self.made.samples, self.lsb, strict=True)]
        ).astype(np.int64)
        # what the integers are made of, for float64
        self.exact = dict(zip(self.made.samples, self.counts * np.array(self.lsb)[:, np.newaxis], strict=True))
        self.record = record_of(self.compiled, self.exact, self.oracle_design)
        of_jets = {str(one): x for one, x in self.record.grid.jets.items()}
        reaches = {one: _HIGHEST * float(np.max(np.abs(of_jets[one]))) or 1.0 for one in self.made.jet_names}
        hours = len(next(iter(self.run.values()))) / self.oracle_design.sample_rate
        self.fixed: FixedWeak = fixed_weak(self.made, JetReaches(run_s=2 * hours, of=reaches))
        full = tuple(round(1.5 * known[one].reach / lsb) for one, lsb in zip(self.made.samples, self.lsb, strict=True))
        self.rows = WeakRows(self.compiled, self.record)
        # one of the shipped mechanisms may have an unknown that its rig does not set: a sensor's offset
        truth = dict(zip(simulation.model.p_names, simulation.truth, strict=True))
        self.truth = np.array([truth.get(one, 0.0) for one in self.compiled.model.p_names])
        self.tables = design_tables(weak_model_of(compiled), self.rows, self.truth)
        self.sensing = Sensing(self.lsb, full, self.oracle_design.sample_rate)
        unknowns = self.compiled.parameters.model.unknowns
        guess = self.compiled.parameters.guess
        bounds = [(min(one.low, x), max(one.high, x)) for one, x in zip(unknowns, guess, strict=True)]
        self.parameters = fixed_parameters(self.made.functions, bounds)
        self.design: WeakDesignQ31 = fixed_design(self.fixed.model, self.tables, self.sensing, self.fixed.formats)

    @cached_property
    def config(self) -> WeakConfigQ31:
        """Starts at half or one and a half times the truth."""
        known = self.compiled.parameters
        wide = np.where(np.arange(len(self.truth)) % 2, 0.6, 1.4)
        start = np.where(known.positive, self.truth * wide, known.guess)
        formats = row_formats(self.rows, self.truth)
        offset = (0,) * len(self.lsb)
        rate = self.oracle_design.sample_rate
        return config_of_q31(self.design, known, formats, self.parameters.p_bits, offset, rate, start)

    @property
    def _first(self) -> int:
        """Sample to whose instant the identifier's first step refers."""
        half, decimation = self.design.half, self.design.decimation
        if decimation > 1:
            return decimation * (1 + half)
        made = any(one.source is not Source.SAMPLED for one in self.design.model.signal)
        return max(half, 2) if made else half

    def oracle_sums(self) -> dict[int, Float]:
        """Float64 S_h [windows, H + 1, 2] of the channels that have terms, by their places."""
        functions = self.oracle_design.test_functions
        # The oracle's first step is at the third sample or later; the identifier's may be at the first one.
        missing = max(2 - self._first, 0)
        padded = {name: np.concatenate([x[:1]] * missing + [x]) for name, x in self.exact.items()}
        record = record_of(self.compiled, padded, self.oracle_design) if missing else self.record
        sums = record.sums(functions)
        out = {}
        for mine, theirs in self._places.items():
            whole = np.zeros((len(sums[theirs]), functions.highest + 1, 2))
            whole[:, 0, 0] = sums[theirs][:, 0]
            whole[:, 1:, 0], whole[:, 1:, 1] = (sums[theirs][:, 1::2], sums[theirs][:, 2::2])
            out[mine] = whole
        return out

    @cached_property
    def _places(self) -> dict[int, int]:
        """Place of each channel that has terms -> that in the oracle."""
        found: dict[int, int] = {}
        first = 0
        for row in self.record.channels.rows:
            ordered = sorted(row.terms, key=lambda one: (one.column, one.order, one.channel))
            found |= {a.channel: b.channel for a, b in zip(self.made.term[first:], ordered, strict=False)}
            first += len(row.terms)
        return found

    def sizes(self) -> dict[int, float]:
        """Largest sum of |channel| over a window, integrals counted from its start, by place."""
        window, record, out = 2 * self.design.hop, self.record, {}
        for mine, theirs in self._places.items():
            gain, fold = np.abs(record.gains[theirs]), record.channels.channels[theirs].fold
            count = len(gain) // window
            whole = gain[: count * window].reshape(count, window)
            if fold:
                integrand = np.asarray(record.integrands[theirs])
                running = running_integrals(integrand, window, fold, self.oracle_design.dt)[fold][:, :-1]
                whole = whole * np.abs(running[:count])
            out[mine] = float(whole.sum(axis=1).max())
        return out


@cache
def rig(name: str, samples: int) -> Rig:
    """Made once."""
    return Rig(name, samples)


_DRIVER = """
#include <string.h>

#include "weak/accumulator_q31.h"
#include "weak/columns_q31.h"
#include "weak/reflection_q31.h"
#include "weak/sums_q31.h"
#include "weak/white_q31.h"
#include "number/integer_q31.h"

extern const pvid_weak_config_q31 *const rig_config;
#define rig_config_q31 (*rig_config)
#define rig_design_q31 (*rig_config->design)
unsigned run(const int32_t counts[], unsigned ticks, int32_t window[], unsigned most, uint8_t outcome[]);

/* S_h of the windows of a run, channel by channel; returns their number. */
unsigned run(const int32_t counts[], unsigned ticks, int32_t window[], unsigned most, uint8_t outcome[])
{
    static pvid_weak_accumulator_q31 self;
    const pvid_weak_model_q31 *model = rig_design_q31.model;
    const unsigned harmonics = (rig_design_q31.functions / 2u) + (rig_design_q31.power / 2u) + 1u;
    unsigned windows = 0;
    static const int32_t offset[PVID_MAX_SAMPLES] = {0};
    pvid_weak_accumulator_init_q31(&self, &rig_design_q31, offset);
    for (unsigned k = 0; k < ticks; k++) {
        const pvid_weak_tick tick = pvid_weak_accumulator_step_q31(&self, &counts[k * model->samples]);
        outcome[k] = (uint8_t)tick;
        if ((tick == PVID_WEAK_WINDOW) && (windows < most)) {
            for (unsigned c = 0; c < model->channels; c++) {
                const bool constant = model->channel[c].gain == PVID_WEAK_NONE;
                for (unsigned h = 0; h < harmonics; h++) {
                    const int32_t mean = (h == 0u) ? (2 * (int32_t)rig_design_q31.hop) : 0;
                    *window++ = constant ? mean : self.window.s[h][c][0];
                    *window++ = constant ? 0 : self.window.s[h][c][1];
                }
            }
            windows++;
        }
    }
    return windows;
}

unsigned columns(unsigned kind, const pvid_scaled_q31 theta[], const int32_t window[], int32_t x[], int32_t exponent[]);

/* White columns of a kind from the S_h of a window; returns how many nuisances were projected out. */
unsigned columns(unsigned kind, const pvid_scaled_q31 theta[], const int32_t window[], int32_t x[], int32_t exponent[])
{
    static pvid_weak_window_q31 sums;
    static pvid_weak_white_q31 white;
    static pvid_weak_columns_q31 made;
    const pvid_weak_design_q31 *design = &rig_design_q31;
    const pvid_weak_kind *own = &design->model->kind[kind];
    const size_t harmonics = pvid_weak_harmonics_q31(design);
    const size_t rows = design->functions;
    const size_t used = own->thetas + 1u;
    const size_t count = used + own->nuisances;
    uint64_t whole[PVID_MAX_COLUMNS];
    pvid_scaled_q31 weight[PVID_MAX_POWER];
    size_t live = 0;
    for (size_t c = 0; c < design->model->channels; c++) {
        for (size_t h = 0; h < harmonics; h++) {
            uint32_t bits = 0;
            for (size_t part = 0; part < 2u; part++) {
                const int32_t one = *window++;
                sums.s[h][c][part] = one;
                bits |= (uint32_t)((one < 0) ? -one : one);
            }
            sums.length[h][c] = (uint8_t)pvid_bit_length_q31(bits);
        }
    }
    pvid_weak_white_init_q31(&white, design);
    pvid_weak_white_weigh_q31(&white, design, (uint8_t)kind, theta, 0, design->n_noise, weight);
    pvid_weak_white_spectrum_q31(&white, design, (uint8_t)kind, design->error_variance[kind], weight, 0, harmonics);
    const pvid_scaled_q31 least = pvid_weak_white_floor_q31(&white, design);
    pvid_weak_white_invert_q31(&white, least, 0, harmonics);
    for (size_t k = 0; k < pvid_weak_reflectors_q31(design); k++) {
        pvid_weak_white_reflector_q31(&white, design, k);
    }
    pvid_weak_columns_begin_q31(&made, design, kind);
    for (size_t h = 0; h < harmonics; h++) {
        pvid_weak_columns_scan_q31(&made, design, kind, &white, sums.length[h], h);
    }
    for (size_t h = 0; h < harmonics; h++) {
        pvid_weak_columns_take_q31(&made, design, kind, &white, sums.length[h],
                                   (const int32_t(*)[2])sums.s[h], h);
    }
    for (size_t j = 0; j < count; j++) {
        pvid_weak_columns_end_q31(&made, design, &white, j);
        whole[j] = pvid_weak_columns_square_q31(rows, made.x[j]);
    }
    for (size_t j = used; j < count; j++) {
        int32_t *mirror = &made.x[j][live];
        const bool kept = pvid_weak_columns_keep_q31(whole[j], rows - live, mirror);
        for (size_t i = 0; i < count; i++) {
            if (kept && ((i < used) || (i > j))) {
                pvid_weak_reflect_q31(mirror, rows - live, &made.x[i][live]);
            }
        }
        live += kept ? 1u : 0u;
    }
    for (size_t j = 0; j < used; j++) {
        memcpy(&x[j * rows], made.x[j], rows * sizeof x[0]);
        exponent[j] = made.exponent[j];
    }
    return (unsigned)live;
}
"""
SIZES = (
    "PVID_MAX_P=8",
    "PVID_MAX_THETA=12",
    "PVID_MAX_THETA_Q31=16",
    "PVID_MAX_MOMENTS_Q31=78",
    "PVID_MAX_C_Q31=48",
    "PVID_MAX_CHANNELS=24",
    "PVID_MAX_HARMONICS=25",
    "PVID_MAX_RING=1024",
    "PVID_MAX_INPUTS=24",
)
# Not -O1: with -fsanitize=undefined the compiler of Debian 12 (gcc 12.2) then takes the sign off a negative sine.
_OPTIONS = (
    *("-std=c99", "-O2", "-fPIC", "-fsanitize=undefined", "-fsanitize-undefined-trap-on-error"),
    *("-Werror", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wvla"),
    *(f"-D{one}" for one in SIZES),
    *INCLUDES,
)


class Core:
    """The C of the identifier, compiled once; signed overflow ends the program."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "driver.c").write_text(_DRIVER, encoding="utf-8")
        rooms = ("weak", "number", "solve", "judge")
        core = [str(one) for one in sources_of("q31") if one.parent.name in rooms]
        self._run([*_OPTIONS, "-c", *core, str(folder / "driver.c")])
        self.libraries: dict[str, ctypes.CDLL] = {}

    def _run(self, arguments: list[str]) -> None:
        subprocess.run(["gcc", *arguments], check=True, cwd=self.folder)

    def library(self, one: Rig) -> ctypes.CDLL:
        """With the tables of a rig."""
        name = one.made.name
        header = files_weak_q31.header(one.fixed, {"PVID_MAX_P": 3}, "a test")
        (self.folder / f"{name}_weak_q31.h").write_text(header, encoding="utf-8")
        text = "\n".join(
            [
                files_weak_q31.source(one.fixed, one.parameters, "a test"),
                files_weak_q31.design_header(one.config, name, {"PVID_MAX_P": 3}, "a test", []),
                "extern const pvid_weak_config_q31 *const rig_config;",
                f"const pvid_weak_config_q31 *const rig_config = &{name}_config_q31;",
            ]
        )
        if text not in self.libraries:
            name = f"{one.name}_{len(self.libraries)}"
            code = self.folder / f"{name}.tables.c"
            code.write_text(text, encoding="utf-8")
            library = self.folder / f"{name}.so"
            objects = [str(path) for path in self.folder.glob("*.o")]
            self._run([*_OPTIONS, "-shared", str(code), *objects, "-o", str(library)])
            self.libraries[text] = ctypes.CDLL(str(library))
        return self.libraries[text]

    def windows(self, one: Rig, counts: Int) -> tuple[Int, Int]:
        """S_h [windows, channels, H + 1, 2] of counts [samples, ticks], and what each tick did."""
        design = one.design
        given = np.ascontiguousarray(counts.T, np.int32)
        size = len(design.model.channel) * (design.highest + 1) * 2
        most = given.shape[0] // (design.hop * design.decimation) + 1
        out, outcome = np.zeros((most, size), np.int32), np.zeros(len(given), np.uint8)
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (given, out, outcome)]
        count = self.library(one).run(pointers[0], len(given), pointers[1], most, pointers[2])
        shape = (count, len(design.model.channel), design.highest + 1, 2)
        return out[:count].reshape(shape).astype(np.int64), outcome.astype(np.int64)

    def columns(self, one: Rig, kind: int, theta: Int, window: Int) -> tuple[Int, Int, int]:
        """White columns [thetas + 1, rows] of a kind, their exponents, and how many nuisances were projected out.

        theta : m and e [thetas, 2]; window : S_h [channels, H + 1, 2]
        """
        design = one.design
        count = design.model.kind[kind].thetas + 1
        given = np.ascontiguousarray(theta, np.int32)
        sums = np.ascontiguousarray(window, np.int32)
        x, exponent = (np.zeros((count, design.functions), np.int32), np.zeros(count, np.int32))
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (given, sums, x, exponent)]
        live = self.library(one).columns(kind, *pointers)
        return x.astype(np.int64), exponent.astype(np.int64), int(live)


@cache
def core_in(folder: Path) -> Core:
    """Compiled once for all tests of a session."""
    folder.mkdir()
    return Core(folder)
