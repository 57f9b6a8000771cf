"""Files of programs that the reader was not written for: the same samples come out, or one sentence."""

import bz2
import gzip
import io
import json
import lzma
import zipfile
from collections import namedtuple
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas
import pytest

from pvid.api.data import named
from pvid.base.errors import PvidError
from pvid.rig.columns import TIME, Channel, Columns
from pvid.rig.run import Recording, read_recording, recording_of_arrays

CHANNELS = (Channel("F", "N"), Channel("x", "m"))
ROWS = 2500  # more than the lines that show how a table is turned
T = np.arange(ROWS) * 0.002
F = np.round(5.0 * np.sin(9.0 * T) + 0.4, 3)
X = np.round(0.02 * np.cos(7.0 * T) + 0.001, 5)
CELLS = [(f"{t:.3f}", f"{f:.3f}", f"{x:.5f}") for t, f, x in zip(T, F, X, strict=True)]
PLAIN = "t,F,x\n" + "".join(",".join(row) + "\n" for row in CELLS)
IN_MM = [(float(t) * 1000, float(f), float(x) * 1000) for t, f, x in CELLS]
STAMPS = np.datetime_as_string(np.datetime64("2024-05-02T10:00:00", "ms") + np.arange(0, 2 * ROWS, 2))


def columns(text: str | None) -> Columns:
    return Columns(CHANNELS) if text is None else Columns.parse(text, CHANNELS)


def read(path: Path, content: str | bytes, text: str | None = None) -> Recording:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_recording(path, None, columns(text))


def assert_same(found: Recording, atol: float = 1e-12) -> None:
    assert found.sample_rate == pytest.approx(500.0, rel=1e-6)
    np.testing.assert_allclose(found.signals["F"], F, atol=atol)
    np.testing.assert_allclose(found.signals["x"], X, atol=atol)


def of_rows(head: str, rows: Any, separator: str = ",") -> str:
    return head + "\n" + "".join(separator.join(map(str, row)) + "\n" for row in rows)


# ---- units and times


@pytest.mark.parametrize(
    ("head", "text"),
    [
        ("time_ms;force;place_mm", "t=time_ms,F=force,x=place_mm"),
        ("t/ms;F/N;x/mm", "t=t/ms,F=F/N,x=x/mm"),
        ("Time in ms;F in N;x in mm", "t=Time in ms,F=F in N,x=x in mm"),
        ('"Time, ms";"Force, N";"Place, mm"', "t=1,F=2,x=3"),
    ],
)
def test_a_name_states_the_unit(head: str, text: str, tmp_path: Path) -> None:
    found = read(tmp_path / "a.csv", of_rows(head, IN_MM, ";"), text)
    assert_same(found)
    assert "t in ms and x in mm" in found.notes[0]


@pytest.mark.parametrize("name", ["x_in", "x_d", "y_m"])
def test_a_word_at_the_end_of_a_name_is_no_unit(name: str, tmp_path: Path) -> None:
    assert_same(read(tmp_path / "a.csv", of_rows(f"t,F,{name}", CELLS), f"x={name}"))


@pytest.mark.parametrize(
    ("name", "first", "a_second", "digits", "note"),
    [
        ("time", 1_714_640_400e3, 1e3, 0, "time is taken as ms since 1970, by its size"),
        ("time", 1_714_640_400e6, 1e6, 0, "us since 1970"),
        ("stamp", 1_714_640_400e9, 1e9, 0, "ns since 1970"),
        ("doy", 123.4, 1 / 86_400, 12, "doy is taken as days, by its name"),
        ("Julian day", 123.4, 1 / 86_400, 12, "days, by its name"),
        ("Time", 45_414.4, 1 / 86_400, 12, "Time is taken as days, by its size and its steps"),
    ],
)
def test_a_clock_states_its_unit(
    name: str, first: float, a_second: float, digits: int, note: str, tmp_path: Path
) -> None:
    stamps = [f"{first + a_second * t:.{digits}f}" for t in T * 500]  # a row a second
    rows = [(stamp, f, x) for stamp, (_, f, x) in zip(stamps, CELLS, strict=True)]
    found = read(tmp_path / "a.csv", of_rows(f"{name},F,x", rows), f"t={name}")
    assert found.sample_rate == pytest.approx(1.0, rel=1e-6) and note in found.notes[0], found.notes
    np.testing.assert_array_equal(found.signals["x"], X)


@pytest.mark.parametrize("first", [0.0, 45_414.4, 1e9, 1.7e9])
def test_seconds_of_any_size_are_seconds(first: float, tmp_path: Path) -> None:
    rows = [(f"{first + t:.3f}", f, x) for t, (_, f, x) in zip(T, CELLS, strict=True)]
    found = read(tmp_path / "a.csv", of_rows("time,F,x", rows), "t=time")
    assert found.sample_rate == pytest.approx(500, rel=1e-9) and not found.notes


def test_seconds_of_a_minute_are_joined(tmp_path: Path) -> None:
    rows = [(f"{(31.3 + 0.1 * k) % 60:.1f}", f, x) for k, (_, f, x) in enumerate(CELLS)]
    found = read(tmp_path / "a.csv", of_rows("s,F,x", rows), "t=s")
    assert found.sample_rate == pytest.approx(10) and "starts over after 60 s, 4 times" in found.notes[0]
    rows = [(f"{(0.1 * k) % 60:.1f}", f, x) for k, (_, f, x) in enumerate(CELLS)]  # or runs of a minute
    assert len(read(tmp_path / "a.csv", of_rows("s,F,x", rows), "t=s").segments) == 5


def test_a_share_without_its_whole_is_refused(tmp_path: Path) -> None:
    content = of_rows("t,F [%],x", CELLS)
    with pytest.raises(PvidError, match=r"column 'F \[%\]' is in %, and F in N: --columns F=NAME:NUMBER"):
        read(tmp_path / "a.csv", content, "F=F [%]")
    np.testing.assert_allclose(read(tmp_path / "a.csv", content, "F=F [%]:0.12").signals["F"], 0.12 * F)


def test_a_probe_of_a_circuit_is_called_as_its_node() -> None:
    v, u = Channel("v", "V"), Channel("u", "V")
    assert u.is_called("V(u)") and not v.is_called("V(u)") and v.is_called("V(v)") and v.is_called("v (mV)")
    assert TIME.is_called("X_Value") and TIME.is_called("ts")


# ---- tables


LONG = [(t, name, cell) for t, *row in CELLS for name, cell in zip("Fx", row, strict=True)]
STACKED = [(at, name, row[k]) for k, name in ((1, "F"), (2, "x")) for at, row in zip(STAMPS, CELLS, strict=True)]
TURNED: dict[str, tuple[str, str | None]] = {
    "one signal after the other": (of_rows("time,series,value", STACKED), "t=time"),
    "one after the other, begins with no number": (
        of_rows("last_changed,entity_id,state", [(STAMPS[0], "F", "unknown"), *STACKED[1:]]),
        "t=last_changed",
    ),
    "without names": (of_rows("0.000,F,0.4", LONG[1:]), None),
    "with units": (
        of_rows(
            "time,name,unit,value",
            [(t, name, "mm" if name == "x" else "N", float(v) * (1000 if name == "x" else 1)) for t, name, v in LONG],
        ),
        "t=time",
    ),
    "InfluxDB": (
        "".join(
            "#group,false,false,true,false,true\r\n#datatype,string,long,dateTime:RFC3339,double,string\r\n"
            "#default,_result,,,,\r\n,result,table,_time,_value,_field\r\n"
            + "".join(f",,{name == 'x':d},{at}Z,{cell},{name}\r\n" for at, one, cell in STACKED if one == name)
            + "\r\n"
            for name in "Fx"
        ),
        "t=_time",
    ),
    "lines of InfluxDB": (
        "".join(f"rig,a=b F={f},x={x} {1714640400000000000 + 2000000 * k}\n" for k, (_, f, x) in enumerate(CELLS)),
        None,
    ),
    "units in the cells": (of_rows("t,F,x", [(t, f, f"{float(x) * 1000:.2f} mm") for t, f, x in CELLS]), None),
    "filled with zero bytes": (PLAIN + "\0" * 100_000, None),
}


@pytest.mark.parametrize("case", TURNED)
def test_tables_of_other_forms(case: str, tmp_path: Path) -> None:
    content, text = TURNED[case]
    found = read(tmp_path / "a.csv", content, text)
    if "no number" in case:
        found = Recording(found.t, {**found.signals, "F": np.append(F[0], found.signals["F"][-ROWS + 1 :])}, 500.0)
        np.testing.assert_array_equal(found.signals["F"], F)
    else:
        assert_same(found)


def test_a_signal_that_comes_late_is_read(tmp_path: Path) -> None:
    rows = [*LONG, *((f"{float(t) + 5:.3f}", name, cell) for t, name, cell in LONG)]
    late = [row for k, row in enumerate(rows) if row[1] == "F" or k > 4200]
    found = read(tmp_path / "a.csv", of_rows("time,name,value", late), "t=time")
    assert found.t[0] == pytest.approx(4.2) and "F, x" in found.notes[0]


def test_rows_of_another_form_behind_the_table_are_no_footer(tmp_path: Path) -> None:
    rows = [(f"1 day, {t}" if k > 700 else t, f, x) for k, (t, f, x) in enumerate(CELLS)]
    with pytest.raises(PvidError, match=r"line 703: 4 columns where the header has 3.*1799 of 2500 lines"):
        read(tmp_path / "a.csv", of_rows("t,F,x", rows))


# ---- other kinds of files


def zipped(files: dict[str, str]) -> bytes:
    found = io.BytesIO()
    with zipfile.ZipFile(found, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return found.getvalue()


def octave(**matrices: npt.NDArray[Any]) -> str:
    return "# Created by Octave 8.4.0, Thu May 02 10:00:00 2024 UTC <me@here>\n" + "".join(
        f"# name: {name}\n# type: matrix\n# rows: {one.shape[0]}\n# columns: {one.shape[1]}\n"
        + "".join(f" {' '.join(map(repr, row))}\n" for row in one.tolist())
        + "\n\n"
        for name, one in matrices.items()
    )


RECORDS = [
    {"t": float(t), "rig": {"F": float(f)}, "x": float(x), "mode": "a" * (k % 3)} for k, (t, f, x) in enumerate(CELLS)
]
NUMBERS = [[float(cell) for cell in row] for row in CELLS]
FRAME = {name: {str(k): row[at] for k, row in enumerate(NUMBERS)} for at, name in enumerate("tFx")}
SERIES = {"name": "run", "columns": [*"tFx"], "values": NUMBERS}
FILES: dict[str, tuple[str, str | bytes, str | None]] = {
    "zip": ("a.zip", zipped({"Raw Data.csv": PLAIN, "meta/device.csv": "property,value\n"}), None),
    "zip with another name": ("a.csv", zipped({"run.csv": PLAIN}), None),
    "bzip2": ("a.csv.bz2", bz2.compress(PLAIN.encode()), None),
    "xz": ("a.csv.xz", lzma.compress(PLAIN.encode()), None),
    "gzip": ("a.csv", gzip.compress(PLAIN.encode()), None),
    "lines of JSON": ("a.jsonl", "".join(json.dumps(one) + "\n" for one in RECORDS), None),
    "lines of JSON, keys that come later": (
        "a.ndjson",
        "".join(json.dumps({**one, **({"T": 20.5} if k % 9 == 5 else {})}) + "\n" for k, one in enumerate(RECORDS)),
        "F=rig.F",
    ),
    "a list of JSON": ("a.json", json.dumps({"meta": {"rate": 500}, "data": RECORDS}, indent=1), None),
    "lists of JSON": ("a.json", json.dumps({"t": T.tolist(), "F": F.tolist(), "x": X.tolist()}), None),
    "rows of JSON": ("a.json", json.dumps([list(map(float, row)) for row in CELLS]), "t=1,F=2,x=3"),
    "JSON, a signal a line": (
        "a.jsonl",
        "".join(json.dumps({"ts": float(t), "name": name, "value": float(v)}) + "\n" for t, name, v in LONG),
        "t=ts",
    ),
    "objects after each other": ("a.json", "".join(json.dumps(one, indent=2) for one in RECORDS), None),
    "a frame of columns": ("a.json", json.dumps(FRAME), None),
    "a frame of columns, index t": (
        "a.json",
        json.dumps({one: dict(zip(T.tolist(), FRAME[one].values(), strict=True)) for one in "Fx"}),
        None,
    ),
    "a frame of rows": (
        "a.json",
        json.dumps({k: dict(zip("tFx", row, strict=True)) for k, row in enumerate(NUMBERS)}),
        None,
    ),
    "a frame with its schema": (
        "a.json",
        json.dumps({"schema": {"fields": [{"name": one} for one in "tFx"]}, "data": RECORDS}),
        None,
    ),
    "columns with their schema": (
        "a.json",
        json.dumps(
            {"schema": {"fields": [{"name": one} for one in "tFx"]}, "data": {"values": [*zip(*NUMBERS, strict=True)]}}
        ),
        None,
    ),
    "an answer of a database": ("a.json", json.dumps({"results": [{"id": 0, "series": [SERIES]}]}), None),
    "Octave": ("a.txt", octave(t=T[:, None], F=F[:, None], x=X[None, :]), None),
    "a matrix of Octave": ("a.mat", octave(data=np.column_stack([T, F, X])), "t=1,F=2,x=3"),
}


@pytest.mark.parametrize("case", FILES)
def test_other_kinds_of_files(case: str, tmp_path: Path) -> None:
    name, content, text = FILES[case]
    assert_same(read(tmp_path / name, content, text))


@pytest.mark.parametrize("text", [json.dumps({"data": RECORDS}), json.dumps(RECORDS, indent=1), json.dumps(NUMBERS)])
def test_json_that_lacks_its_end_is_read_up_to_there(text: str, tmp_path: Path) -> None:
    run = read(tmp_path / "a.json", text[:-20], "t=1,F=2,x=3" if text.startswith("[[") else None)
    assert "the file ends within a record, which is left out" in run.notes
    np.testing.assert_array_equal(run.signals["x"], X[: len(run.t)])
    assert len(run.t) >= len(T) - 1


def test_lines_among_json_that_are_none_are_left_out(tmp_path: Path) -> None:
    lines = [json.dumps(one) for one in RECORDS]
    run = read(tmp_path / "a.jsonl", "\n".join(["boot 1.2", *lines, '{"t": 5.0, "ri']))
    assert_same(run)
    assert "left out, no JSON: 2 (first: 'boot 1.2')" in run.notes


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [
        ("a.zip", zipped({"a.csv": PLAIN, "b.csv": PLAIN}), "holds 2 files: 'a.csv' and 'b.csv'; unpack it"),
        ("a.zip", b"PK\x03\x04 this is not", "not a whole zip file"),
        ("a.csv.xz", b"\xfd7zXZ\0 this is not", "not a whole xz file"),
        ("a.json", "{", "is no JSON"),
        ("a.json", '{"t": [0, 1, 2, 3, 4, 5], "F": [0.1, 0.', "one column alone.*; the file ends within a record"),
        ("a.json", json.dumps({one: dict(enumerate(F.tolist(), 90)) for one in "Fx"}), "no column t"),
        ("a.json", "[]", "has no list of records"),
        ("a.txt", octave(t=T[:, None]).replace("# rows: 2500", "# rows: 2501"), "'t' is not 2501 by 1 numbers"),
        ("a.log", "(1714640400.000001) can0 123#00FF12\n" * 9, "a candump log of CAN frames"),
        ("a.txt", " (000.002000)  can0  123   [3]  00 01 02\n" * 9, "a candump log of CAN frames"),
        ("a.asc", "date Thu May 2\nbase hex  timestamps absolute\n 0.1 1 100 Rx d 1 00\n" * 9, "a Vector log"),
        ("a.log", "FMT, 128, 89, FMT, BBnNZ, Type,Length\nATT, 1, 2, 3\n", "mavlogdump.py --format csv"),
        ("a.txt", "2024-05-02 10:00:00.12: ATT {TimeUS : 1, Roll : 2.0}\n" * 9, "mavlogdump.py --format csv"),
        ("a.txt", "<table><tr><td>1</td><td>2</td></tr></table>\n", "a page of HTML"),
        ("a.txt", '<?xml version="1.0"?>\n<data/>\n', "is XML"),
        ("a.db", b"SQLite format 3\0" + bytes(range(32, 127)) * 9, "is a database: `sqlite3"),
        ("a.vcd", "$date today $end\n$timescale 1ns $end\n", "a dump of value changes"),
    ],
)
def test_what_is_no_table_is_named(name: str, content: str | bytes, part: str, tmp_path: Path) -> None:
    with pytest.raises(PvidError, match=part) as caught:
        read(tmp_path / name, content)
    assert "\n" not in str(caught.value)


# ---- Python


class DataSet(dict[str, npt.NDArray[Any]]):
    """As one of xarray: its coordinates are no keys."""

    coords = ("t",)
    data_vars = ("F", "x")

    def __missing__(self, name: str) -> npt.NDArray[Any]:
        return {"t": T}[name]


class InUnits(np.ndarray[Any, np.dtype[Any]]):
    """As a variable of such a set that states its unit."""

    attrs = {"units": "mm"}


class Lazy:
    """As a frame of polars before its rows are computed."""

    def collect(self) -> pandas.DataFrame:
        return FRAME


FRAME = pandas.DataFrame({"t": T, "F": F, "x": X})
Row = namedtuple("Row", "t F x")
AT = pandas.to_datetime("2024-05-02") + pandas.to_timedelta(np.arange(ROWS) * 2, "ms")
LEVELS = pandas.MultiIndex.from_tuples([("t", ""), ("rig", "F"), ("rig", "x")])
UNITS = pandas.MultiIndex.from_tuples([("t", "s"), ("F", "N"), ("x", "m")])
DATA: dict[str, tuple[Any, str | None]] = {
    "columns in levels": (FRAME.set_axis(LEVELS, axis=1), None),
    "units as a level": (FRAME.set_axis(UNITS, axis=1), None),
    "rows in levels": (FRAME.set_index(pandas.MultiIndex.from_arrays([["a"] * ROWS, T], names=["run", "t"])), None),
    "an index of times without a name": (FRAME[["F", "x"]].set_index(AT), None),
    "texts with decimal commas": (FRAME.assign(F=[f"{one:.3f}".replace(".", ",") for one in F]), None),
    "a unit in the name": (pandas.DataFrame({"t_ms": T * 1000, "F": F, "x [mm]": X * 1000}), "t=t_ms"),
    "records": ([{"t": t, "F": f, "x": x} for t, f, x in zip(T, F, X, strict=True)], None),
    "named tuples": ([Row(*one) for one in zip(T, F, X, strict=True)], None),
    "a data set": (DataSet(F=F, x=X), None),
    "a data set with units": (DataSet(F=F, x=(X * 1000).view(InUnits)), None),
    "a lazy frame": (Lazy(), None),
    "an index of numbers without a name": (FRAME[["F", "x"]].set_index(T), None),
    "names in bytes": ({b"t": T, b"F": F, b"x": X}, None),
    "milliseconds since 1970": ({"t": 1_714_640_400_000 + 2 * np.arange(ROWS), "F": F, "x": X}, None),
}


@pytest.mark.parametrize("case", DATA)
def test_data_of_other_kinds(case: str) -> None:
    data, text = DATA[case]
    assert_same(recording_of_arrays(named(data), None, columns(text)))


@pytest.mark.parametrize(
    ("data", "part"),
    [
        ([(0.0, 1.0, 2.0)] * 9, "such as {'t': times, 'x': positions}, not list"),
        ({"t": T, "F": (one for one in F), "x": X}, "column F: an array of numbers is wanted, not generator"),
        ({"t": T, "F": [[1.0], [1.0, 2.0]] * 9, "x": X}, "column F: one number a sample is wanted: setting an array"),
    ],
)
def test_data_without_arrays_is_refused(data: Any, part: str) -> None:
    with pytest.raises(PvidError, match=part):
        recording_of_arrays(named(data), None, columns(None))


# ---- what a review found


@pytest.mark.parametrize("name", ["t [s]", "time_s", "julian_time_of_run_s"])
def test_seconds_of_a_day_are_seconds_where_the_file_states_them(name: str, tmp_path: Path) -> None:
    rows = [(f"{43_200 + 0.0023727 * k:.7f}", f, x) for k, (_, f, x) in enumerate(CELLS)]
    found = read(tmp_path / "a.csv", of_rows(f"{name},F,x", rows), f"t={name}")
    assert found.sample_rate == pytest.approx(1 / 0.0023727, rel=1e-3)


def test_times_of_arrays_are_seconds_at_any_hour() -> None:
    found = recording_of_arrays({"t": 43_200 + 0.00200231 * np.arange(ROWS), "F": F, "x": X}, None, columns(None))
    assert found.sample_rate == pytest.approx(1 / 0.00200231, rel=1e-3)


def test_the_own_name_of_a_signal_is_no_unit(tmp_path: Path) -> None:
    own = Columns((Channel("F", "N"), Channel("elbow_rev", "rad")))
    path = tmp_path / "a.csv"
    path.write_text(of_rows("t,F,elbow_rev", CELLS), encoding="utf-8")
    found = read_recording(path, None, own)
    np.testing.assert_array_equal(found.signals["elbow_rev"], X)


def test_the_time_of_a_long_table_keeps_its_unit(tmp_path: Path) -> None:
    rows = [(f"{1000 * float(t):.6g}", *of) for t, f, x in CELLS for of in (("F", "N", f), ("x", "m", x))]
    assert_same(read(tmp_path / "a.csv", of_rows("time_ms,name,unit,value", rows), "t=time_ms"))


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [
        (
            "a.json",
            json.dumps({one: [{"t": 0.0, "F": 1.0, "x": 2.0}] * 9 for one in ("before", "after")}),
            "holds several tables: 'before' and 'after'; keep the one to read",
        ),
        ("a.json", "[" * 100_000, "is nested too deeply for a recording"),
        (
            "a.txt",
            "# Created by Octave\n" + "".join(f"# name: {n}\n# rows: 2\n# columns: 1\n1\n2\n" for n in "tFxx"),
            "has several matrices 'x', of structs: save one of these alone",
        ),
    ],
)
def test_one_of_several_tables_is_not_taken(name: str, content: str, part: str, tmp_path: Path) -> None:
    with pytest.raises(PvidError, match=part):
        read(tmp_path / name, content)


def test_an_archive_of_an_unknown_method_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.csv", of_rows("t,F,x", CELLS))
    content = bytearray(path.read_bytes())
    content[8] = 9  # Deflate64, in the file's own head and in the directory
    content[content.rindex(b"PK\x01\x02") + 10] = 9
    path.write_bytes(content)
    with pytest.raises(PvidError, match="is encrypted, or packed in a way that is not read: unpack it"):
        read_recording(path, None, columns(None))


def test_json_on_one_long_line_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    records = [{"t": float(t), "F": float(f), "x": float(x)} for t, f, x in CELLS]
    monkeypatch.setattr("pvid.rig.text_lines.BLOCK", 1000)
    assert_same(read(tmp_path / "a.json", json.dumps(records)))
    monkeypatch.setattr("pvid.rig.text_lines._LONGEST", 1000)
    with pytest.raises(PvidError, match="is longer than 0 MiB: write it as lines or as columns"):
        read(tmp_path / "a.json", json.dumps(records))
