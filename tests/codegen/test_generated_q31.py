"""Generated fixed point: the values of the expressions within the rounding of their formats, in C and its twin."""

import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import sympy as sp
from described import MOTOR
from generated import MODELS, VECTORS, Generated, exactly, functions_by_name, vectors
from generated import SCALED as SCALED_TYPE
from rounding import SCALED, bounds_of, fixed_bounds_of

from pvid.base.errors import PvidError
from pvid.codegen.c_functions import scaled_literal
from pvid.codegen.fixed_model import FixedModel, Reaches, fixed_model, reaches_of
from pvid.codegen.formats import bits_of, fixed
from pvid.codegen.formats import bounds_of as interval_bounds_of
from pvid.codegen.functions import functions_of
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.self_test import scaled_of
from pvid.core.sources import FIRMWARE, INCLUDES
from pvid.model.operations import evaluated, program_of
from pvid.twin.printer.program import loaded

PRINTED = 200  # vectors of the twin


@pytest.fixture(scope="module", params=MODELS)
def model(request: pytest.FixtureRequest) -> FixedModel:
    return fixed_model(functions_by_name(request.param))


def inputs(model: FixedModel, beyond: bool = False) -> npt.NDArray[np.int32]:
    """Random integers within the limits [inputs, VECTORS]; every second vector has one beyond its limit."""
    random = np.random.default_rng(31)
    limits = np.array(model.limits)[:, None]
    drawn = random.integers(-limits, limits + 1, (len(limits), VECTORS))
    drawn[:, :2] = np.hstack([limits, -limits])
    if beyond:
        places = random.integers(0, len(limits), VECTORS // 2)
        drawn[places, np.arange(0, VECTORS, 2)] = limits[places, 0] + 1
    return drawn.astype(np.int32)


def test_values_are_those_of_the_expressions_within_rounding(model: FixedModel, tmp_path: Path) -> None:
    """Some of the vectors have the integers of the printed twin; inputs beyond their limits are refused."""
    functions = model.functions
    generated = Generated(functions, tmp_path)
    twin = loaded(generated.files[f"{functions.name}_twin.py"], "twin")
    given, wild, fits = inputs(model), inputs(model, beyond=True), np.zeros(VECTORS, np.uint8)
    values = given * 2.0 ** -np.array(model.input_bits, np.float64)[:, None]
    for one in model.of_inputs:
        called = getattr(twin, f"{functions.name}_{one.function.name}_q31")
        outside = generated.run("every_fixed", one.function, "q31", wild, fits)
        assert fits.mean() == 0.5
        for vector, row, within in zip(wild.T[:PRINTED].tolist(), outside.T, fits, strict=False):
            out = [0] * len(row)
            assert called(vector, out) == within and (out == row.tolist() or not within)
        found = generated.run("every_fixed", one.function, "q31", given, fits)
        assert fits.all()
        bounds = fixed_bounds_of(one.made, values)
        right = exactly(functions, one.function, values)
        for label, integer, bits, wanted, bound in zip(
            one.function.labels, found, one.made.result_bits, right, bounds, strict=True
        ):
            assert (np.abs(integer * 2.0**-bits - wanted) <= bound).all(), label
    pairs = scaled_of(vectors(functions, functions.theta))
    given_p = np.empty(pairs.shape[:-1], SCALED_TYPE)
    given_p["m"], given_p["e"] = pairs[..., 0], pairs[..., 1]
    exact_p = np.ldexp(given_p["m"].astype(np.float64), given_p["e"])
    for function in model.of_parameters:
        found = generated.run("every_scaled", function, "q31", given_p)
        bounds = bounds_of(function.program, exact_p, SCALED)
        right = exactly(functions, function, exact_p)
        for label, number, wanted, bound in zip(function.labels, found, right, bounds, strict=True):
            value = np.ldexp(number["m"].astype(np.float64), number["e"])
            assert (np.abs(value - wanted) <= bound).all(), label
            assert np.median(bound / np.maximum(np.abs(wanted), 1e-30)) < 1e-6, label
        for vector, row in zip(given_p.T[:PRINTED].tolist(), found.T.tolist(), strict=False):
            results = [twin.pvid_scaled_q31() for _ in row]
            called = getattr(twin, f"{functions.name}_{function.name}_q31")
            called([twin.pvid_scaled_q31(*one) for one in vector], results)
            assert [(one.m, one.e) for one in results] == row, function.name


def test_no_value_leaves_its_bounds(model: FixedModel) -> None:
    """Every value of the list, not the results alone: with the extremes of the inputs among them."""
    program = model.of_inputs[-1].made.program
    whole = program.__class__(program.arguments, program.values, tuple(range(len(program.values))))
    bounds = interval_bounds_of(whole, [(-one, one) for one in model.reaches], "test")
    random = np.random.default_rng(7)
    reach = np.array(model.reaches)[:, None]
    given = random.uniform(-reach, reach, (len(reach), 2000))
    given[:, :200] = np.sign(given[:, :200]) * reach
    for values, (low, high) in zip(evaluated(whole, given), bounds, strict=True):
        assert low <= np.min(values) and np.max(values) <= high


def test_objects_hold_no_floating_point(tmp_path: Path) -> None:
    """On a soft-float core every operation on floats would be a call."""
    generated = Generated(functions_by_name("two_link_arm"), tmp_path)
    assert "two_link_arm_q31.c" in generated.files
    for name in ("two_link_arm_q31.c", "two_link_arm_q31.h"):
        assert "float" not in generated.files[name] and "double" not in generated.files[name]
    target = tmp_path / "q31.o"
    freestanding = FIRMWARE / "ports" / "freestanding" / "include"
    options = ["-mcpu=cortex-m0", "-mthumb", "-std=c99", "-O2", "-ffreestanding", f"-I{freestanding}", *INCLUDES]
    code = str(tmp_path / "two_link_arm_q31.c")
    subprocess.run(["arm-none-eabi-gcc", *options, f"-I{tmp_path}", "-c", code, "-o", str(target)], check=True)
    listing = ["arm-none-eabi-nm", "--undefined-only", str(target)]
    called = subprocess.run(listing, capture_output=True, text=True, check=True).stdout.split()
    assert "pvid_sin_q31" in called
    assert not [name for name in called if name.startswith(("__aeabi_f", "__aeabi_d", "__aeabi_i2", "__aeabi_l2"))]


def test_formats_have_one_spare_bit() -> None:
    assert bits_of((-1.0, 1.0)) == 30 and bits_of((0.0, 1.001)) == 29 and bits_of((-0.5, 0.2)) == 31
    assert bits_of((0.0, 0.0)) == 30 and bits_of((0.0, 1000.0)) == 20


def test_a_square_is_not_negative_and_a_sine_at_most_its_range() -> None:
    x, y = sp.symbols("x y", real=True)
    program = program_of([x, y], [1 / (1 + x**2), sp.cos(y), sp.sin(y), x * y, abs(x)])
    bounds = interval_bounds_of(program, [(-3.0, 2.0), (-0.1, 0.2)], "test")
    low, high = zip(*(bounds[k] for k in program.results), strict=True)
    assert low == pytest.approx((0.1, np.cos(0.2), np.sin(-0.1), -0.6, 0.0), rel=1e-9)
    assert high == pytest.approx((1.0, 1.0, np.sin(0.2), 0.4, 3.0), rel=1e-9)


def test_a_divisor_that_may_be_0_is_refused() -> None:
    x, y = sp.symbols("x y", real=True)
    with pytest.raises(PvidError, match=r"here: a divisor lies in -1\.\.3 and may be 0"):
        fixed(program_of([x, y], [y / (1 + x)]), [(-2.0, 2.0), (-1.0, 1.0)], "here")
    fixed(program_of([x, y], [y / (3 + x)]), [(-2.0, 2.0), (-1.0, 1.0)], "here")
    with pytest.raises(PvidError, match="a square root has no fixed-point form"):
        fixed(program_of([x], [sp.sqrt(x)]), [(1.0, 2.0)], "here")


def test_reaches_follow_from_the_description_or_are_given() -> None:
    functions = functions_of(MOTOR)
    names = [one.name for one in functions.inputs]
    plain = dict(zip(names, reaches_of(functions, Reaches(bandwidth_hz=5.0)), strict=True))
    assert plain["i"] == 5 and plain["phi_1"] == pytest.approx(100 * 2 * np.pi * 5)
    given = dict(zip(names, reaches_of(functions, Reaches(of={"phi_1": 40.0})), strict=True))
    assert given["phi_1"] == 40
    with pytest.raises(PvidError, match="motor has no input speed: its inputs are V, i, phi, phi_1"):
        reaches_of(functions, Reaches(of={"speed": 1.0}))
    # no reach of the motor allows a divisor of 0
    assert GeneratedModel(functions.model, "test").fixed.refusal is None


def test_integrals_reach_what_their_integrands_and_time_allow() -> None:
    functions = functions_by_name("chain")
    names = [one.name for one in functions.inputs]
    found = dict(zip(names, reaches_of(functions, Reaches(window_s=3.0)), strict=True))
    assert found["t"] == 3 and sorted(found[f"integral_{k}"] for k in (0, 1)) == pytest.approx([0.5 * 4.5, 4.5])


@pytest.mark.parametrize("value", [1.0, 0.5, 1 / 3, -7.25e-9, 1e20, 0.0])
def test_literals_have_thirty_digits(value: float) -> None:
    m, e = scaled_literal(Fraction(value))
    assert m == 0 if value == 0 else 2**29 <= abs(m) < 2**30
    assert m * 2.0**e == pytest.approx(value, rel=2.0**-30)
