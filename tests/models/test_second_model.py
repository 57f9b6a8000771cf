"""A second mechanism, defined here alone, goes through everything that names, labels and tabulates parameters."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import field_board
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
import pytest
from matplotlib.figure import Figure
from rich.console import Console

from pvid.core.native import Native
from pvid.link import frames as link
from pvid.log.file import LogWriter
from pvid.log.history import History
from pvid.log.reader import LogStream, Record
from pvid.log.status import StatusLine
from pvid.log.values import Values, tables_of
from pvid.models.model import Channel, Constant, Constants, Float, Mechanism, Model, Parameter, Quantity, Scale
from pvid.rig.file import RigFile
from pvid.run import answer
from pvid.run.engine_identify import identify_by_engine
from pvid.run.identify import ErrorParts, Identification, Publications, Trajectory
from pvid.show import figures
from pvid.show.models_table import models_table
from pvid.show.view import LiveView
from pvid.sim.pendulum import simulate


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
    modes_hz=lambda p: (float(p[0]) / 6.28,),
    scales=(Scale("v_gain", "v_gain_sd", "the gain of v", (0.0, -1.0), (0.0, 0.0)),),
)
MECHANISM = Mechanism(MOTOR, {"k": 0.1})
NAMES = ["res", "ind", "a", "b", "i0"]


@pytest.fixture
def result() -> Identification:
    """What an identification of the motor would give."""
    p, covariance = np.array([200.0, 100.0]), np.diag([4.0, 1.0])
    names = (*MOTOR.physical_names, *MOTOR.p_names)
    value = dict(zip(names, [*MECHANISM.physical(p), *p, 0.25], strict=True))
    errors = [*MECHANISM.physical_errors(p, covariance), 2.0, 1.0, 0.01]
    t = np.linspace(0, 1, 5)
    made = replace(
        identify_by_engine(simulate(duration=8.0).run, RigFile.standard()),
        model=MOTOR,
        value={name: float(one) for name, one in value.items()},
        se={name: float(one) for name, one in zip(names, errors, strict=True)},
        parts={name: ErrorParts(float(one), {"v_gain": 0.0}) for name, one in zip(names, errors, strict=True)},
        trajectory=Trajectory(t, np.tile(p, (5, 1)), np.ones((5, 2)), np.ones((5, 2)), np.ones((5, 2)), t),
        publications=Publications.none(MOTOR),
    )
    assert made.identified
    return made


def test_the_answer_has_the_names_and_units_of_its_model(result: Identification) -> None:
    told = answer.as_json(result)
    assert list(told["parameters"]) == NAMES
    assert {name: one["unit"] for name, one in told["parameters"].items()} == {
        "res": "ohm",
        "ind": "H",
        "a": "1/s",
        "b": "1/H",
        "i0": "A",
    }
    assert told["res"]["value"] == 2.0 and told["res"]["se_v_gain"] == 0.0 and "se_l1" not in told["res"]
    assert told["modes_hz"] == [200 / 6.28]
    assert [pair.split()[0] for pair in answer.one_line(result).split(", ")] == NAMES


def test_the_table_of_an_answer_has_the_names_and_units_of_its_model(result: Identification) -> None:
    table = answer.table(result)
    assert table is not None
    console = Console(record=True, width=100)
    console.print(table)
    seen = console.export_text()
    for label in ("res [ohm]", "ind [H]", "a [1/s]", "b [1/H]", "i0 [A]"):
        assert label in seen


def test_the_figure_has_an_axis_for_each_physical_parameter(
    result: Identification, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    labels: list[str] = []

    def kept(figure: Figure, path: Path, dpi: int) -> None:
        labels.extend(axis.get_ylabel() for axis in figure.axes)

    monkeypatch.setattr(figures, "save", kept)
    figures.convergence(result, tmp_path / "a.png", truth={"res": 2.0, "ind": 0.01})
    assert labels == ["resistance R [ohm]", "inductance L [H]"]
    assert not plt.get_fignums()


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
