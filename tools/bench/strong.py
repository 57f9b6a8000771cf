"""The strong form in C beside the weak form: errors with finer and finer encoders, and from how far they start; and
what the paper's norm of all rows of an instant gives, beside rows that are weighted apart."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.case import Advance, columns
from bench.mechanisms import design_of, size_of, start_of
from bench.weak import rms
from pvid.base.errors import PvidError
from pvid.codegen.strong_library import strong_native
from pvid.codegen.weak_library import weak_native
from pvid.configuration.strong import reference_of, strong_design
from pvid.configuration.weak import samples_of, weak_config
from pvid.identification.analysis import analysed
from pvid.model import Model
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.signals import order_of
from pvid.oracle.strong_described import StrongModel, StrongRows, StrongSettings, all_rows, residuals
from pvid.oracle.weak.edges import with_edges
from pvid.oracle.weak.identify import Identified
from pvid.oracle.weak.parameters import Parameters
from pvid.oracle.weak.solve import least_squares_step
from pvid.rig.run import Recording
from pvid.sim.simulated_run import SOFT, RigSimulation, simulation_of

Float = npt.NDArray[np.float64]
Run = dict[str, Float]

FINER = (1, 4, 16, 64)  # 14 to 20 bits a turn, where the rig's encoder has 14
FACTORS = (1.5, 2.0, 3.0, 5.0, 10.0, 30.0)  # of a start over the truth, or under it
CLOSE, LEAST = 2.0, 0.01  # of what a start may change: standard errors, or of the size where these are smaller


HEADER = columns(
    "mechanism | sensors finer | window s | runs | RMS %: strong | weak | strong over weak: median | largest | of | "
    "in 2 s.e. %: strong | weak"
)
NORM_HEADER = columns(
    "mechanism | kinds | correlation | runs | RMS %: apart | in one norm | ratio: median | least | largest | scatter: "
    "ratio | mean error over scatter | products of M: apart | in one"
)
RADIUS_HEADER = ("mechanism", "form", "starts", "all converge within", *(f"x {one:g}" for one in FACTORS))


@dataclass(frozen=True)
class Form:
    """An identifier in C for the runs of a rig.

    Attributes
    ----------
    of : p and its standard errors [n_p] from a run and a start [n_p]
    window_s : length of a window [s]
    """

    of: Callable[[Run, Float], tuple[Float, Float]]
    window_s: float


def with_finer_sensors(simulation: RigSimulation, times: float) -> RigSimulation:
    """Steps and noise of what the equations differentiate twice are so much smaller; of all sensors where none is."""
    model = simulation.model
    sensors = [one.name for one in model.signals if one.kind == "sensor"]
    highest = {name: max(order_of(one, [name]) for one in model.equations) for name in sensors}
    finer = [name for name in sensors if highest[name] > 1] or sensors

    def of(one: Signal) -> Signal:
        if one.name not in finer:
            return one
        return (
            replace(one, resolution=one.resolution / times) if one.resolution else replace(one, noise=one.noise / times)
        )

    signals = tuple(of(one) for one in model.signals)
    return replace(simulation, model=replace(model, signals=signals))


def as_sampled(simulation: RigSimulation) -> RigSimulation:
    """With the side of an input's jumps on which the rig samples what jumps with it, as `identify` finds it."""
    run = simulation.run(0, SOFT)
    return replace(simulation, model=with_edges(simulation.model, run, simulation.rig.sample_rate))


def _recorded(simulation: RigSimulation) -> Recording:
    """The first run, which both designs are for."""
    run = simulation.run(0, SOFT)
    return Recording(
        run["t"], {one.name: run[one.name] for one in simulation.model.signals}, simulation.rig.sample_rate
    )


def _analysed(simulation: RigSimulation) -> Identified:
    return analysed(_recorded(simulation), simulation.model).found


def strong_of(simulation: RigSimulation, found: Identified | None = None) -> Form:
    """With the window that the first run calls for, and the errors that its distance from the weak form shows."""
    reference = reference_of(found or _analysed(simulation))
    design = strong_design(simulation.model, _recorded(simulation), reference=reference)
    native = strong_native(design.strong, design.config)

    def of(run: Run, start: Float) -> tuple[Float, Float]:
        own = replace(design.config.estimator, start=start.astype(np.float32))
        core = native.identifier_of(replace(design.config, estimator=own))
        samples = np.stack([np.asarray(run[one.name], np.float32) for one in design.strong.signals], axis=1)
        p = core.run_samples(samples, sums=False).p[-1].astype(np.float64)
        return p, core.assess()["se"][: len(p)].astype(np.float64)

    return Form(of, design.config.window / simulation.rig.sample_rate)


def weak_of(simulation: RigSimulation, found: Identified | None = None) -> Form:
    """With the rig's own design, and the errors that the analysis of the first run shows."""
    truth, design = np.asarray(simulation.truth), design_of(simulation, SOFT)
    run = simulation.run(0, SOFT)
    config = weak_config(simulation.model, run, design, truth, shared=True, found=found or _analysed(simulation))
    native = weak_native(simulation.model, config.design)

    def of(run: Run, start: Float) -> tuple[Float, Float]:
        limits = config.estimator
        own = replace(limits, start=np.clip(start, limits.lower, limits.upper).astype(np.float32))
        core = native.identifier_of(replace(config, estimator=own))
        record = core.run_samples(samples_of(config, run), sums=False, hashes=False)
        n_p = len(truth)
        return record.p[-1].astype(np.float64), np.asarray(core.estimate["se"], np.float64)[:n_p]

    return Form(of, design.window_s)


def _refused(name: str, width: int, why: PvidError) -> tuple[str, ...]:
    return (name, str(why), *[""] * (width - 2))


def rows(names: Sequence[str], seeds: int, advance: Advance) -> Iterator[tuple[str, ...]]:
    """A row of HEADER for each mechanism and resolution."""
    for name in names:
        for times in FINER:
            simulation = as_sampled(with_finer_sensors(simulation_of(name), times))
            try:
                found = _analysed(simulation)
                strong, weak = strong_of(simulation, found), weak_of(simulation, found)
            except PvidError as error:
                yield _refused(name, len(HEADER), error)
                break
            truth, size = np.asarray(simulation.truth), size_of(simulation)
            errors: list[list[Float]] = [[], []]
            inside: list[list[npt.NDArray[np.bool_]]] = [[], []]
            for seed in range(seeds):
                run = simulation.run(seed, SOFT)
                for k, form in enumerate((strong, weak)):
                    p, se = form.of(run, start_of(simulation, seed))
                    errors[k].append((p - truth) / size)
                    inside[k].append(np.abs(p - truth) < 2 * se)
                advance()
            both = [rms(np.array(one)) for one in errors]
            ratios = both[0] / both[1]
            worst = int(np.argmax(ratios))
            yield (
                name,
                str(times),
                f"{strong.window_s:.3g}",
                str(seeds),
                *(f"{100 * float(np.median(one)):.3g}" for one in both),
                f"{np.median(ratios):.3g}",
                f"{ratios[worst]:.3g}",
                simulation.model.p_names[worst],
                *(f"{100 * float(np.mean(one)):.0f}" for one in inside),
            )


def starts(simulation: RigSimulation, factor: float, runs: int) -> Float:
    """Truth times or over the factor, any parameter either way; one of either sign is that much of its sd off."""
    truth, unknowns = np.asarray(simulation.truth), simulation.model.unknowns
    way = np.random.default_rng([round(10 * factor), 3]).choice([-1.0, 1.0], (runs, len(truth)))
    positive = np.array([one.positive for one in unknowns])
    sd = np.array([one.sd for one in unknowns])
    moved = np.where(positive, truth * factor**way, truth + (factor - 1) * way * sd)
    return np.asarray(np.clip(moved, [one.low for one in unknowns], [one.high for one in unknowns]))


def radius_rows(names: Sequence[str], runs: int, advance: Advance) -> Iterator[tuple[str, ...]]:
    """A row of RADIUS_HEADER for each mechanism and form: starts of a factor that end where the truth ends."""
    for name in names:
        simulation = as_sampled(simulation_of(name))
        for word, make in (("weak", weak_of), ("strong", strong_of)):
            try:
                form = make(simulation)
            except PvidError as error:
                yield _refused(name, len(RADIUS_HEADER), error)
                continue
            run, truth, size = simulation.run(0, SOFT), np.asarray(simulation.truth), size_of(simulation)
            best, se = form.of(run, truth)
            bound = np.maximum(CLOSE * se, LEAST * size)
            share = []
            for factor in FACTORS:
                ends = [form.of(run, one)[0] for one in starts(simulation, factor, runs)]
                share.append(np.mean([np.all(np.abs(end - best) < bound) for end in ends]))
                advance()
            reached = [f for k, f in enumerate(FACTORS) if min(share[: k + 1]) == 1.0]
            within = f"x {reached[-1]:g}" if reached else "none"
            yield (name, word, str(runs), within, *(f"{100 * one:.0f} %" for one in share))


def in_one_norm(parameters: Parameters, rows: StrongRows, start: Float) -> tuple[Float, Float]:
    """p with the inverse covariance W of the residuals of an instant as the weight of its rows, which the paper's norm
    is then: S = sum W_kl C_k^T M_kl C_l; and that covariance [kinds, kinds]."""
    p, kinds = start, range(len(rows.known))
    m = [[rows.regressors[k].T @ rows.regressors[j] for j in kinds] for k in kinds]
    b = [[rows.regressors[k].T @ rows.known[j] for j in kinds] for k in kinds]
    covariance = np.eye(len(kinds))
    for _ in range(12):  # from the estimate of rows apart: it changes little
        covariance = np.atleast_2d(np.cov(residuals(parameters, rows, p)))
        weights, theta, c = np.linalg.inv(covariance), parameters.theta(p), parameters.jacobian(p)
        s, f = np.diag(parameters.prior(start)), np.zeros(len(p))
        for k, j in ((k, j) for k in kinds for j in kinds):
            s = s + weights[k, j] * c[k].T @ m[k][j] @ c[j]
            f = f + weights[k, j] * c[k].T @ (b[k][j] - m[k][j] @ theta[j])
        p = parameters.moved(p, least_squares_step(parameters, p, s, f))
    return p, covariance


def common_mode() -> tuple[CompiledModel, Callable[[int], Run], Float]:
    """Two outputs of two drives, whose sensors share nine tenths of their noise: model, runs, truth."""
    model = Model("two outputs")
    y = [model.sensor(f"y{k}", "", noise=0.3) for k in (1, 2)]
    for one, name in zip(y, "ab", strict=True):
        u = model.input(f"u{name}", "", "sampled")
        model.equation(one - model.unknown(name, "", 1.0) * u)
    truth = np.array([1.2, 0.7])

    def run(seed: int) -> Run:
        rng = np.random.default_rng(seed)
        u, noise = rng.normal(size=(2, 4000)), rng.normal(size=(3, 4000))
        y = truth[:, np.newaxis] * u + 0.3 * (np.sqrt(0.9) * noise[0] + np.sqrt(0.1) * noise[1:])
        return {"y1": y[0], "y2": y[1], "ua": u[0], "ub": u[1]}

    return model.compiled("two_outputs"), run, truth


def norm_rows(names: Sequence[str], seeds: int, advance: Advance) -> Iterator[tuple[str, ...]]:
    """A row of NORM_HEADER for each mechanism with several rows at an instant, in float64 with the window of C."""
    for name in ["two outputs, common noise", *names] if names else []:
        if name not in names:
            (model, run_of, truth), rate, settings = common_mode(), 1.0, StrongSettings(5, 4, 4)
            size = truth
        else:
            simulation = as_sampled(simulation_of(name))
            model, rate = simulation.model, simulation.rig.sample_rate
            truth, size = np.asarray(simulation.truth), size_of(simulation)
            try:
                if len(StrongModel(model).model.rows) < 2:
                    continue
                fitted = strong_design(model, _recorded(simulation)).fitted
            except PvidError as error:
                yield _refused(name, len(NORM_HEADER), error)
                continue
            settings = StrongSettings(fitted.taps, fitted.degree, 4)

            def run_of(seed: int, one: RigSimulation = simulation) -> Run:
                return one.run(seed, SOFT)

        oracle = StrongModel(model)
        errors: list[list[Float]] = [[], []]
        correlation = 0.0
        for seed in range(seeds):
            run = run_of(seed)
            rows = oracle.rows({one.name: run[one.name] for one in model.signals}, rate, settings)
            apart, _ = all_rows(oracle.parameters, rows, truth)
            whole, covariance = in_one_norm(oracle.parameters, rows, apart)
            sd = np.sqrt(np.diag(covariance))
            correlation += np.max(np.abs(covariance / np.outer(sd, sd) - np.eye(len(sd)))) / seeds
            for own, p in zip(errors, (apart, whole), strict=True):
                own.append((p - truth) / size)
            advance()
        both = [rms(np.array(one)) for one in errors]
        scatter = [np.std(one, axis=0) for one in errors]
        ratios, counts = both[1] / both[0], [n.shape[1] for n in rows.regressors]
        products = (sum(n * (n + 1) // 2 for n in counts), sum(counts) * (sum(counts) + 1) // 2)
        yield (
            name,
            str(len(counts)),
            f"{correlation:.2f}",
            str(seeds),
            *(f"{100 * float(np.median(one)):.3g}" for one in both),
            *(f"{one:.3g}" for one in (np.median(ratios), np.min(ratios), np.max(ratios))),
            f"{np.median(scatter[1] / scatter[0]):.3g}",
            f"{np.median(np.abs(np.mean(errors[0], axis=0)) / scatter[0]):.3g}",
            *map(str, products),
        )
