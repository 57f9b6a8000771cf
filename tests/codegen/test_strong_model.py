"""The printed strong form of every mechanism: the sums of the paper's equations, bits of C and twin, convergence."""

import re
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import sympy as sp
from generated import WARNINGS
from struct_fields import set_field

from bench.kinds import KINDS
from pvid.base.errors import PvidError
from pvid.codegen import files_strong
from pvid.codegen.strong import StrongFunctions, renamed, strong_functions_of
from pvid.codegen.strong_library import strong_native
from pvid.codegen.strong_sums import StrongSums, chains_of, over, strong_sums_of, times
from pvid.codegen.strong_twin import StrongModelTwin
from pvid.core.sources import INCLUDES
from pvid.design.fir import savitzky_golay
from pvid.model.operations import Program, evaluated
from pvid.model.signals import sgn
from pvid.model.strong import strong_form
from pvid.models import mechanisms
from pvid.models.kapitza import paper_pendulum
from pvid.settings.enums import Law, Reason, Status
from pvid.settings.parts import EstimatorConfig, GateConfig
from pvid.settings.strong import StrongModelConfig
from pvid.sim.simulated_run import simulation_of

Float = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]

TICKS = 400
BY_DAY = ("kapitza", "battery_2rc", "two_mass_drive")  # of order two, of order one, and the longest
GAP = 180  # a sample of the run that is no number
FIVE = np.array([[0, 0], [8 / 12, -1 / 12], [16 / 12, -1 / 12], [-1, 0.5], [-4, 1]], np.float32)


@cache
def strong_of(name: str) -> StrongFunctions:
    return renamed(strong_functions_of(strong_form(mechanisms.compiled_of(name))))


@cache
def sums_of(name: str) -> StrongSums:
    return strong_sums_of(strong_of(name))


@cache
def recorded(name: str) -> tuple[Float32, Float]:
    """Samples of the shipped rig [ticks, signals], and the true p."""
    simulation = simulation_of(name)
    run = simulation.run(seed=1)
    return np.stack([run[one.name] for one in strong_of(name).signals], 1).astype(np.float32), simulation.truth


def rows_of(strong: StrongFunctions, inputs: Float) -> Float:
    """Regressors and Y of all kinds in float64 [columns, ...] from the inputs [inputs, ...]."""
    symbols = [one.symbol for one in strong.functions.inputs]
    row = sp.lambdify(symbols, list(strong.row.expressions), modules=[{sgn.__name__: np.sign}, "numpy"])
    return np.stack([np.broadcast_to(np.asarray(x, float), inputs.shape[1:]) for x in row(*inputs)])


def values_of(program: Program, arguments: Float) -> Float:
    """The results of a program in float64."""
    return np.array(np.broadcast_arrays(*evaluated(program, arguments)))


def config_of(name: str, divider: int = 8, weights: Float32 | None = None) -> StrongModelConfig:
    """Started 30 % off, rows of equal weight; the window is of 61 samples, or these weights."""
    strong, simulation = strong_of(name), simulation_of(name)
    unknowns, truth = strong.functions.model.unknowns, simulation.truth
    bank = savitzky_golay(61, 6)
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
    plain = (1e-3,) * len(strong.functions.kinds)
    taps = bank.weights32 if weights is None else weights
    return StrongModelConfig(simulation.rig.sample_rate, taps, bank.stride, plain, estimator)


@pytest.mark.parametrize("name", KINDS)
def test_the_printed_sums_are_those_of_the_papers_equations(name: str) -> None:
    """S = C^T M C and F = C^T (B - M theta) literally, in float64 on random inputs of three kinds of sizes."""
    strong, sums = strong_of(name), sums_of(name)
    functions, random = strong.functions, np.random.default_rng(7)
    unknowns = functions.model.unknowns
    for size in (0.3, 1.0, 4.0):
        inputs = size * random.normal(size=(len(functions.inputs), 60))
        p = np.array([one.guess * random.uniform(0.5, 2) if one.positive else random.normal() for one in unknowns])
        weights = np.exp(random.normal(size=len(sums.kinds)))
        weights[0] = 1
        columns, n_p = rows_of(strong, inputs), len(p)
        s, f, distance = np.zeros((n_p, n_p)), np.zeros(n_p), 0.0
        for kind, own, w in zip(functions.kinds, sums.kinds, weights, strict=True):
            thetas = functions.theta.expressions[kind.theta.start : kind.theta.stop]
            theta = np.array(sp.lambdify(sums.p, thetas)(*p), float)
            c = np.array(sp.lambdify(sums.p, sp.Matrix(thetas).jacobian(sums.p))(*p), float)
            n, y = columns[kind.columns.start : kind.known], columns[kind.known]
            m, b, scale = n @ n.T, n @ y, w / float(own.unit) ** 2
            s += scale * c.T @ m @ c
            f += scale * c.T @ (b - m @ theta)
            distance += scale * float(np.sum((y - theta @ n) ** 2))
        x = values_of(sums.atoms_program, inputs)
        total = np.array([np.prod([x[a] ** k for a, k in m], axis=0).sum() if m else 60.0 for m in sums.places])
        arguments = np.concatenate([p, weights, total])
        found = values_of(sums.projection, arguments)
        upper = np.triu_indices(n_p)
        d = np.sqrt(np.maximum(np.diag(s), 1e-300))
        assert np.abs((found[: len(upper[0])] - s[upper]) / (d[upper[0]] * d[upper[1]])).max() < 1e-9
        # F is a difference of large sums: against the sizes of its parts
        parts = np.abs(s) @ np.abs(p) + np.abs(f)
        assert (np.abs(found[len(upper[0]) :] - f) <= 1e-9 * parts).all()
        linear = sums.linear
        projected = f[linear] + s[np.ix_(linear, linear)] @ p[linear]
        rss = values_of(sums.distance, arguments)[0] - p[linear] @ (projected + f[linear])
        assert abs(rss - distance) < 1e-8 * max(distance, np.abs(p[linear]) @ np.abs(projected))


@pytest.mark.parametrize("name", KINDS)
def test_residual_gradient_and_bound_are_those_of_the_rows(name: str) -> None:
    strong, sums = strong_of(name), sums_of(name)
    functions, random = strong.functions, np.random.default_rng(8)
    inputs = random.normal(size=(len(functions.inputs), 40))
    p = np.array([one.guess * 1.1 if one.positive else 0.1 for one in functions.model.unknowns])
    x, columns = values_of(sums.atoms_program, inputs), rows_of(strong, inputs)
    spread = np.concatenate([np.repeat(p[:, None], 40, 1), x])
    found = iter(values_of(sums.innovation.program, spread))
    squares = np.zeros(40)
    for kind, own, entries in zip(functions.kinds, sums.kinds, sums.innovation.entries, strict=True):
        thetas = functions.theta.expressions[kind.theta.start : kind.theta.stop]
        c = np.array(sp.lambdify(sums.p, sp.Matrix(thetas).jacobian(sums.p))(*p), float)
        theta, unit = np.array(sp.lambdify(sums.p, thetas)(*p), float), float(own.unit)
        n, y = columns[kind.columns.start : kind.known] / unit, columns[kind.known] / unit
        np.testing.assert_allclose(next(found), y - theta @ n, rtol=1e-9, atol=1e-9 * np.abs(theta @ n).max())
        for a in entries:
            np.testing.assert_allclose(next(found), (c.T @ n)[a], rtol=1e-9, atol=1e-9)
        squares = np.maximum(squares, y**2)
    assert (values_of(sums.bound, x)[0] >= squares * (1 - 1e-12)).all()


def _at_night(name: str, schedule: str) -> bool:
    """In stages, which take most of the time, two mechanisms of order two are enough by day."""
    return schedule == "window in stages" and name in ("battery_2rc", "two_mass_drive")


@pytest.mark.parametrize(
    ("name", "schedule"),
    [
        pytest.param(name, schedule, marks=[pytest.mark.night] if _at_night(name, schedule) else [])
        for name in KINDS
        for schedule in ("window in stages", "five points at every row")
    ],
)
def test_c_and_twin_have_the_same_bits(name: str, schedule: str) -> None:
    samples = recorded(name)[0][:TICKS].copy()
    samples[GAP, 0] = np.nan
    five = schedule != "window in stages"
    config = config_of(name, 1 if five else 8, FIVE if five else None)
    config = replace(config, stride=3 if five else config.stride, gate=GateConfig(6.0, 1.0))
    got = strong_native(strong_of(name), config).identifier_of(config).run_samples(samples)
    want = StrongModelTwin(strong_of(name), config).run(samples)
    assert (got.reason == want.reason).all()
    assert (got.p.view(np.uint32) == want.p.view(np.uint32)).all()
    assert (got.sums.view(np.uint32) == want.sums.view(np.uint32)).all()
    assert want.reason[GAP] == Reason.REJECTED_NOT_FINITE and want.reason[GAP + 5] == Reason.WARMING_UP
    assert len(np.unique(want.p, axis=0)) > 10


@pytest.mark.parametrize("name", [pytest.param(one, marks=() if one in BY_DAY else pytest.mark.night) for one in KINDS])
def test_the_printed_c_has_no_warning_and_its_header_is_cpp(name: str, tmp_path: Path) -> None:
    files = files_strong.files_of(strong_of(name), "test")
    for one, text in files.items():
        (tmp_path / one).write_text(text, encoding="utf-8")
    header, source = (str(tmp_path / one) for one in files)
    options = ["-DPVID_MAX_P=8", *INCLUDES, f"-I{tmp_path}"]
    subprocess.run(["gcc", "-std=c99", "-O2", *WARNINGS, *options, "-c", source, "-o", "/dev/null"], check=True)
    subprocess.run(["g++", "-fsyntax-only", "-Wall", "-Werror", "-x", "c++", *options, header], check=True)


def test_rigid_body_and_motor_are_identified_from_derivatives() -> None:
    """Where the signals are smooth and measured at the order that the row needs; on the shipped rigs' noise."""
    for name, among, bound in (("rigid_body", None, 2e-3), ("dc_motor", ("R", "k"), 5e-3)):
        samples, truth = recorded(name)
        config = config_of(name)
        identifier = strong_native(strong_of(name), config).identifier_of(config)
        found = identifier.run_samples(samples, sums=False)
        for p, true, one in zip(found.p[-1], truth, strong_of(name).functions.model.p_names, strict=True):
            if among is None or one in among:
                assert abs(p / true - 1) < bound, one  # measured: 7e-4 and 8e-4
        se = identifier.assess()["se"][: len(truth)]
        assert (se > 0).all() and np.isfinite(se).all()


@pytest.mark.parametrize("law", [Law.STATIONARY, Law.PSEUDOVELOCITY])
def test_schedules_end_at_the_solution_of_all_rows(law: Law) -> None:
    """S and F from all sums at every row, at every eighth, in stages: apart by a part of the standard errors."""
    samples, _ = recorded("rigid_body")
    base = config_of("rigid_body")
    ends = {}
    for schedule, divider, exact in (("exact", 1, 1), ("lazy", 1, 8), ("staged", 8, 0), ("at once", 7, 0)):
        own = replace(base, estimator=replace(base.estimator, divider=divider, law=law), exact_every=exact)
        identifier = strong_native(strong_of("rigid_body"), own).identifier_of(own)
        ends[schedule] = identifier.run_samples(samples, sums=False).p[-1]
        se = identifier.assess()["se"][:6]
    share = 0.1 if law is Law.STATIONARY else 3.0  # law (5) depends on its way
    assert all((np.abs(one - ends["exact"]) < share * se).all() for one in ends.values())


@pytest.mark.parametrize(
    ("divider", "exact"), [(1, 1), (1, 8), (8, 0), (7, 0)], ids=["exact", "lazy", "staged", "once"]
)
def test_beside_a_bound_the_others_are_those_of_the_constrained_estimate(divider: int, exact: int) -> None:
    """With p_a held 5 standard errors off, b moves by the covariance of both over the variance of a."""
    samples, _ = recorded("dc_motor")
    base = config_of("dc_motor")
    own = replace(base, estimator=replace(base.estimator, divider=divider), exact_every=exact)
    free = strong_native(strong_of("dc_motor"), own).identifier_of(own)
    ends = free.run_samples(samples, sums=False).p[-1]
    covariance = free.assess()["covariance"][:7, :7].astype(float)
    se = np.sqrt(np.diag(covariance))
    correlation = np.abs(covariance / np.outer(se, se) - np.eye(7))
    a, b = np.unravel_index(np.argmax(correlation), (7, 7))
    assert correlation[a, b] > 0.3
    lower = own.estimator.lower.copy()
    lower[a] = ends[a] + 5 * se[a]
    start = np.maximum(own.estimator.start, np.float32(1.01) * lower)
    held = replace(own, estimator=replace(own.estimator, lower=lower, start=start))
    found = strong_native(strong_of("dc_motor"), held).identifier_of(held).run_samples(samples, sums=False).p[-1]
    moved = covariance[a] / covariance[a, a] * (lower[a] - ends[a])
    assert found[a] == lower[a]
    assert (np.abs(found - ends - moved) < 0.1 * se).all(), (found - ends - moved) / se


def test_samples_beyond_a_row_are_refused_and_p_stays_finite() -> None:
    samples, _ = recorded("dc_motor")
    hostile = samples[:600].copy()
    hostile[100:130] *= np.float32(1e30)
    hostile[300:420] *= np.float32(1e12)
    config = config_of("dc_motor", weights=FIVE)
    identifier = strong_native(strong_of("dc_motor"), config).identifier_of(config)
    record = identifier.run_samples(hostile)
    assert np.isfinite(record.p).all() and np.isfinite(record.sums).all()
    assert {Reason.REJECTED_SATURATED, Reason.UPDATED} <= set(record.reason.tolist())


def test_an_outlier_is_rejected_and_a_frozen_identifier_keeps_its_state() -> None:
    samples, _ = recorded("rigid_body")
    config = replace(config_of("rigid_body", weights=FIVE), gate=GateConfig(6.0, 1.0))
    identifier = strong_native(strong_of("rigid_body"), config).identifier_of(config)
    identifier.run_samples(samples[:400])
    wrong = samples[400:440].copy()
    wrong[20] += np.float32(3)
    assert (identifier.run_samples(wrong).reason == Reason.REJECTED_OUTLIER).sum() >= 1
    identifier.freeze(True)
    kept = identifier.state_bytes
    frozen = identifier.run_samples(samples[440:480])
    assert (frozen.reason == Reason.HELD_FROZEN).all() and len(np.unique(frozen.p, axis=0)) == 1
    identifier.freeze(False)
    assert identifier.run_samples(samples[480:500]).reason[-1] in (Reason.ACCUMULATED, Reason.UPDATED)
    assert len(kept) == len(identifier.state_bytes)


def test_before_init_and_with_null_nothing_is_done() -> None:
    """A refused init leaves zeros, whatever stood in the memory: an object that is not ready."""
    config = config_of("rigid_body", weights=FIVE)
    identifier = strong_native(strong_of("rigid_body"), config).identifier_of(config)
    ffi, library = identifier.native.headers.ffi, identifier.native.library
    ffi.buffer(identifier.state)[:] = b"\xff" * len(identifier.state_bytes)
    identifier.config_struct.gate.sigmas = 1
    assert identifier.initialise() is Status.BAD_GATE_SIGMAS and not any(identifier.state_bytes)
    inputs, sums = ffi.new("float[64]"), ffi.new("float[256]", [7.0] * 256)
    for one in (identifier.state, ffi.NULL):
        for _ in range(2 * config.window):
            assert library.rigid_body_strong_step_f32(one, inputs) == Reason.NOT_READY
            assert library.rigid_body_strong_row_step_f32(one, inputs) == Reason.NOT_READY
        library.rigid_body_strong_gap_f32(one)
        library.rigid_body_strong_freeze_f32(one, True)
        library.rigid_body_strong_read_sums_f32(one, sums)
        estimate = ffi.new("pvid_estimate_f32 *", {"kappa": 7.0})
        library.rigid_body_strong_assess_f32(one, estimate)
        assert set(sums) == {7.0} and not any(bytes(ffi.buffer(estimate)))
        library.rigid_body_strong_assess_f32(one, ffi.NULL)
    assert not any(identifier.state_bytes)
    layout = library.pvid_layout()
    init = library.rigid_body_strong_init_layout_f32
    assert init(ffi.NULL, identifier.config_pointer, layout) == Status.BAD_POINTER
    assert init(identifier.state, ffi.NULL, layout) == Status.BAD_POINTER
    assert init(identifier.state, identifier.config_pointer, layout + 1) == Status.BAD_LAYOUT


@pytest.mark.parametrize(
    ("field", "value", "status"),
    [
        ("sample_rate_hz", np.nan, Status.BAD_SAMPLE_RATE),
        ("sample_rate_hz", 2e6, Status.BAD_SAMPLE_RATE),
        ("bank.half", 1, Status.BAD_HALF),
        ("bank.half", 4096, Status.BAD_HALF),
        ("bank.stride", 0, Status.BAD_STRIDE),
        ("bank.stride", 4096, Status.BAD_STRIDE),
        ("bank.weights", None, Status.BAD_BANK),
        ("row_sd.0", 0, Status.BAD_ROW_SD),
        ("row_sd.2", np.nan, Status.BAD_ROW_SD),
        ("exact_every", 256, Status.BAD_DIVIDER),
        ("estimator.divider", 0, Status.BAD_DIVIDER),
        ("estimator.dead_zone", 1, Status.BAD_DEAD_ZONE),
        ("estimator.start.0", np.nan, Status.BAD_START),
        ("estimator.start_sd.5", 0, Status.BAD_START_SD),
        ("estimator.lower.1", np.inf, Status.BAD_BOUNDS),
        ("estimator.forgetting_s", -1, Status.BAD_FORGETTING),
        ("estimator.feedback_hz", np.nan, Status.BAD_FEEDBACK),
        ("estimator.law", 7, Status.BAD_LAW),
        ("estimator.step_limit", 1, Status.BAD_STEP_LIMIT),
        ("estimator.kappa_min", 1, Status.BAD_KAPPA_MIN),
        ("estimator.correlation", 0.5, Status.BAD_CORRELATION),
        ("gate.sigmas", 1, Status.BAD_GATE_SIGMAS),
        ("gate.patience_s", -1, Status.BAD_GATE_PATIENCE),
    ],
)
def test_init_names_the_field_that_it_refuses(field: str, value: float | None, status: Status) -> None:
    config = config_of("rigid_body", weights=FIVE)
    identifier = strong_native(strong_of("rigid_body"), config).identifier_of(config)
    set_field(identifier.config_struct, field, identifier.native.headers.ffi.NULL if value is None else value)
    assert identifier.initialise() is status and not any(identifier.state_bytes)


@pytest.mark.parametrize("weights", [FIVE, None], ids=["five points", "window"])
def test_a_bad_sample_empties_the_window_as_a_gap_does_and_keeps_the_sums(weights: Float32 | None) -> None:
    samples, _ = recorded("rigid_body")
    config = config_of("rigid_body", weights=weights)
    native = strong_native(strong_of("rigid_body"), config)
    with_gaps, with_bad = (native.identifier_of(config) for _ in range(2))
    start = with_gaps.run_samples(samples[:300])
    before = with_bad.run_samples(samples[:300])
    warming = int((start.reason == Reason.WARMING_UP).sum())
    assert config.window - 2 <= warming <= config.window + 2  # a held input is known three samples later
    begin = 301
    for k, bad in enumerate((np.inf, -np.inf, np.nan)):
        wrong = samples[begin - 1 : begin].copy()
        wrong[0, k % wrong.shape[1]] = bad
        rejected = with_bad.run_samples(wrong)
        assert rejected.reason.tolist() == [Reason.REJECTED_NOT_FINITE]
        assert (rejected.sums[-1] == before.sums[-1]).all() and (rejected.p[-1] == before.p[-1]).all()
        with_gaps.gap()
        after, before = (one.run_samples(samples[begin : begin + 300]) for one in (with_gaps, with_bad))
        assert (after.reason == before.reason).all() and (after.p == before.p).all()
        assert ((after.reason == Reason.WARMING_UP) == (np.arange(300) < warming)).all()
        begin += 301
    assert with_gaps.counters["rejected_not_finite"] == 0 and with_bad.counters["rejected_not_finite"] == 3


@pytest.mark.parametrize("name", ["rigid_body", "dc_motor"])
def test_any_bits_as_samples_leave_finite_numbers_within_the_bounds(name: str) -> None:
    """Any words, with stretches of numbers that are long enough to fill the window."""
    random, signals = np.random.default_rng(5), len(strong_of(name).signals)
    words = random.integers(0, 2**32, (20_000, signals), np.uint32)
    words[np.arange(20_000) % 200 > 20] &= 0xBFFFFFFF
    config = config_of(name, divider=1, weights=FIVE)
    identifier = strong_native(strong_of(name), config).identifier_of(config)
    record = identifier.run_samples(words.view(np.float32), estimate_every=1)
    estimate, n_p = record.estimate, len(config.estimator.start)
    assert (record.p >= config.estimator.lower).all() and (record.p <= config.estimator.upper).all()
    assert np.isfinite(record.sums).all()
    for one in ("se", "covariance"):
        assert np.isfinite(estimate[one]).all()
    assert (estimate["se"][:, :n_p] >= 0).all() and (estimate["residual_sd"] >= 0).all()
    assert np.isfinite(estimate["residual_sd"]).all()
    assert ((estimate["kappa"] >= 0) & (estimate["kappa"] <= 1)).all()
    assert Reason.UPDATED in record.reason


def test_the_papers_pendulum_has_sums_as_few_as_by_hand() -> None:
    """58 sums, one multiplication each; the shift G = u + w is found, and its C is readable."""
    strong = renamed(strong_functions_of(strong_form(paper_pendulum.model.compiled("paper_pendulum"))))
    sums = strong_sums_of(strong)
    assert len(sums.places) == 58 and len(sums.chains) == 57 and sums.shift is not None
    assert sums.projection.operations <= 284
    w, d1, d2, x0, phi, second, fourth, g = sp.symbols("w d1 d2 x0 phi phi_2 phi_4 G")
    of_p = sp.Matrix([w * x0 + w**2 * fourth + d1 * g**3 * second + d2 * g**4 * phi])
    printed = files_strong.source(strong, "test")
    assert "With G = x1 + w:" in printed and "P[0] = d1 g[0][1] + d2 g[0][2] + phi_4*w**2 + w*x0" in printed
    slopes = of_p.jacobian([w, d1, d2]) + sp.Matrix([[of_p.diff(g)[0], 0, 0]])
    for a, (name, slope) in enumerate(zip(("w", "d1", "d2"), slopes, strict=True)):
        (text,) = re.findall(rf"g\[0\]\[{a}\] = dP/d{name} = (.*)\n", printed)
        assert sp.expand(sp.sympify(text) - slope) == 0
    assert "/* sum G^7 phi^2 */" in printed and "/* S[0][2] */" in printed


def test_chains_make_each_product_by_one_multiplication_of_known_ones() -> None:
    random = np.random.default_rng(4)
    wanted = [tuple((a, int(k)) for a, k in enumerate(random.integers(0, 4, 4)) if k) for _ in range(40)]
    made: set[tuple[tuple[int, int], ...]] = {(), *(((a, 1),) for a in range(4))}
    for one in chains_of(filter(None, wanted), 4):
        assert one.left in made and one.right in made and times(one.left, one.right) == one.made
        assert over(one.made, one.left) == one.right
        made.add(one.made)
    assert set(wanted) <= made


def test_a_row_that_is_integrated_by_parts_is_refused() -> None:
    with pytest.raises(PvidError, match="dc_motor: a row is integrated by parts; give its strong form"):
        strong_functions_of(mechanisms.compiled_of("dc_motor"))


def test_the_header_names_the_size_that_it_needs() -> None:
    header = files_strong.header(strong_of("dc_motor"), "test")
    assert '#error "compile pvid and this file with -DPVID_MAX_P=7"' in header
    for line in ("sample[0]  V    [V]    held until the next", "sample[2]  phi  [rad]", "phi, derivative 2"):
        assert line in header
