"""Constraints between parameters: the estimate is that of sequential quadratic programming, in float64 and in C."""

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import sympy as sp
from constraint_sets import SETS, SIGMA, Set
from motor_run import TRUTH, motor_equations, recording
from weak_rig import assert_equals_the_twin

import pvid
from pvid.base.errors import PvidError
from pvid.codegen.refine import refine_functions
from pvid.codegen.strong import renamed, strong_functions_of
from pvid.codegen.strong_library import strong_native
from pvid.codegen.strong_twin import StrongModelTwin
from pvid.codegen.weak_library import weak_native
from pvid.configuration.strong import strong_design
from pvid.configuration.weak import config_to_identify, samples_of
from pvid.core.native import Native
from pvid.core.sources import INCLUDES, core_sources
from pvid.identification.analysis import analysed
from pvid.identification.core import identify_in_c
from pvid.identification.road import identified
from pvid.identification.strong import identify_strong_mechanism
from pvid.model import Model
from pvid.model.compiled import CompiledModel
from pvid.model.identifiability import identifiable
from pvid.model.report import check_report
from pvid.model.strong import strong_form
from pvid.model.together import with_own
from pvid.oracle.strong_described import StrongRows, StrongSettings, all_rows, identify_strong
from pvid.oracle.weak.parameters import Parameters
from pvid.oracle.weak.solve import Moments, gauss_newton
from pvid.settings.parts import EstimatorConfig
from pvid.settings.strong import StrongModelConfig

Float = npt.NDArray[np.float64]
SEEDS = range(3)
FIVE = np.array([[0, 0], [8 / 12, -1 / 12], [16 / 12, -1 / 12], [-1, 0.5], [-4, 1]], np.float32)


def from_optimum(case: Set, rows: Float, y: Float, p: Float) -> float:
    """The largest distance of p from the optimum of sequential quadratic programming, in standard errors of theta
    without constraints."""
    m, b = rows.T @ rows / SIGMA**2, rows.T @ y / SIGMA**2
    errors = np.sqrt(np.diag(np.linalg.inv(m)))
    return float(np.max(np.abs(p - case.optimum(m, b, p + 0.5 * errors)) / errors))


@pytest.mark.parametrize("name", SETS)
def test_float64_finds_the_optimum_of_sequential_quadratic_programming(name: str) -> None:
    """Within 1e-3 standard errors; SLSQP itself ends within about 1e-6 of them."""
    case, compiled = SETS[name], SETS[name].compiled()
    parameters, n = Parameters(compiled), len(case.truth)
    order = [int(str(one)[1:]) for one in compiled.rows[0].theta]
    for seed in SEEDS:
        rows, y = case.rows(seed)
        m, b = rows.T @ rows / SIGMA**2, rows.T @ y / SIGMA**2
        p = parameters.checked(None)
        for _ in range(3):
            p, size = gauss_newton(
                parameters, Moments([(0,)], [m[np.ix_(order, order)]], [b[order]]), p, parameters.prior(p), 30
            )
        assert from_optimum(case, rows, y, p[:n]) < 1e-3, (seed, p)
        assert np.max(np.abs(parameters.constraints(p)[0])) < 1e-10 and size < 1e-8


def cored(name: str, seed: int) -> tuple[Float, Float, Float]:
    """p of the core after all rows, settled; what it must be; standard errors of theta without constraints."""
    case = SETS[name]
    t, n, margins = case.theta, len(case.truth), case.margins
    s = list(sp.symbols(f"s0:{len(margins)}", real=True))
    tied = sp.lambdify([t + s], case.g(t) + [a - b for a, b in zip(case.h(t), s, strict=True)])
    sd, low = (case.start, 0.01) if case.positive else ([10.0] * n, -99.0)
    rows, y = case.rows(seed)
    core = pvid.Estimator(
        lambda p: p[:n], lambda p: np.eye(n, n + len(s)), start=[*case.start, *margins],
        start_sd=[*sd, *[1.0] * len(s)], row_sd=SIGMA, lower=[low] * n + [0.0] * len(s), upper=[99.0] * (n + len(s)),
        positive=[case.positive] * n + [False] * len(s), rate=50.0, constraints=lambda p: np.array(tied(p)),
    ).add(rows, y)  # fmt: skip
    for _ in range(60):
        Native().library.pvid_estimator_iterate_f32(core._state)
    m, b = rows.T @ rows / SIGMA**2, rows.T @ y / SIGMA**2
    errors = np.sqrt(np.diag(np.linalg.inv(m)))
    p = core.estimate.p
    assert np.max(np.abs(tied(p))) < 1e-6  # a few ulp
    return p[:n], case.optimum(m, b, p[:n] + 0.5 * errors), errors


@pytest.mark.parametrize("name", SETS)
def test_the_core_stops_at_the_optimum(name: str) -> None:
    """Within rounding: float32 sums of 400 rows leave up to 2e-4 standard errors."""
    for seed in SEEDS:
        p, best, errors = cored(name, seed)
        assert np.max(np.abs(p - best) / errors) < 1e-3, (seed, p, best)


def test_a_curvature_above_the_information_keeps_the_core_from_settling() -> None:
    """The law neglects it (theory.md 4): with a reaction that large Gauss-Newton has no stable point here."""
    p, best, errors = cored("sphere", 4)
    assert 1e-2 < np.max(np.abs(p - best) / errors) < 0.3


@pytest.mark.parametrize("room", [1, 2, 8])
def test_the_core_compiles_without_a_warning_for_any_room(room: int, tmp_path: Path) -> None:
    """gcc 12 took a scratch array of one constraint for uninitialised, and boards are built with warnings as errors."""
    sizes = [f"-DPVID_MAX_CONSTRAINTS={room}", f"-DPVID_MAX_DRIFTS={min(room, 4)}", "-DPVID_MAX_P=8"]
    options = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror", *sizes, *INCLUDES]
    for source in core_sources():
        if source.stem in ("constraints_f32", "drift_f32", "estimator_f32", "staged_f32", "assess_f32"):
            subprocess.run(["gcc", *options, "-c", str(source), "-o", str(tmp_path / "object.o")], check=True)


# ---- a mechanism: the torque constant is the back-EMF's, and the moment of inertia follows from it


def motor(*more: str, margin: str = "") -> CompiledModel:
    """Constraints as text, in the unknowns' names; margin: what is at least 0."""
    model = Model("motor with two constants")
    given = "R:ohm:1 L:H:1e-3 ke:V*s/rad:0.05 kt:N*m/A:0.05 J:kg*m^2:1e-4 b:N*m*s/rad:1e-4"
    own = motor_equations(model, "ke", "kt", given)
    own["tau"] = model.known("tau", "s", 1e-3)
    own["R0"] = model.known("R0", "ohm", 1.0)
    own["c"] = model.known("c", "V^2*s^2", 1e-3)
    for one in more:
        model.constraint(sp.sympify(one, locals=own))
    if margin:
        least = model.unknown("margin", "ohm", 0.1, positive=False, low=0, sd=1.0)
        model.constraint(sp.sympify(margin, locals=own) - least)
    return model.compiled("motor_two_constants")


def test_a_constraint_makes_identifiable_what_the_rows_do_not_determine() -> None:
    free, tied = identifiable(motor()), identifiable(motor("ke - kt"))
    assert free.rank == 5 and set(free.unidentifiable) == {"kt", "J", "b"} and tied.identifiable
    assert "1 constraint ties ke and kt." in check_report(motor("ke - kt"))
    assert not identifiable(motor("L - R*tau")).identifiable


def test_tied_parameters_are_found_with_their_errors_in_float64_and_in_c() -> None:
    """With twin and core of the same bits; the constraint is met, and its parameters share one error."""
    answer = analysed(recording(), motor("ke - kt", "ke**2 - kt**2"))  # the second one is redundant
    core = identify_in_c(answer)
    for found in (answer.values, core.values):
        assert found["ke"].value == pytest.approx(found["kt"].value, rel=1e-6)
        assert found["ke"].se_noise == pytest.approx(found["kt"].se_noise, rel=1e-3)
        for name, truth in TRUTH.items():
            one = found[name]
            assert one.value is not None and one.se_noise is not None, name
            assert abs(one.value - truth) < 4 * one.se_noise and one.se_noise < 0.01 * truth, name
    assert core.published and answer.found.verdict.word == "good"
    config = config_to_identify(answer.model, answer.recording, answer.ranking)
    records = assert_equals_the_twin(
        weak_native(answer.model, config.design), config, samples_of(config, answer.recording.signals)[:4000]
    )
    p = records[0].p[-1]
    assert p[2] != np.float32(0.05) and p[2] == pytest.approx(p[3], rel=1e-6)


def test_what_constraints_fix_has_no_error_and_is_no_doubt() -> None:
    """R through a constant, in both forms: its variance is 0, and its float32 another number than float64's."""
    for answer in (
        identify_in_c(analysed(recording(), motor("ke - kt", "R - 12*R0/10")), "f32"),
        identify_strong_mechanism(recording(), motor("ke - kt", "R - 12*R0/10"), "f32"),
    ):
        assert all(np.isfinite([one.value or np.nan, one.se or 0.0]).all() for one in answer.values.values())
        assert answer.values["R"].value == pytest.approx(1.2, rel=1e-6) and "disagree" not in str(answer.verdict)


def test_the_refinement_keeps_constraints_with_their_errors() -> None:
    """Without it kt, J and b have no value; the redundant second one does no harm."""
    answer = identified(recording(), motor("ke - kt", "ke**2 - kt**2"), refine=True, predict=False)
    assert answer.refinement is not None and answer.refinement.adopted
    found = answer.values
    assert found["ke"].value == pytest.approx(found["kt"].value, rel=1e-9)
    assert found["ke"].se_noise == pytest.approx(found["kt"].se_noise, rel=1e-6)
    for name, truth in TRUTH.items():
        one = found[name]
        assert one.value is not None and one.se_noise is not None, name
        assert abs(one.value - truth) < 4 * one.se_noise and one.se_noise < 1e-3 * truth, name


def test_a_refinement_without_a_margin_in_its_equations_is_refused() -> None:
    answer = identified(recording(), motor("ke - kt", margin="R - R0"), refine=True, predict=False)
    assert answer.refinement is not None and not answer.refinement.adopted
    assert "margin is in no equation of the refinement" in answer.refinement.text


def test_the_strong_form_keeps_constraints_in_float64() -> None:
    found = identify_strong_mechanism(recording(), motor("ke - kt"), "f64")
    for name, truth in TRUTH.items():
        one = found.values[name]
        assert one.value is not None and one.se is not None and abs(one.value - truth) < 4 * one.se, name
    assert found.values["ke"].value == pytest.approx(found.values["kt"].value, rel=1e-9)
    ticks = identify_strong(motor("ke - kt"), recording().signals, 1000.0, settings=StrongSettings(31, 6))
    assert ticks.history[-1] == pytest.approx(ticks.p, rel=1e-3) and ticks.se[2] == pytest.approx(ticks.se[3])


@pytest.mark.parametrize("divider", [8, 1, 5])
def test_the_printed_strong_form_keeps_constraints_with_the_bits_of_its_twin(divider: int) -> None:
    """At the optimum of float64 with the same window, with the errors of both; kt is ke at every tick.

    divider: staged; at every row, from all rows at every eighth; all at one row.
    """
    design = strong_design(motor("ke - kt", "ke**2 - kt**2"), recording())  # the second one is redundant
    config = replace(design.config, estimator=replace(design.config.estimator, divider=divider))
    core = strong_native(design.strong, config).identifier_of(config)
    record = core.run_samples(design.samples)
    twin = StrongModelTwin(design.strong, config).run(design.samples[:1500])
    assert np.array_equal(twin.hash, record.hash[:1500]) and np.array_equal(twin.p, record.p[:1500])
    assert np.max(np.abs(record.p[:, 2] / record.p[:, 3] - 1)) < 2e-7
    assert core.counters["updates"] > 900 and twin.p[-1, 2] != np.float32(0.05)
    errors, se = np.asarray(design.fitted.noise), core.assess()["se"][:6]
    assert np.max(np.abs(record.p[-1] - design.fitted.p) / np.hypot(errors, se)) < 1.5
    assert se[2] == pytest.approx(se[3], rel=1e-5)


def printed_end(name: str, seed: int) -> tuple[Float, Float, Float]:
    """As `cored`, of the printed strong form: all rows, then rows of zeros, at each of which it steps again."""
    case = SETS[name]
    n, m = len(case.truth), len(case.margins)
    strong = renamed(strong_functions_of(strong_form(case.compiled())))
    rows, y = case.rows(seed)
    sd = np.array([*(case.start if case.positive else [10.0] * n), *[1.0] * m], np.float32)
    low = [*[0.01 if case.positive else -99.0] * n, *[0.0] * m]
    estimator = EstimatorConfig(
        start=np.array([*case.start, *case.margins], np.float32), start_sd=sd, row_sd=1.0,
        lower=np.array(low, np.float32), upper=np.full(n + m, 99, np.float32), divider=1,
    )  # fmt: skip
    config = StrongModelConfig(50.0, FIVE, 1, (SIGMA,), estimator, exact_every=1)
    given = {"y": y, **{f"x{k}": row for k, row in enumerate(rows.T)}}
    samples = np.pad(np.stack([given[one.name] for one in strong.signals], axis=1), ((0, 60), (0, 0)))
    p = strong_native(strong, config).identifier_of(config).run_samples(samples, sums=False).p[-1, :n]
    start = 2  # the first two instants have no row
    m_sum, b = rows[start:].T @ rows[start:] / SIGMA**2, rows[start:].T @ y[start:] / SIGMA**2
    errors = np.sqrt(np.diag(np.linalg.inv(m_sum)))
    return p, case.optimum(m_sum, b, p + 0.5 * errors), errors


@pytest.mark.parametrize("name", [one for one in SETS if one != "pole and gain"])  # C has no exp
def test_the_printed_strong_form_stops_at_the_optimum(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within rounding, as the other form."""
    largest = {"PVID_MAX_P": 8, "PVID_MAX_CONSTRAINTS": 4}  # one core for all: seconds of compiling
    monkeypatch.setattr("pvid.codegen.strong_library.raised", lambda sizes: largest)
    for seed in SEEDS:
        p, best, errors = printed_end(name, seed)
        assert np.max(np.abs(p - best) / errors) < 1e-3, (seed, p, best)


@pytest.mark.parametrize("form", ["printed", "analysis"])
def test_an_inequality_of_the_strong_form_is_a_margin_that_reaches_0(form: str) -> None:
    """R >= 1.3 ohm is false of the motor, whose R is 1.2: R ends there."""
    found = identify_strong_mechanism(recording(), motor("ke - kt", margin="R - 13*R0/10"), "f32")
    p = dict(zip(found.model.p_names, found.design.fitted.p, strict=True))
    values = {name: p[name] if form == "analysis" else found.values[name].value for name in ("R", "margin")}
    assert values["R"] == pytest.approx(1.3, rel=1e-5) and values["margin"] == pytest.approx(0.0, abs=1e-6)


def test_fixed_point_refuses_constraints_of_the_strong_form() -> None:
    with pytest.raises(PvidError, match="which fixed point does not keep: .*, and `--form strong`"):
        identify_strong_mechanism(recording(), motor("ke - kt"), "q31")


def test_fixed_point_refuses_constraints() -> None:
    with pytest.raises(PvidError, match="which fixed point does not keep"):
        identify_in_c(analysed(recording(), motor("ke - kt")), "q31")


def test_the_second_stage_in_c_refuses_constraints() -> None:
    with pytest.raises(PvidError, match="which the second stage does not keep: the weak form"):
        refine_functions(motor("ke - kt"))


@pytest.mark.parametrize("name", SETS)
def test_the_strong_form_in_float64_finds_the_same_optimum(name: str) -> None:
    case, compiled = SETS[name], SETS[name].compiled()
    parameters, n = Parameters(compiled), len(case.truth)
    order = [int(str(one)[1:]) for one in compiled.rows[0].theta]
    for seed in SEEDS:
        rows, y = case.rows(seed)
        p, _ = all_rows(parameters, StrongRows([rows[:, order]], [y], np.arange(400.0)), parameters.checked(None))
        assert from_optimum(case, rows, y, p[:n]) < 1e-3, (seed, p)


@pytest.mark.parametrize(
    ("constraints", "message"),
    [
        (("ke - kt", "ke - 2*kt"), "no values near the start meet its constraints: do these contradict"),
        (("ke**2 + kt**2 + c",), "no values near the start meet its constraints"),
        (("L - R*tau", "ke - kt", "ke**2 - c", "J*R - c*tau", "b*tau - J", "R - R0"), "leave no parameter to"),
    ],
)
def test_constraints_that_leave_nothing_are_refused(constraints: tuple[str, ...], message: str) -> None:
    with pytest.raises(PvidError, match=message):
        Parameters(motor(*constraints)).checked(None)


def test_a_constraint_of_something_else_is_refused() -> None:
    model = Model("refused")
    x, k = model.sensor("x", "m", noise=1e-3), model.known("k", "N/m", 1.0)
    m = model.unknown("m", "kg", 1.0)
    for one, message in (
        (x - 1, "contains a signal"), (k, "contains no unknown"), (m - k, "which is added to it"),
        (m - sp.Symbol("z"), "z is not declared"),
    ):  # fmt: skip
        with pytest.raises(PvidError, match=message):
            model.constraint(one)


@pytest.mark.parametrize("seed", range(40))
def test_p_stays_finite_within_its_bounds_and_on_any_constraints(seed: int) -> None:
    """Planes and quadrics, some of them met nowhere, and rows of all sizes: g is within 1e-4 of a large step."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    m = int(rng.integers(1, n))
    q, line, at_0 = rng.normal(size=(m, n, n)) * (seed % 3 > 0), rng.normal(size=(m, n)), rng.normal(size=m)
    start, sd = rng.normal(size=n), 10.0 ** rng.uniform(-2, 2, n)
    lower, upper = start - sd * rng.uniform(0.1, 20, n), start + sd * rng.uniform(0.1, 20, n)

    def g(p: Float) -> Float:
        return np.asarray(np.einsum("mij,i,j->m", q, p, p) + line @ p + at_0)

    try:
        core = pvid.Estimator(
            lambda p: p, lambda p: np.eye(n), start=start, start_sd=sd, row_sd=0.1, lower=lower, upper=upper,
            positive=[False] * n, rate=10.0, constraints=g,
        )  # fmt: skip
    except PvidError:
        return
    rows = rng.normal(size=(40, n))
    rows[rng.integers(40, size=4)] *= 1e6
    rows[3, 0], y = np.nan, rows @ rng.normal(size=n) + rng.normal(size=40)
    for one, right in zip(rows, y, strict=True):
        core.step(one, right)
        p = np.array([core._state.p[k] for k in range(n)])
        assert np.isfinite(p).all() and (p >= np.float32(lower)).all() and (p <= np.float32(upper)).all()
        slopes = np.einsum("mij,j->mi", q + q.transpose(0, 2, 1), p) + line
        assert np.sum(np.abs(g(p)) / np.max(np.abs(slopes) * sd, axis=1)) < 1.1e-4
    assert np.isfinite(core.estimate.covariance).all()


@pytest.mark.parametrize("constraints", [lambda p: p[0] ** 2 + 1, lambda p: [p[0] - 1, p[0] - 2]])
def test_the_core_refuses_a_start_that_no_step_brings_to_the_constraints(constraints: object) -> None:
    with pytest.raises(PvidError, match="do these contradict each other"):
        pvid.Estimator(lambda p: p, start=[1.0, 1.0, 1.0], start_sd=[1.0] * 3, row_sd=1.0, constraints=constraints)  # type: ignore[arg-type]


def test_several_recordings_have_a_constraint_each_between_their_own_parameters() -> None:
    compiled = with_own(motor("ke - kt", "L - R*tau"), ["ke", "kt"], ["A", "B"])
    assert [str(one) for one in compiled.constraints] == ["ke[A] - kt[A]", "ke[B] - kt[B]", "L - R*tau"]
    assert [str(one) for one in compiled.alone.constraints] == ["ke - kt", "L - R*tau"]
