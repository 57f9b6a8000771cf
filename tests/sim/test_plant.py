"""The plant of a described mechanism: against SciPy, conservation laws and closed forms of dry friction."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Known, Signal, Unknown
from pvid.model.signals import Integral, Jet, sgn, total_derivative
from pvid.models.drive import RandomSteps, Sines, Steps
from pvid.sim.compiled_plant import loaded
from pvid.sim.plant import SHARP, Friction, Plant

Float = npt.NDArray[np.float64]

F, X, Y = Jet("F"), Jet("x"), Jet("y")
NONE = sp.Integer(0)
A, B, C = (sp.Symbol(name, real=True) for name in "abc")


def described(
    equations: Sequence[sp.Expr],
    sensors: Sequence[Jet],
    *,
    force: str = "",
    hidden: Sequence[Jet] = (),
    unknowns: Sequence[sp.Symbol] = (),
    knowns: Sequence[tuple[sp.Symbol, float]] = (),
) -> CompiledModel:
    """A model as the compiler gives it, without rows; `force` is the hold of an input F."""
    signals = [Signal(jet, "m", "sensor", resolution=1e-3) for jet in sensors]
    if force == "zoh":
        signals.append(Signal(F, "N", "input", hold="zoh", driven=True))
    elif force:
        signals.append(Signal(F, "N", "input", driven=True))
    return CompiledModel(
        name="described",
        title="",
        signals=tuple(signals),
        unknowns=tuple(Unknown(one, "", 1.0, True, 0.0, 1e9, 2.0) for one in unknowns),
        knowns=tuple(Known(one, "", value) for one, value in knowns),
        outputs=(),
        rows=(),
        equations=tuple(equations),
        hidden=tuple(hidden),
    )


def double_pendulum(damping: sp.Expr = NONE, force: sp.Expr = NONE) -> list[sp.Expr]:
    """Two equal links, masses and lengths 1, angles from below: Lagrange's equations."""
    L = double_pendulum_lagrangian()
    forces = (force - damping * X.d(), -damping * Y.d())
    return [
        total_derivative(sp.diff(L, q.d())) - sp.diff(L, q) - force for q, force in zip((X, Y), forces, strict=True)
    ]


def double_pendulum_lagrangian(sign: int = -1) -> sp.Expr:
    """T - V, with sign 1 the energy T + V."""
    kinetic = X.d() ** 2 + Y.d() ** 2 / 2 + X.d() * Y.d() * sp.cos(X - Y)
    return kinetic + sign * C * (-2 * sp.cos(X) - sp.cos(Y))


def test_double_pendulum_with_a_smooth_force_moves_as_in_scipy() -> None:
    model = described(double_pendulum(B, F), [X, Y], force="sampled", unknowns=[B], knowns=[(C, 9.81)])
    plant = Plant(model)
    drive = Sines(((3.0, 0.9, 0.4), (1.0, 2.3, 0.0)))
    constants = plant.constants(np.array([0.05]))
    moved = plant.driven(constants, plant.start({"x": 0.5, "y_1": 0.2}), {"F": drive}, 1000.0, 3001)

    def rates(t: float, state: Float) -> list[float]:
        x, vx, y, vy = state
        matrix = np.array([[2.0, math.cos(x - y)], [math.cos(x - y), 1.0]])
        force = float(drive.values(np.array([t]))[0])
        right = [
            force - 0.05 * vx - math.sin(x - y) * vy**2 - 2 * 9.81 * math.sin(x),
            -0.05 * vy + math.sin(x - y) * vx**2 - 9.81 * math.sin(y),
        ]
        ax, ay = np.linalg.solve(matrix, right)
        return [vx, ax, vy, ay]

    true = solve_ivp(rates, (0.0, 3.0), [0.5, 0.0, 0.0, 0.2], "DOP853", moved.t, rtol=1e-12, atol=1e-13)
    # RK4 at 0.1 ms: (w h)^4 of 20 rad/s is 2e-11; the chaotic motion multiplies it
    np.testing.assert_allclose(moved["x"], true.y[0], atol=1e-9)
    np.testing.assert_allclose(moved["y_1"], true.y[3], atol=1e-8)
    accelerations = np.array([rates(t, state) for t, state in zip(moved.t[::500], true.y.T[::500], strict=True)])
    np.testing.assert_allclose(moved["x_2"][::500], accelerations[:, 1], atol=1e-6)


def test_motor_with_held_voltages_moves_as_in_scipy() -> None:
    """Current (first order) and angle (second), voltage held between samples; i is the signal x."""
    equations = [3e-3 * X.d() + 1.2 * X + 0.05 * Y.d() - F, 2e-4 * Y.d(2) + 1e-4 * Y.d() - 0.05 * X]
    plant = Plant(described(equations, [X, Y], force="zoh"))
    drive = RandomSteps(5.0, 0.003, seed=4)
    moved = plant.driven(plant.constants(np.array([])), plant.start({}), {"F": drive}, 1000.0, 61)
    state = np.zeros(3)
    for k in range(60):
        volts = float(drive.values(np.array([k / 1000.0]))[0])
        state = solve_ivp(
            lambda t, s, volts=volts: [
                (volts - 1.2 * s[0] - 0.05 * s[2]) / 3e-3,
                s[2],
                (0.05 * s[0] - 1e-4 * s[2]) / 2e-4,
            ],
            (0.0, 1e-3),
            state,
            "DOP853",
            rtol=1e-12,
            atol=1e-14,
        ).y[:, -1]
        # RK4 at 0.1 ms: (h R/L)^4/120 = 2e-8 of the largest current, angle and rate
        assert np.all(np.abs(moved.states[k + 1] - state) < 1e-7 * np.array([5.0, 0.1, 5.0]))


def test_undamped_lagrangian_conserves_its_energy() -> None:
    model = described(double_pendulum(), [X, Y], knowns=[(C, 9.81)])
    plant = Plant(model)
    moved = plant.driven(plant.constants(np.array([])), plant.start({"x": 1.0, "y": -0.5}), {}, 1000.0, 10_000)
    energy = sp.lambdify([X, X.d(), Y, Y.d()], double_pendulum_lagrangian(1).subs(C, 9.81))(*moved.states.T)
    assert np.ptp(moved["x"]) > 1.0
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


def block(force: str = "zoh", spring: sp.Expr = NONE) -> Plant:
    """A mass a on a table with Coulomb friction b, pushed by F and a spring."""
    return Plant(described([A * X.d(2) + B * sgn(X.d()) + spring * X - F], [X], force=force, unknowns=[A, B]))


PUSH_NOTHING = {"F": Sines(())}


def test_sliding_block_stops_between_samples_and_stays() -> None:
    """x = v^2 m/(2 F) after v m/F = 0.32345 s, within no step of 10 ms."""
    plant = block()
    moved = plant.driven(np.array([2.0, 3.0]), plant.start({"x_1": 0.485175}), PUSH_NOTHING, 100.0, 60, substeps=1)
    stopped = moved.t > 0.485175 * 2 / 3
    assert np.all(moved["x_1"][stopped] == pytest.approx(0.0, abs=1e-13))
    np.testing.assert_allclose(moved["x"][stopped], 0.485175**2 / 3.0, rtol=1e-12)


def test_spring_with_dry_friction_loses_two_steps_of_friction_a_half_cycle_then_sticks() -> None:
    """Amplitude 1, friction/stiffness 0.15: turns at -0.7, 0.4, -0.1, where 0.1 < 0.15 holds."""
    plant = block(spring=sp.Integer(40))
    moved = plant.driven(np.array([1.0, 6.0]), plant.start({"x": 1.0}), PUSH_NOTHING, 1000.0, 3000, substeps=2)
    half = math.pi / math.sqrt(40.0)
    for number, turn in ((1, -0.7), (2, 0.4)):
        k = round(number * half * 1000.0)
        assert moved["x"][k] == pytest.approx(turn, abs=40 * 1e-3**2)  # a turn is up to half a sample away
    np.testing.assert_allclose(moved["x"][int(3 * half * 1000) + 1 :], -0.1, atol=1e-9)


def test_stiction_holds_until_the_breakaway_force() -> None:
    """A force that rises in steps of 0.1 N a sample: friction 3 N slides, 3.9 N holds."""
    plant = block()
    ramp = {"F": Steps(tuple(0.1 * k for k in range(100)), 0.01)}
    moved = plant.driven(
        np.array([2.0, 3.0]), plant.start({}), ramp, 100.0, 45, substeps=4, friction=Friction(breakaway=1.3)
    )
    first = int(np.argmax(moved["x_1"] > 1e-9))
    assert first - 1 == 40  # F = 4.0: the first above 3.9
    assert moved["x_1"][first] == pytest.approx((4.0 - 3.0) / 2.0 * 0.01, rel=1e-9)
    dry = plant.driven(np.array([2.0, 3.0]), plant.start({}), ramp, 100.0, 45, substeps=4)
    assert int(np.argmax(dry["x_1"] > 1e-9)) - 1 == 31


def test_located_reversals_agree_with_steps_of_10_us() -> None:
    """A naive run with the sign of the moment errs by a step at each reversal."""
    drive = Sines(((3.0, 1.0, 1.6), (3.0, 2.7, 1.5)))
    plant = block("sampled")
    moved = plant.driven(np.array([0.8, 1.5]), plant.start({}), {"F": drive}, 1000.0, 1001)
    step, v, x = 1e-5, 0.0, 0.0
    force = drive.values((np.arange(100_000) + 0.5) * step).tolist()
    naive = []
    for k, push in enumerate(force):
        if k % 100 == 0:
            naive.append((x, v))
        after = v + step * (push - math.copysign(1.5, v)) / 0.8
        if after * v < 0.0 or v == 0.0:  # it would reverse: it sticks where friction can hold
            after = 0.0 if abs(push) <= 1.5 else v + step * (push - math.copysign(1.5, push)) / 0.8
        x += step * (v + after) / 2.0
        v = after
    changes = np.count_nonzero(np.diff(np.sign(moved["x_1"])))
    assert changes >= 5 and np.count_nonzero(moved["x_1"] == 0.0) > 20
    error = 2.0 * changes * 1.5 / 0.8 * step  # 2 b/a for up to a step at each change
    np.testing.assert_allclose(moved["x_1"][:1000], [one[1] for one in naive], atol=error)
    np.testing.assert_allclose(moved["x"][:1000], [one[0] for one in naive], atol=error)


def test_soft_friction_comes_near_the_sharp_one() -> None:
    plant, drive = block("sampled"), {"F": Sines(((5.0, 1.0, 0.3),))}
    start, constants = plant.start({}), np.array([0.8, 1.5])
    sharp = plant.driven(constants, start, drive, 1000.0, 2000)["x"]
    soft = {
        width: plant.driven(constants, start, drive, 1000.0, 2000, friction=Friction(width))["x"]
        for width in (0.02, 0.002)
    }
    far, near = (float(np.abs(one - sharp).max()) for one in soft.values())
    assert near < 0.2 * far < 0.2 * np.ptp(sharp)


def test_friction_on_a_driven_velocity_reverses_with_it() -> None:
    """Y is the force that moves a carriage along a given path F: no friction can hold what is driven."""
    plant = Plant(described([Y - 3 * F.d() - 2 * sgn(F.d())], [Y], force="sampled"))
    path = Sines(((0.5, 0.7, 0.3),))
    moved = plant.driven(np.array([]), plant.start({}), {"F": path}, 100.0, 600)
    rate = path.values(np.arange(600) / 100.0, 1)
    np.testing.assert_allclose(moved["y"], 3 * rate + 2 * np.sign(rate), atol=1e-6)


def test_two_frictions_stick_and_let_go_together() -> None:
    """Two blocks coupled by a stiff damper, pushed as one: they move like one block."""
    pull = 200 * (X.d() - Y.d())
    equations = [X.d(2) + sgn(X.d()) + pull - F, Y.d(2) + sgn(Y.d()) - pull]
    plant = Plant(described(equations, [X, Y], force="sampled"))
    moved = plant.driven(np.array([]), plant.start({}), {"F": Sines(((6.0, 1.0, 0.0),))}, 1000.0, 2000)
    one = Plant(described([2 * X.d(2) + 2 * sgn(X.d()) - F], [X], force="sampled"))
    whole = one.driven(np.array([]), one.start({}), {"F": Sines(((6.0, 1.0, 0.0),))}, 1000.0, 2000)
    assert np.ptp(whole["x"]) > 0.1
    np.testing.assert_allclose((moved["x"] + moved["y"]) / 2.0, whole["x"], atol=0.02 * np.ptp(whole["x"]))
    assert np.count_nonzero((moved["x_1"] == 0.0) & (moved["y_1"] == 0.0)) > 20


def test_integral_and_algebraic_signal_are_those_of_a_cell() -> None:
    """x = 3 - a integral of F - b F: a charge and a resistance."""
    plant = Plant(described([X - 3 + A * Integral(F, 1) + B * F], [X], force="sampled", unknowns=[A, B]))
    drive = Sines(((2.0, 0.5, 0.0),), offset=0.3)
    moved = plant.driven(np.array([0.1, 0.02]), plant.start({}), {"F": drive}, 100.0, 300)
    t = moved.t
    charge = 0.3 * t + 2.0 / math.pi * (1.0 - np.cos(math.pi * t))
    # the inputs of a sample are read 1e-6 of a step behind it
    np.testing.assert_allclose(moved["x"], 3.0 - 0.1 * charge - 0.02 * drive.values(t), atol=1e-9)


def test_derivative_of_a_driven_signal_is_that_of_its_drive() -> None:
    """A pendulum's pivot: x'' = -F''."""
    plant = Plant(described([X.d(2) + F.d(2)], [X], force="sampled"))
    drive = Sines(((0.01, 2.0, 0.5),))
    at0 = -float(drive.values(np.zeros(1))[0]), -float(drive.values(np.zeros(1), 1)[0])
    moved = plant.driven(np.array([]), plant.start({"x": at0[0], "x_1": at0[1]}), {"F": drive}, 1000.0, 1000)
    np.testing.assert_allclose(moved["x"], -drive.values(moved.t), atol=1e-9)


def test_gain_acts_on_the_motion_and_not_on_the_record() -> None:
    plant = block()
    drives = {"F": Steps((4.0, -4.0), 0.1)}
    constants = np.array([2.0, 0.0])
    plain = plant.driven(constants, plant.start({}), drives, 100.0, 50)
    louder = plant.driven(constants, plant.start({}), drives, 100.0, 50, gains={"F": 1.01})
    np.testing.assert_array_equal(plain["F"], louder["F"])
    np.testing.assert_allclose(louder["x"], 1.01 * plain["x"], rtol=1e-12)


def test_disturbance_adds_to_the_equations() -> None:
    plant = block()
    push = np.full((50, 1), 0.7)
    moved = plant.driven(np.array([2.0, 0.0]), plant.start({}), PUSH_NOTHING, 100.0, 50, disturbance=push)
    np.testing.assert_allclose(moved["x_1"], 0.35 * moved.t, atol=1e-13)


def test_controller_sets_the_input_of_each_sample() -> None:
    """A regulator of the rate: v_(k+1) = v_k + dt (1 - v_k)."""
    plant = block()
    moved = plant.controlled(np.array([1.0, 0.0]), plant.start({}), lambda t, state: {"F": 1.0 - state[1]}, 100.0, 50)
    expected = 1.0 - 0.99 ** np.arange(50)
    np.testing.assert_allclose(moved["x_1"], expected, rtol=1e-12)
    np.testing.assert_allclose(moved["F"], 1.0 - expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("equations", "sensors", "hidden", "sentence"),
    [
        ([X.d(2) - Y], [X, Y], [], "1 equations for the 2 quantities x, y"),
        ([X.d(2) ** 2 - 1], [X], [], "equation 1 is not linear in x_2"),
        ([X.d(2) - 1, X.d() + Y.d() * X - Y.d() * X], [X], [Y], "as many equations"),
        ([sgn(X.d()) + X], [X], [], "a highest derivative, stands in x_1"),
    ],
)
def test_equations_that_determine_no_motion_are_refused(
    equations: list[sp.Expr], sensors: list[Jet], hidden: list[Jet], sentence: str
) -> None:
    with pytest.raises(PvidError, match=sentence):
        Plant(described(equations, sensors, hidden=hidden))


def test_singular_mass_matrix_is_refused_on_the_way() -> None:
    plant = Plant(described([X.d(2) + Y.d(2) - 1, X.d(2) + Y.d(2) - F], [X, Y], force="zoh"))
    with pytest.raises(PvidError, match="do not determine the motion"):
        plant.driven(np.array([]), plant.start({}), PUSH_NOTHING, 100.0, 2)


def test_motion_without_bound_is_refused() -> None:
    plant = Plant(described([X.d() - X**2], [X]))
    with pytest.raises(PvidError, match="grows without bound"):
        plant.driven(np.array([]), plant.start({"x": 1.0}), {}, 100.0, 300)


def test_missing_drive_and_unknown_state_are_named() -> None:
    plant = block()
    with pytest.raises(PvidError, match="needs a drive of F"):
        plant.driven(np.array([1.0, 1.0]), plant.start({}), {}, 100.0, 2)
    with pytest.raises(PvidError, match="z is no state of the simulation; states are x, x_1"):
        plant.start({"z": 1.0})


def test_host_without_a_compiler_is_told_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(PvidError, match=r"needs a C compiler \(cc, gcc or clang"):
        loaded("int nothing;")


def test_law_of_friction_has_a_range() -> None:
    assert SHARP.width == 0.0
    for given in ({"width": -1.0}, {"breakaway": 0.5}):
        with pytest.raises(PvidError, match="breakaway >= 1"):
            Friction(**given)
