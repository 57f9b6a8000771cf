"""A tick of recursive least squares, its U-D form, an extended Kalman filter and the strong form, side by side.

Instructions and state: on a board's emulator, the same samples through every method, from the samples to the
parameters; the Savitzky-Golay bank has the standard rig's samples at 1 kHz. Longest safe run: rows of the standard rig,
again and again, until an estimate is no number, a variance is not positive, or w is off by more than a factor of two.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.boards import BUILD, Board, board, build, keep_header
from pvid.board.replay_image import SAMPLING, ReplayReport, ReplayRun, build_image, header, play, standard_run
from pvid.cases import case_of
from pvid.core.native import Native
from pvid.core.sources import ROOT
from pvid.rig.file import RigFile
from pvid.settings.enums import Core
from pvid.settings.f32 import StrongConfig
from pvid.settings.kinds import Settings
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors, standard_start
from pvid.twin.kapitza.strong import regressors
from pvid.twin.strong import StrongTwin

Float32 = npt.NDArray[np.float32]

HEADER = ("method", "instructions", "longest tick", "state [B]", "longest safe run [ticks]")
BOARD = "mps2-an386"
TICKS = 3000
LONG = 10_000_000
COST = ROOT / "tests" / "cost"
_RUN_TIMEOUT_S = 300.0

_FRONT = """
typedef struct {
    pvid_differentiator_f32 phi;
    pvid_differentiator_f32 y;
    float inverse_l1;
    NAME_f32 estimator;
} baseline;

static pvid_status baseline_init(baseline *self, const pvid_strong_config_f32 *config)
{
    self->inverse_l1 = 1.0f / config->l1;
    NAME_init_f32(&self->estimator, 0.9999f, 1.0e6f);
    const pvid_status status = pvid_differentiator_init_f32(&self->phi, &config->bank, config->sample_rate_hz);
    return (status == PVID_OK) ? pvid_differentiator_init_f32(&self->y, &config->bank, config->sample_rate_hz) : status;
}

static pvid_reason baseline_step(baseline *self, float phi, float y)
{
    float d_phi[PVID_ORDERS];
    float d_y[PVID_ORDERS];
    float n[PVID_KAPITZA_STRONG_THETA];
    float row_y;
    const bool ready = pvid_differentiator_step_f32(&self->phi, phi, d_phi);
    if (!pvid_differentiator_step_f32(&self->y, y, d_y) || !ready) {
        return PVID_WARMING_UP;
    }
    const float u[3] = {d_y[2] * self->inverse_l1, d_y[3] * self->inverse_l1, d_y[4] * self->inverse_l1};
    pvid_kapitza_strong_row_f32(d_phi, u, &row_y, n);
    NAME_step_f32(&self->estimator, n, row_y);
    return PVID_UPDATED;
}
"""

_KALMAN = """
typedef struct {
    ekf_f32 estimator;
} baseline;

static pvid_status baseline_init(baseline *self, const pvid_strong_config_f32 *config)
{
    const float rate = config->sample_rate_hz;
    const ekf_config_f32 filter = {
        .dt = 1.0f / rate, .angle_variance = 5.0e-8f, .rate_noise = 1.0e-10f, .start = {31.0f, 8.9f, 5.6f},
        .start_sd = {1.5f, 0.4f, 0.3f}, .second = {rate * rate / config->l1}};
    ekf_init_f32(&self->estimator, &filter);
    return PVID_OK;
}

static pvid_reason baseline_step(baseline *self, float phi, float y)
{
    return ekf_sample_f32(&self->estimator, phi, y) ? PVID_UPDATED : PVID_WARMING_UP;
}
"""

_LONG = """
#include "NAME_f32.c"
#include <math.h>
#include <stdint.h>
uint32_t safe_periods(uint32_t rows, const float n[][11], const float y[], float w, uint32_t periods)
{
    static NAME_f32 self;
    NAME_init_f32(&self, 0.9999f, 1.0e6f);
    for (uint32_t period = 0; period < periods; period++) {
        for (uint32_t i = 0; i < rows; i++) {
            NAME_step_f32(&self, n[i], y[i]);
        }
        int k = 0;
        for (int i = 0; i < 11; i++) {
            const float variance = VARIANCE;
            k += i + 2;
            if (!(variance > 0.0f) || !isfinite(variance) || !isfinite(self.theta[i])) {
                return period;
            }
        }
        if (!(self.theta[0] > 0.5f * w) || !(self.theta[0] < 2.0f * w)) {
            return period;
        }
    }
    return periods;
}
"""
_VARIANCE = {"rls": "self.p[k]", "ud": "self.d[i]"}


def baseline_report(on: Board, run: ReplayRun, name: str) -> ReplayReport:
    """What the replay of a run by a baseline of tests/cost prints: rls, ud or ekf."""
    code = _KALMAN if name == "ekf" else _FRONT.replace("NAME", name)
    first = "x" if name == "ekf" else "theta"
    own = (
        f'#include <string.h>\n#include "{COST / name}_f32.c"\n{code}\n'
        "static uint32_t baseline_hash(uint32_t hash, float value)\n{\n    uint32_t word;\n"
        "    memcpy(&word, &value, sizeof word);\n    return pvid_fnv_word(hash, word);\n}\n"
        "#define REPLAY_TYPE baseline\n#define REPLAY_INIT baseline_init\n"
        "#define REPLAY_STEP(self, sample) baseline_step(self, (sample)[0], (sample)[1])\n"
        "#define REPLAY_HASH(hash, estimator, reason) "
        f"baseline_hash((hash) + (uint32_t)(reason), (estimator)->{first}[0])"
    )
    defined = ("#define REPLAY_TYPE", "#define REPLAY_INIT", "#define REPLAY_STEP", "#define REPLAY_HASH")
    lines = [line for line in header(run).splitlines() if not line.startswith(defined)]
    at = next(place for place, line in enumerate(lines) if line.startswith("#define REPLAY_SAMPLE"))
    text = "\n".join([*lines[:at], own, *lines[at:], ""])
    folder = BUILD / "runs" / f"{name}-{zlib.crc32(text.encode()):08x}"
    keep_header(folder, "replay_run.h", text)
    options = {"PVID_REPLAY_RUN": str(folder), "PVID_MAX_WINDOW": "5"}
    tree = build(on, BUILD / f"{on.name}-{folder.name}", options)
    return play(on, tree / "apps" / "replay" / "replay.elf", _RUN_TIMEOUT_S)


def exact_rows(run: ReplayRun) -> tuple[Float32, Float32]:
    """The rows of a run of the strong form: N [rows, 11], Y [rows], each column over its rms."""
    rows, reasons = StrongTwin(_strong(run)).rows(*run.samples)
    n, y = regressors(rows[reasons == reasons[-1]])
    return n, y


def _strong(run: ReplayRun) -> StrongConfig:
    if not isinstance(run.config, StrongConfig):
        raise PvidError("the run is not one of the strong form in float32")
    return run.config


def safe_rows(name: str, n: Float32, y: Float32, ticks: int = LONG) -> int:
    """Rows until a baseline fails, at most `ticks`; its rows are scaled by their rms, which is its best case."""
    scale = np.sqrt(np.mean(np.square(n.astype(np.float64)), axis=0))
    y_scale = float(np.sqrt(np.mean(np.square(y.astype(np.float64)))))
    rows = np.ascontiguousarray(n / scale, np.float32)
    values = np.ascontiguousarray(y / y_scale, np.float32)
    w = STANDARD_PENDULUM.linear[0] * scale[0] / y_scale
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder) / "long.c", Path(folder) / "long.so"
        source.write_text(_LONG.replace("NAME", name).replace("VARIANCE", _VARIANCE[name]), encoding="utf-8")
        options = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", f"-I{COST}"]
        subprocess.run(["gcc", *options, str(source), "-o", str(library), "-lm"], check=True)
        run = ctypes.CDLL(str(library)).safe_periods
        run.restype = ctypes.c_uint32
        pointers = (ctypes.c_void_p(rows.ctypes.data), ctypes.c_void_p(values.ctypes.data))
        periods = run(len(rows), *pointers, ctypes.c_float(w), -(-ticks // len(rows)))
    return min(int(periods) * len(rows), ticks)


def safe_ticks(native: Native, config: Settings, run: ReplayRun, ticks: int = LONG) -> int:
    """The same of a variant of the strong form: the run's samples again and again, a gap between."""
    identifier, case = native.identifier(config), case_of(config)
    truth = STANDARD_PENDULUM.linear
    done = 0
    while done < ticks:
        identifier.gap()
        p = case.p_of(config, identifier.run(*run.samples, sums=False, hashes=False).p[-1].astype(np.float64))
        estimate = identifier.assess()
        if not np.isfinite(estimate["se"][:3]).all() or not 0.5 < p[0] / truth[0] < 2.0:
            break
        done += run.ticks
    return min(done, ticks)


def smoothed_run(ticks: int, core: Core = "f32", divider: int = 1) -> ReplayRun:
    """The standard rig at 1 kHz: the strong form behind a Savitzky-Golay bank of 35 taps on means of nine samples."""
    sensors = replace(standard_sensors(SAMPLING.bits), random_offset=False)
    run = simulate(sensors=sensors, truth="linear", duration=ticks / 1000, seed=1).run
    rig = RigFile.standard()
    settings = replace(
        rig.identifier,
        form="strong",
        core=core,
        differentiator="savitzky-golay",
        window_s=0.315,
        degree=10,
        block=9,
        divider=divider,
    )
    rig = replace(rig, identifier=settings, sensor=replace(rig.sensor, phi_lsb=sensors.phi_lsb))
    case = case_of(settings)
    counts = np.rint(np.stack([run.phi / sensors.phi_lsb, run.y / sensors.y_lsb], axis=1))[:ticks]
    return ReplayRun(
        config=case.settings(rig, run.sample_rate, standard_start(1)),
        counts=counts.astype(np.int16),
        phi_lsb=np.float32(sensors.phi_lsb),
        y_lsb=np.float32(sensors.y_lsb),
        measure_from=case.alike_from(ticks),
    )


@dataclass(frozen=True)
class Variant:
    """A schedule of the strong form."""

    name: str
    exact_every: int
    divider: int

    def of(self, config: StrongConfig) -> StrongConfig:
        """The settings with this schedule."""
        estimator = replace(config.estimator, divider=self.divider)
        return replace(config, exact_every=self.exact_every, estimator=estimator)


VARIANTS = (
    Variant("strong form, all sums at every row", 1, 1),
    Variant("strong form, a solve at every row, all sums at every eighth", 8, 1),
    Variant("strong form, staged, a solve at every eighth row", 0, 8),
)
BASELINES = (("rls", "packed recursive least squares, 11 parameters"), ("ud", "the same as U D U^T"))


def others(ticks: int = TICKS) -> Iterator[tuple[str, ReplayRun]]:
    """The strong form behind a long bank and in fixed point."""
    bank = "Savitzky-Golay, 315 samples in blocks of nine, a row for each"
    yield f"strong form, {bank}", smoothed_run(ticks)
    yield f"strong form, staged, {bank}", smoothed_run(ticks, divider=8)
    yield "strong form in fixed point, a solve at every row", standard_run(ticks, "q31")
    yield "strong form in fixed point, a solve at every eighth row", standard_run(ticks, "q31", 8)
    yield f"strong form in fixed point, {bank}", smoothed_run(ticks, "q31")


def rows_of(
    native: Native, ticks: int = LONG, progress: Callable[[int], None] = lambda _: None
) -> Iterator[tuple[str, ...]]:
    """The rows of the table."""
    on, run = board(BOARD), standard_run(TICKS)
    n, y = exact_rows(run)
    for done, (name, label) in enumerate(BASELINES):
        progress(done)
        yield _row(label, baseline_report(on, run, name), safe_rows(name, n, y, ticks), ticks)
    progress(2)
    yield _row("extended Kalman filter, 7 states", baseline_report(on, run, "ekf"), None, ticks)
    own = [(one.name, replace(run, config=one.of(_strong(run)))) for one in VARIANTS]
    for done, (label, variant) in enumerate([*own, *others()], 3):
        progress(done)
        report = play(on, build_image(on, variant)[0], _RUN_TIMEOUT_S)
        yield _row(label, report, safe_ticks(native, variant.config, variant, ticks), ticks)


STEPS = 11


def _row(label: str, report: ReplayReport, safe: int | None, ticks: int) -> tuple[str, ...]:
    shown = "-" if safe is None else (f"{safe:.0e} and more" if safe >= ticks else f"{safe}")
    mean, longest = f"{report.instructions_mean:.0f}", f"{report.instructions_longest:.0f}"
    return label, mean, longest, str(report.state_bytes), shown
