"""What the rows determine is said in closed form, whatever the drive."""

import pytest
from mechanisms_to_refuse import arm, cart, cell, free_pendulum, motor, squares, two_sensors, two_sums

from pvid.model import Model
from pvid.model.identifiability import Identifiability, identifiable
from pvid.model.report import check_report, verdict
from pvid.models.mechanisms import compiled_of, names


def judged(model: Model) -> Identifiability:
    return identifiable(model.compiled())


@pytest.mark.parametrize("name", names())
def test_every_shipped_mechanism_is_identifiable(name: str) -> None:
    found = identifiable(compiled_of(name))
    assert found.identifiable
    assert found.unidentifiable == ()
    assert all(one.excluded for one in found.symmetries)


def test_an_unknown_mass_at_the_elbow_shifts_three_base_parameters() -> None:
    found = judged(arm(elbow_known=False))
    assert (found.rank, found.unknowns) == (4, 5)
    (shift,) = found.shifts
    assert set(shift.unknowns) == {"I1", "h1", "m2"}
    assert shift.kind == "sum"
    assert "only I1 + m2*l1², h1 + l1*m2 can be identified" in verdict(found).replace("l1²*m2", "m2*l1²")
    assert judged(arm(elbow_known=True)).identifiable
    first, _ = arm(elbow_known=False).compiled().rows
    assert {str(one) for one in first.theta} == {"I2", "h2", "h1 + l1*m2", "I1 + I2 + l1**2*m2"}


def test_a_motor_without_current_sensor_has_its_torque_constant_and_products_only() -> None:
    found = judged(motor(current=False))
    assert (found.rank, found.unknowns) == (5, 6)
    (shift,) = found.shifts
    assert set(shift.unknowns) == {"R", "L", "J", "b", "Tc"}
    assert shift.kind == "product"
    assert len(shift.combinations) == 4
    assert "declare one of them as known, or add a sensor for i." in verdict(found)
    assert judged(motor(current=True)).identifiable


def test_two_frictions_that_add_up_are_named_as_their_sum() -> None:
    found = judged(two_sums())
    assert "b1 and D: only b1 + D can be identified" in verdict(found)
    assert found.symmetries == ()


def test_without_a_known_force_only_ratios_are_identifiable() -> None:
    found = judged(free_pendulum())
    assert (found.rank, found.unknowns) == (2, 3)
    (shift,) = found.shifts
    assert shift.kind == "product"
    assert {str(one) for one in shift.combinations} == {"J/G", "b/G"}
    assert "nothing known fixes their scale" in verdict(found)


def test_sin_squared_plus_cos_squared_is_one() -> None:
    found = judged(squares())
    assert (found.rank, found.unknowns) == (2, 3)
    assert len(squares().compiled().rows[0].theta) == 2
    assert {str(one) for one in found.shifts[0].combinations} == {"a + c", "b + c"}


def test_a_relation_between_rows_is_found() -> None:
    """d theta / d p has full rank, but along solutions y' is k x'."""
    found = judged(two_sensors())
    assert (found.rank, found.unknowns) == (3, 4)
    assert set(found.unidentifiable) == {"b1", "b2"}
    assert "b1 and b2 can change together" in verdict(found)


def test_a_cart_without_sensor_is_identifiable() -> None:
    assert judged(cart(hidden="x")).identifiable


def test_rc_pairs_may_swap_unless_ranges_exclude_it() -> None:
    (swap,) = judged(cell(ranges=False)).symmetries
    assert set(swap.swapped) == {("R1", "R2"), ("T1", "T2")}
    assert not swap.excluded
    assert "exchanges R1 with R2 and T1 with T2: give ranges" in check_report(cell(ranges=False).compiled())
    (excluded,) = judged(cell(ranges=True)).symmetries
    assert excluded.excluded


def test_an_unknown_that_enters_squared_has_two_signs() -> None:
    model = Model("square")
    x, u = model.sensor("x", "m", resolution=1e-4), model.input("u", "1/s^2", hold="zoh")
    c = model.unknown("c", "m", 1.0, positive=False)
    w = model.unknown("w", "1/s^2", 1.0)
    model.equation(c**2 * x.d(2) + c**2 * w * x - u * model.known("a", "m^3", 1.0))
    (flip,) = judged(model).symmetries
    assert flip.negated == ("c",)
    assert "opposite sign of c" in verdict(judged(model))


@pytest.mark.parametrize("name", names())
def test_the_report_names_every_theta_unknown_and_signal(name: str) -> None:
    compiled = compiled_of(name)
    text = check_report(compiled)
    assert text.startswith(f"{name}: ")
    assert "Identifiable: all" in text
    named = [one.name for one in compiled.signals] + list(compiled.p_names) + [one.name for one in compiled.knowns]
    assert all(name in text for name in named)
    assert max(len(line) for line in text.splitlines()) < 170


def test_the_report_of_a_row_reads_as_mathematics() -> None:
    text = check_report(compiled_of("cart_pendulum"))
    assert "ml*cos(c)   D[x'*cos(a)] + g*sin(a) + a'*x'*sin(a)" in text
    assert "equation of a: no term is free of unknowns; another row fixes the scale." in text
    assert "i has a corner at every step of V" in check_report(compiled_of("dc_motor"))
