"""A second mechanism, defined here alone, goes through everything that names, labels and tabulates parameters."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator

import field_board
import numpy as np
import numpy.typing as npt
import pytest
from rich.console import Console

from pvid.core.native import Native
from pvid.link import frames as link
from pvid.log.file import LogWriter
from pvid.log.history import History
from pvid.log.reader import LogStream, Record
from pvid.log.status import StatusLine
from pvid.log.values import Values, tables_of
from pvid.models.model import Channel, Constant, Constants, Float, Mechanism, Model, Parameter, Quantity, Scale
from pvid.show.models_table import models_table
from pvid.show.view import LiveView


def _physical(p: npt.ArrayLike, _: Constants) -> Float:
    a, b = np.moveaxis(np.asarray(p, np.float64), -1, 0)
    return np.stack([a / b, 1 / b], -1)


def _gradient(p: npt.ArrayLike, _: Constants) -> Float:
    a, b = np.moveaxis(np.asarray(p, np.float64), -1, 0)
    return np.stack([np.stack([1 / b, -a / b**2], -1), np.stack([0 * b, -1 / b**2], -1)], -2)


# R and L of a winding from a = R/L and b = 1/L; one constant that they do not need.
MOTOR = Model(
    name="toy_motor",
    title="winding of a motor",
    channels=(
        Channel("i", "A", "current", short="current", shown_in=("mA", 1e3)),
        Channel("v", "V", "voltage", short="voltage"),
    ),
    constants=(Constant("k", "V s", "torque constant"),),
    parameters=(
        Parameter("a", "1/s", "R/L"),
        Parameter("b", "1/H", "1/L"),
        Parameter("i0", "A", "offset of the current", role="offset"),
    ),
    physical=(Quantity("res", "ohm", "resistance", symbol="R"), Quantity("ind", "H", "inductance", symbol="L")),
    physical_of=_physical,
    gradient_of=_gradient,
    mapped_of=lambda of, _: np.array([np.asarray(of)[0], 1.0]) / np.asarray(of)[1],
    is_plausible=lambda p: bool((p > 0).all()),
    scales=(Scale("v_gain", "v_gain_sd", "the gain of v", (0.0, -1.0), (0.0, 0.0)),),
)
MECHANISM = Mechanism(MOTOR, {"k": 0.1})


@pytest.fixture(scope="module")
def stream() -> LogStream:
    return LogStream()


@pytest.fixture(scope="module")
def records(native: Native, stream: LogStream, tmp_path_factory: pytest.TempPathFactory) -> list[Record]:
    """Of the log of a board, whose frames carry numbers and no names."""
    path = tmp_path_factory.mktemp("log") / "a.pvlog"
    writer = LogWriter(path)
    writer.begin("a port", None)
    writer.take(b"".join(field_board.frames(field_board.messages(field_board.Field(4000)))))
    writer.close()
    return list(stream.feed(path.read_bytes()))


def columns(records: list[Record], table: str) -> Iterator[dict[str, float]]:
    values = Values(MECHANISM)
    for record in records:
        for rows in values.rows(record):
            if rows.table == table:
                yield {name: column[-1] for name, column in rows.columns.items()}


def test_the_values_of_a_log_have_the_columns_of_the_model(records: list[Record]) -> None:
    tables = tables_of(MOTOR)
    assert list(tables["samples"])[-2:] == ["i", "v"]
    assert tables["samples"]["i"].unit == "A" and tables["estimates"]["ind"].unit == "H"
    assert not {"w", "g", "phi"} & {name for table in tables.values() for name in table}
    estimate = [record.item for record in records if isinstance(record.item, link.Estimate)][-1]
    last = list(columns(records, "estimates"))[-1]
    assert set(last) == set(tables["estimates"])
    assert (last["a"], last["b"], last["i0"]) == estimate.p[:3]
    assert last["res"] == estimate.p[0] / estimate.p[1] and last["res_se"] > 0
    assert set(next(columns(records, "samples"))) == set(tables["samples"])


def test_the_views_of_a_log_have_the_names_of_the_model(records: list[Record], stream: LogStream) -> None:
    console = Console(record=True, width=100)
    history, view = History(MECHANISM), LiveView(console, "title", MECHANISM)
    line = StatusLine(io.StringIO(), MOTOR)
    for record in records:
        history.take(record)
        view.take(record, stream.account)
        line.take(record, stream.account)
    assert set(history.newest) >= {"res", "res_se", "a", "i0_se"} and history.is_physical
    console.print(view.panel(stream.account, 1.0))
    seen = console.export_text()
    for word in ("resistance", "inductance", "R/L", "offset of the current", " mA, voltage "):
        assert word in seen
    assert re.search(r"tick \d+: a [\d.]+ 1/s, b [\d.]+ 1/H, ", line.line(stream.account, 1.0))


def test_the_list_of_models_shows_what_a_model_holds() -> None:
    console = Console(record=True, width=120)
    console.print(models_table([MOTOR]))
    seen = console.export_text()
    for word in ("toy_motor", "winding of a motor", "torque constant", "1/H", "inductance", "channel", "parameter"):
        assert word in seen
