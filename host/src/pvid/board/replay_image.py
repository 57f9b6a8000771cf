"""The run of firmware/apps/replay: its header, the expected result on the host, and the report of the image."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.boards import BUILD, Board, build, keep_header, one_at_a_time
from pvid.board.boards import run as run_image
from pvid.cases import Samples, case_of
from pvid.core.native import Native
from pvid.core.sources import left_out
from pvid.design.c_tables import float_literal
from pvid.rig.file import RigFile
from pvid.settings.enums import Core, Form
from pvid.settings.kinds import Settings
from pvid.sim.pendulum import simulate, standard_sensors, standard_start
from pvid.twin import fnv

REPORT_EVERY = 500  # ticks from one line with the running hash to the next

MISSING = int(np.iinfo(np.int16).min)  # marks a missing sample; not in fixed point

# From so many ticks on the samples are a file that the assembler takes in: a compiler is slow with so many numbers.
MANY_TICKS = 100_000

# REPLAY_IN_FLASH of replay_run.h: an AVR reads tables in flash by instructions of their own.
IN_FLASH = (
    "#if defined(__AVR__)",
    "#include <avr/pgmspace.h>",
    "#define REPLAY_IN_FLASH PROGMEM",
    "#else",
    "#define REPLAY_IN_FLASH",
    "#endif",
)


class Sampling(NamedTuple):
    """How the standard run of a form is sampled: ticks a second, bits of the encoder."""

    rate: float
    bits: int


# Both fit 16 bits: 0.107 rad is 17 900 steps of 2 pi / 2^20. The strong form's five points need 20 ms between samples
# (benchmarks/accuracy.md); its window is five samples long.
SAMPLING: dict[Form, Sampling] = {"strong": Sampling(50.0, 20), "weak": Sampling(1000.0, 14)}


@dataclass(frozen=True)
class ReplayRun:
    """A run in counts of the sensors, and the settings to identify it with.

    counts int16 [ticks, 2]: phi and y; to the float core a sample is float32(count) * lsb, rounded once, on the board
    and here, and no number where it is MISSING.
    """

    config: Settings
    counts: npt.NDArray[np.int16]
    phi_lsb: np.float32
    y_lsb: np.float32
    measure_from: int

    @property
    def form(self) -> Form:
        """Which form of the model."""
        return self.config.form

    @property
    def core(self) -> Core:
        """Which arithmetic."""
        return self.config.core

    @property
    def ticks(self) -> int:
        """Samples of each channel."""
        return len(self.counts)

    @property
    def phi(self) -> Samples:
        """[rad], or counts, [ticks]"""
        return self.samples[0]

    @property
    def y(self) -> Samples:
        """[m], or counts, [ticks]"""
        return self.samples[1]

    @property
    def samples(self) -> tuple[Samples, Samples]:
        """phi and y [ticks] as the core takes them."""
        values = case_of(self.config).from_counts(self.counts, (float(self.phi_lsb), float(self.y_lsb)))
        if not _is_float(self):
            return values
        phi, y = (np.where(self.counts[:, i] == MISSING, np.float32(np.nan), x) for i, x in enumerate(values))
        return phi, y


@cache
def standard_run(form: Form, ticks: int, core: Core = "f32", divider: int = 1) -> ReplayRun:
    """The standard rig (linear truth) for `ticks`: weak form at 1 kHz and 14 bits, strong form (five points) at 50 Hz
    and 20 bits, with a solve every `divider` groups of rows."""
    sensors = replace(standard_sensors(SAMPLING[form].bits), random_offset=False)
    rate = SAMPLING[form].rate
    run = simulate(sensors=sensors, truth="linear", sample_rate=rate, duration=ticks / rate, seed=1).run
    standard = RigFile.standard()
    identifier = replace(
        standard.identifier,
        form=form,
        core=core,
        differentiator="finite-difference",
        stride=1,
        divider=divider,
    )
    rig = replace(standard, identifier=identifier, sensor=replace(standard.sensor, phi_lsb=sensors.phi_lsb))
    start = standard_start(1)
    config = case_of(identifier).settings(rig, run.sample_rate, start)
    counts = np.rint(np.stack([run.phi / sensors.phi_lsb, run.y / sensors.y_lsb], axis=1))[:ticks]
    if len(counts) != ticks or np.abs(counts).max() > np.iinfo(np.int16).max:
        raise PvidError("the standard run does not fit 16-bit counts")
    return ReplayRun(
        config=config,
        counts=counts.astype(np.int16),
        phi_lsb=np.float32(sensors.phi_lsb),
        y_lsb=np.float32(sensors.y_lsb),
        measure_from=case_of(identifier).alike_from(ticks),
    )


def header(run: ReplayRun, samples: Path | None = None) -> str:
    """replay_run.h of a run; its counts stand in it, or little-endian in the file `samples`."""
    case = case_of(run.config)
    settings = case.header(run.config, RigFile.standard().l1, "replay_config", "pvid.board.replay_image")
    return "\n".join(
        [
            "/* Generated by pvid.board.replay_image: do not edit. */",
            "#ifndef REPLAY_RUN_H",
            "#define REPLAY_RUN_H",
            "",
            "#include <stddef.h>",
            "",
            f'#include "{case.umbrella}"',
            "",
            *IN_FLASH,
            "",
            f"#define REPLAY_TYPE pvid_{run.form}_{run.core}",
            f"#define REPLAY_INIT pvid_{run.form}_init_{run.core}",
            f"#define REPLAY_STEP(self, sample) pvid_{run.form}_step_{run.core}(self, (sample)[0], (sample)[1])",
            f"#define REPLAY_HASH {case.hash_function}",
            f"#define REPLAY_SAMPLE {'float' if _is_float(run) else 'int32_t'}",
            "#define REPLAY_COUNT int16_t",
            "#define REPLAY_CHANNELS 2u",
            f"#define REPLAY_FAULTS {'pvid_arithmetic_faults_f32()' if _is_float(run) else '0u'}",
            f"#define REPLAY_IS_FLOAT {int(_is_float(run))}",
            f'#define REPLAY_FORM "{run.form}"',
            f"#define REPLAY_TICKS {run.ticks}u",
            f"#define REPLAY_MEASURE_FROM {run.measure_from}u",
            f"#define REPLAY_REPORT_EVERY {REPORT_EVERY}u",
            f"#define REPLAY_MISSING ({MISSING + 1} - 1)",
            "",
            settings,
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


def _resolutions(run: ReplayRun) -> list[str]:
    """What a count is worth to the core: itself in fixed point."""
    if not _is_float(run):
        return ["static const int32_t replay_lsb[REPLAY_CHANNELS] = {1, 1};"]
    lsb = ", ".join(map(float_literal, (run.phi_lsb, run.y_lsb)))
    return [f"static const float replay_lsb[REPLAY_CHANNELS] = {{{lsb}}};"]


def _is_float(run: ReplayRun) -> bool:
    return np.issubdtype(case_of(run.config).sample_type, np.floating)


# ---- what the host computes


def native_hashes(run: ReplayRun, native: Native) -> npt.NDArray[np.uint32]:
    """Running hash of the C core on this machine after every tick, [ticks]."""
    return native.identifier(run.config).run(*run.samples).hash


def twin_hashes(run: ReplayRun) -> npt.NDArray[np.uint32]:
    """Running hash of the numpy twin after every tick, [ticks]. Cost: 0.5 ms a tick in the strong form."""
    return fnv.running_hashes(case_of(run.config).twin(run.config).run(*run.samples).lane())


# ---- report of the image


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
        raise PvidError(f"the image did not finish; its last output: {last}")
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

    The strong form's windows are as long as its five points, so that its state is what a board would hold, and it has
    a dead zone only if the run has one; `macros` of pvid/config.h come on top.
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
    options = {"PVID_REPLAY_RUN": str(folder), "PVID_LEAVE_OUT": left_out(run.form, run.core)}
    options |= case_of(run.config).sizes(run.config, exact=target.toolchain == "avr")
    if run.form == "strong":
        options["PVID_DEAD_ZONE"] = str(int(run.config.estimator.dead_zone > 0))
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
