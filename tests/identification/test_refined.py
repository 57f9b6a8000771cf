"""Refinement in float64: derivatives of its kernels, blocks, the first fit of a mechanism with friction."""

import numpy as np
import numpy.typing as npt
import pytest

from pvid.design.second_derivative import second_derivative
from pvid.identification.refinement.fit import GOOD, Cut
from pvid.identification.refinement.inputs import HIGHEST, drive_edge_hz
from pvid.identification.refinement.kernel import Drive, PlayedKernel, kernel_of
from pvid.identification.refinement.problem import RefinedMechanism, refine_mechanism
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import PERFECT, SOFT, RigSimulation, simulation_of

Float = npt.NDArray[np.float64]


@pytest.mark.parametrize("name", ["kapitza", "dc_motor", "battery_2rc"])
def test_derivatives_are_those_of_finite_differences(name: str) -> None:
    """Of the steps as they are computed, to the error of the differences; order 2, order 1, outputs with inputs."""
    kernel = kernel_of(compiled_of(name))
    made, rng = kernel.made, np.random.default_rng(2)
    truth = simulated_rig(name).truth
    r = np.array([truth.get(one.name, 0.1) for one in made.parameters] + [0.5 for _ in made.settings])
    u, du = rng.normal(size=(2, 600, 3, len(made.inputs)))
    first, starts = np.array([0, 200], np.int32), 0.1 * rng.normal(size=(2, kernel.states))
    _, found, _ = kernel.blocks(r, first, 300, Drive(1, 2e-3, u, du), starts)
    assert found is not None
    for column in range(kernel.columns):
        ends = []
        for sign in (1e-5, -1e-5):
            near, begun, driven = r.copy(), starts.copy(), u
            entry = column - kernel.states
            if entry < 0:
                begun[:, column] += sign
            elif made.parameters[entry].name == "tau":
                driven = u + sign * du
            else:
                near[entry] += sign * (r[entry] if made.parameters[entry].log else 1.0)
            ends.append(kernel.blocks(near, first, 300, Drive(1, 2e-3, driven, du), begun, False)[0])
        wanted = (ends[0] - ends[1]) / 2e-5
        near_enough = 0.1 if entry in kernel.widths else 1e-5  # a width's derivative is a difference itself
        np.testing.assert_allclose(found[..., column], wanted, atol=near_enough * np.abs(wanted).max() + 1e-9)


def test_the_drives_band_ends_where_its_noise_begins() -> None:
    """Instants that jitter make more noise than the sensor: the band went up to Nyquist's frequency."""
    rate, fastest, noise = 1000.0, 4.1, 3e-6
    t = np.arange(20_000) / rate
    random = np.random.default_rng(0)
    y = sum(size * np.sin(2 * np.pi * hz * t) for hz, size in ((1.1, 6e-3), (2.3, 5e-3), (fastest, 4e-3)))
    clean = y + random.normal(0.0, noise, len(t))
    jittered = clean + random.normal(0.0, 3e-4, len(t)) * np.gradient(y) * rate
    assert np.std(jittered - clean) > 6 * noise
    for x in (clean, jittered):
        assert fastest <= drive_edge_hz(x, rate, noise) <= fastest + 0.2


def test_derivatives_with_a_play_are_those_of_finite_differences() -> None:
    """But for the few samples at which the encoder begins or ceases to follow."""
    kernel = PlayedKernel(kernel_of(compiled_of("kapitza")))
    names = [one.name for one in kernel.made.parameters]
    values = {**simulated_rig("kapitza").truth, "l1": 0.3, "play": 4e-3, "k1": 0.02}
    r = np.array([values.get(name, 0.0) for name in (*names, *kernel.made.settings)])
    starts, first = np.array([[0.1, 0.25, 0.3, -0.2]]), np.zeros(1, np.int32)
    u = np.zeros((1500, 3, 1))
    z, found, _ = kernel.blocks(r, first, 1500, Drive(1, 1e-3, u, u), starts)
    assert found is not None and 0.05 < np.mean(np.diff(z[0, :, 0]) == 0) < 0.5
    for name in ("w", "d1", "d2", "k1", "c", "play"):
        place, ends = names.index(name), []
        unit = r[place] if kernel.made.parameters[place].log else 1.0
        for sign in (1e-6, -1e-6):
            near = r.copy()
            near[place] += sign * unit
            ends.append(kernel.blocks(near, first, 1500, Drive(1, 1e-3, u, u), starts, False)[0])
        wanted = ((ends[0] - ends[1]) / 2e-6)[..., 0].ravel()
        far = np.abs(found[0, :, 0, kernel.states + place] - wanted) > 1e-5 * np.abs(wanted).max()
        assert far.mean() < 0.02, name


def refined_rig(
    simulation: RigSimulation, seed: int = 0, imperfections: Imperfections = PERFECT
) -> tuple[RefinedMechanism, Float]:
    """6000 samples of a rig, from a start 3 % off, and the errors of its parameters in their standard errors."""
    model, truth = simulation.model, simulation.truth
    p = truth * np.where([one.positive for one in model.unknowns], 1.03, 1.0)
    signals = {name: values[:6000] for name, values in simulation.run(seed, imperfections).items()}
    found = refine_mechanism(model, signals, simulation.rig.sample_rate, p, 1.0)
    z = [(found.values[name] - truth[k]) / found.errors[name] for k, name in enumerate(model.p_names)]
    return found, np.array(z)


def test_sharp_friction_of_a_motor_is_refined_to_its_standard_errors() -> None:
    simulation = simulation_of("dc_motor")
    found, z = refined_rig(simulation)
    assert found.found.converged and found.found.slow_chi2 < 1.5
    friction = simulation.truth[simulation.model.p_names.index("Tc")]
    assert np.abs(z).max() < 4 and abs(found.values["Tc"] / friction - 1) < 5e-3


def test_sharp_friction_of_two_joints_does_not_bias() -> None:
    """By the width of its sign: with steps four times as long, two parameters are 4 standard errors off."""
    found, z = refined_rig(simulation_of("two_link_arm"), 2)
    assert found.found.converged and np.abs(z).max() < 3.5


def test_soft_friction_of_a_motor_is_refined_with_its_width() -> None:
    """tanh(v / width), which is not the law that is assumed."""
    simulation = simulation_of("dc_motor")
    found, z = refined_rig(simulation, imperfections=SOFT)
    assert found.found.converged and found.found.slow_chi2 < GOOD and np.abs(z).max() < 4
    (width,) = found.problem.kernel.widths
    assert found.found.r[width] == pytest.approx(simulation.rig.friction_width, rel=0.3)


def test_the_second_derivative_is_exact_in_its_band_and_quiet_beyond() -> None:
    rate, edge = 1000.0, 8.0
    front = second_derivative(rate, edge)
    t = np.arange(6000) / rate
    for hz in (0.5, 3.0, 7.5):
        times, found = front.apply(np.sin(2 * np.pi * hz * t), rate)
        wanted = -((2 * np.pi * hz) ** 2) * np.sin(2 * np.pi * hz * times)
        assert np.abs(found - wanted).max() < 2e-4 * (2 * np.pi * edge) ** 2
    for edge_hz in (2.0, 8.0, 60.0, HIGHEST * rate):
        assert second_derivative(rate, edge_hz).worst < 2e-5
    _, noise = front.apply(np.random.default_rng(0).normal(size=60_000), rate)
    white = np.sqrt(3 * 2.0**4) * rate**2 / np.sqrt(5)  # a plain second difference has sqrt(6) rate^2
    assert noise.std() < 1e-2 * white


def test_blocks_fill_the_run() -> None:
    cut = Cut.of([(0, 1000)], 260)
    assert cut.samples == 250 and cut.first.tolist() == [0, 250, 500, 750]


def test_blocks_fill_the_stretches_between_gaps() -> None:
    cut = Cut.of([(0, 1000), (1100, 1600), (1700, 1800)], 260)
    assert cut.samples == 250 and cut.first.tolist() == [0, 250, 500, 750, 1100, 1350]
    cut = Cut.of([(0, 400), (500, 799), (900, 1199)], 290)  # as blocks of 400 they would leave two stretches out
    assert cut.samples == 200 and cut.first.tolist() == [0, 200, 500, 900]
