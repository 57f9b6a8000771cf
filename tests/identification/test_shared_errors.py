"""Errors that all windows share: what a gain, a delay and an offset do to p, and that a board publishes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from pvid.codegen.refine import refine_functions
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.configuration.refine import refine_design
from pvid.configuration.shared import Shared
from pvid.configuration.weak import (
    config_for_recording,
    config_for_rig_like_the_shipped,
    config_for_simulated_rig,
    samples_of,
    simulated_run_of,
    weak_config,
)
from pvid.configuration.weak_q31 import weak_q31_for_rig_like_the_shipped, weak_q31_for_run
from pvid.configuration.weak_tables import for_core
from pvid.identification.core import identify_in_c
from pvid.identification.road import identified
from pvid.models.drive import Scaled
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import Servo, simulated_rig
from pvid.oracle.weak.gate import gated
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.library import Library
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.shared import of_scale, of_signals
from pvid.oracle.weak.solve import Fit
from pvid.rig.run import Recording
from pvid.sim.simulated_run import PERFECT, RigSimulation, simulation_of

Float = npt.NDArray[np.float64]


def fit_of(name: str, run: dict[str, Float], p: Float) -> Fit:
    compiled = compiled_of(name)
    return gated(WeakRows.of(ready(compiled), run, for_core(simulated_run_of(compiled)[1])), p)


def run_of(name: str, seed: int) -> dict[str, Float]:
    run = simulation_of(name).run(seed, PERFECT)
    return {one.name: np.asarray(run[one.name], np.float64) for one in compiled_of(name).signals}


def moves(name: str, run: dict[str, Float]) -> dict[str, Float]:
    """Cause -> what it does to p, over p of positive parameters."""
    compiled = compiled_of(name)
    design = for_core(simulated_run_of(compiled)[1])
    fit = fit_of(name, run, np.asarray(simulation_of(name).truth))
    library = Library(run, design, fit)
    scale = np.where(fit.rows.compiled.parameters.positive, np.abs(fit.p), 1.0)
    return {one.text: one.moves / scale for one in [*of_scale(library), *of_signals(library)]}


@pytest.mark.parametrize(("name", "least"), [("dc_motor", 6), ("kapitza", 1), ("rigid_body", 6), ("two_mass_drive", 3)])
def test_a_signal_that_is_off_moves_p_by_what_is_said(name: str, least: int) -> None:
    compiled, run = compiled_of(name), run_of(name, 3)
    truth = np.asarray(simulation_of(name).truth)
    fit = fit_of(name, run, truth)
    scale = np.where(fit.rows.compiled.parameters.positive, np.abs(fit.p), 1.0)
    said, place = moves(name, run), np.arange(len(run[compiled.signals[0].name]))
    seen = 0
    for one in compiled.signals:
        x = run[one.name]
        spoiled = {"gain": (1 + one.gain_sd) * x, "delay": np.interp(place - 0.1, place, x)}
        spoiled["offset"] = x + (0.5 * one.resolution if one.kind == "sensor" else 1e-3 * one.reach)
        for kind, other in spoiled.items():
            if (found := said.get(f"{kind} of {one.name}")) is not None:
                apart = (fit_of(name, {**run, one.name: other}, truth).p - fit.p) / scale
                large = np.maximum(np.abs(apart), np.abs(found)) > 2e-3
                np.testing.assert_allclose(found[large], apart[large], rtol=0.15, atol=2e-3)
                seen += int(large.any())
    assert seen >= least


@pytest.mark.parametrize("name", ["dc_motor", "rigid_body", "two_mass_drive", "kapitza"])
def test_the_errors_hold_on_another_motion(name: str) -> None:
    """Half and twice as large, 1.5 times as fast: what is off by one standard deviation stays within five errors."""
    rig = simulated_rig(name)
    sums = []
    for size, rate in ((1.0, 1.0), (0.5, 1.0), (2.0, 1.0), (1.0, 1.5)):
        drive = {key: Scaled(one, size, rate) for key, one in rig.drive.items() if not isinstance(one, Servo)}
        other = RigSimulation.of(compiled_of(name), replace(rig, drive={**rig.drive, **drive})).run(4, PERFECT)
        run = {one.name: np.asarray(other[one.name], np.float64) for one in compiled_of(name).signals}
        sums.append(np.sqrt(np.sum(np.square(list(moves(name, run).values())), axis=0)))
    large = sums[0] > 1e-3
    assert large.sum() >= 3
    for one in sums[1:]:
        assert np.all((one[large] < 5 * sums[0][large]) & (one[large] > 0.5 * sums[0][large]))


@pytest.mark.parametrize("name", ["dc_motor", "rigid_body"])
def test_a_board_publishes_them_and_compares_without_them(name: str) -> None:
    """p and the standing have the same bits: errors that windows share neither cause a doubt nor remove one."""
    compiled = compiled_of(name)
    bare, whole = config_for_simulated_rig(compiled), config_for_rig_like_the_shipped(compiled)
    assert bare.trust.shared is None and whole.trust.shared is not None and len(whole.causes) >= 3
    run = run_of(name, 1)
    half = len(run[compiled.signals[0].name]) // 2
    run[compiled.signals[-1].name][half:] *= 1.3  # its sensor slips: estimates contradict
    samples = samples_of(bare, run)
    one, other = (weak_native(compiled, c.design).identifier_of(c).run_samples(samples) for c in (bare, whole))
    assert np.array_equal(one.published, other.published) and np.array_equal(one.hash, other.hash)
    assert np.array_equal(one.standing, other.standing) and np.any(one.standing >> 16 & 0xFF >= 2)
    n_p = len(compiled.p_names)
    places = np.cumsum([0, *range(n_p, 1, -1)])
    positive = np.array([one.positive for one in compiled.unknowns])
    there = np.isfinite(one.published_se[:, 0]) & (one.standing >> 16 != 0)
    sd = whole.trust.shared[places] * np.where(positive, one.published[there][:, :n_p], 1.0)
    expected = np.hypot(one.published_se[there][:, :n_p], sd)
    np.testing.assert_allclose(other.published_se[there][:, :n_p], expected, rtol=2e-6)


@pytest.mark.parametrize("name", ["dc_motor", "battery_2rc"])
def test_the_second_stage_adds_them_behind_its_verdict(name: str) -> None:
    """Its estimates have the same bits, its covariance that of the table; p of the second has another order in r."""
    compiled, simulation = compiled_of(name), RigSimulation.of(compiled_of(name), simulated_rig(name), whole=True)
    whole, run = config_for_rig_like_the_shipped(compiled), simulation.run()
    settings, made = refine_design(compiled, whole, run, simulation.truth), refine_functions(compiled)
    bare = replace(whole, trust=replace(whole.trust, shared=None))
    native = weak_native(compiled, whole.design, made)
    both = [native.refined_of(config, settings) for config in (bare, whole)]
    one, other = (identifier.run_both(samples_of(whole, run)) for identifier in both)
    assert np.array_equal(one.r, other.r) and np.array_equal(one.told, other.told) and np.any(one.r[-1] != 0)
    assert whole.trust.shared is not None
    n, positive = len(compiled.p_names), [unknown.positive for unknown in compiled.unknowns]
    table = np.zeros((n, n))
    table[np.triu_indices(n)] = whole.trust.shared
    sd, correlation = np.diag(table), np.triu(table, 1) + np.triu(table, 1).T + np.eye(n)
    places = np.ix_(made.places_of_p, made.places_of_p)
    without, with_table = (identifier.refined for identifier in both)
    assert without is not None and with_table is not None
    added = np.asarray(with_table["covariance"] - without["covariance"], np.float64)[places]
    np.testing.assert_allclose(added, correlation * np.outer(sd, sd), atol=1e-6 * np.max(sd) ** 2)
    unit = np.where(positive, one.r[-1][made.places_of_p], 1.0)
    expected = np.hypot(one.se[-1][made.places_of_p], sd * unit)
    np.testing.assert_allclose(other.se[-1][made.places_of_p], expected, rtol=1e-5)


def test_fixed_point_publishes_the_same() -> None:
    compiled = compiled_of("kapitza")
    run, design, p = simulated_run_of(compiled)
    floating, weak = config_for_rig_like_the_shipped(compiled), weak_q31_for_rig_like_the_shipped(compiled)
    bare = weak_q31_for_run(compiled, run, design, p)
    records = [
        weak_native_q31(one.made, one.parameters, one.config).identifier().run_samples(one.counts_of(run))
        for one in (bare, weak)
    ]
    one, other = (weak.values(record.published_se[-1]) for record in records)
    assert np.array_equal(records[0].hash, records[1].hash)
    assert floating.trust.shared is not None
    sd = floating.trust.shared[[0, 4, 7, 9]] * np.where(
        [True, True, True, False], weak.values(records[1].published[-1]), 1
    )
    np.testing.assert_allclose(other, np.hypot(one, sd), rtol=1e-4)


def test_a_board_for_a_recording_publishes_the_errors_of_its_analysis() -> None:
    """Those that `identify` and `identify --core f32` print, within a twentieth; also where a signal is late."""
    compiled = compiled_of("dc_motor")
    run = run_of("dc_motor", 2)
    place = np.arange(len(run["V"]))
    run["phi"] = np.interp(place - 0.7, place, run["phi"])
    recording = Recording(place / 1000.0, run, 1000.0)
    answer = identified(recording, compiled, refine=False)
    core = identify_in_c(answer, "f32")
    config = config_for_recording(compiled, recording, found=answer.found)
    record = weak_native(compiled, config.design).identifier_of(config).run_samples(samples_of(config, run))
    printed = np.array([core.values[name].se for name in compiled.p_names])
    analysed = np.array([answer.values[name].se for name in compiled.p_names])
    assert np.all(answer.found.by_model > 0)
    np.testing.assert_allclose(record.published_se[-1, : len(printed)], printed, rtol=0.05)
    np.testing.assert_allclose(record.published_se[-1, : len(printed)], analysed, rtol=0.05)


def test_the_error_of_a_friction_that_is_near_zero_is_in_the_unit_of_the_board() -> None:
    """The analysis has it on a scale of its own, where it may be below 0; the board in its logarithm."""
    compiled, rig = compiled_of("dc_motor"), simulated_rig("dc_motor")
    run = RigSimulation.of(compiled, replace(rig, truth={**rig.truth, "Tc": 1e-7})).run(3)
    recording = Recording(run.pop("t"), run, rig.sample_rate)
    found = identified(recording, compiled, refine=False).found
    place = compiled.p_names.index("Tc")
    assert not found.fit.rows.compiled.parameters.positive[place]
    config = config_for_recording(compiled, recording, found=found)
    n = len(compiled.p_names)
    assert config.trust.shared is not None
    relative = config.trust.shared[np.cumsum([0, *range(n, 1, -1)])[place]]
    shared = np.sqrt(found.se[place] ** 2 - found.noise[place] ** 2)
    assert relative * abs(found.p[place]) > 0.3 * shared > 0


def test_what_a_rig_file_states_takes_the_place_of_the_defaults() -> None:
    compiled = compiled_of("dc_motor")
    run, design, p = simulated_run_of(compiled)
    known = tuple(replace(one, delay_sd=0.0, offset_sd=0.0, gain_sd=0.02) for one in compiled.signals)
    config = weak_config(replace(compiled, signals=known), run, design, p, shared=True)
    assert not any("delay" in one or "offset" in one for one in config.causes)
    assert "gain of V 2 %" in config.causes[0]


def test_nothing_is_known_of_a_parameter_whose_errors_run_away() -> None:
    fit = fit_of("kapitza", run_of("kapitza", 0), np.asarray(simulation_of("kapitza").truth))
    cause = next(iter(of_scale(Library(run_of("kapitza", 0), simulated_run_of(compiled_of("kapitza"))[1], fit))))
    positive = fit.rows.compiled.parameters.positive
    shared = Shared.of(fit.p, positive, [replace(cause, moves=np.array([np.nan, np.inf, 0.0, 0.0]))])
    assert np.array_equal(shared.sd, [100.0, 100.0, 0.0, 0.0])
    counts = shared.counts([20] * 4)
    assert counts is not None and counts[0] == 100 * 2**24
