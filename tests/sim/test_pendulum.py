"""The plant of the tests: its motion against closed forms, conservation laws and another derivation."""

import math

import numpy as np
import numpy.typing as npt
import pytest
from pendulum_plant import STANDARD_DRIVE, STANDARD_PENDULUM, STANDARD_RELEASE, Pendulum, Sensors, Tone, Truth, simulate
from scipy.integrate import solve_ivp

Float = npt.NDArray[np.float64]

EXACT = Sensors()


def test_standard_rig_is_that_of_the_table() -> None:
    """theory.md 6: w 31.667, d1 8.875, d2 5.625; |phi| up to 0.107 rad."""
    np.testing.assert_allclose(STANDARD_PENDULUM.linear, [9.5 / 0.3, 8.875, 5.625], rtol=1e-14)
    run = simulate(sensors=EXACT, truth="full").run
    assert np.abs(run.phi).max() == pytest.approx(0.107, abs=1e-3)
    assert np.abs(run.y).max() <= 15e-3


def reference(pendulum: Pendulum, tones: tuple[Tone, ...], truth: str, end: float) -> Float:
    """(a1, a2) at `end` by another method (LSODA) from equations written another way.

    Linear: theory.md (1). Full: Newton and Euler for body 2 alone, on which the massless rod 1 pulls with a tension T
    along itself.
    """
    l1, l2, rho2 = pendulum.l1, pendulum.l2, pendulum.rho2

    def rhs(t: float, x: Float) -> list[float]:
        a1, a2, v1, v2 = x
        pivot = 0.0
        for tone in tones:
            rate = math.tau * tone.frequency_hz
            pivot -= tone.amplitude_m * rate**2 * math.sin(rate * t + tone.phase_rad)
        gravity = pendulum.g + pivot
        if truth == "linear":
            phi = a2 - a1
            big_l1, big_l2, big_g = l1 / l2, (l2 / rho2) ** 2, gravity / l1
            acceleration = -big_g * a1 + big_l2 * big_g * phi
            return [v1, v2, acceleration, acceleration + big_g * a1 - big_l2 * (1.0 + big_l1) * big_g * phi]
        # Unknowns: a1'', a2'' and T per unit mass.
        s1, c1, s2, c2 = math.sin(a1), math.cos(a1), math.sin(a2), math.cos(a2)
        # Centre of mass at (l1 sin a1 + l2 sin a2, -l1 cos a1 - l2 cos a2), force on it T (-sin a1, cos a1).
        matrix = np.array([[l1 * c1, l2 * c2, s1], [l1 * s1, l2 * s2, -c1], [0.0, rho2**2, l2 * (s2 * c1 - c2 * s1)]])
        right = [l1 * s1 * v1**2 + l2 * s2 * v2**2, -l1 * c1 * v1**2 - l2 * c2 * v2**2 - gravity, 0.0]
        a = np.linalg.solve(matrix, right)
        return [v1, v2, float(a[0]), float(a[1])]

    start = [*STANDARD_RELEASE, 0.0, 0.0]
    solution = solve_ivp(rhs, (0.0, end), start, method="LSODA", rtol=1e-11, atol=1e-13)
    return np.asarray(solution.y[:2, -1])


@pytest.mark.parametrize("truth", ["linear", "full"])
def test_motion_agrees_with_another_derivation_and_method(truth: Truth) -> None:
    simulation = simulate(truth=truth, duration=5.001)
    assert simulation.run.t[-1] == 5.0
    expected = reference(STANDARD_PENDULUM, STANDARD_DRIVE, truth, 5.0)
    # LSODA's global error at 1e-11 a step
    np.testing.assert_allclose(simulation.state[-1, :2], expected, atol=1e-8)


def energy(pendulum: Pendulum, state: Float) -> Float:
    """Per unit mass, of the full equations without drive."""
    a1, a2, v1, v2 = state.T
    l1, l2 = pendulum.l1, pendulum.l2
    kinetic = (l1 * v1) ** 2 + (l2**2 + pendulum.rho2**2) * v2**2 + 2 * l1 * l2 * np.cos(a1 - a2) * v1 * v2
    return np.asarray(kinetic / 2 + pendulum.g * (2 - l1 * np.cos(a1) - l2 * np.cos(a2)))


def test_energy_is_kept_without_drive_and_falls_with_friction() -> None:
    quiet = simulate(drive=(), truth="full", release=(1.0, -0.7), duration=20.0)
    total = energy(STANDARD_PENDULUM, quiet.state)
    assert np.ptp(total) < 1e-10
    assert np.ptp(quiet.state[:, 0]) > 1.0  # it did move
    for damping in ((1e-3, 0.0), (0.0, 1e-3)):
        pendulum = Pendulum(0.3, 0.12, 0.08, 9.5, *damping)
        falling = simulate(pendulum=pendulum, drive=(), truth="full", release=(1.0, -0.7), duration=20.0)
        c1, c2 = damping
        v1, v2 = falling.state[:, 2], falling.state[:, 3]
        power = -(c1 * v1**2 + c2 * (v2 - v1) ** 2)
        lost = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2)]) / 1000.0
        # The trapezoid rule at 1 kHz: h^2/12 of the power's slope, 1e-6 of the energy lost.
        total = energy(pendulum, falling.state)
        np.testing.assert_allclose(total - total[0], lost, atol=1e-5 * abs(lost[-1]))
        assert lost[-1] < -0.01


def test_free_modes_have_the_frequencies_of_the_table() -> None:
    """theory.md 6: 0.742 and 2.56 Hz, as the two lines of a free motion's spectrum."""
    run = simulate(drive=(), sensors=EXACT, duration=100.0).run
    spectrum = np.abs(np.fft.rfft(run.phi * np.hanning(len(run))))
    frequency = np.fft.rfftfreq(len(run), 1.0 / run.sample_rate)
    peaks = [k for k in range(1, 1000) if spectrum[k] > max(spectrum[k - 1], spectrum[k + 1], spectrum.max() / 100)]
    np.testing.assert_allclose(frequency[peaks], [0.742, 2.56], atol=0.01)  # the bins are 0.01 Hz wide
