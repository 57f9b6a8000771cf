"""Both stages in C on the other mechanisms: a large motion is found, kept and refined without bias, with the twin's
bits."""

from dataclasses import replace

import numpy as np
import pytest

from bench.refine_mechanisms import HEADER, IMPERFECT, NAMES, Case, cases, imperfect_rows, rows_of, run_case
from pvid.base.errors import PvidError
from pvid.codegen.refine import refine_functions
from pvid.configuration.refine import refine_settings
from pvid.models.simulated_rig import simulated_rig
from pvid.settings.enums import Reason
from pvid.sim.bound import bound
from pvid.twin.printed import PrintedTwin


@pytest.fixture(scope="module")
def furuta() -> Case:
    """The rotary pendulum, which turns by radians, at a rate that leaves six ticks for a step."""
    return Case.of("furuta", 2000.0)


def test_a_large_motion_is_refined_to_the_bound(furuta: Case) -> None:
    """From a start at 0 no block fits; with steps for most of its states the estimates are twice the bound off."""
    runs = [run_case(furuta, seed) for seed in range(3)]
    least = bound(furuta.simulation)
    for one in runs:
        assert one.first < 12.0 and np.all(np.abs(one.error) < 3.5 * one.se)
        assert np.all(np.abs(one.error) < 5 * least)
    rms = {key: np.sqrt(np.mean([getattr(one, key) ** 2 for one in runs], axis=0)) for key in ("weak", "error")}
    at = furuta.simulation.model.p_names.index("b2")  # of which the weak form has seven times the bound
    assert rms["error"][at] < 0.5 * rms["weak"][at]


def test_the_twin_has_the_bits_of_blocks_whose_start_is_measured(furuta: Case) -> None:
    """With gaps, behind which blocks start anew."""
    core, samples = furuta.identifier(0), furuta.samples(0)[:18_000]
    twin = PrintedTwin(core.sources, core.config, furuta.settings)
    assert twin.module.PVID_REFINE_HAS_MEASURED == 1
    told: set[int] = set()
    for piece in np.split(samples, [7000]):
        record = core.run_both(piece)
        np.testing.assert_array_equal(record.hash, twin.run(piece).hash)
        core.gap()
        twin.gap()
        told |= set(record.told.tolist())
    assert Reason.UPDATED in told


def test_few_ticks_for_a_step_have_more_jobs_each_and_too_slow_samples_are_refused(furuta: Case) -> None:
    assert (furuta.settings.ratio, furuta.settings.jobs) == (6, 5)
    slower = Case.of("furuta", 1000.0).settings
    assert (slower.ratio, slower.jobs) == (3, 11)
    simulation = furuta.simulation
    made = refine_functions(simulation.model)
    with pytest.raises(PvidError, match=r"needs \d+ samples a second for the fastest motion .*, not 50"):
        refine_settings(made, simulation.run(), 50.0, simulation.truth, 2.0)


@pytest.mark.parametrize("name", ["dc_motor", pytest.param("cart_pendulum", marks=pytest.mark.night)])
def test_sharp_friction_is_refined_to_the_bound(name: str) -> None:
    """The weak form's errors are 1 to 30 bounds, most of them of the reversals."""
    case = Case.of(name, 1000.0)
    least = bound(case.simulation)
    for seed in (0, 1):
        one = run_case(case, seed)
        assert np.all(np.abs(one.error) < np.maximum(4 * one.se, 5 * least)), (seed, one.error / one.se)
        assert np.sqrt(np.mean((one.error / least) ** 2)) < 0.5 * np.sqrt(np.mean((one.weak / least) ** 2))


@pytest.fixture(scope="module")
def masses() -> Case:
    """The two masses, whose current is measured: an input with noise."""
    return Case.of("two_mass_drive", 1000.0)


def test_an_observer_keeps_the_noise_of_a_measured_input_out_of_the_blocks(masses: Case) -> None:
    """Every published estimate is within its standard errors; without the observer blocks differ by ten of theirs, and
    the track is lost."""
    none = np.zeros_like(masses.settings.observer)
    without = replace(masses, settings=replace(masses.settings, observer=none))
    places = refine_functions(masses.simulation.model).places_of_p
    for seed in (0, 1):
        found = masses.identifier(seed).run_both(masses.samples(seed))
        there = np.any(found.r != 0, axis=1)
        error = found.r[there][:, places] - masses.simulation.truth
        assert np.all(np.abs(error) < 3 * found.se[there][:, places])
        assert np.argmax(there) < 5000 and np.mean(there) > 0.7 and there[-1]
        found = without.identifier(seed).run_both(masses.samples(seed))
        assert np.mean(np.any(found.r != 0, axis=1)) < 0.3


def test_the_gain_of_the_observer_is_the_steady_kalman_filters(masses: Case) -> None:
    """Its states are in the order of the motion: angle and rate of the motor, of the load. The rows' innovations are
    larger than the encoder's noise; those of the battery, whose current hardly has any noise, are not."""
    settings = masses.settings
    encoder = masses.simulation.model.signal("th").sd / np.sqrt(4 * settings.ratio)
    assert settings.observer is not None and settings.observer.shape == (4,)
    assert np.all(settings.observer > 0) and settings.observer[0] < 1
    assert 1.05 < settings.sd[0] / encoder < 1.3
    alpha = settings.observer[0]
    beta = alpha**2 / (2 - alpha)  # of a tracker that knows no more than angle and rate
    assert settings.observer[1] * 4e-3 == pytest.approx(beta, rel=0.5)
    battery = Case.of("battery_2rc", 1.0).settings
    assert battery.observer is not None and np.all(np.abs(battery.observer) < 2e-3)


def test_a_gain_that_is_no_number_is_refused(masses: Case) -> None:
    gain = np.full(4, np.nan, np.float32)
    with pytest.raises(PvidError, match="refused"):
        replace(masses, settings=replace(masses.settings, observer=gain)).identifier(0)


@pytest.mark.parametrize(
    ("name", "ticks"),
    [
        ("dc_motor", 2500),  # an input that is held for a step, an angle without whole turns, two outputs
        pytest.param("cart_pendulum", 3600, marks=pytest.mark.long),  # an input that is held within a step
        pytest.param("two_mass_drive", 1700, marks=pytest.mark.night),  # a hidden coordinate
        ("battery_2rc", 6800),  # the integral of an input, relaxations, an output by an algebraic equation
    ],
)
def test_the_twin_has_the_bits_of_steps_of_runge_kutta(name: str, ticks: int) -> None:
    """With a missing sample of an output, and of an input, behind which the block restarts."""
    case = Case.of(name, simulated_rig(name).sample_rate)
    case = replace(case, settings=replace(case.settings, distance=0.1, se_max=10.0))
    core, samples = case.identifier(0), case.samples(0)[:ticks].copy()
    samples[ticks - 500, case.settings.signal[-1].sample] = np.nan
    samples[ticks - 100, case.settings.signal[0].sample] = np.nan
    twin = PrintedTwin(core.sources, core.config, case.settings)
    record = core.run_both(samples)
    np.testing.assert_array_equal(record.hash, twin.run(samples).hash)
    np.testing.assert_array_equal(list(core.refinement.work.sums.sum), twin.refinement.work.sums.sum)
    assert len(set(record.told.tolist())) > 1  # a block has ended


def test_an_input_that_is_held_keeps_the_droop_of_its_own_steps_alone() -> None:
    """The droop of the mean over a step is undone, that of the staircase stays, 1 - theta^2 / 24. Corrected as samples
    it was theta^2 / 12 less: a bias of 1.5 bounds for the rigid body."""
    case = Case.of("rigid_body", 1000.0)
    settings = replace(case.settings, ratio=4)
    core = replace(case, settings=settings).identifier(0)
    twin = PrintedTwin(core.sources, core.config, settings)
    theta, ticks = 0.05, 2000
    place = settings.signal[0].sample
    sample = np.zeros((ticks, len(settings.signal)), np.float32)
    sample[:, place] = 0.9 * settings.signal[0].range * np.cos(theta * np.arange(ticks))
    found = []
    for one in sample:
        before = twin.refinement.front.next
        twin.run(one[None])
        if twin.refinement.front.next > before:
            signals = twin.module.pvid_refine_signals_f32()
            twin.module.pvid_refine_front_read_f32(twin.refinement.front, before, signals)
            found.append(signals.u[0])
    middle = settings.ratio * np.arange(len(found)) + settings.ratio + (settings.ratio - 1) / 2
    best = max(
        (np.linalg.lstsq(np.cos(theta * (middle - late))[:, None], np.array(found), rcond=None) for late in (0.5, 4.5)),
        key=lambda fit: -float(fit[1][0]),
    )
    amplitude = float(best[0][0]) / (0.9 * settings.signal[0].range)
    assert abs(amplitude - (1 - theta**2 / 24)) < 2e-5  # fourth order: 1e-5; theta^2 / 12 is 2e-4


@pytest.mark.night
def test_each_mechanism_is_in_a_table_with_a_cell_for_each_column() -> None:
    made = cases()
    refused = {"buck_converter", "thrust_stand"}  # a reading contains parameters of the motion
    assert {name for name, *_ in made} == set(NAMES) - refused
    name, rate, case = next(one for one in made if one[0] == "rigid_body")
    rows = list(rows_of(name, rate, case, [run_case(case, 0)]))
    assert [len(row) for row in rows] == [len(HEADER)] * 6 and rows[0][8] == "1 of 1"


@pytest.mark.night
def test_no_published_estimate_of_an_imperfect_motor_is_far_off() -> None:
    rows = list(imperfect_rows("dc_motor", Case.of("dc_motor", 1000.0), 1))
    assert all(len(row) == len(IMPERFECT) and row[-1] == "0" for row in rows)
    found = {row[1]: row[2] for row in rows}
    assert found["none"] == found["stiction, 1.3 times the friction"] == "1 of 1"
    assert found["one sensor a sample late"] == "0 of 1"
