"""Facts of every mechanism: names, units, and the map from p to physical parameters against its numerical inverse and
gradient; and the pendulum's own against closed forms."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from pvid.cli.main import commands
from pvid.models.kapitza.physical import linear, physical
from pvid.models.model import Mechanism, Model
from pvid.models.registry import DEFAULT, MODELS

Float = npt.NDArray[np.float64]

every_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
# a product of units with whole powers
UNIT = re.compile(r"(1|[A-Za-z]+(\^\d)?)([ /][A-Za-z]+(\^\d)?)*")
lengths = st.floats(0.01, 10.0)


@every_model
def test_names_are_unique_words(model: Model) -> None:
    channels, constants = ([one.name for one in some] for some in (model.channels, model.constants))
    names = [*channels, *constants, *model.p_names, *model.physical_names]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[a-z][a-z0-9_]*", name) for name in (model.name, *names))


@every_model
def test_every_quantity_has_a_meaning_and_a_unit(model: Model) -> None:
    for one in (*model.channels, *model.constants, *model.parameters, *model.physical):
        assert one.meaning
        assert one.unit == "" or UNIT.fullmatch(one.unit), one
    assert all(one.unit for one in (*model.channels, *model.constants))


@every_model
def test_parameters_are_mapped_then_offset_then_nuisance(model: Model) -> None:
    order = ["mapped", "offset", "nuisance"]
    roles = [order.index(one.role) for one in model.parameters]
    assert roles == sorted(roles) and roles.count(0) == model.n_mapped > 0 and roles.count(1) <= 1
    assert [one.name for one in model.answers] == [*model.physical_names, *(one.name for one in model.published)]


@every_model
@given(data=st.data())
def test_the_physical_map_is_undone_by_its_inverse(model: Model, data: st.DataObject) -> None:
    mechanism, values = _any_rig(model, data)
    p = mechanism.mapped(values)
    found = mechanism.physical(np.stack([p, p]))
    # eps, times what cancels between the mapped parameters
    np.testing.assert_allclose(found, [values, values], rtol=1e-15 * _cancelled(mechanism, p) + 1e-13)


@every_model
@given(data=st.data())
def test_the_gradient_is_the_one_by_central_differences(model: Model, data: st.DataObject) -> None:
    mechanism, values = _any_rig(model, data)
    assert mechanism.constants is not None
    p = mechanism.mapped(values)
    h = 1e-5 / _cancelled(mechanism, p)
    told = model.gradient_of(p, mechanism.constants)
    for i, step in enumerate(np.diag(h * p)):
        moved = (mechanism.physical(p + step) - mechanism.physical(p - step)) / (2 * step[i])
        # h^2 of the third derivative, eps / h of rounding
        np.testing.assert_allclose(told[:, i] * p[i], moved * p[i], rtol=1e-5, atol=1e-5 * np.abs(told * p).max())


def _any_rig(model: Model, data: st.DataObject) -> tuple[Mechanism, Float]:
    """A mechanism, and physical parameters of a rig."""
    sizes = st.floats(0.1, 5.0)
    constants = {one.name: data.draw(sizes, one.name) for one in model.constants}
    return Mechanism(model, constants), np.array([data.draw(sizes, name) for name in model.physical_names])


def _cancelled(mechanism: Mechanism, p: Float) -> float:
    """How much larger a relative error of p can be in the physical parameters, at least 1."""
    assert mechanism.constants is not None
    gradient = mechanism.model.gradient_of(p, mechanism.constants)
    return max(1.0, float(np.abs(gradient * p / mechanism.physical(p)[:, None]).max()))


@every_model
def test_without_constants_nothing_physical_is_claimed(model: Model) -> None:
    p = np.ones((2, model.n_mapped))
    unknown = Mechanism(model)
    assert np.isnan(unknown.physical(p)).all() and unknown.physical(p).shape == (2, len(model.physical))
    assert np.isnan(unknown.physical_errors(p, np.stack([np.eye(model.n_mapped)] * 2))).all()


# ---- the pendulum (theory.md 1)


def test_linear_parameters_of_the_standard_rig() -> None:
    """theory.md 6 states them."""
    p = linear(9.5, 0.12, 0.08, 0.3)
    np.testing.assert_allclose(p, [9.5 / 0.3, 8.875, 5.625], rtol=1e-15)


@given(g=st.floats(0.1, 100.0), l2=lengths, rho2=lengths, l1=lengths)
def test_physical_undoes_linear(g: float, l2: float, rho2: float, l1: float) -> None:
    p = linear(g, l2, rho2, l1)
    big_l2 = p[1] - p[2] - 1.0
    # L2 = d1 - d2 - 1 cancels: a few eps of the largest term, relative to L2.
    lost = 8.0 * 2.2e-16 * (p[1] + p[2] + 1.0) / (l2 / rho2) ** 2
    if big_l2 > 0.0:
        np.testing.assert_allclose(physical(p, l1), [g, l2, rho2], rtol=lost + 1e-14)


@pytest.mark.parametrize("p", [(-1.0, 9.0, 5.0), (30.0, 9.0, -1.0), (30.0, 6.0, 5.0), (30.0, 5.0, 5.0)])
def test_outside_the_physical_region_nothing_is_claimed(p: tuple[float, float, float]) -> None:
    assert np.isnan(physical(p, 0.3)).all()


def test_errors_of_the_physical_parameters_by_the_delta_method() -> None:
    """Against the gradient by central differences and a covariance with every entry in play."""
    truth, mechanism = linear(9.5, 0.12, 0.08, 0.3), Mechanism(MODELS[DEFAULT], {"l1": 0.3})
    root = np.array([[0.3, 0.0, 0.0], [-0.02, 0.05, 0.0], [0.01, 0.04, 0.02]])
    covariance = root @ root.T
    h = 1e-5
    gradient = np.empty((3, 3))
    for i in range(3):
        step = np.zeros(3)
        step[i] = h
        gradient[:, i] = (physical(truth + step, 0.3) - physical(truth - step, 0.3)) / (2.0 * h)
    expected = np.sqrt(np.diag(gradient @ covariance @ gradient.T))
    # Central differences: h^2 of the third derivative, eps / h of rounding, both near 1e-10.
    np.testing.assert_allclose(mechanism.physical_errors(truth, covariance), expected, rtol=1e-8)
    wider = np.pad(covariance, (0, 1))  # with the offset, which is not read
    np.testing.assert_array_equal(
        mechanism.physical_errors([*truth, 0.1], wider), mechanism.physical_errors(truth, covariance)
    )


def test_the_command_lists_every_model_with_its_quantities() -> None:
    listed = CliRunner().invoke(commands, ["models"], standalone_mode=False)
    assert listed.return_value == 0
    for model in MODELS.values():
        for name in (model.name, *model.p_names, *model.physical_names):
            assert f" {name} " in listed.output
