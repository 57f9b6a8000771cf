"""The printed strong form in fixed point: bits of C and twin on wild runs, accuracy, refusals of init and of models."""

import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from generated import WARNINGS
from struct_fields import set_field

from pvid.base.errors import PvidError
from pvid.codegen.files_strong_q31 import files_of
from pvid.codegen.strong_library import strong_native
from pvid.codegen.strong_library_q31 import StrongNativeQ31
from pvid.codegen.strong_twin_q31 import StrongTwinQ31
from pvid.configuration.strong import strong_design
from pvid.configuration.strong_q31 import StrongDesignQ31, fixed_design
from pvid.core.model_library import core_of
from pvid.core.sizes import options_of, raised
from pvid.core.sources import INCLUDES
from pvid.design.bank_q31 import integer_bank
from pvid.design.fir import ORDERS, savitzky_golay
from pvid.oracle.strong_described import StrongModel, StrongRows, StrongSettings, all_rows
from pvid.rig.run import Recording
from pvid.settings.cores import STRONG_FIXED
from pvid.settings.enums import Law, Reason, Status
from pvid.settings.record import Record
from pvid.sim.simulated_run import simulation_of
from pvid.twin import fnv

Int32 = npt.NDArray[np.int32]

MOST = np.iinfo(np.int32).max


@cache
def recording(name: str) -> Recording:
    simulation = simulation_of(name)
    run = simulation.run(seed=1)
    return Recording(run.pop("t"), run, simulation.rig.sample_rate)


@cache
def made(name: str, law: Law = Law.STATIONARY) -> tuple[StrongDesignQ31, StrongNativeQ31]:
    model, run = simulation_of(name).model, recording(name)
    design = fixed_design(model, run, strong_design(model, run, law))
    return design, StrongNativeQ31(design.strong_q31)


def wild(counts: Int32, window: int, seed: int) -> Int32:
    """The run with what sensors do: stuck, dead, jumping, at the ends of the word, noisy, swapped in time."""
    random = np.random.default_rng(seed)
    out = np.tile(counts[: 3 * window], (3, 1)).astype(np.int64)
    ticks, signals = out.shape
    largest = np.abs(counts).max(axis=0)
    for place in range(window, ticks, window // 2):
        part, one = (slice(place, place + int(random.integers(1, window // 3))), int(random.integers(signals)))
        kind = int(random.integers(7))
        if kind == 0:
            out[part, one] = out[place, one]
        elif kind == 1:
            out[part] = 0
        elif kind == 2:
            out[place, one] = random.choice([MOST, -MOST, -MOST - 1])
        elif kind == 3:
            out[part, one] += random.integers(-largest[one], largest[one] + 1)
        elif kind == 4:
            out[part, one] += random.integers(-largest[one], largest[one] + 1, len(out[part]))
        elif kind == 5:
            out[part] = out[part][::-1]
        else:
            out[part, one] *= 40
    return np.clip(out, -MOST - 1, MOST).astype(np.int32)


def difference(core: Record, twin: Record) -> str:
    for name in ("reason", "p", "sums", "exponent"):
        ticks = np.nonzero(
            np.any(np.atleast_2d(getattr(core, name) != getattr(twin, name)).reshape(len(core.p), -1), 1)
        )
        if len(ticks[0]):
            return f"{name} at tick {ticks[0][0]}"
    return ""


@pytest.mark.parametrize(
    "name",
    [
        "rigid_body",
        "dc_motor",
        *(
            pytest.param(one, marks=pytest.mark.long)
            for one in ("kapitza", "cart_pendulum", "two_link_arm", "furuta", "two_mass_drive")
        ),
    ],
)
def test_c_has_the_bits_of_its_twin_whatever_the_sensors_do(name: str) -> None:
    design, native = made(name)
    readings = wild(design.counts, design.strong_q31.config.window, seed=3)
    identifier, twin = native.started(), StrongTwinQ31(design.strong_q31)
    cuts = np.linspace(0, len(readings), 5).astype(int)
    seen: set[int] = set()
    hashed = fnv.START
    for part, (first, last) in enumerate(zip(cuts, cuts[1:], strict=False)):
        core, own = (identifier.run_samples(readings[first:last]), twin.run(readings[first:last]))
        assert difference(core, own) == ""
        hashed = int(fnv.running_hashes(own, hashed)[-1])
        assert identifier.running_hash == hashed
        seen |= set(core.reason.tolist())
        if part == 1:
            identifier.gap()
            twin.gap()
        identifier.freeze(part == 2)
        twin.freeze(part == 2)
    wanted = {Reason.UPDATED, Reason.WARMING_UP, Reason.ACCUMULATED, Reason.REJECTED_SATURATED, Reason.HELD_FROZEN}
    assert wanted <= seen
    lower, upper = (design.strong_q31.config.estimator.lower, design.strong_q31.config.estimator.upper)
    assert np.all((core.p >= lower) & (core.p <= upper))


@pytest.mark.parametrize("name", ["dc_motor", "rigid_body", "cart_pendulum", "two_link_arm"])
def test_the_estimate_is_that_of_all_rows_in_float64(name: str) -> None:
    """Of those up to the last solve. A sixteenth of a standard error is 0.2 % of it beside the noise."""
    design, native = made(name)
    identifier = native.started()
    record = identifier.run_samples(design.counts, sums=False)
    oracle, run, fitted = StrongModel(simulation_of(name).model), recording(name), design.base.fitted
    rows = oracle.rows(run.signals, run.sample_rate, StrongSettings(fitted.taps, fitted.degree, 1))
    first = int(np.argmax(record.reason != Reason.WARMING_UP))
    last = int(np.nonzero(np.isin(record.reason, [Reason.UPDATED, Reason.MISFIT]))[0][-1])
    begin = first + 1 - fitted.taps - (2 if any(design.strong_q31.made.strong.held) else 0)
    part = slice(begin, begin + last + 1 - first)
    used = StrongRows([one[part] for one in rows.regressors], [one[part] for one in rows.known], rows.times[part])
    p, _ = all_rows(oracle.parameters, used, oracle.parameters.checked(None))
    found = design.strong_q31.values(record.p[-1])
    assert np.all(np.abs(found - p) < fitted.noise / 16)
    assert identifier.counters["rejected_saturated"] == 0
    se = design.strong_q31.values(identifier.assess()["se"][: len(p)])
    assert np.all((se > fitted.noise / 2) & (se < 50 * fitted.noise))  # correlation: half a window


def test_the_papers_law_alone_is_gain_0_at_every_row() -> None:
    design, native = made("rigid_body", Law.PSEUDOVELOCITY)
    own = design.strong_q31.config.estimator
    assert (own.gain, own.divider) == (0, 1)
    record = native.started().run_samples(design.counts[:2000])
    assert difference(record, StrongTwinQ31(design.strong_q31).run(design.counts[:2000])) == ""
    assert np.all(record.reason[record.reason != Reason.WARMING_UP] == Reason.UPDATED)


@pytest.mark.parametrize("taps", [9, 61, 401])
@pytest.mark.parametrize("largest", [16, 2**20, 28 * 2**24])
def test_integer_weights_keep_the_sums_within_their_word_and_the_bank(taps: int, largest: int) -> None:
    bank = savitzky_golay(taps, 8)
    whole = integer_bank(bank, largest)
    for order in range(ORDERS):
        size = int(np.abs(whole.weights[order].astype(np.int64)).sum()) + (whole.centre if order == 0 else 0)
        assert size * 4 * largest <= 2**62
        off = np.abs(whole.weights[order] / 2.0 ** whole.bits[order] - bank.weights[order]).max()
        assert off <= 2.0 ** -(whole.bits[order] + 1)
    assert np.abs(whole.weights.astype(np.int64)).max() <= 2**30


def test_the_window_at_full_scale_ends_no_word() -> None:
    """Each sample has the sign of its weight, order by order: the largest sums there are."""
    design, native = made("dc_motor")
    config = design.strong_q31.config
    full = np.array(config.full_scale)
    parts = []
    for order in range(ORDERS):
        side = np.sign(config.weights[order])
        signs = np.concatenate([(1 - 2 * (order % 2)) * side[::-1], [1 if order == 0 else -1], side])
        parts.append(np.where(signs == 0, 1, signs)[:, None] * full)
    readings = np.tile(np.concatenate(parts), (2, 1)).astype(np.int32)
    core = native.started().run_samples(readings)
    assert difference(core, StrongTwinQ31(design.strong_q31).run(readings)) == ""


def test_a_count_beyond_full_scale_is_refused_and_empties_the_window() -> None:
    design, native = made("dc_motor")
    config, identifier = design.strong_q31.config, native.started()
    warming = int((identifier.run_samples(design.counts[:300]).reason == Reason.WARMING_UP).sum())
    assert 0 < warming < 200
    for reading, refused in ((1, True), (0, False), (MOST, True), (-MOST - 1, True)):
        most = np.array(config.offset) + np.array(config.full_scale)
        row = design.counts[300].copy()
        row[1] = reading if abs(reading) > 1 else most[1] + reading
        before = identifier.counters["rejected_saturated"]
        reason = identifier.run_samples(row[None]).reason[0]
        if refused:
            assert reason == Reason.REJECTED_SATURATED and identifier.counters["rejected_saturated"] == before + 1
            after = identifier.run_samples(design.counts[301:601]).reason
            assert ((after == Reason.WARMING_UP) == (np.arange(300) < warming)).all()
        else:
            assert identifier.state.missing == 0  # the window stays full, whatever becomes of its row
            identifier.gap()
            identifier.run_samples(design.counts[:300])


def test_before_init_and_with_null_nothing_is_done() -> None:
    native = made("dc_motor")[1]
    identifier = native.started()
    ffi, library, name = native.headers.ffi, native.library, native.strong_q31.name
    identifier.config_struct.gate.sigmas = 1
    assert identifier.initialise() is Status.BAD_GATE_SIGMAS and not any(identifier.state_bytes)
    reading, estimate = ffi.new("int32_t[64]"), ffi.new("pvid_estimate_q31 *")
    for one in (identifier.state, ffi.NULL):
        for _ in range(100):
            assert getattr(library, f"{name}_step_q31")(one, reading) == Reason.NOT_READY
        getattr(library, f"{name}_gap_q31")(one)
        getattr(library, f"{name}_freeze_q31")(one, True)
        getattr(library, f"{name}_assess_q31")(one, estimate)
        getattr(library, f"{name}_assess_q31")(one, ffi.NULL)
    assert not any(identifier.state_bytes) and not any(bytes(ffi.buffer(estimate)))
    init, layout = getattr(library, f"{name}_init_layout_q31"), library.pvid_layout()
    assert init(ffi.NULL, identifier.config_pointer, layout) == Status.BAD_POINTER
    assert init(identifier.state, ffi.NULL, layout) == Status.BAD_POINTER
    assert init(identifier.state, identifier.config_pointer, layout + 1) == Status.BAD_LAYOUT


@pytest.mark.parametrize(
    ("field", "value", "status"),
    [
        ("bank.half", 1, Status.BAD_HALF),
        ("bank.half", 4096, Status.BAD_HALF),
        ("bank.stride", 0, Status.BAD_STRIDE),
        ("bank.stride", 9, Status.BAD_STRIDE),
        ("bank.centre", 0, Status.BAD_CENTRE),
        ("bank.centre", 2**30 + 1, Status.BAD_CENTRE),
        ("full_scale.0", 0, Status.BAD_FULL_SCALE),
        ("full_scale.1", 2**24 + 1, Status.BAD_FULL_SCALE),
        ("full_scale.2", 2**24, Status.BAD_FULL_SCALE),  # the weights are for less
        ("rows_per_second", 0, Status.BAD_DRIVE_TICKS),
        ("rows_per_second", 2**30 + 1, Status.BAD_DRIVE_TICKS),
        ("estimator.p_bits.0", 3, Status.BAD_FORMAT),
        ("estimator.divider", 0, Status.BAD_DIVIDER),
        ("estimator.row_sd", 0, Status.BAD_ROW_SD),
        ("estimator.start_sd.1", 0, Status.BAD_START_SD),
        ("gate.sigmas", 1, Status.BAD_GATE_SIGMAS),
    ],
)
def test_init_names_the_field_that_it_refuses(field: str, value: int, status: Status) -> None:
    native = made("dc_motor")[1]
    identifier = native.started()
    set_field(identifier.config_struct, field, value)
    assert identifier.initialise() is status
    assert not any(identifier.state_bytes)


PROGRAM = """\
#include <stdio.h>
#include "{name}_design_q31.h"
#include "pvid/fnv_q31.h"
int main(void)
{{
    static {name}_q31 identifier;
    int32_t reading[{upper}_SIGNALS];
    uint32_t hash = 2166136261u;
    if ({name}_init_q31(&identifier, &{name}_config) != PVID_OK) {{
        return 2;
    }}
    while (fread(reading, sizeof reading, 1, stdin) == 1) {{
        hash = pvid_fnv_estimator_q31(hash, &identifier.estimator, {name}_step_q31(&identifier, reading));
    }}
    printf("%u", (unsigned)hash);
    return 0;
}}
"""


@pytest.fixture
def sources(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A folder with the generated files of a mechanism and a program that steps it through its standard input."""
    strong_q31 = made(request.param)[0].strong_q31
    program = PROGRAM.format(name=strong_q31.name, upper=strong_q31.name.upper())
    for name, text in {**files_of(strong_q31, "a test"), "program.c": program}.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize("sources", ["dc_motor", "two_link_arm"], indirect=True)
def test_the_generated_files_compile_without_a_warning_and_in_cpp(sources: Path) -> None:
    design = made(next(sources.glob("*_strong_q31.c")).name.removesuffix("_strong_q31.c"))[0]
    sizes = options_of(raised(design.strong_q31.sizes))
    (sources / "main.cpp").write_text(f'#include "{design.strong_q31.name}_q31.h"\n')
    options = [*WARNINGS, *sizes, *INCLUDES, f"-I{sources}", "-fsyntax-only"]
    code = sources / f"{design.strong_q31.name}_q31.c"
    subprocess.run(["gcc", "-std=c99", *options, str(code)], check=True)
    plain = [one for one in options if one not in ("-Wmissing-prototypes", "-Wstrict-prototypes")]
    subprocess.run(["g++", *plain, str(sources / "main.cpp")], check=True)


@pytest.mark.long
@pytest.mark.parametrize("sources", ["dc_motor"], indirect=True)
def test_no_operation_of_a_wild_run_is_undefined(sources: Path) -> None:
    design, native = made("dc_motor")
    options = ["-std=c99", "-O2", "-fsanitize=undefined,address", "-fno-sanitize-recover=all", *INCLUDES]
    options += [f"-I{sources}", *options_of(raised(design.strong_q31.sizes))]
    code = map(str, [*sources.glob("*.c"), *core_of(STRONG_FIXED, False)])
    subprocess.run(["gcc", *options, *code, "-o", str(sources / "program")], check=True)
    for seed in range(8):
        readings = wild(design.counts, design.strong_q31.config.window, seed)
        done = subprocess.run([sources / "program"], input=readings.tobytes(), capture_output=True, check=False)
        identifier = native.started()
        identifier.run_samples(readings)
        assert (done.returncode, int(done.stdout or -1)) == (0, identifier.running_hash), done.stderr


def test_counts_beyond_24_bits_are_refused_and_made_coarser_to_identify() -> None:
    run, model = recording("dc_motor"), simulation_of("dc_motor").model
    fine = replace(model, signals=tuple(replace(one, resolution=1e-8) for one in model.signals))
    base = strong_design(fine, run)
    with pytest.raises(PvidError, match=r"V reaches 8.* counts of its sensor and the fixed-point core takes 2\^24"):
        fixed_design(fine, run, base)
    design = fixed_design(fine, run, base, between_counts=True)
    assert 2**23 <= np.abs(design.counts).max() <= 2**24
    assert np.all(np.abs(design.counts) <= design.strong_q31.config.full_scale)


def test_an_integral_since_the_start_of_the_run_goes_on_over_a_gap() -> None:
    """Of the current of a battery: bits of the twin, and the step of the rows where the current is unknown."""
    design, native = made("battery_2rc")
    readings = design.counts[:600].copy()
    readings[200] = MOST
    identifier, twin = native.started(), StrongTwinQ31(design.strong_q31)
    assert difference(identifier.run_samples(readings), twin.run(readings)) == ""
    down = design.strong_q31.config.integral_down[0]
    rates = design.strong_q31.made.integrands
    assert rates is not None
    unit = design.strong_q31.config.sample_rate * 2.0 ** (1 + rates.result_bits[0])
    place = [one.name for one in design.strong_q31.made.strong.signals].index("i")
    current = design.counts[:600, place] * design.strong_q31.lsb[place]
    current[200] = current[199]
    expected = float(np.sum((current[1:] + current[:-1]) / 2) / design.strong_q31.config.sample_rate)
    assert down >= 0 and identifier.state.integral[0] / unit == pytest.approx(expected, rel=1e-6)


def test_the_alarm_has_a_reference_where_a_block_has_few_rows() -> None:
    """Fewer than the rows between two looks at what p[0] does."""
    design, native = made("battery_2rc")
    identifier = native.started()
    assert identifier.state.misfit.block < 64
    identifier.run_samples(design.counts[:400])
    assert identifier.state.misfit.least_part.e < 60  # 2^120 where there is none


def test_both_cores_publish_what_no_row_shows() -> None:
    """The distance from a reference, of all parameters together, beside the errors of the rows."""
    model, run = simulation_of("rigid_body").model, recording("rigid_body")
    p = strong_design(model, run).fitted.p
    for reference in (p, p / 1.1, np.where(np.arange(len(p)) == 1, np.nan, p / 1.1)):
        design = strong_design(model, run, reference=reference)
        known = np.where(np.isnan(reference), 0.0, p - reference)
        assert np.allclose(design.fitted.bias, known)
        fixed = fixed_design(model, run, design)
        own = StrongNativeQ31(fixed.strong_q31).started()
        own.run_samples(fixed.counts, sums=False)
        in_q31 = fixed.strong_q31.values(own.assess()["se"][: len(p)])
        whole = strong_native(design.strong, design.config)
        found = []
        for config in (design.config, replace(design.config, shared=None)):
            core = whole.identifier_of(config)
            core.run_samples(design.samples, sums=False)
            found.append(core.assess())
        with_it, alone = (np.asarray(one["se"][: len(p)], np.float64) for one in found)
        assert np.allclose(with_it, np.hypot(alone, design.fitted.shared), rtol=1e-3)
        assert np.allclose((in_q31 / with_it)[known != 0], 1, rtol=1e-3)  # the reference is 10 % off: rows hardly count
        covariance = found[0]["covariance"][: len(p), : len(p)]
        assert np.allclose(np.sqrt(np.diag(covariance)), with_it, rtol=1e-5)
        assert (covariance[0, 2] > 0.9 * with_it[0] * with_it[2]) == bool(known[0] != 0)


def test_shared_errors_that_are_none_are_refused() -> None:
    design, _ = made("rigid_body")
    config = design.base.config
    assert config.shared is not None
    for wrong in (-config.shared, np.full_like(config.shared, np.nan)):
        with pytest.raises(PvidError, match="shared"):
            strong_native(design.strong, config).identifier_of(replace(config, shared=wrong))
