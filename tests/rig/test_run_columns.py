"""Files as programs and loggers write them: names, units, separators, decimal commas, comments, cut ends."""

import gzip
import itertools
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pendulum_run import columns_of, read_run

from pvid.base.errors import PvidError

ROWS = 60
T = np.arange(ROWS) / 1000.0
PHI = np.round(0.1 * np.sin(30.0 * T), 6)
Y = np.round(0.01 * np.cos(20.0 * T), 6)

# Reading files takes as long as the disk does.
relaxed = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


def table(separator: str = ",", decimal: str = ".", header: str = "t,phi,y", end: str = "\n", close: str = "") -> str:
    lines = [header.replace(",", separator)] if header else []
    for row in zip(T.tolist(), PHI.tolist(), Y.tolist(), strict=True):
        lines.append(separator.join(f"{value:.6f}".replace(".", decimal) for value in row) + close)
    return end.join(lines) + end


def written(folder: Path, content: str | bytes, name: str = "run.csv") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def assert_is_the_run(path: Path, columns: str | None = None) -> None:
    run = read_run(path, text=columns)
    np.testing.assert_array_equal(run.t, T)
    np.testing.assert_array_equal(run.phi, PHI)
    np.testing.assert_array_equal(run.y, Y)
    assert run.notes == ()


@pytest.mark.parametrize(
    ("separator", "decimal"),
    [
        (",", "."),
        (";", "."),
        (";", ","),
        ("\t", "."),
        ("\t", ","),
        (" ", "."),
        ("   ", ","),
        (" \t ", "."),
        (" ; ", ","),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_separators_and_decimal_commas_are_found(separator: str, decimal: str, end: str, tmp_path: Path) -> None:
    assert_is_the_run(written(tmp_path, table(separator, decimal, end=end)))


@pytest.mark.parametrize(
    "content",
    [
        "\ufeff" + table(";", ","),
        '"t","phi","y"\n' + table(header=""),
        "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in table().splitlines()) + "\n",
        "\n".join(",".join(f'"{c}"'.replace(".", ",") for c in line.split(",")) for line in table().splitlines())
        + "\n",
        "# a logger\n# of 2026, with commas, and more\n" + table(),
        "# t,phi,y\n" + table(header=""),
        "% t phi y\n" + table(" ", header=""),
        "sep=;\n" + table(";", ","),
        table().replace("\n", "\n\n"),
        table().replace("\n0.020", "\n# a remark, in between\n   \n0.020"),
        table(close=","),
        table(header="t,phi,y,", close=","),
        table() + "\n  \n\n",
        " " + table(" ").replace("\n", "\n  ").rstrip(" "),
    ],
    ids=[
        "byte order mark",
        "quoted names",
        "quoted cells",
        "quoted decimal commas",
        "comments",
        "names in a comment",
        "names in MATLAB's comment",
        "sep=",
        "blank lines",
        "a comment within",
        "separators at the end",
        "separators at the end of all",
        "blank end",
        "indented",
    ],
)
def test_program_added_table_lines_are_read(content: str, tmp_path: Path) -> None:
    assert_is_the_run(written(tmp_path, content))


def test_a_word_beside_the_first_row_alone_is_a_remark(tmp_path: Path) -> None:
    first, _, others = table(";", ",", header="", close=";").partition(";\n")
    head = "A lab;;;\nt;phi;y;words\n(s);(rad);(m);\n"
    run = read_run(written(tmp_path, f"{head}{first};let go\n{others}"))
    np.testing.assert_array_equal(run.phi, PHI)
    assert run.notes == ("left out in front of the table: line 1, 'A lab;;;'", "line 3 states units")


@pytest.mark.parametrize("name", ["run.tsv", "run.txt", "run.dat", "RUN.CSV"])
def test_other_endings_of_text_are_read(name: str, tmp_path: Path) -> None:
    assert_is_the_run(written(tmp_path, table("\t"), name))
    assert_is_the_run(written(tmp_path, gzip.compress(table("\t").encode()), name + ".gz"))


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_columns_of_other_names_and_units(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"run{suffix}"
    columns = {"note": np.zeros(ROWS), "h": Y * 1000.0, "angle_deg": np.rad2deg(PHI), "time_ms": np.arange(ROWS)}
    if suffix == ".csv":
        lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
        path.write_text("\n".join(lines) + "\n")
    elif suffix == ".npz":
        np.savez(path, **columns)  # type: ignore[arg-type]
    else:
        pyarrow.parquet.write_table(pyarrow.table(columns), path)
    run = read_run(path, text="t=time_ms:ms,phi=angle_deg:deg,y=h:mm")
    np.testing.assert_array_equal(run.t, T)  # milliseconds are divided, so that they give the bits of decimals
    np.testing.assert_allclose(run.phi, PHI, rtol=1e-15)  # two roundings there and back
    np.testing.assert_allclose(run.y, Y, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "signal", "one"),
    [
        ("t=a:us", "t", 1e-6),
        ("t=a:µs", "t", 1e-6),
        ("t=a:min", "t", 60.0),
        ("phi=a:rev", "phi", 2 * np.pi),
        ("phi=a:turn", "phi", 2 * np.pi),
        ("phi=a:°", "phi", np.pi / 180),
        ("phi=a:3.8e-4", "phi", 3.8e-4),
        ("phi=a:rev/4096", "phi", 2 * np.pi / 4096),
        ("phi=a:-deg/10", "phi", -np.pi / 1800),
        ("y=a:cm", "y", 1e-2),
        ("y=a:-um", "y", -1e-6),
        ("y=a:in", "y", 0.0254),
        ("y=a", "y", 1.0),
        ("y = a : mm", "y", 1e-3),
        ("y=time: h:mm", "y", 1e-3),
    ],
)
def test_units(text: str, signal: str, one: float) -> None:
    columns = columns_of(text)
    assert columns[signal].in_si(np.array([1.0]))[0] == pytest.approx(one, rel=1e-15)
    assert columns[signal].name == ("time: h" if ": h" in text else "a")


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "SIGNAL=COLUMN:UNIT"),
        ("phi", "'phi' is not SIGNAL=COLUMN:UNIT"),
        ("phi=:deg", "SIGNAL=COLUMN:UNIT"),
        ("x=a:m", "'x' is no signal; the signals are t, phi, y"),
        ("y=a:m,y=b:m", "y is given twice"),
        ("y=a:deg", "'deg' is no unit of y; it is m, cm, mm, um, in or a number of m"),
        ("y=a:0", "no unit of y"),
        ("y=a:nan", "no unit of y"),
        ("y=a:1e999", "no unit of y"),
        ("phi=a:rev/0", "no unit of phi"),
        ("phi=a:rev/x", "no unit of phi"),
        ("t=a:--s", "no unit of t"),
    ],
)
def test_a_wrong_map_is_one_sentence(text: str, part: str) -> None:
    with pytest.raises(PvidError, match="^--columns: ") as caught:
        columns_of(text)
    assert part in str(caught.value) and "\n" not in str(caught.value)


@given(st.text(max_size=40))
def test_any_map_is_read_or_refused_in_a_sentence(text: str) -> None:
    try:
        columns_of(text)
    except PvidError as error:
        assert str(error).isprintable()


@pytest.mark.parametrize(
    ("header", "suggested"),
    [
        ("time_ms,angle_deg,pivot_mm", "--columns t=time_ms:ms,phi=angle_deg:deg,y=pivot_mm:mm"),
        ("T,PHI,Y", "--columns t=T:s,phi=PHI:rad,y=Y:m"),
        ("time [s],theta [rad],height (cm)", "--columns 't=time [s]:s,phi=theta [rad]:rad,y=height (cm):cm'"),
        ("t,enc,y", "--columns phi=enc:rad"),
        ("micros,phi,h", "--columns t=micros:us,y=h:m"),
        ("a,b,c", "--columns t=NAME:s,phi=NAME:rad,y=NAME:m"),
        ("t=0,angle:raw,y", "--columns 't=1:s,phi=\"angle:raw\":rad'"),
        ("", "--columns t=1:s,phi=2:rad,y=3:m"),
    ],
)
def test_missing_columns_are_listed_with_the_text_that_names_them(header: str, suggested: str, tmp_path: Path) -> None:
    path = written(tmp_path, table(header=header))
    with pytest.raises(PvidError) as caught:
        read_run(path)
    sentence = str(caught.value)
    assert sentence.endswith(f": use {suggested}.")
    for name in header.split(",") if header else "123":
        assert f"'{name}'" in sentence
    if "NAME" not in suggested:
        typed = suggested.removeprefix("--columns ").strip("'")
        read_run(path, text=typed.replace(":ms", ":s").replace(":us", ":s"))


def test_a_file_without_names_is_read_by_place(tmp_path: Path) -> None:
    assert_is_the_run(written(tmp_path, table(header="")), "t=1,phi=2,y=3")
    assert_is_the_run(written(tmp_path, table(header="a,b,c")), "t=1,phi=2,y=c")
    path = written(tmp_path, table(header=""))
    with pytest.raises(PvidError, match="no column '4' for y among '1', '2', '3'"):
        read_run(path, text="t=1,phi=2,y=4")


@pytest.mark.parametrize("cut", range(2, 27))
def test_a_line_that_the_file_ends_within_is_left_out(cut: int, tmp_path: Path) -> None:
    run = read_run(written(tmp_path, table()[:-cut]))  # the last line has 26 characters and its end
    np.testing.assert_array_equal(run.y, Y[:-1])
    assert run.notes == ("the file ends within line 61, which is left out",)


def test_a_whole_last_line_may_lack_its_end(tmp_path: Path) -> None:
    assert_is_the_run(written(tmp_path, table()[:-1]))


def test_a_bad_line_is_named_whatever_stands_before_it(tmp_path: Path) -> None:
    lines = ("# one\n\n" + table(";", ",").replace("\n0,020", "\n\n# two\n0,020")).splitlines()
    row = next(number for number, line in enumerate(lines) if line.startswith("0,031"))
    for line in ("0,031;fast;0", "0,031;0"):
        lines[row] = line
        run = read_run(written(tmp_path, "\n".join(lines) + "\n"))
        assert run.notes[0] == f"left out: a damaged line, {row + 1}, '{line}'"
        np.testing.assert_allclose(run.phi, PHI, atol=1e-5)  # the gap is interpolated
    lines[row] = "0,029;0;0"
    run = read_run(written(tmp_path, "\n".join(lines) + "\n"))
    assert run.notes[0] == f"t is 0.029 s between 0.03 s and 0.032 s (line {row + 1}): interpolated"


def test_a_mistake_far_into_a_long_file_is_found(tmp_path: Path) -> None:
    """Behind several of the blocks that a file is read in."""
    count = 60_000
    lines = ["t,phi,y", *(f"{k / 1000:.3f},0.123456789012,-0.001234567890" for k in range(count))]
    for cells, note in (
        ("50.000,0.1,oops", "left out: a damaged line, 50002, '50.000,0.1,oops'"),
        ("50.000,0.1,inf", "cells without a number, taken as missing: 1 of y ('inf')"),
    ):
        lines[50_001] = cells
        assert read_run(written(tmp_path, "\n".join(lines) + "\n")).notes[0] == note
    lines[50_001] = "49.997,0.1,0.2"
    run = read_run(written(tmp_path, "\n".join(lines) + "\n"))
    assert run.notes[0] == "t is 49.997 s between 49.999 s and 50.001 s (line 50002): interpolated"
    lines[50_001] = "50.000,0.1,0.2"
    assert len(read_run(written(tmp_path, "\n".join(lines) + "\n"))) == count


@given(
    separator=st.sampled_from([",", ";", "\t", " "]),
    decimal=st.sampled_from([".", ","]),
    order=st.permutations(["t", "phi", "y", "extra"]),
    comment=st.booleans(),
    values=st.lists(st.floats(-1e6, 1e6), min_size=5, max_size=30),
)
@relaxed
def test_every_bit_comes_back_whatever_the_layout(
    separator: str, decimal: str, order: list[str], comment: bool, values: list[float], tmp_path: Path
) -> None:
    if separator == decimal:
        decimal = "."
    if decimal == ",":  # it is found only where a number has one
        values = [value if "." in repr(value) and "e" not in repr(value) else 0.25 for value in values]
    columns = {"t": [k / 100 for k in range(len(values))], "phi": values, "y": values[::-1], "extra": values}
    rows = [[repr(columns[name][k]).replace(".", decimal) for name in order] for k in range(len(values))]
    lines = [separator.join(cells) for cells in itertools.chain([order], rows)]
    run = read_run(written(tmp_path, ("# comment\n" if comment else "") + "\n".join(lines) + "\n"))
    np.testing.assert_array_equal(run.phi, values)
    np.testing.assert_array_equal(run.y, values[::-1])
    np.testing.assert_array_equal(run.t, columns["t"])
