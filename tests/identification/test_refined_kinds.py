"""The second stage of kinds of mechanisms that no shipped one is: algebraic equations, no input, many unknowns."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import tanh

import numpy as np
import numpy.typing as npt
import pytest
import sympy as sp
from runge_kutta import States, motion
from test_own_mechanisms import errors_over_se, held_at_random, of_core, read, recorded

from pvid.base.errors import PvidError
from pvid.codegen.build import files_of
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.refine import refine_functions
from pvid.configuration.refine import refine_settings
from pvid.configuration.weak import config_to_identify
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.identification.core import identify_in_c
from pvid.identification.core_refined import BothStages, compare_refined, refined_in_c
from pvid.identification.refinement.inputs import inputs_of
from pvid.identification.refinement.kernel import Drive, kernel_of
from pvid.identification.refinement.problem import refine_mechanism
from pvid.model import Integral, Model, sgn, sin
from pvid.model.compiled import CompiledModel
from pvid.model.signals import Jet
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]


def motor_without_inductance() -> CompiledModel:
    model = Model("motor without inductance")
    V = model.input("V", "V", hold="zoh", reach=12)
    i, w = model.sensor("i", "A", noise=5e-3, reach=5), model.sensor("w", "rad/s", noise=0.05, reach=300)
    R, k = model.unknown("R", "ohm", 1.0), model.unknown("k", "N*m/A", 0.06)
    J, Tc = model.unknown("J", "kg*m^2", 3e-4), model.unknown("Tc", "N*m", 0.02)
    model.equation(R * i + k * w - V)
    model.equation(J * w.d() + Tc * sgn(w) - k * i)
    return model.compiled("motor")


def cart_on_a_force_cell() -> CompiledModel:
    model = Model("cart on a force cell")
    F = model.input("F", "N", hold="zoh", reach=10)
    x, f = model.sensor("x", "m", noise=1e-5, reach=0.2), model.sensor("f", "N", noise=1e-3, reach=20)
    m, c, k = model.unknown("m", "kg", 1.2), model.unknown("c", "N*s/m", 0.8), model.unknown("k", "N/m", 90.0)
    f0 = model.unknown("f0", "N", 0.1, positive=False, sd=1.0)
    model.equation(m * x.d(2) + (f - f0) - F)
    model.equation(f - f0 - k * x - c * x.d())
    return model.compiled("cell")


def accelerometer() -> CompiledModel:
    model = Model("accelerometer")
    F = model.input("F", "N", hold="zoh", reach=10)
    x, a = model.sensor("x", "m", noise=1e-5, reach=0.2), model.sensor("a", "m/s^2", noise=1e-2, reach=20)
    m, c, k = model.unknown("m", "kg", 1.2), model.unknown("c", "N*s/m", 0.8), model.unknown("k", "N/m", 90.0)
    a0 = model.unknown("a0", "m/s^2", 0.1, positive=False, sd=1.0)
    model.equation(m * x.d(2) + c * x.d() + k * x - F)
    model.equation(a - a0 - x.d(2))
    return model.compiled("accelerometer")


def converter() -> CompiledModel:
    """Two outputs of which one contains the other; a capacitor that no sensor measures."""
    model = Model("converter")
    d = model.input("d", "", hold="zoh", reach=1)
    i, v = model.sensor("i", "A", noise=1e-2, reach=10), model.sensor("v", "V", noise=1e-2, reach=10)
    s = model.sensor("s", "A", noise=1e-2, reach=10)
    L, C, R = model.unknown("L", "H", 2e-3), model.unknown("C", "F", 1e-3), model.unknown("R", "ohm", 0.2)
    load, vin = model.unknown("load", "ohm", 2.0), model.known("vin", "V", 12)
    vc = model.unmeasured("vc", "V")
    model.equation(L * i.d() + v - d * vin)
    model.equation(C * vc.d() - i + v / load)
    model.equation(v - vc - R * (i - v / load))
    model.equation(s - i - v / load)
    return model.compiled("converter")


def discharge() -> CompiledModel:
    model = Model("discharge")
    u = model.sensor("u", "V", resolution=1e-3, reach=5)
    T, u0 = model.unknown("T", "s", 0.5), model.unknown("u0", "V", 0.2, positive=False, sd=1.0)
    model.equation(T * u.d() + u - u0)
    return model.compiled("discharge")


def free_pendulum() -> CompiledModel:
    model = Model("free pendulum")
    a = model.sensor("a", "rad", resolution=1e-3, reach=2)
    w2, b = model.unknown("w2", "1/s^2", 20.0), model.unknown("b", "1/s", 0.1)
    a0 = model.unknown("a0", "rad", 0.01, positive=False, sd=0.1)
    model.equation(a.d(2) + b * a.d() + w2 * sin(a - a0))
    return model.compiled("swing")


def coupled() -> CompiledModel:
    """A determinant of more terms than are brought into a shorter form."""
    model = Model("three masses in one")
    F = model.input("F", "N", hold="zoh", smooth=True)
    q = [model.sensor(name, "m", noise=1e-4) for name in ("x", "y", "z")]
    p = [model.unknown(f"p{k}", "kg", 1.0 + 0.1 * k) for k in range(3)]
    k, length = model.unknown("k", "N/m", 2.0), model.known("length", "m", 1.0)
    for i in range(3):
        own = (p[0] + p[1] * sin(q[0] / length) + p[2] * sin(q[1] / length)) * q[i].d(2) * (i + 2)
        others = [p[(i + j) % 3] * sin((i + 1) * q[j] / length) * q[j].d(2) for j in range(3) if j != i]
        model.equation(own + sum(others) + k * q[i] - (F if i == 0 else 0))
    return model.compiled("coupled")


KINDS = (motor_without_inductance, cart_on_a_force_cell, accelerometer, converter, discharge, free_pendulum, coupled)


def start_of_kind(compiled: CompiledModel) -> tuple[Float, Float, Float]:
    """r with settings, a state, inputs."""
    kernel, rng = kernel_of(compiled), np.random.default_rng(3)
    made, known = kernel.made, {one.name: one.value for one in compiled.knowns}
    r = [compiled.unknowns[one.place].guess if one.place >= 0 else 2.0 for one in made.parameters]
    r += [known.get(name, 1.0) for name in made.settings]
    return np.array(r), rng.uniform(0.5, 2, kernel.states), rng.uniform(-2, 2, len(made.inputs))


@pytest.mark.parametrize("kind", KINDS)
def test_readings_and_rates_solve_the_equations(kind: Callable[[], CompiledModel]) -> None:
    """Whichever of the equations determine motion and whichever only what is measured."""
    compiled = kind()
    kernel, (r, state, u) = kernel_of(compiled), start_of_kind(compiled)
    made = kernel.made
    held = np.tile(u, (2, 3, 1))
    drive = Drive(1, 1e-9, held, np.zeros_like(held))
    z = kernel.blocks(r, np.array([0], np.int32), 1, drive, state[None], False)[0][0, 0]
    v = state[len(made.coordinates) :] if made.order == 2 else np.zeros(1)
    rates = kernel.derivatives(r, state[: len(made.coordinates)], v, u)["a"]
    jets = [Jet(*_split(name)) for name in made.coordinates]
    known: list[tuple[Sequence[sp.Symbol], Sequence[float] | Float]] = [(jets, state[: len(jets)])]
    if made.order == 2:
        known += [([one.d() for one in jets], v), ([one.d(2) for one in jets], rates)]
    else:  # where a coordinate x_1 is the rate of x
        known += [([one.d() for one in jets], rates)]
    known += [(made.inputs, u), ([Jet(name) for name in made.outputs], z)]
    known += [([one.symbol for one in compiled.unknowns], [r[k] for k in made.places_of_p])]
    values = {name: float(x) for names, found in known for name, x in zip(names, found, strict=True)}
    values |= {one.symbol: one.value for one in compiled.knowns}
    for equation in compiled.equations:
        soft = {one: one.args[0] / (one.args[0] ** 4 + 16) ** 0.25 for one in equation.atoms(sgn)}  # of width 2
        terms = [float(one.xreplace(soft).xreplace(values)) for one in sp.Add.make_args(sp.expand(equation))]
        assert abs(sum(terms)) < 1e-9 * max(map(abs, terms)), equation


def _split(name: str) -> tuple[str, int]:
    stem, _, order = name.rpartition("_")
    return (stem, int(order)) if order.isdigit() else (name, 0)


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_by_start_and_parameters_are_those_of_the_readings(kind: Callable[[], CompiledModel]) -> None:
    compiled = kind()
    kernel, (r, state, u) = kernel_of(compiled), start_of_kind(compiled)
    made, samples, sub = kernel.made, 8, 4
    inputs = np.random.default_rng(1).uniform(-1, 1, (samples * sub, 1, len(u))) * np.ones((1, 3, 1)) + u
    given = np.array([0], np.int32), samples, Drive(sub, 1e-4, inputs, np.zeros_like(inputs))
    jacobian = kernel.blocks(r, *given, state[None])[1]
    assert jacobian is not None

    def moved(place: int, step: float) -> Float:
        now, parameters = state.copy(), r.copy()
        if place < kernel.states:
            now[place] += step
        elif made.parameters[place - kernel.states].log:
            parameters[place - kernel.states] *= np.exp(step)
        else:
            parameters[place - kernel.states] += step
        return kernel.blocks(parameters, *given, now[None], False)[0]

    columns = [k for k in range(jacobian.shape[-1]) if k - kernel.states not in kernel.widths]
    for k in columns:
        slope = (moved(k, 1e-5) - moved(k, -1e-5)) / 2e-5
        assert np.abs(slope - jacobian[..., k]).max() <= 1e-5 * np.abs(slope).max() + 1e-8, k


def test_the_motor_of_every_textbook_is_refined() -> None:
    """Its current jumps with the voltage: the second stage has the algebraic equation as a reading."""
    truth, dt, n = {"R": 1.2, "k": 0.05, "J": 2e-4, "Tc": 0.01}, 1e-3, 6000
    V = held_at_random(n, 40, 200, 8.0, 1)

    def rate(x: States, u: float) -> States:
        i = (u - truth["k"] * x[0]) / truth["R"]
        return ((truth["k"] * i - truth["Tc"] * tanh(x[0] / 0.01)) / truth["J"],)

    w = motion(rate, (0.0,), V, dt, 8)[:, 0]
    signals = {"V": V, "i": read((V - truth["k"] * w) / truth["R"], 0.01, 2), "w": read(w, 0.1, 3)}
    found = refine_mechanism(motor_without_inductance(), signals, 1 / dt, np.array([1.19, 0.0501, 2.01e-4, 0.01]), 1.0)
    assert found.found.converged
    assert np.abs(errors_over_se(found, truth)).max() < 4


def test_a_mechanism_without_an_input_is_refined_in_float64_and_in_c() -> None:
    truth, dt = {"T": 0.7, "u0": 0.15}, 1e-3
    t = np.arange(3000) * dt
    u = read(truth["u0"] + (5.0 - truth["u0"]) * np.exp(-t / truth["T"]), 1e-3, 1)
    answer = analysed(recorded(dt, u=u), discharge())
    found = refine_mechanism(discharge(), {"u": u}, 1 / dt, answer.found.p, 0.6)
    assert found.found.converged and np.abs(errors_over_se(found, truth)).max() < 4
    in_c = refined_in_c(identify_in_c(answer))
    assert in_c.adopted
    for name, value in truth.items():
        estimate, se = of_core(in_c, name)
        assert abs(estimate - value) < 4 * se


def test_an_integral_of_a_product_is_an_input() -> None:
    model = Model("heat")
    i, v = model.sensor("i", "A", noise=1e-3, driven=True), model.sensor("v", "V", noise=1e-3)
    z, s = model.define("z", "A^2*s", 2 * Integral(i**2, 1)), model.unknown("s", "V/(A^2*s)", 1.0)
    R, T, h = model.unknown("R", "ohm", 1.0), model.unknown("T", "s", 1.0), model.unmeasured("h", "V")
    model.equation(v + s * z + h)
    model.equation(T * h.d() + h - R * i)
    compiled = model.compiled("heat")
    t = np.arange(200) * 0.01
    signals = {"i": np.sin(t), "v": np.zeros(200)}
    u, _ = inputs_of(compiled, kernel_of(compiled).made, signals, 100.0, 2)
    place = kernel_of(compiled).made.inputs.index(Jet("z"))
    assert np.abs(u[::2, 0, place] - (t - np.sin(2 * t) / 2)).max() < 1e-4


def coasting() -> CompiledModel:
    model = Model("coasting vehicle")
    F = model.input("F", "N", hold="zoh", reach=400)
    v = model.sensor("v", "m/s", resolution=0.01, reach=20)
    m, Fr = model.unknown("m", "kg", 80.0), model.unknown("Fr", "N", 10.0)
    b, cw = model.unknown("b", "N*s/m", 0.5), model.unknown("cw", "kg/m", 0.3)
    model.equation(m * v.d() + Fr * sgn(v) + b * v + cw * v * abs(v) - F)
    return model.compiled("coasting")


def coasted(n: int = 4000) -> tuple[Recording, dict[str, float]]:
    truth = {"m": 92.0, "Fr": 13.5, "b": 0.9, "cw": 0.31}

    def rate(x: States, F: float) -> States:
        drag = truth["Fr"] * tanh(x[0] / 0.01) + truth["b"] * x[0] + truth["cw"] * x[0] * abs(x[0])
        return ((F - drag) / truth["m"],)

    F = np.maximum(held_at_random(n, 100, 300, 200.0, 3), -60.0)
    v = motion(rate, (0.1,), F, 0.02, 40)[:, 0]
    return recorded(0.02, F=F, v=read(v, 0.01, 5)), truth


@pytest.fixture(scope="module")
def coasted_through() -> tuple[Analysis, BothStages]:
    """The analysis of the recording, and the settings of both stages."""
    recording, _ = coasted()
    answer = analysed(recording, coasting())
    weak = config_to_identify(answer.model, recording, answer.ranking)
    return answer, BothStages.of(answer.model, recording, weak)


def test_friction_of_a_measured_speed_has_a_second_stage_in_c(coasted_through: tuple[Analysis, BothStages]) -> None:
    """Its jump is that at the reversal; the step there is as short as the speed's sensor needs, not its integral."""
    answer, stages = coasted_through
    widths = stages.settings.width
    h = stages.settings.ratio / stages.settings.sample_rate
    assert widths is not None and stages.settings.fine_parts is not None
    assert abs(float(widths[0]) / (2 * 13.5 / 92.0 * h / stages.settings.fine_parts) - 1) < 0.02
    in_c = refined_in_c(identify_in_c(answer))
    assert in_c.identified
    assert compare_refined(stages).equal


def test_a_reversal_against_a_moving_belt_is_where_the_speeds_are_equal() -> None:
    model = Model("block on a belt")
    x, w = model.sensor("x", "m", resolution=1e-4, reach=0.2), model.known("w", "m/s", 0.3)
    m, k, Fc = model.unknown("m", "kg", 1.0), model.unknown("k", "N/m", 30.0), model.unknown("Fc", "N", 2.0)
    model.equation(m * x.d(2) + k * x + Fc * sgn(x.d() - w))
    t = np.arange(2000) * 1e-3
    settings = refine_settings(
        refine_functions(model.compiled("belt")), {"x": 0.1 * np.sin(5.5 * t)}, 1e3, (1.0, 30.0, 2.0), 2.0
    )
    assert settings.width is not None and settings.fine_parts is not None
    assert abs(float(settings.width[0]) / (2 * 2.0 / 1.0 * settings.ratio * 1e-3 / settings.fine_parts) - 1) < 0.01


def test_a_configuration_that_the_core_refuses_is_named_with_its_value(
    coasted_through: tuple[Analysis, BothStages],
) -> None:
    _, stages = coasted_through
    narrow = replace(stages.settings, width=np.array([1e-12], np.float32))
    with pytest.raises(PvidError, match=r"bad bounds: width is 1e-12 and must be 1e-09 to 1e\+09"):
        replace(stages, settings=narrow).run()
    several = replace(stages.settings, first_block=200)
    with pytest.raises(PvidError, match=r"bad window \(pvid/status.h has its fields and their ranges\)"):
        replace(stages, settings=several).run()


def refused(model: Model) -> str:
    compiled = model.compiled("m")
    whole = GeneratedModel(compiled, "test")
    reason = whole.refinement.refusal
    assert reason is not None and files_of(whole)  # the other files are written without the second stage
    return reason


def test_what_has_no_second_stage_is_a_sentence() -> None:
    spring = Model("massless spring with friction")
    F, x = spring.input("F", "N", hold="zoh"), spring.sensor("x", "m", noise=1e-3)
    k, Fc = spring.unknown("k", "N/m", 1.0), spring.unknown("Fc", "N", 1.0)
    spring.equation(k * x + Fc * sgn(x.d()) - F)
    assert "equation 1 is not linear in x_1" in refused(spring)
    still = Model("spring")
    F, x, k = still.input("F", "N", hold="zoh"), still.sensor("x", "m", noise=1e-3), still.unknown("k", "N/m", 1.0)
    still.equation(k * x - F)
    assert "no equation has a derivative" in refused(still)
    tied = Model("two equations of one acceleration")
    F = tied.input("F", "N", hold="zoh")
    x, y = tied.sensor("x", "m", noise=1e-3), tied.sensor("y", "m", noise=1e-3)
    m, k = tied.unknown("m", "kg", 1.0), tied.unknown("k", "N/m", 1.0)
    tied.equation(m * x.d(2) + k * (x - y) - F)
    tied.equation(m * x.d(2) - k * y)
    assert "equations 1 and 2 do not determine x_2 and y" in refused(tied)
    assert "i depends on" in (GeneratedModel(motor_without_inductance(), "test").refinement.refusal or "")


def test_many_equations_that_are_solved_in_turn_are_no_coupled_ones() -> None:
    """A chain of four algebraic readings: each needs the one before."""
    model = Model("chain")
    F, x = model.input("F", "N", hold="zoh"), model.sensor("x", "m", noise=1e-3)
    m, g = model.unknown("m", "kg", 1.0), model.unknown("g", "", 1.5)
    model.equation(m * x.d(2) - F)
    before = x.d(2)
    for k in range(4):
        y = model.sensor(f"y{k}", "m/s^2", noise=1e-3)
        model.equation(y - g * before)
        before = y
    made = refine_functions(model.compiled("chain"))
    assert [one.name for one in made.parameters] == ["m", "g"] and made.moving == 1


def test_an_input_that_is_a_derivative_is_refused_in_a_sentence() -> None:
    model = Model("dead time by Pade")
    u, p = model.input("u", "", hold="zoh"), model.sensor("p", "rad/s", noise=1e-3)
    d, T, J = model.unmeasured("d", ""), model.unknown("T", "s", 0.01), model.unknown("J", "s^2", 0.1)
    model.equation(J * p.d() - d)
    model.equation(T * d.d() + d - u + T * u.d())
    compiled = model.compiled("pade")
    signals = {"u": np.zeros(100), "p": np.zeros(100)}
    with pytest.raises(PvidError, match="derivative of u"):
        refine_mechanism(compiled, signals, 100.0, np.array([0.01, 0.1]), 0.2)
