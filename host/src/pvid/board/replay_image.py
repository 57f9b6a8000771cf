"""The run that firmware/apps/replay plays: its header, what the host expects of it, and what the image reports."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.boards import BUILD, Board, build, keep_header, one_at_a_time
from pvid.board.boards import run as run_image
from pvid.core.headers import Headers, Tables, default_library
from pvid.core.native import Native
from pvid.design.c_tables import float_array, float_literal, struct_initializer
from pvid.design.weak_sizing import raised_bounds
from pvid.rig.file import RigFile
from pvid.run.compare_q31 import twin_hashes as twin_hashes_q31
from pvid.run.compare_q31 import twin_q31
from pvid.settings.f32 import StrongConfig, WeakConfig
from pvid.settings.q31 import StrongConfigQ31
from pvid.setup.f32 import config_of
from pvid.setup.q31 import ConfigQ31, config_of_q31
from pvid.setup.strong_header_q31 import strong_header_q31
from pvid.setup.weak_header_q31 import to_c_header_q31
from pvid.sim.pendulum import simulate, standard_sensors, standard_start
from pvid.twin import fnv
from pvid.twin.strong import StrongTwin
from pvid.twin.weak import WeakTwin

REPORT_EVERY = 500  # ticks from one line with the running hash to the next

MISSING = int(np.iinfo(np.int16).min)  # a count that stands for no sample; not in fixed point

# From so many ticks on the samples are a file that the assembler takes in: a compiler is slow with so many numbers.
MANY_TICKS = 100_000

# Both fit 16 bits: 0.107 rad is 17 900 steps of 2 pi / 2^20.
ENCODER_BITS = {"strong": 20, "weak": 14}

# The strong form's five points need 20 ms between samples (benchmarks/accuracy.md); its window is five samples long.
SAMPLE_RATE = {"strong": 50.0, "weak": 1000.0}

STRONG_SETTLED = 500  # ticks by which windows are full and the drive is noticed: from there all ticks are alike


@dataclass(frozen=True)
class ReplayRun:
    """A run in counts of the sensors, and the settings to identify it with.

    counts int16 [ticks, 2]: phi and y; a sample is float32(count) * lsb, rounded once, on the board and here, and no
    number where it is MISSING.
    """

    form: str
    config: StrongConfig | WeakConfig
    counts: npt.NDArray[np.int16]
    phi_lsb: np.float32
    y_lsb: np.float32
    measure_from: int
    fixed: ConfigQ31 | None = None  # in place of config, where the fixed-point core plays the counts

    @property
    def core(self) -> str:
        """Which arithmetic."""
        return "f32" if self.fixed is None else "q31"

    @property
    def ticks(self) -> int:
        """Samples of each channel."""
        return len(self.counts)

    @property
    def phi(self) -> npt.NDArray[np.float32]:
        """[rad], [ticks]"""
        return self._samples(0, self.phi_lsb)

    @property
    def y(self) -> npt.NDArray[np.float32]:
        """[m], [ticks]"""
        return self._samples(1, self.y_lsb)

    def _samples(self, channel: int, lsb: np.float32) -> npt.NDArray[np.float32]:
        counts = self.counts[:, channel]
        values = counts.astype(np.float32) * lsb
        return np.where(counts == MISSING, np.float32(np.nan), values)


@cache
def standard_run(form: str, ticks: int, core: str = "f32", divider: int = 1) -> ReplayRun:
    """The standard rig (linear truth) for `ticks`: weak form at 1 kHz and 14 bits, strong form (five points) at 50 Hz
    and 20 bits, with a solve every `divider` groups of rows."""
    sensors = replace(standard_sensors(ENCODER_BITS[form]), random_offset=False)
    rate = SAMPLE_RATE[form]
    run = simulate(sensors=sensors, truth="linear", sample_rate=rate, duration=ticks / rate, seed=1).run
    standard = RigFile.standard()
    identifier = replace(
        standard.identifier,
        form=form,  # type: ignore[arg-type]
        differentiator="finite-difference",
        stride=1,
        full_angle=False,  # the run's equations are linear
        divider=divider,
    )
    rig = replace(standard, identifier=identifier, sensor=replace(standard.sensor, phi_lsb=sensors.phi_lsb))
    start = standard_start(1)
    config = config_of(rig, run.sample_rate, start)
    counts = np.rint(np.stack([run.phi / sensors.phi_lsb, run.y / sensors.y_lsb], axis=1))[:ticks]
    if len(counts) != ticks or np.abs(counts).max() > np.iinfo(np.int16).max:
        raise PvidError("the standard run does not fit 16-bit counts")
    return ReplayRun(
        form=form,
        config=config,
        counts=counts.astype(np.int16),
        phi_lsb=np.float32(sensors.phi_lsb),
        y_lsb=np.float32(sensors.y_lsb),
        measure_from=_measure_from(config, ticks),
        fixed=config_of_q31(rig, run.sample_rate, start) if core == "q31" else None,
    )


def _measure_from(config: StrongConfig | WeakConfig, ticks: int) -> int:
    """First tick of the mean: whole periods of the weak form's windows, all of them with a solve in work."""
    if isinstance(config, StrongConfig):
        return min(STRONG_SETTLED, ticks // 2)
    period = config.hop * config.design.decimation
    settled = 3 * period + config.design.taps
    return ticks - max((ticks - settled) // period, 1) * period


def header(run: ReplayRun, samples: Path | None = None) -> str:
    """replay_run.h of a run; its counts stand in it, or little-endian in the file `samples`."""
    tables: Tables = {}
    if run.fixed is not None:
        settings = [_header_q31(run.fixed)]
    else:
        headers = Headers.of(default_library())
        filled = headers.filled(f"pvid_{run.form}_config_f32", run.config)
        tables = filled.tables
        pointers = {name: f"replay_{name}" for name in tables}
        settings = []
        if isinstance(run.config, WeakConfig):
            design = struct_initializer(headers, filled.struct.design[0], pointers)
            settings = [f"static const pvid_weak_design_f32 replay_design = {design};"]
            pointers |= {"design": "&replay_design"}
        initializer = struct_initializer(headers, filled.struct, pointers)
        settings.append(f"static const pvid_{run.form}_config_f32 replay_config = {initializer};")
    arrays = [
        float_array(f"replay_{name}", np.asarray(table, np.float32).reshape(table.shape[0], -1), "see the settings")
        for name, table in tables.items()
    ]
    return "\n".join(
        [
            "/* Generated by pvid.board.replay_image: do not edit. */",
            "#ifndef REPLAY_RUN_H",
            "#define REPLAY_RUN_H",
            "",
            "#include <stddef.h>",
            "",
            '#include "pvid/pvid.h"',
            "",
            "#if defined(__AVR__)",
            "#include <avr/pgmspace.h>",
            "#define REPLAY_IN_FLASH PROGMEM",
            "#else",
            "#define REPLAY_IN_FLASH",
            "#endif",
            "",
            f"#define REPLAY_Q31 {int(run.core == 'q31')}",
            f"#define REPLAY_WEAK {int(run.form == 'weak')}",
            f'#define REPLAY_FORM "{run.form}"',
            f"#define REPLAY_TICKS {run.ticks}u",
            f"#define REPLAY_MEASURE_FROM {run.measure_from}u",
            f"#define REPLAY_REPORT_EVERY {REPORT_EVERY}u",
            f"#define REPLAY_MISSING ({MISSING + 1} - 1)",
            "",
            *arrays,
            *settings,
            *_resolutions(run),
            "/* [tick][phi, y] in steps of these */",
            *_counts_text(run, samples),
            "",
            "#endif",
            "",
        ]
    )


def _counts_text(run: ReplayRun, samples: Path | None) -> list[str]:
    if samples is None:
        lines = [f"    {{{phi}, {y}}}," for phi, y in run.counts.tolist()]
        return ["static const int16_t replay_samples[REPLAY_TICKS][2] REPLAY_IN_FLASH = {", *lines, "};"]
    directives = (".section .rodata.replay", ".balign 4", "replay_samples:", f'.incbin \\"{samples}\\"', ".text")
    return [
        f"/* CRC-32 of the file: {zlib.crc32(_packed(run)):08x} */",
        "__asm__(",
        *(f'    "{directive}\\n"' for directive in directives),
        ");",
        "extern const int16_t replay_samples[REPLAY_TICKS][2];",
    ]


def _packed(run: ReplayRun) -> bytes:
    return run.counts.astype("<i2").tobytes()


def _header_q31(config: ConfigQ31) -> str:
    names = RigFile.standard().l1, "replay_config", "pvid.board.replay_image"
    if isinstance(config, StrongConfigQ31):
        return strong_header_q31(config, *names)
    return to_c_header_q31(config, *names)


def _resolutions(run: ReplayRun) -> list[str]:
    """What a count is worth to the core: itself in fixed point."""
    if run.core == "q31":
        return ["#define replay_phi_lsb 1", "#define replay_y_lsb 1"]
    return [
        f"static const float replay_phi_lsb = {float_literal(run.phi_lsb)};",
        f"static const float replay_y_lsb = {float_literal(run.y_lsb)};",
    ]


# ---- what the host computes


def native_hashes(run: ReplayRun, native: Native) -> npt.NDArray[np.uint32]:
    """Running hash of the C core on this machine after every tick, [ticks]."""
    if run.fixed is not None:
        return native.identifier(run.fixed).run(run.counts[:, 0], run.counts[:, 1]).hash
    if isinstance(run.config, WeakConfig):
        return native.identifier(run.config).run(run.phi, run.y).hash
    return native.identifier(run.config).run(run.phi, run.y).hash


def twin_hashes(run: ReplayRun) -> npt.NDArray[np.uint32]:
    """Running hash of the numpy twin after every tick, [ticks]. Cost: 0.5 ms a tick in the strong form."""
    if run.fixed is not None:
        phi, y = run.counts.astype(np.int64).T
        return twin_hashes_q31(twin_q31(run.fixed).run(phi, y))
    if isinstance(run.config, WeakConfig):
        states = WeakTwin(run.config).run(run.phi, run.y)
    else:
        states = StrongTwin(run.config).run(run.phi, run.y)
    return fnv.running_hashes(states.p[:, :, 0], states.sums[:, :, 0], states.reason[:, 0])


# ---- what the image says


@dataclass(frozen=True)
class ReplayReport:
    """What the image printed. `instructions` are clock cycles on an AVR."""

    ticks: int
    hash: int
    hashes: dict[int, int]  # running hash by ticks done
    instructions_mean: float
    instructions_longest: float
    stack_used: int
    stack_size: int
    state_bytes: int
    estimator_bytes: int


def parse_report(text: str) -> ReplayReport:
    """Reads what the image printed.

    Raises
    ------
    PvidError
        When the image faulted or did not come to its end; the sentence has its own words.
    """
    fault = re.search(r"pvid fault: .*", text)
    if fault:
        raise PvidError(f"the image stopped: {fault.group(0)}")
    lines = [line.strip() for line in text.splitlines()]
    if "done" not in lines:
        last = next((line for line in reversed(lines) if line), "nothing")
        raise PvidError(f"the image did not come to its end; its last words: {last}")
    values = dict(line.split(" ", 1) for line in lines if re.fullmatch(r"[a-z_0-9]+ [0-9a-f]+", line))
    number = {name: int(value) for name, value in values.items() if value.isdecimal()}
    total = int(values["total_counts_high"] + values["total_counts_low"], 16)
    scale = 1024 / number["counts_per_1024"]
    return ReplayReport(
        ticks=number["ticks"],
        hash=int(values["hash"], 16),
        hashes={int(at): int(value, 16) for at, value in re.findall(r"^at (\d+) ([0-9a-f]{8})", text, re.MULTILINE)},
        instructions_mean=scale * total / number["measured_ticks"],
        instructions_longest=scale * number["longest_counts"],
        stack_used=number["stack_used"],
        stack_size=number["stack_size"],
        state_bytes=number["state_bytes"],
        estimator_bytes=number["estimator_bytes"],
    )


# ---- the image


def build_image(target: Board, run: ReplayRun, macros: Mapping[str, str] | None = None) -> tuple[Path, Path]:
    """Builds the replay image of `run` for a board under build/targets; returns (image, build tree).

    The strong form's windows are as long as its five points, so that its state is what a board would hold; `macros`
    of pvid/config.h come on top.
    """
    samples = None
    if run.ticks >= MANY_TICKS:
        packed = _packed(run)
        folder = BUILD / "runs" / f"samples-{zlib.crc32(packed):08x}"
        samples = folder / "replay_samples.bin"
        with one_at_a_time(folder):
            folder.mkdir(parents=True, exist_ok=True)
            if not samples.exists() or samples.read_bytes() != packed:
                samples.write_bytes(packed)
    text = header(run, samples)
    name = f"{run.form}-{run.core}-{run.ticks}-{zlib.crc32(text.encode()):08x}"
    folder = BUILD / "runs" / name
    keep_header(folder, "replay_run.h", text)
    options = {"PVID_REPLAY_RUN": str(folder)}
    if isinstance(run.config, StrongConfig):
        options["PVID_MAX_WINDOW"] = str(run.config.window)
    elif target.toolchain == "avr":
        design = run.config.design
        options |= {"PVID_MAX_TAPS": str(design.taps), "PVID_MAX_DECIMATION": str(design.decimation)}
        options |= {"PVID_MAX_FUNCTIONS": str(design.functions)}
        if run.fixed is not None:
            options |= {"PVID_MAX_THETA_Q31": str(len(run.fixed.estimator.n_bits))}
    else:
        options |= {macro: str(value) for macro, value in raised_bounds(run.config.design).items()}
    options |= macros or {}
    suffix = "".join(f"-{macro}-{value}" for macro, value in (macros or {}).items())
    tree = build(target, BUILD / f"{target.name}-{name}{suffix}", options)
    return tree / "apps" / "replay" / "replay.elf", tree


def play(target: Board, image: Path, timeout: float) -> ReplayReport:
    """Runs a replay image in its board's emulator and reads its report; `timeout` [s] as in `board.boards.run`."""
    outcome = run_image(target, image, timeout)
    report = parse_report(outcome.text)
    if outcome.exit_code != 0:
        raise PvidError(f"{target.name}: the image ended with exit code {outcome.exit_code}")
    return report
