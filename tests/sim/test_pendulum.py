"""The simulated rig: the motion against closed forms and conservation laws, the sensors against their definition."""

import math
import time
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bench.campaign.motion import accelerations, integrate, relative_angle, step_of
from bench.campaign.pivot import PivotMotion
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.design.fir import savitzky_golay
from pvid.sim.pendulum import (
    SLIP,
    STANDARD_DRIVE,
    STANDARD_PENDULUM,
    STANDARD_RELEASE,
    Drive,
    Exact,
    Pendulum,
    Sensors,
    Simulation,
    Tone,
    is_physical,
    simulate,
    standard_sensors,
    standard_start,
)

Float = npt.NDArray[np.float64]

EXACT = Sensors()


def exact_of(simulation: Simulation) -> Exact:
    assert simulation.exact is not None
    return simulation.exact


# ---- parameters


def test_standard_rig_is_that_of_the_table() -> None:
    """theory.md 6: w 31.667, d1 8.875, d2 5.625; |phi| up to 0.107 rad."""
    np.testing.assert_allclose(STANDARD_PENDULUM.linear, [9.5 / 0.3, 8.875, 5.625], rtol=1e-14)
    run = simulate(sensors=EXACT, truth="full").run
    assert (len(run), run.sample_rate, run.t[0]) == (40_000, 1000.0, 0.0)
    assert np.abs(run.phi).max() == pytest.approx(0.107, abs=1e-3)
    assert np.abs(run.y).max() <= 15e-3


@given(l1=st.floats(0.05, 2.0), l2=st.floats(0.02, 1.0), rho2=st.floats(0.02, 1.0), g=st.floats(1.0, 20.0))
def test_linear_parameters_go_there_and_back(l1: float, l2: float, rho2: float, g: float) -> None:
    pendulum = Pendulum(l1, l2, rho2, g)
    again = Pendulum.from_linear(pendulum.linear, l1)
    # L2 = d1 - d2 - 1 cancels: eps of d1 relative to L2, at most 1e4 in this range.
    np.testing.assert_allclose([again.l2, again.rho2, again.g], [l2, rho2, g], rtol=1e-10)


def test_tilt_takes_its_part_of_gravity() -> None:
    assert STANDARD_PENDULUM.tilted(math.radians(60.0)).g == pytest.approx(9.5 / 2.0, rel=1e-15)


@pytest.mark.parametrize("name", ["l1", "l2", "rho2", "g"])
@pytest.mark.parametrize("value", [0.0, -0.1, math.nan, math.inf])
def test_impossible_pendulums_are_refused(name: str, value: float) -> None:
    given = {"l1": 0.3, "l2": 0.12, "rho2": 0.08, "g": 9.5, name: value}
    with pytest.raises(PvidError, match=f"pendulum's {name} must be"):
        Pendulum(**given)


@pytest.mark.parametrize(
    ("rough", "sentence"),
    [({"dry1": -1.0}, "dry1 must be"), ({"dry2": math.nan}, "dry2 must be"), ({"slant": 1.6}, "slant must be within")],
)
def test_impossible_frictions_and_slants_are_refused(rough: dict[str, float], sentence: str) -> None:
    with pytest.raises(PvidError, match=sentence):
        replace(STANDARD_PENDULUM, **rough)


def test_starts_are_within_half_of_the_truth_and_physical() -> None:
    starts = np.array([standard_start(seed) for seed in range(200)])
    ratio = starts / STANDARD_PENDULUM.linear
    assert np.all((ratio >= 0.5) & (ratio <= 1.5))
    assert all(is_physical(start) for start in starts)
    assert np.ptp(ratio, axis=0).min() > 0.9  # the whole range is used
    np.testing.assert_array_equal(starts[7], standard_start(7))


# ---- the motion


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
        matrix = np.array(
            [
                [l1 * c1, l2 * c2, s1],
                [l1 * s1, l2 * s2, -c1],
                [0.0, rho2**2, l2 * (s2 * c1 - c2 * s1)],
            ]
        )
        right = [
            l1 * s1 * v1**2 + l2 * s2 * v2**2,
            -l1 * c1 * v1**2 - l2 * c2 * v2**2 - gravity,
            0.0,
        ]
        a = np.linalg.solve(matrix, right)
        return [v1, v2, float(a[0]), float(a[1])]

    start = [*STANDARD_RELEASE, 0.0, 0.0]
    solution = solve_ivp(rhs, (0.0, end), start, method="LSODA", rtol=1e-11, atol=1e-13)
    return np.asarray(solution.y[:2, -1])


@pytest.mark.parametrize("truth", ["linear", "full"])
def test_motion_agrees_with_another_derivation_and_method(truth: str) -> None:
    simulation = simulate(truth=truth, duration=5.001)  # type: ignore[arg-type]
    assert simulation.run.t[-1] == 5.0
    expected = reference(STANDARD_PENDULUM, STANDARD_DRIVE, truth, 5.0)
    # LSODA's global error at 1e-11 a step
    np.testing.assert_allclose(simulation.state[-1, :2], expected, atol=1e-8)


@pytest.mark.parametrize(("dry", "slant"), [(0.0, 0.05), (1e-3, 0.0), (3e-3, 0.05)])
def test_dry_friction_and_a_slanted_slide_move_it_as_the_equations_in_c_do(
    dry: float, slant: float, native: Native
) -> None:
    """Of host/native/pendulum.c, by Runge-Kutta in fixed steps, whose errors are those of its reversals."""
    pendulum = replace(STANDARD_PENDULUM, damping1=1e-4, damping2=2e-4, dry1=dry, dry2=dry / 2, slant=slant)
    motion = PivotMotion(np.array([[one.amplitude_m, one.frequency_hz, one.phase_rad] for one in STANDARD_DRIVE]))
    steps, step_s = step_of(pendulum, 4.1, motion, (dry, dry / 2), SLIP, 6.0)
    rough: dict[str, Any] = {"dry": (dry, dry / 2), "slip": SLIP, "slant": slant}
    drive = accelerations(motion, steps, step_s)
    expected = integrate(native, pendulum, [*STANDARD_RELEASE, 0.0, 0.0], drive, step_s, **rough)
    simulation = simulate(pendulum, sensors=EXACT, truth="full", duration=6.0)
    smooth = simulate(replace(pendulum, dry1=0.0, dry2=0.0, slant=0.0), sensors=EXACT, truth="full", duration=6.0)
    assert expected is not None
    angle = relative_angle(expected, step_s, simulation.run.t)
    np.testing.assert_allclose(simulation.run.phi, angle, atol=2e-5)
    assert np.max(np.abs(simulation.run.phi - smooth.run.phi)) > 5e-3


def test_tolerances_leave_nothing_to_gain() -> None:
    """Every sample of 40 s against the same equations with steps of 2 ms at most: the interpolant is good too."""
    simulation = simulate(truth="linear")
    pendulum = STANDARD_PENDULUM
    w, d1, d2 = pendulum.linear
    big_l2 = d1 - d2 - 1.0
    drive = Drive(STANDARD_DRIVE)

    def rhs(t: float, x: Float) -> list[float]:
        phi1, phi, v1, v = x
        big_g = w + float(drive.derivatives(np.array([t]))[0, 2]) / pendulum.l1
        return [v1, v, -big_g * phi1 + big_l2 * big_g * phi, big_g * phi1 - (d1 - 1.0) * big_g * phi]

    start = [STANDARD_RELEASE[0], STANDARD_RELEASE[1] - STANDARD_RELEASE[0], 0.0, 0.0]
    t = simulation.run.t[:4001]
    fine = solve_ivp(rhs, (0.0, t[-1]), start, method="DOP853", t_eval=t, rtol=1e-13, atol=1e-15, max_step=2e-3)
    phi = simulation.state[:4001, 1] - simulation.state[:4001, 0]
    # 1e-12 a step, 200 steps; 1e-11 rad is 3e-8 LSB of a 14-bit encoder.
    assert np.abs(phi - fine.y[1]).max() < 1e-11


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


def test_small_full_motion_is_the_linear_one() -> None:
    small = (6e-4, 14e-4)
    linear = simulate(truth="linear", release=small, sensors=EXACT, duration=10.0).run.phi
    full = simulate(truth="full", release=small, sensors=EXACT, duration=10.0).run.phi
    # Cubic terms: angle^2 = 2e-6 of the motion, times its duration in radians (10 s x 16 rad/s).
    assert 0.0 < np.abs(full - linear).max() < 1e-3 * np.abs(linear).max()


@pytest.mark.parametrize("damping", [0.0, 1e-3])
def test_exact_derivatives_are_the_derivatives(damping: float) -> None:
    """Order k + 1 against a Savitzky-Golay derivative of order k, and u against the drive's second derivative."""
    pendulum = Pendulum(0.3, 0.12, 0.08, 9.5, damping, damping)
    simulation = simulate(pendulum=pendulum, duration=4.0)
    exact = exact_of(simulation)
    bank = savitzky_golay(41, 8)
    inner = slice(bank.delay, -bank.delay)
    for signal in (exact.phi, exact.u):
        for order in range(signal.shape[1] - 1):
            slope = bank.apply(signal[:, order], 1000.0)[1]
            # omega h = 0.5 over the half window: (omega h)^9 / 9! of the amplitude, and rounding of 1e-11
            np.testing.assert_allclose(slope, signal[inner, order + 1], atol=1e-7 * np.abs(signal[:, order + 1]).max())
    np.testing.assert_array_equal(exact.phi[:, 0], simulation.state[:, 1] - simulation.state[:, 0])
    expected = bank.apply(Drive(STANDARD_DRIVE).derivatives(simulation.run.t)[:, 0], 1000.0)[2] / 0.3
    np.testing.assert_allclose(exact.u[inner, 0], expected, atol=1e-6 * np.abs(expected).max())


def test_full_truth_claims_no_exact_derivatives() -> None:
    assert simulate(truth="full", duration=1.0).exact is None


def test_drive_stops_and_resumes_smoothly() -> None:
    drive = Drive(STANDARD_DRIVE, on=((1.0, 3.0), (4.0, 6.0)), ramp_s=0.4)
    t = np.arange(7001) / 1000.0
    values = drive.derivatives(t)
    steady = Drive(STANDARD_DRIVE).derivatives(t)
    off = (t < 1.0) | ((t > 3.0) & (t < 4.0)) | (t > 6.0)
    full = ((t >= 1.4) & (t <= 2.6)) | ((t >= 4.4) & (t <= 5.6))
    assert np.all(values[off] == 0.0)
    # The polynomial is 1 at its end up to the rounding of coefficients of 540, and less so its derivatives.
    np.testing.assert_allclose(values[full, :3], steady[full, :3], rtol=0, atol=1e-9)
    bank = savitzky_golay(21, 6)
    for order in range(4):
        slope = bank.apply(values[:, order], 1000.0)[1]
        scale = np.abs(values[:, order + 1]).max()
        # Order 4 is continuous with a kink at each corner: its slope 2e4/0.4^5.. times 10 ms of half window
        np.testing.assert_allclose(slope, values[10:-10, order + 1], atol=(2e-2 if order == 3 else 1e-3) * scale)


def test_a_switched_rig_moves_freely_while_the_drive_is_off() -> None:
    drive = Drive(STANDARD_DRIVE, on=((0.0, 4.0), (8.0, 12.0)))
    simulation = simulate(drive=drive, truth="full", duration=12.0)
    total = energy(STANDARD_PENDULUM, simulation.state)
    assert np.ptp(total[4000:8001]) < 1e-11
    assert np.ptp(total[:4000]) > 1e-4
    assert np.ptp(total[8001:]) > 1e-4
    linear = exact_of(simulate(drive=drive, duration=12.0))
    w, d1, d2 = STANDARD_PENDULUM.linear
    residual = linear.phi[:, 4] + d1 * w * linear.phi[:, 2] + d2 * w**2 * linear.phi[:, 0]  # theory.md 2 with u = 0
    assert np.abs(residual[4000:8001]).max() < 1e-9 < np.abs(residual[:4000]).max()


@pytest.mark.parametrize("on", [((0.0, 0.9),), ((0.0, 5.0), (4.0, 8.0)), ((5.0, 3.0),), ((math.nan, 3.0),)])
def test_impossible_intervals_are_refused(on: tuple[tuple[float, float], ...]) -> None:
    with pytest.raises(PvidError, match="interval"):
        Drive(STANDARD_DRIVE, on=on)


# ---- the sensors


def test_measurement_is_that_of_the_prototype() -> None:
    """The tables of theory.md were measured with these samples: same seed, same bits."""
    simulation = simulate(sensors=standard_sensors(14), seed=11)
    phi, y = simulate(sensors=EXACT).run.phi, simulate(sensors=EXACT).run.y
    random = np.random.default_rng(11)
    q = 2.0 * np.pi / 2**14
    offset = random.uniform(-0.5, 0.5)
    expected = q * (np.round(phi / q + 0.5 * random.standard_normal(phi.size) + offset) - offset)
    expected_y = 5e-6 * np.round(y / 5e-6 + 0.4 * random.standard_normal(y.size))
    np.testing.assert_array_equal(simulation.run.phi, expected)
    np.testing.assert_array_equal(simulation.run.y, expected_y)


def test_exact_sensors_deliver_the_truth() -> None:
    simulation = simulate(sensors=EXACT, duration=2.0)
    np.testing.assert_array_equal(simulation.run.phi, simulation.state[:, 1] - simulation.state[:, 0])
    np.testing.assert_array_equal(simulation.run.y, Drive(STANDARD_DRIVE).derivatives(simulation.run.t)[:, 0])


def test_zero_skew_and_outliers() -> None:
    plain = simulate(sensors=EXACT, duration=2.0).run
    zeroed = simulate(sensors=Sensors(phi_zero=0.02), duration=2.0).run
    np.testing.assert_allclose(zeroed.phi - plain.phi, 0.02, rtol=1e-13)
    skewed = simulate(sensors=Sensors(skew_s=1e-3), duration=2.0).run
    # One sample later at 1 kHz: the same sines up to the rounding of t.
    np.testing.assert_allclose(skewed.y[:-1], plain.y[1:], atol=1e-16)
    np.testing.assert_array_equal(skewed.phi, plain.phi)
    hit = simulate(sensors=Sensors(outlier_fraction=0.1, outlier_rad=1.0), duration=2.0).run.phi - plain.phi
    assert set(np.round(hit, 12).tolist()) == {-1.0, 0.0, 1.0}
    assert np.mean(hit != 0.0) == pytest.approx(0.1, abs=0.03)  # 2000 draws: 0.7 % (1 s.d.)


def test_seeds_change_the_noise_and_nothing_else() -> None:
    one, same, other = (simulate(seed=seed, duration=5.0) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.run.phi, same.run.phi)
    assert np.any(one.run.phi != other.run.phi)
    np.testing.assert_array_equal(one.state, other.state)
    noise = one.run.phi - (one.state[:, 1] - one.state[:, 0])
    lsb = standard_sensors().phi_lsb
    # White noise of 0.5 LSB and rounding: sqrt(0.25 + 1/12) LSB; 5000 draws: 1 % (1 s.d.).
    assert np.std(noise) == pytest.approx(lsb * math.sqrt(0.25 + 1.0 / 12.0), rel=0.05)


def test_twenty_seeds_cost_one_integration() -> None:
    simulate(duration=40.0)
    before = time.process_time()
    for seed in range(20):
        simulate(duration=40.0, seed=seed)
    assert time.process_time() - before < 2.0  # an integration takes 0.7 s, a measurement some milliseconds


def test_the_truth_cannot_be_spoiled() -> None:
    simulation = simulate(duration=1.0)
    with pytest.raises(ValueError, match="read-only"):
        simulation.state[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        exact_of(simulation).phi[0, 0] = 1.0
    simulation.run.phi[:] = 0.0
    assert np.any(simulate(duration=1.0).run.phi != 0.0)


# ---- requests that make no sense


@pytest.mark.parametrize(
    ("request_", "sentence"),
    [
        ({"sample_rate": 0.0}, "sample rate"),
        ({"sample_rate": math.nan}, "sample rate"),
        ({"duration": 0.0}, "0 s at 1000 Hz"),
        ({"duration": math.inf}, "inf s at 1000 Hz"),
        ({"duration": 1e9}, r"1e\+09 s at 1000 Hz"),
        ({"release": (math.nan, 0.0)}, "release"),
        ({"truth": "quadratic"}, "linear"),
        ({"seed": -1}, "seed"),
        ({"sample_rate": 6.0}, "4.1 Hz"),
        ({"pendulum": replace(STANDARD_PENDULUM, dry2=1e-3)}, "are in the full equations: choose the truth 'full'"),
        ({"pendulum": replace(STANDARD_PENDULUM, slant=1e-3)}, "are in the full equations: choose the truth 'full'"),
    ],
)
def test_impossible_requests_are_refused(request_: dict[str, object], sentence: str) -> None:
    with pytest.raises(PvidError, match=sentence):
        simulate(**request_)  # type: ignore[arg-type]


@pytest.mark.parametrize("field", ["phi_lsb", "phi_noise_lsb", "y_lsb", "y_noise_lsb", "phi_zero", "skew_s"])
def test_impossible_sensors_are_refused(field: str) -> None:
    with pytest.raises(PvidError, match=field):
        replace(EXACT, **{field: math.nan})  # type: ignore[arg-type]


def test_parametric_resonance_grows_and_beyond_all_bounds_is_reported() -> None:
    """theory.md 6: the linear model blows up at 5 mm for 4.7 to 5.7 Hz (twice the fast mode)."""
    grown = simulate(drive=[Tone(5e-3, 5.12)], sensors=EXACT, duration=40.0).run.phi
    assert np.abs(grown).max() > 10.0
    with pytest.raises(PvidError, match="without bound"):
        simulate(drive=[Tone(0.5, 5.12)], duration=400.0, sample_rate=20.0)
