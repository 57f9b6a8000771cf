"""The excitation as printed has the bits of the compiled one: random tables, limits, guards and measurements."""

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pvid.core.sources import FOLDERS, INCLUDES, source
from pvid.twin.printer.program import printed_module

CORE = tuple(source(f"{one}.c") for one in ("excite_f32", "elementary_f32", "finite_f32"))
ROOTS = ("init", "start", "step", "stop", "abort", "state_of", "reason_of", "restrained", "rule")
TICKS = 400
DRAWS = 60
OF_A_GUARD = ("low", "soft_low", "soft_high", "high", "response", "push", "ahead_s", "brake", "smoothing_s")

# A run of the compiled one, whose tables come as plain numbers.
DRIVER = """
#include "pvid/excite.h"
int run(const float *of, const unsigned char *counts, const float *parts, const float *guards, const float *level,
        const float *measured, unsigned ticks, unsigned run_number, float *drive, unsigned char *state)
{
    static pvid_excite_f32 self;
    static pvid_excite_part_f32 part[PVID_EXCITE_PARTS];
    static pvid_excite_guard_f32 guard[PVID_EXCITE_GUARDS];
    pvid_excite_config_f32 config = {of[0], of[1], of[2], of[3], of[4], of[5], part, guard, counts[0], counts[1], 2u};
    for (unsigned k = 0; k < counts[0]; k++, parts += 6) {
        const pvid_excite_part_f32 one = {(pvid_excite_kind)(int)parts[0], parts[1], parts[2], parts[3], parts[4],
                                          parts[5], level, 3u};
        part[k] = one;
    }
    for (unsigned k = 0; k < counts[1]; k++, guards += 11) {
        const pvid_excite_guard_f32 one = {(unsigned char)guards[0], guards[1] > 0.5f, guards[2], guards[3], guards[4],
                                           guards[5], guards[6], guards[7], guards[8], guards[9], guards[10]};
        guard[k] = one;
    }
    const int status = (int)pvid_excite_init_f32(&self, &config);
    (void)pvid_excite_start_f32(&self, of[6], run_number);
    for (unsigned k = 0; k < ticks; k++) {
        if (k == counts[2] * 2u) { pvid_excite_stop_f32(&self); }
        if (k == counts[3] * 2u) { pvid_excite_abort_f32(&self); }
        drive[k] = pvid_excite_step_f32(&self, &measured[2 * k]);
        state[k] = (unsigned char)(pvid_excite_state_of_f32(&self) * 16u + pvid_excite_reason_of_f32(&self, NULL));
    }
    drive[ticks] = pvid_excite_restrained_f32(&self);
    return status;
}
int rule(float *out, float amplitude, float low, float top)
{
    pvid_excite_part_f32 part[8];
    const int parts = pvid_excite_rule_f32(part, amplitude, low, top);
    for (int k = 0; k < parts; k++) {
        out[3 * k] = part[k].amplitude, out[3 * k + 1] = part[k].hz, out[3 * k + 2] = part[k].turns;
    }
    return parts;
}
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("excite")
    (folder / "driver.c").write_text(DRIVER, encoding="utf-8")
    target = folder / "driver.so"
    options = ("-std=c99", "-O2", "-shared", "-fPIC", "-ffp-contract=off", *INCLUDES)
    subprocess.run(["gcc", *options, folder / "driver.c", *CORE, "-o", target, "-lm"], check=True)
    return ctypes.CDLL(str(target))


@pytest.fixture(scope="module")
def twin() -> Any:
    return printed_module([Path(one) for one in CORE], FOLDERS, {}, [f"pvid_excite_{one}_f32" for one in ROOTS])


def drawn(rng: np.random.Generator) -> dict[str, np.ndarray[Any, Any]]:
    """Settings, tables and measurements of a run, as float32."""
    rate, high = 10 ** rng.uniform(1, 5), 10 ** rng.uniform(-3, 3)
    times = [rng.uniform(1, 60) / rate, rng.uniform(1, 300) / rate]
    of = [rate, -high * rng.uniform(0, 2), high, high * rate * 10 ** rng.uniform(-3, 1), *times, rng.uniform(0, 1)]
    parts = [
        [kind, high * rng.uniform(0, 2), hz, rng.uniform(0, 1), hz + rng.uniform(0, 0.49 * rate - hz), 9.0 / rate]
        for kind in rng.integers(0, 4, rng.integers(1, 17))
        for hz in [rate * 10 ** rng.uniform(-4, -0.5)]
    ]
    guards = []
    for _ in range(rng.integers(0, 7)):
        of_rate, response = rng.integers(0, 2), rng.integers(-1, 2)
        wide = 10 ** rng.uniform(0, 4)
        ahead = [0.0, 0.0] if of_rate else [10 ** rng.uniform(-5, 0), 10 ** rng.uniform(-2, 6)]
        push = rng.uniform(0, 1) if response else 0.0
        limits = [-wide, -wide * rng.uniform(0.1, 0.9), wide * rng.uniform(0.1, 0.9), wide]
        guards.append([rng.integers(0, 2), of_rate, *limits, response, push, *ahead, 10 ** rng.uniform(-5, 0)])
    measured = rng.normal(size=(TICKS, 2)).cumsum(axis=0) * 10 ** rng.uniform(-2, 1)
    measured[rng.integers(0, 20 * TICKS, 2) % TICKS, 0] *= rng.choice([1.0, 1.0, np.nan, 1e38])
    counts = [len(parts), len(guards), *rng.integers(0, 256, 2)]
    made = {
        "of": of,
        "parts": parts,
        "guards": guards or [[0] * 11],
        "level": rng.uniform(-1, 1, 3),
        "measured": measured,
    }
    with np.errstate(over="ignore"):
        floats = {name: np.asarray(one, np.float32) for name, one in made.items()}
    return floats | {"counts": np.array(counts, np.uint8)}


def of_twin(module: Any, one: dict[str, np.ndarray[Any, Any]], number: int) -> tuple[list[Any], list[int]]:
    config = module.pvid_excite_config_f32()
    names = ("sample_rate_hz", "low", "high", "slew", "ramp_s", "burst_s")
    for name, value in zip(names, one["of"], strict=False):
        setattr(config, name, value)
    config.parts, config.guards, config.measured = int(one["counts"][0]), int(one["counts"][1]), 2
    level = list(one["level"])
    config.part, config.guard = [], []
    for row in one["parts"]:
        part = module.pvid_excite_part_f32()
        part.kind, part.level, part.levels = int(row[0]), level, 3
        part.amplitude, part.hz, part.turns, part.to_hz, part.sweep_s = row[1:]
        config.part.append(part)
    for row in one["guards"]:
        guard = module.pvid_excite_guard_f32()
        guard.signal, guard.of_rate = int(row[0]), bool(row[1])
        for name, value in zip(OF_A_GUARD, row[2:], strict=True):
            setattr(guard, name, value)
        config.guard.append(guard)
    self = module.pvid_excite_f32()
    assert module.pvid_excite_init_f32(self, config) == 0
    module.pvid_excite_start_f32(self, one["of"][6], number)
    drives, states = [], []
    for k in range(TICKS):
        if k == 2 * int(one["counts"][2]):
            module.pvid_excite_stop_f32(self)
        if k == 2 * int(one["counts"][3]):
            module.pvid_excite_abort_f32(self)
        drives.append(module.pvid_excite_step_f32(self, list(one["measured"][k])))
        states.append(module.pvid_excite_state_of_f32(self) * 16 + self.reason)
    return [*drives, module.pvid_excite_restrained_f32(self)], states


def test_drives_and_states_have_the_same_bits(library: ctypes.CDLL, twin: Any) -> None:
    rng = np.random.default_rng(50)
    ended = set()
    for _ in range(DRAWS):
        one, number = drawn(rng), int(rng.integers(0, 2**31))
        drive, state = np.zeros(TICKS + 1, np.float32), np.zeros(TICKS, np.uint8)
        given = [
            one[name].ctypes.data_as(ctypes.c_void_p)
            for name in ("of", "counts", "parts", "guards", "level", "measured")
        ]
        out = [made.ctypes.data_as(ctypes.c_void_p) for made in (drive, state)]
        assert library.run(*given, TICKS, ctypes.c_uint(number), *out) == 0
        with np.errstate(all="ignore"):
            drives, states = of_twin(twin, one, number)
        assert np.array(drives, np.float32).tobytes() == drive.tobytes()
        assert states == state.tolist()
        ended.add(states[-1])
    assert len(ended) > 3  # ends of every kind


def test_the_table_by_rule_has_the_same_bits(library: ctypes.CDLL, twin: Any) -> None:
    rng = np.random.default_rng(51)
    for _ in range(50):
        amplitude, low, factor = (np.float32(10 ** rng.uniform(a, b)) for a, b in ((-3, 3), (-2, 3), (0.01, 2)))
        top = np.float32(low * factor)
        out = np.zeros((8, 3), np.float32)
        floats = [ctypes.c_float(float(one)) for one in (amplitude, low, top)]
        parts = library.rule(out.ctypes.data_as(ctypes.c_void_p), *floats)
        rows = [twin.pvid_excite_part_f32() for _ in range(8)]
        assert twin.pvid_excite_rule_f32(rows, amplitude, low, top) == parts > 0
        printed = np.array([[one.amplitude, one.hz, one.turns] for one in rows[:parts]], np.float32)
        assert printed.tobytes() == out[:parts].tobytes()
