"""The same samples from arrays of every kind, and from the files of other programs."""

import datetime
import decimal
import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
import openpyxl
import pandas
import pyarrow
import pyarrow.feather
import pyarrow.parquet
import pytest
import scipy.io
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.writer import Writer
from mcap_protobuf.writer import Writer as ProtobufWriter
from mcap_ros2.writer import Writer as Ros2Writer

from pvid.api.data import named
from pvid.base.errors import PvidError
from pvid.identification.survey import surveyed
from pvid.rig.columns import Channel, Columns
from pvid.rig.run import Recording, read_recording, recording_of_arrays

CHANNELS = (Channel("F", "N"), Channel("x", "m"))
ROWS = 200
T = np.arange(ROWS) * 0.002
F = np.round(5.0 * np.sin(9.0 * T) + 0.4, 3)
X = np.round(0.02 * np.cos(7.0 * T) + 0.001, 5)
FLOAT = npt.NDArray[np.float64]


def columns(text: str | None = None) -> Columns:
    return Columns(CHANNELS) if text is None else Columns.parse(text, CHANNELS)


def assert_same(found: Recording, force: FLOAT = F, place: FLOAT = X) -> None:
    np.testing.assert_allclose(found.t - found.t[0], T, atol=1e-12, rtol=0)
    np.testing.assert_allclose(found.signals["F"], force, rtol=1e-15)
    np.testing.assert_allclose(found.signals["x"], place, rtol=1e-15)
    assert found.sample_rate == pytest.approx(500.0, rel=1e-12)


NANOSECONDS = np.datetime64("2024-05-02T23:59:59.9", "ns") + (np.arange(ROWS) * 2_000_000).astype("timedelta64[ns]")
STRUCTURED = np.array(list(zip(T, F, X, strict=True)), [("t", "f8"), ("F", "f8"), ("x", "f8")])
DATA: dict[str, Any] = {
    "columns of matrices": {"t": T[:, None], "F": F[:, None], "x": X[None, :]},
    "objects": {"t": T.astype(object), "F": F.astype(object), "x": X.astype(object)},
    "decimals": {"t": T, "F": np.array([decimal.Decimal(str(one)) for one in F]), "x": X},
    "texts": {"t": T, "F": np.array([f"{one:.3f}" for one in F]), "x": [f"{one:.5f}".encode() for one in X]},
    "lists": {"t": T.tolist(), "F": F.tolist(), "x": X.tolist()},
    "structured": STRUCTURED,
    "records": STRUCTURED.view(np.recarray),
    "datetime64": {"t": NANOSECONDS, "F": F, "x": X},
    "timedelta64": {"t": NANOSECONDS - NANOSECONDS[0], "F": F, "x": X},
    "milliseconds since 1970": {"t": NANOSECONDS.astype("datetime64[ms]"), "F": F, "x": X},
    "datetimes": {"t": NANOSECONDS.astype("datetime64[us]").astype(datetime.datetime), "F": F, "x": X},
    "times as text": {"t": np.datetime_as_string(NANOSECONDS), "F": F, "x": X},
    "frame": pandas.DataFrame({"t": T, "F": F, "x": X}),
    "nullable": pandas.DataFrame({"t": T, "F": F, "x": X}).convert_dtypes(),
    "frame of arrow": pandas.DataFrame({"t": T, "F": F, "x": X}).convert_dtypes(dtype_backend="pyarrow"),
    "frame with times": pandas.DataFrame({"t": pandas.to_datetime(NANOSECONDS), "F": F, "x": X}),
    "frame with zones": pandas.DataFrame(
        {"t": pandas.to_datetime(NANOSECONDS).tz_localize("Europe/Berlin"), "F": F, "x": X}
    ),
    "frame with an index": pandas.DataFrame({"F": F, "x": X}, index=pandas.Index(T, name="t")),
    "categories": pandas.DataFrame({"t": T, "F": pandas.Categorical(F), "x": X}),
    "arrow": pyarrow.table({"t": T, "F": F, "x": X}),
    "longdouble": {"t": T.astype(np.longdouble), "F": F, "x": X},
}


@pytest.mark.parametrize("case", DATA)
def test_arrays_of_every_kind(case: str) -> None:
    assert_same(recording_of_arrays(named(DATA[case]), None, columns()))


def test_switches_are_0_and_1() -> None:
    on = F > 0
    for data in (on, on.astype(object), pandas.Series(on).astype("boolean")):
        assert_same(recording_of_arrays({"t": T, "F": data, "x": X}, None, columns()), on.astype(float))


MISSING: dict[str, Any] = {
    "masked": np.ma.masked_array(np.where(np.arange(ROWS) == 50, 9999.0, X), np.arange(ROWS) == 50),
    "masked column": np.ma.masked_array(X, np.arange(ROWS) == 50)[:, None],
    "None": np.array([None if k == 50 else one for k, one in enumerate(X.tolist())]),
    "NA": pandas.Series([pandas.NA if k == 50 else one for k, one in enumerate(X.tolist())]),
    "Float64": pandas.Series([None if k == 50 else one for k, one in enumerate(X.tolist())], dtype="Float64"),
    "inf": np.where(np.arange(ROWS) == 50, np.inf, X),
    "text": np.array(["OL" if k == 50 else str(one) for k, one in enumerate(X.tolist())]),
    "arrow": pyarrow.array([None if k == 50 else one for k, one in enumerate(X.tolist())]),
}


@pytest.mark.parametrize("case", MISSING)
def test_what_is_masked_or_no_number_is_missing(case: str) -> None:
    found = recording_of_arrays({"t": T, "F": F, "x": MISSING[case]}, None, columns())
    np.testing.assert_array_equal(np.delete(found.signals["x"], 50), np.delete(X, 50))
    assert abs(found.signals["x"][50] - X[50]) < 1e-4 and any("missing samples of x: 1" in one for one in found.notes)


@pytest.mark.parametrize(
    ("x", "part"),
    [
        (np.zeros((ROWS, 2)), "one number a sample is wanted, not shape (200, 2)"),
        (X * 1j, "real numbers are wanted, not complex128"),
        (np.array([{}] * ROWS), "real numbers are wanted, not dict"),
        (np.array(["up"] * ROWS), "row 1, column x: 'up' is not a number"),
        (NANOSECONDS, "real numbers are wanted, not datetime64"),
    ],
)
def test_what_holds_no_real_numbers_is_refused(x: Any, part: str) -> None:
    with pytest.raises(PvidError, match=re.escape(part)):
        recording_of_arrays({"t": T, "F": F, "x": x}, None, columns())


# ---- files


def test_parquet_and_arrow(tmp_path: Path) -> None:
    units = [
        pyarrow.field(n, pyarrow.float64(), metadata={"unit": u}) for n, u in (("t", "s"), ("F", "N"), ("x", "mm"))
    ]
    in_mm = pyarrow.table([T, F, X * 1000.0], schema=pyarrow.schema(units))
    pyarrow.parquet.write_table(in_mm, tmp_path / "run.parquet")
    pyarrow.feather.write_feather(in_mm, tmp_path / "run.feather")
    with pyarrow.ipc.new_stream(tmp_path / "run.arrow", in_mm.schema) as stream:
        stream.write_table(in_mm)
    for suffix in ("parquet", "feather", "arrow"):
        found = read_recording(tmp_path / f"run.{suffix}", None, columns())
        assert_same(found, F, X * 1000.0 / 1000.0)
        assert found.notes == ("units as the file states them: x in mm",)
    stamped = pyarrow.table({"time": NANOSECONDS, "F": F, "x": X, "note": ["a"] * ROWS})
    pyarrow.parquet.write_table(stamped, tmp_path / "stamped.parquet")
    assert_same(read_recording(tmp_path / "stamped.parquet", None, columns("t=time")))


OF_ROWS = list(zip(T.tolist(), F.tolist(), X.tolist(), strict=True))
IN_COMMAS = {
    key: ";".join(f"{one:.5f}" for one in values).replace(".", ",")
    for key, values in zip("tFx", (T, F, X), strict=True)
}
TURNED = {
    "rows of one time together": "time,name,value\n" + "".join(f"{t!r},F,{f}\n{t!r},x,{x}\n" for t, f, x in OF_ROWS),
    "one signal after the other": "time;signal;value\n"
    + "".join(f"{t!r};F;{f}\n" for t, f, _ in OF_ROWS)
    + "".join(f"{t!r};x;{x}\n" for t, _, x in OF_ROWS),
    "a data base's": "#group,false\n,result,table,time,value,field,measurement\n"
    + "".join(
        f",,0,2024-05-02T10:00:{t:06.3f}Z,{f},F,rig\n,,1,2024-05-02T10:00:{t:06.3f}Z,{x},x,rig\n" for t, f, x in OF_ROWS
    ),
    "with a counter": "id,time,name,value\n"
    + "".join(f"{k},{t!r},F,{f}\n{k + 1},{t!r},x,{x}\n" for k, (t, f, x) in enumerate(OF_ROWS)),
    "a row for each signal": "\n".join(
        f"{name},{','.join(map(repr, one.tolist()))}" for name, one in zip(("time", "F", "x"), (T, F, X), strict=True)
    ),
    "such rows with decimal commas": "\n".join(
        f"{'time' if key == 't' else key};{text}" for key, text in IN_COMMAS.items()
    ),
}


@pytest.mark.parametrize("case", TURNED)
def test_turned_tables(case: str, tmp_path: Path) -> None:
    """Also those that `look` surveys, which needs no names."""
    (tmp_path / "run.csv").write_text(TURNED[case], encoding="utf-8")
    found = read_recording(tmp_path / "run.csv", None, columns("t=time"))
    assert_same(found)
    assert "a row for each signal" in found.notes[0] and len(found.notes) == 1
    assert surveyed(tmp_path / "run.csv").names == ("time", "F", "x")
    with pytest.raises(PvidError, match=re.escape("no column 'time' for t and y (m) among 'stamp', 'F', 'x'")):
        (tmp_path / "run.csv").write_text(TURNED[case].replace("time", "stamp"), encoding="utf-8")
        read_recording(tmp_path / "run.csv", None, Columns.parse("t=time", (*CHANNELS, Channel("y", "m"))))


def test_a_table_with_a_mode_beside_each_row_is_not_turned(tmp_path: Path) -> None:
    modes = "time,mode,y\n" + "".join(f"{t!r},{'run' if t < 0.2 else 'stop'},{x}\n" for t, _, x in OF_ROWS)
    (tmp_path / "run.csv").write_text(modes, encoding="utf-8")
    assert surveyed(tmp_path / "run.csv").names == ("time", "mode", "y")


@pytest.mark.parametrize("title", [None, "Lab 3"])
def test_workbooks(title: str | None, tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for row in ([title], [], ["time", "force", "place", "mode"]) if title else (["time", "force", "place", "mode"],):
        sheet.append(row)
    if title:
        sheet.append(["s", "N", "m", None])
    for k, (t, f, x) in enumerate(zip(T.tolist(), F.tolist(), X.tolist(), strict=True)):
        sheet.append([t, f, x if k != 50 else "n/a", "auto"])
    if title:
        sheet.append(["Mean", 1.0, 2.0])
    book.save(tmp_path / "run.xlsx")
    found = read_recording(tmp_path / "run.xlsx", None, columns("t=time,F=force,x=place"))
    np.testing.assert_array_equal(np.delete(found.signals["x"], 50), np.delete(X, 50))
    np.testing.assert_array_equal(found.signals["F"], F)
    notes = "; ".join(found.notes)
    assert "1 of place ('n/a')" in notes and ("behind the table" in notes) == (title is not None)


def test_workbook_with_the_table_in_a_later_sheet(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    assert book.active is not None
    book.active.append(["read me", 3])
    data = book.create_sheet("data")
    data.append(["t", "F", "x"])
    start = datetime.datetime(2024, 5, 2, 10)
    for k, (f, x) in enumerate(zip(F.tolist(), X.tolist(), strict=True)):
        data.append([start + datetime.timedelta(milliseconds=2 * k), f, x])
    book.save(tmp_path / "run.xlsx")
    found = read_recording(tmp_path / "run.xlsx", None, columns())
    assert_same(found)
    assert found.notes[0] == "the table is in sheet 'data' of 'Sheet' and 'data'"


MATLAB: dict[str, tuple[Mapping[str, Any], str | None]] = {
    "vectors": ({"t": T, "F": F[:, None], "x": X}, None),
    "structure": ({"log": {"time": T, "u": F, "x": X, "name": "lab"}, "k": 3.0}, "t=time,F=u"),
    "signals": (
        {"out": {"time": T[:, None], "signals": {"values": np.column_stack([F, X])}}},
        "t=time,F=values[1],x=values[2]",
    ),
    "matrix": ({"data": np.column_stack([T, F, X])}, "t=data[1],F=data[2],x=data[3]"),
    "matrix by place": ({"data": np.column_stack([T, F, X])}, "t=1,F=2,x=3"),
    "same names": ({"a": {"t": T, "y": F}, "b": {"y": X}}, "t=t,F=a.y,x=b.y"),
}


@pytest.mark.parametrize("case", MATLAB)
def test_files_of_matlab(case: str, tmp_path: Path) -> None:
    content, text = MATLAB[case]
    scipy.io.savemat(tmp_path / "run.mat", dict(content))
    assert_same(read_recording(tmp_path / "run.mat", None, columns(text)))


def written_hdf5(path: Path, content: Mapping[str, Any], units: Mapping[str, str]) -> None:
    with h5py.File(path, "w") as file:
        for name, data in content.items():
            file[name] = data
        for name, unit in units.items():
            file[name].attrs["units"] = unit


HDF5: dict[str, tuple[Mapping[str, Any], Mapping[str, str], str | None]] = {
    "datasets": ({"t": T, "F": F, "x": X}, {}, None),
    "groups": ({"run/time": T, "run/u": F, "run/enc/x": X}, {}, "t=time,F=u"),
    "whole names": ({"a/y": F, "b/y": X, "time": T}, {}, "t=time,F=a.y,x=b.y"),
    "matrix": ({"data": np.column_stack([T, F, X])}, {}, "t=data[1],F=data[2],x=data[3]"),
    "matrix of MATLAB": ({"data": np.vstack([T, F, X])}, {}, "t=data[1],F=data[2],x=data[3]"),
    "records": ({"table": STRUCTURED}, {}, None),
    "units": ({"t": T * 1000.0, "F": F, "x": X}, {"t": "ms", "x": "m"}, None),
}


@pytest.mark.parametrize("suffix", ["h5", "hdf5", "mat"])
@pytest.mark.parametrize("case", HDF5)
def test_files_of_hdf5(case: str, suffix: str, tmp_path: Path) -> None:
    content, units, text = HDF5[case]
    path = tmp_path / f"run.{suffix}"
    if suffix == "mat":  # MATLAB 7.3 has a block of text in front
        with h5py.File(path, "w", userblock_size=512):
            pass
        with h5py.File(path, "a") as file:
            for name, data in content.items():
                file[name] = data
            for name, unit in units.items():
                file[name].attrs["units"] = unit
        raw = bytearray(path.read_bytes())
        raw[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
        path.write_bytes(bytes(raw))
    else:
        written_hdf5(path, content, units)
    assert_same(read_recording(path, None, columns(text)))


@pytest.mark.parametrize("version", [1, 4])
def test_files_of_netcdf_with_what_is_packed(version: int, tmp_path: Path) -> None:
    """In integers of a step and an offset; times since a date."""
    path, count = tmp_path / "run.nc", np.round(T * 1000.0).astype(np.int32)
    step = 1e-5
    packed = np.round((X - 0.01) / step).astype(np.int32)
    gone = np.where(np.arange(len(X)) == 40, -99, packed).astype(np.int32)
    stated = {
        "units": "m",
        "scale_factor": np.float64(step),
        "add_offset": np.float64(0.01),
        "_FillValue": np.int32(-99),
    }
    kept: dict[str, tuple[npt.NDArray[Any], dict[str, Any]]] = {
        "t": (count, {"units": "ms since 2024-05-02"}),
        "F": (F, {"units": "N"}),
        "x": (gone, stated),
    }
    if version == 4:
        with h5py.File(path, "w") as file:
            for name, (data, attributes) in kept.items():
                file[name] = data
                file[name].attrs.update(attributes)
    else:
        with scipy.io.netcdf_file(path, "w") as file:
            file.createDimension("row", len(T))
            for name, (data, attributes) in kept.items():
                variable = file.createVariable(name, data.dtype, ("row",))
                variable[:] = data
                for one, value in attributes.items():
                    setattr(variable, one, value)
    found = read_recording(path, None, columns())
    np.testing.assert_allclose(found.t, count / 1000.0, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found.signals["F"], F)
    there = np.arange(len(X)) != 40
    np.testing.assert_allclose(found.signals["x"][there], packed[there] * step + 0.01, rtol=1e-12)
    assert abs(found.signals["x"][40] - X[40]) < 1e-3


def written_mcap(path: Path, topics: Mapping[str, list[tuple[int, dict[str, Any]]]]) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for topic, messages in topics.items():
            schema = writer.register_schema("any", "jsonschema", b"{}")
            channel = writer.register_channel(topic, "json", schema)
            for at, message in messages:
                writer.add_message(channel, at, json.dumps(message).encode(), at)
        writer.finish()  # type: ignore[no-untyped-call]


AT = [1_714_694_400_123_456_789 + 2_000_000 * k for k in range(ROWS)]


def test_messages_of_json(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rows = list(zip(AT, T.tolist(), F.tolist(), X.tolist(), strict=True))
    written_mcap(
        path,
        {
            "/samples": [(at, {"t": t, "F": f, "x": x, "on": True}) for at, t, f, x in rows],
            "/log": [(AT[3], {"t": 1.0})],
        },
    )
    assert_same(read_recording(path, None, columns()))
    nested = {
        "/state": [
            (at, {"header": {"stamp": {"sec": at // 10**9, "nanosec": at % 10**9}}, "effort": [f], "pose": {"x": x}})
            for at, _, f, x in rows
        ]
    }
    written_mcap(path, nested)
    assert_same(read_recording(path, None, columns("F=effort[0],x=pose.x")))
    assert_same(read_recording(path, None, columns("t=header.stamp,F=/state.effort[0],x=/state.pose.x")))


def test_signals_of_several_topics_have_the_time_of_the_log(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rows = list(zip(AT, F.tolist(), X.tolist(), strict=True))
    written_mcap(path, {"/u": [(at, {"data": f}) for at, f, _ in rows], "/y": [(at, {"data": x}) for at, _, x in rows]})
    assert_same(read_recording(path, None, columns("F=/u.data,x=/y.data")))
    with pytest.raises(PvidError, match="no column 'u' for F"):
        read_recording(path, None, columns("F=u,x=/y.data"))


def test_messages_of_ros_2(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    text = "builtin_interfaces/Time stamp\nfloat64[] effort\nfloat64 x\nstring name\n"
    text += "================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
    with path.open("wb") as file:
        writer = Ros2Writer(file)
        schema = writer.register_msgdef("lab_msgs/msg/State", text)
        for at, f, x in zip(AT, F.tolist(), X.tolist(), strict=True):
            stamp = {"sec": at // 10**9, "nanosec": at % 10**9}
            message = {"stamp": stamp, "effort": [f, 0.0], "x": x, "name": "a"}
            writer.write_message("/state", schema, message, at, at)
        writer.finish()  # type: ignore[no-untyped-call]
    assert_same(read_recording(path, None, columns("t=stamp,F=effort[0]")))
    assert_same(read_recording(path, None, columns("F=effort[0]")))


def test_messages_of_protobuf_are_rows(tmp_path: Path) -> None:
    """A message within a message, and a stamp of its own; the type is made here, as a logger's schema is."""
    file = FileDescriptorProto(name="state.proto", package="lab", syntax="proto3")
    stamp = file.message_type.add(name="Stamp")
    stamp.field.add(name="seconds", number=1, type=FieldDescriptorProto.TYPE_INT64, label=1)
    stamp.field.add(name="nanos", number=2, type=FieldDescriptorProto.TYPE_INT32, label=1)
    state = file.message_type.add(name="State")
    state.field.add(name="stamp", number=1, type=FieldDescriptorProto.TYPE_MESSAGE, type_name=".lab.Stamp", label=1)
    state.field.add(name="x", number=2, type=FieldDescriptorProto.TYPE_DOUBLE, label=1)
    state.field.add(name="effort", number=3, type=FieldDescriptorProto.TYPE_DOUBLE, label=3)
    pool = DescriptorPool()
    pool.Add(file)
    kind = GetMessageClass(pool.FindMessageTypeByName("lab.State"))
    path = tmp_path / "lab.mcap"
    with path.open("wb") as target, ProtobufWriter(target) as writer:
        for at, f, x in zip(AT, F.tolist(), X.tolist(), strict=True):
            message = kind(stamp={"seconds": at // 10**9, "nanos": at % 10**9}, x=x, effort=[f, 0.0])
            writer.write_message("/state", message, log_time=at, publish_time=at)
    assert_same(read_recording(path, None, columns("t=stamp,F=effort[0]")))
    assert_same(read_recording(path, None, columns("F=effort[0]")))


@pytest.mark.parametrize("name", ["a.xlsx", "a.mat", "a.h5", "a.mcap", "a.feather", "a.parquet", "a.npz"])
def test_damaged_files_are_one_sentence(name: str, tmp_path: Path) -> None:
    for content in (b"", b"PK\x03\x04 this is not", bytes(range(256)) * 20):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(PvidError) as caught:
            read_recording(tmp_path / name, None, columns())
        assert str(tmp_path / name) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "how"),
    [
        ("a.bag", "mcap convert"),
        ("a.tdms", "npTDMS"),
        ("a.ulg", "ulog2csv"),
        ("a.wpilog", "AdvantageScope"),
        ("a.7z", "unpack"),
        ("a.xls", "save it as .xlsx"),
        ("a.mf4", "asammdf"),
        ("a.wav", "wavfile"),
        ("a.pickle", "to_parquet"),
        ("a.dwg", "must end in"),
    ],
)
def test_other_kinds_of_files_are_refused_with_what_converts_them(name: str, how: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(bytes(range(256)))
    with pytest.raises(PvidError, match="must end in") as caught:
        read_recording(tmp_path / name, None, columns())
    assert how in str(caught.value)


def test_text_with_another_suffix_is_read(tmp_path: Path) -> None:
    rows = [f"{t:.4f},{f},{x}" for t, f, x in zip(T, F, X, strict=True)]
    for name in ("run.log", "run.lvm", "run", "RUN.ASC"):
        (tmp_path / name).write_text("\n".join(["t,F,x", *rows]) + "\n")
        assert_same(read_recording(tmp_path / name, None, columns()))


@pytest.mark.parametrize(
    ("name", "module", "package"),
    [
        ("a.xlsx", "openpyxl", "openpyxl"),
        ("a.h5", "h5py", "h5py"),
        ("a.nc", "h5py", "h5py"),
        ("a.mcap", "mcap.reader", "mcap"),
        ("a.parquet", "pyarrow.parquet", "pyarrow"),
    ],
)
def test_a_package_that_is_not_installed_is_named(
    name: str, module: str, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(PvidError, match=rf"needs the Python package {package}: .*pip install {package}$"):
        read_recording(tmp_path / name, None, columns())
