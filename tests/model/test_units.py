"""Units of terms are checked; only coherent units of SI are accepted."""

import pytest
import sympy as sp
from sympy.physics import units as si

from pvid.base.errors import PvidError
from pvid.base.units import BASE, unit_of
from pvid.model import Model, cos, sin
from pvid.model.refusal import ModelError
from pvid.model.units import dimension_of_unit

FINE = 1e-4


@pytest.mark.parametrize(
    ("one", "other"),
    [("N*m/A", "V*s"), ("ohm*s", "H"), ("", "rad"), ("kg*m^2/s^2", "N*m"), ("1/s^2", "rad/s^2"), ("A*s", "C")],
)
def test_equal_units_are_equal(one: str, other: str) -> None:
    assert dimension_of_unit(one) == dimension_of_unit(other)


@pytest.mark.parametrize(
    ("unit", "said"),
    [
        ("mm", '"mm" is 0.001 m: equations are in SI, use "m"'),
        ("deg", '"deg" is 0.0174533 rad: equations are in SI, use "rad"'),
        ("A*h", '"A*h" is 3600 C: equations are in SI, use "C"'),
        ("furlong", "no unit"),
        ("N*", "no unit"),
        ("import", "no unit"),
        ("m**-", "no unit"),
        ("2*m", "no unit"),
        ("rev/s", 'use "1/s"'),
        ("kilo", "no unit"),
    ],
)
def test_other_units_are_refused_with_what_to_use(unit: str, said: str) -> None:
    with pytest.raises(PvidError) as caught:
        Model("units").sensor("x", unit, resolution=FINE)
    text = str(caught.value)
    assert "test_units.py, line" in text
    assert said in text


def motor(wrong: str) -> None:
    model = Model("motor")
    v = model.input("V", "V", hold="zoh")
    i, phi = (model.sensor(name, unit, resolution=FINE) for name, unit in (("i", "A"), ("phi", "rad")))
    r, inductance, k = (model.unknown(name, unit, 1.0) for name, unit in (("R", "ohm"), ("L", "H"), ("k", "N*m/A")))
    terms = {
        "back EMF": k * phi,
        "number": k * phi.d() + 3,
        "sine": k * sin(inductance) * phi.d(),
        "right": k * phi.d(),
    }
    model.equation(inductance * i.d() + r * i + terms[wrong] - v)


def test_a_wrong_term_is_named_with_both_units_and_the_line() -> None:
    with pytest.raises(PvidError) as caught:
        motor("back EMF")
    assert str(caught.value).endswith("equation 1: the term k*phi has the unit V*s, but V, which is added to it, has V")
    assert "test_units.py, line" in str(caught.value)


def test_a_bare_number_among_volts_is_refused() -> None:
    with pytest.raises(PvidError, match="the term 3 has the unit 1"):
        motor("number")


def test_the_argument_of_a_sine_must_be_a_number() -> None:
    with pytest.raises(PvidError, match=r"L inside sin\(L\) has the unit H"):
        motor("sine")
    motor("right")


def test_units_of_outputs_and_of_a_lagrangian_are_checked() -> None:
    model = Model("outputs")
    q, u = model.sensor("q", "rad", resolution=FINE), model.input("u", "N*m", hold="zoh")
    j, g = model.unknown("J", "kg*m^2", 1.0), model.unknown("G", "N*m", 1.0)
    with pytest.raises(PvidError, match=r"the output w has the unit 1/s\^2, not 1/s"):
        model.output("w", "1/s", g / j)
    with pytest.raises(PvidError, match="the Lagrangian: the term"):
        model.lagrange(j * q.d() ** 2 / 2 + j * cos(q), [q], [u])
    model.output("w", "rad/s", (g / j) ** 0.5)
    model.lagrange(j * q.d() ** 2 / 2 + g * cos(q), [q], [u])
    assert len(model.compiled().rows) == 1


SYMPY = {"min": "minute", "h": "hour", "in": "inch", "lb": "pound", "L": "liter"}


@pytest.mark.parametrize("name", [*BASE[:-1], *"g N J W V Pa Hz C ohm F H Wb T S bar psi ft min h in lb L".split()])
def test_units_are_those_of_sympy(name: str) -> None:
    base = (si.kilogram, si.meter, si.second, si.ampere, si.kelvin, si.mole, si.candela)
    unit = unit_of(name)
    assert unit is not None
    of_sympy = si.convert_to(getattr(si, SYMPY.get(name, name)), base)
    ours = sp.prod([one**power for one, power in zip(base, unit.dimension, strict=False)])
    assert float(of_sympy / ours) == pytest.approx(float(unit.scale), rel=1e-6)  # psi in six digits


@pytest.mark.parametrize("text", ["m*/s", "*/", "m**/s", "m*", "/s", "m//s"])
def test_a_unit_does_not_end_a_comment_of_c(text: str) -> None:
    with pytest.raises(PvidError, match="no unit"):
        dimension_of_unit(text)


def test_powers_are_fractions_too() -> None:
    assert dimension_of_unit("m^0.5/s^1.5") == dimension_of_unit("m^(1/2)/s^(3/2)") != dimension_of_unit("m^0/s^1")
    with pytest.raises(ModelError, match=r'equations are in SI, use "m\^\(1/2\)\*s\^-1"'):
        dimension_of_unit("cm^0.5/s")
    assert dimension_of_unit("m^(5/2)/s") * dimension_of_unit("1/m^(1/2)") == dimension_of_unit("m^2/s")
    assert dimension_of_unit("V/(A^2*s)") == dimension_of_unit("V/A^2/s") == dimension_of_unit("V A^-2 s^-1")
    assert dimension_of_unit("V/(A*s)^2") == dimension_of_unit("V/(A^2*s^2)") == dimension_of_unit("V/A^2/s^2")
    assert dimension_of_unit("kg*(m/s)^2") == dimension_of_unit("J") == dimension_of_unit("((N))*m")


@pytest.mark.parametrize("text", ["10", "2*m", "(m", "m)", "()", "m^", "m^(1/0)", "(m)(s)"])
def test_what_is_no_product_of_powers_is_no_unit(text: str) -> None:
    with pytest.raises(PvidError, match="no unit"):
        dimension_of_unit(text)


def test_a_number_in_place_of_a_constant_is_named_as_the_cause() -> None:
    model = Model("oscillator")
    x, k = model.sensor("x", "m", resolution=1e-4), model.unknown("k", "N/m", 1.0)
    with pytest.raises(PvidError, match=r"a number has no unit: a constant that has one is a model\.known"):
        model.equation(2.5e-4 * x.d(2) + k * x)
