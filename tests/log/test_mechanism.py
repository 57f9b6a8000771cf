"""What a log takes from the description of its mechanism: names, units, and outputs with their standard errors."""

import io
import re

import field_board
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from logs import log_of
from rich.console import Console

from pvid.cli.main import commands
from pvid.core.native import Native
from pvid.link import frames as link
from pvid.link.names import Quantity
from pvid.log.history import History
from pvid.log.mechanism import LogMechanism, mechanism_described
from pvid.log.reader import LogStream, Record
from pvid.log.rig import mechanism_in
from pvid.log.status import StatusLine
from pvid.log.values import Values, tables_of
from pvid.model import Model
from pvid.models.mechanisms import compiled_of, described
from pvid.models.registry import names
from pvid.show.view import LiveView

lengths = st.floats(0.01, 10.0)


def pendulum(l1: float | None = 0.3) -> LogMechanism:
    return mechanism_described("kapitza", described("kapitza"), {} if l1 is None else {"l1": l1})


def p_of(g: float, l2: float, rho2: float, l1: float) -> dict[str, float]:
    """theory.md 1."""
    ratio = (l2 / rho2) ** 2
    return {"w": g / l1, "d1": 1 + ratio * (1 + l1 / l2), "d2": l1 / l2 * ratio}


@pytest.mark.parametrize("name", names())
def test_a_rig_of_every_mechanism_names_what_its_board_sends(name: str) -> None:
    compiled, found = compiled_of(name), mechanism_in({"model": {"name": name}})
    assert found is not None and found.name == name
    assert found.parameters == tuple((one.name, one.unit) for one in compiled.unknowns)
    assert found.samples == tuple((one.name, one.unit) for one in compiled.signals)
    required = any(one.required for one in compiled.knowns)
    assert [one.name for one in found.outputs] == [one.name for one in compiled.outputs if not required]


@given(g=st.floats(0.1, 100.0), l2=lengths, rho2=lengths, l1=lengths)
def test_outputs_are_those_of_the_closed_form(g: float, l2: float, rho2: float, l1: float) -> None:
    p = p_of(g, l2, rho2, l1)
    if p["d1"] - p["d2"] - 1 > 0:  # cancels: a few eps of the largest term
        lost = 8.0 * 2.2e-16 * (p["d1"] + p["d2"] + 1) / (l2 / rho2) ** 2
        found = pendulum(l1).outputs_at(p, np.zeros((3, 3)))
        np.testing.assert_allclose([value for value, _ in found.values()], [g, l2, rho2], rtol=lost + 1e-14)


def test_errors_of_outputs_are_those_of_central_differences() -> None:
    """With every entry of the covariance in play, in another order and beside a parameter that no output needs."""
    mechanism, p = pendulum(), p_of(9.5, 0.12, 0.08, 0.3)
    root = np.array([[0.3, 0.0, 0.0], [-0.02, 0.05, 0.0], [0.01, 0.04, 0.02]])
    h, none = 1e-5, np.zeros((3, 3))

    def at(**moved: float) -> np.ndarray:
        return np.array([value for value, _ in mechanism.outputs_at({**p, **moved}, none).values()])

    slope = np.stack([(at(**{k: x + h}) - at(**{k: x - h})) / (2 * h) for k, x in p.items()], 1)
    covariance = root @ root.T
    expected = np.sqrt(np.diag(slope @ covariance @ slope.T))
    turned = {"c": 0.1, **dict(reversed(p.items()))}
    for values, of_p in ((p, covariance), (turned, np.pad(covariance[::-1, ::-1], ((1, 0), (1, 0))))):
        # h^2 of the third derivative, eps / h of rounding, both near 1e-10
        np.testing.assert_allclose([se for _, se in mechanism.outputs_at(values, of_p).values()], expected, rtol=1e-8)


@pytest.mark.parametrize("p", [(-1.0, 9.0, 5.0), (30.0, 9.0, -1.0), (30.0, 6.0, 5.0), (30.0, 5.0, 5.0)])
def test_outside_the_physical_region_no_output_is_claimed(p: tuple[float, float, float]) -> None:
    assert pendulum().outputs_at(dict(zip(("w", "d1", "d2"), p, strict=True)), np.eye(3)) == {}


def test_without_a_constant_or_a_parameter_no_output_is_claimed() -> None:
    assert pendulum(None).outputs == () and pendulum(None).outputs_at(p_of(9.5, 0.12, 0.08, 0.3), np.eye(3)) == {}
    assert pendulum().outputs_at({"w": 30.0, "d1": 9.0}, np.eye(2)) == {}


def test_former_keys_and_wrong_values_of_constants() -> None:
    for document, value in (({"l1": 0.25}, 0.25), ({"model": {"name": "kapitza"}, "known": {"l1": 0.5}}, 0.5)):
        found = mechanism_in(document)
        assert found is not None and found.known == {"l1": value} and len(found.outputs) == 3
    for wrong in ("long", 10**400, float("nan")):
        lacking = mechanism_in({"model": {"name": "kapitza"}, "known": {"l1": wrong}})
        assert lacking is not None and not lacking.outputs
    assert mechanism_in({"model": {"name": "motor.py"}}) is None and mechanism_in({}) is None


# ---- a mechanism of the user's own goes through everything that names and tabulates parameters


def winding() -> LogMechanism:
    """R and L of a winding from a = R/L and b = 1/L."""
    model = Model("winding of a motor")
    v, i = model.input("v", "V", hold="zoh"), model.sensor("i", "A", resolution=1e-3)
    a, b = model.unknown("a", "1/s", 20.0), model.unknown("b", "1/H", 5.0)
    i0 = model.unknown("i0", "A", 0.0, positive=False, sd=0.1)
    model.equation(i.d() + a * (i - i0) - b * v)
    model.output("res", "ohm", a / b)
    model.output("ind", "H", 1 / b)
    return mechanism_described("winding", model.compiled("winding"), {})


@pytest.fixture(scope="module")
def stream() -> LogStream:
    return LogStream()


@pytest.fixture(scope="module")
def records(native: Native, stream: LogStream, tmp_path_factory: pytest.TempPathFactory) -> list[Record]:
    """Of the log of a board that names its samples in another order."""
    names = link.Names(b"winding\nsample i A\nsample v V\np a 1/s\np b 1/H\np i0 A\np more")
    sent = field_board.messages(field_board.Field(4000))
    named = [(tick, names if isinstance(message, link.Names) else message) for tick, message in sent]
    path = tmp_path_factory.mktemp("log") / "a.pvlog"
    log_of(path, b"".join(field_board.frames(named)), why=None)
    return list(stream.feed(path.read_bytes()))


def test_tables_have_the_names_and_outputs_of_a_described_mechanism(records: list[Record]) -> None:
    mechanism = winding()
    values, tables = Values(mechanism), tables_of(mechanism)
    assert list(tables["samples"])[-2:] == ["v", "i"] and tables["estimates"]["ind"].unit == "H"
    rows = [rows for record in records for rows in values.rows(record)]
    last = {name: column[-1] for name, column in [one for one in rows if one.table == "estimates"][-1].columns.items()}
    assert set(last) == set(tables["estimates"])
    assert last["res"] == last["a"] / last["b"] and last["ind_se"] == pytest.approx(last["b_se"] / last["b"] ** 2)
    assert set(next(one.columns for one in rows if one.table == "samples").keys()) == set(tables["samples"])


def test_views_have_the_names_and_outputs_of_a_described_mechanism(records: list[Record], stream: LogStream) -> None:
    console, mechanism = Console(record=True, width=100), winding()
    history, view = History(mechanism), LiveView(console, "title", mechanism)
    line = StatusLine(io.StringIO(), mechanism)
    for record in records:
        history.take(record)
        view.take(record, stream.account)
        line.take(record, stream.account)
    assert set(history.newest) >= {"res", "res_se", "a", "i0_se"} and history.is_physical
    assert history.mechanism.answers[:2] == (Quantity("res", "ohm"), Quantity("ind", "H"))
    console.print(view.panel(stream.account, 1.0))
    seen = console.export_text()
    assert re.search(r"res +[\d.]+ +± [\d.]+ ohm +[\d.]+ %", seen) and " mA (" in seen
    assert re.search(r"tick \d+: a [\d.]+ 1/s, b [\d.]+ 1/H, i0 [\d.]+ A, ", line.line(stream.account, 1.0))


def test_the_command_lists_every_mechanism_with_its_quantities() -> None:
    listed = CliRunner().invoke(commands, ["models"], standalone_mode=False)
    assert listed.return_value == 0
    for name in names():
        one = described(name)
        for some in (one.signals, one.knowns, one.unknowns, one.outputs):
            assert all(re.search(rf" {name} .* {quantity.name} ", listed.output, re.S) for quantity in some)
