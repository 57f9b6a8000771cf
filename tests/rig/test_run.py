"""Runs on disk: exact round trips, and for every fault one sentence that names file, line and column."""

import gzip
import io
import math
import random
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pendulum_run import Run, read_run, write_run

from pvid.base.errors import PvidError
from pvid.rig.run import MIN_ROWS

SUFFIXES = (".csv", ".csv.gz", ".npz", ".parquet")

# Reading hostile files takes as long as the disk does.
relaxed = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


def run_of(rows: int = 50, rate: float = 1000.0) -> Run:
    random = np.random.default_rng(rows)
    return Run(
        t=np.arange(rows) / rate,
        phi=0.1 * random.standard_normal(rows),
        y=1e-3 * random.standard_normal(rows),
        sample_rate=rate,
    )


def lines_of(run: Run) -> list[str]:
    return [
        "t,phi,y",
        *(f"{t!r},{p!r},{y!r}" for t, p, y in zip(*map(np.ndarray.tolist, (run.t, run.phi, run.y)), strict=True)),
    ]


GOOD = lines_of(run_of())


def refused(path: Path, content: str | bytes) -> str:
    """The sentence with which a file of this content is refused, after the checks that all of them must pass."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(PvidError) as caught:
        read_run(path)
    sentence = str(caught.value)
    assert sentence.startswith(str(path))
    assert "\n" not in sentence
    assert sentence.isprintable()
    assert len(sentence) < len(str(path)) + 350
    return sentence.removeprefix(str(path))


def changed(line: int, cells: str) -> str:
    """The good file with line `line` (the header is 1) replaced."""
    return "\n".join([*GOOD[: line - 1], cells, *GOOD[line:]]) + "\n"


# ---- what must be read


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_gives_every_bit_back(suffix: str, tmp_path: Path) -> None:
    extreme = np.resize([5e-324, -0.0, 1.7976931348623157e308, 0.1, 1 / 3, -1e-300], 50)
    run = Run(np.arange(50) / 1000.0, extreme, -extreme, 1000.0)
    path = tmp_path / f"run{suffix}"
    write_run(path, run)
    again = read_run(path)
    for name in ("t", "phi", "y"):
        assert getattr(again, name).tobytes() == getattr(run, name).tobytes()
    assert again.sample_rate == 1000.0
    assert again.notes == ()


@given(
    values=st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=MIN_ROWS, max_size=40),
    rate=st.floats(0.1, 1e5),
    start=st.floats(-10.0, 10.0),
)
@relaxed
def test_any_finite_run_gives_every_bit_back(values: list[float], rate: float, start: float, tmp_path: Path) -> None:
    t = start + np.arange(len(values)) / rate
    run = Run(t, np.array(values), np.array(values[::-1]), rate)
    path = tmp_path / "run.csv"
    write_run(path, run)
    again = read_run(path)
    for name in ("t", "phi", "y"):
        assert getattr(again, name).tobytes() == getattr(run, name).tobytes()
    # t near 10 s is rounded to 1e-15 s, over at least four periods
    assert again.sample_rate == pytest.approx(rate, rel=1e-8 + 1e-15 * rate)


@pytest.mark.parametrize("rate", [1000.0, 100.0, 125.0, 10_000.0, 1024.0, 50.0, 0.5])
def test_the_rate_of_a_decimal_clock_is_round(rate: float, tmp_path: Path) -> None:
    write_run(tmp_path / "run.csv", run_of(500, rate))
    assert read_run(tmp_path / "run.csv").sample_rate == rate
    assert read_run(tmp_path / "run.csv", rate).sample_rate == rate


@pytest.mark.parametrize(
    "content",
    [
        "\n".join(GOOD),
        "\r\n".join(GOOD) + "\r\n",
        "\ufeff" + "\n".join(GOOD) + "\n",
        "\n".join(GOOD) + "\n\n\n",
        "\n".join(GOOD).replace(",", " , "),
    ],
    ids=["no end", "CRLF", "BOM", "blank end", "spaces"],
)
def test_harmless_differences_are_read(content: str, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(content.encode())
    run = read_run(path)
    np.testing.assert_array_equal(run.phi, run_of().phi)
    assert len(run) == 50


def test_columns_in_any_order_and_further_ones(tmp_path: Path) -> None:
    lines = ["y,note,t,motor,phi"]
    lines += [f"{y},text,{t},{i},{p}" for i, (t, p, y) in enumerate(line.split(",") for line in GOOD[1:])]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines) + "\n")
    run = read_run(path)
    np.testing.assert_array_equal(run.phi, run_of().phi)
    np.testing.assert_array_equal(run.y, run_of().y)


def test_forty_thousand_rows_load_at_once(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    write_run(path, run_of(40_000))
    before = time.process_time()
    read_run(path)
    assert time.process_time() - before < 0.5


# ---- what must be refused


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        ("", ["empty"]),
        ("\n\n", ["empty"]),
        ("t,phi,y\n", ["no data"]),
        (changed(1, "t,phi"), ["line 1", "y"]),
        (changed(1, "time,angle,pos"), ["line 1", "t", "phi", "y", "angle"]),
        (changed(1, "t,phi,phi"), ["line 1", "phi", "2 times"]),
        (changed(1, "T,PHI,Y"), ["line 1", "'PHI'"]),
        ("\n".join(GOOD[1:]), ["no column", "'1', '2', '3'", "--columns t=1:s,phi=2:rad,y=3:m"]),
        (changed(12, "0.009,0.1,0"), ["line 12", "column t", "repeats"]),
        ("\n".join([GOOD[0], *random.Random(1).sample(GOOD[1:], 30)]), ["column t", "runs back"]),
        ("\n".join(["phi,y", *(line.partition(",")[2] for line in GOOD[1:])]), ["no column t (s)", "'# dt = 0.001 s'"]),
        ("\n".join(GOOD[:MIN_ROWS]) + "\n", [f"{MIN_ROWS - 1} rows", f"at least {MIN_ROWS}"]),
    ],
)
def test_faults_of_a_csv_file_are_named(content: str, parts: list[str], tmp_path: Path) -> None:
    sentence = refused(tmp_path / "run.csv", content)
    for part in parts:
        assert part in sentence, sentence


@pytest.mark.parametrize(
    "cells",
    ["0.01,0.1", "0.01,0.1,0,0", "0.01,x,0.0", ",0.1,0.0", "0.01,-,0.1e", "0.01,1_0,0.0", '0.01,"0.1,0.0', "nan,1,0"],
)
def test_a_damaged_line_is_left_out_and_named(cells: str, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(changed(12, cells))
    run = read_run(path)
    assert run.notes[0] == f"left out: a damaged line, 12, {cells!r}"
    assert "missing samples: 1 of 50" in run.notes[1]
    np.testing.assert_array_equal(np.delete(run.phi, 10), np.delete(run_of().phi, 10))


@pytest.mark.parametrize(
    ("lines", "parts"),
    [
        (["0.1,0.2"], ["line 12: 2 columns where the header has 3", "4 of 50 lines"]),
        (["0.01,up,0"], ["line 12, column phi: 'up' is not a number", "4 of 50 lines"]),
        ([",0.1,0.0"], ["line 12, column t: the cell is empty"]),
        (['"0.1,0.2'], ["line 12", "quoted"]),
    ],
)
def test_a_table_with_many_damaged_lines_is_refused(lines: list[str], parts: list[str], tmp_path: Path) -> None:
    sentence = refused(tmp_path / "run.csv", "\n".join([*GOOD[:11], *4 * lines, *GOOD[15:]]) + "\n")
    for part in parts:
        assert part in sentence, sentence


@pytest.mark.parametrize("cell", ["-inf", "1e999", "9.90000E+37", "-9.9E37", "OL"])
def test_an_overload_is_missing(cell: str, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(changed(12, f"0.01,{cell},0"))
    assert read_run(path).notes[0].startswith("cells without a number, taken as missing: 1 of phi")


def test_time_in_milliseconds_contradicts_the_rig(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t,phi,y\n" + "".join(f"{k},0.1,0\n" for k in range(50)))
    assert read_run(path).sample_rate == 1.0
    with pytest.raises(PvidError, match="column t.* 1 Hz.* 1000 Hz: t looks like ms: use --columns t=t:ms"):
        read_run(path, 1000.0)


def test_non_file_is_refused(tmp_path: Path) -> None:
    for path, part in ((tmp_path / "absent.csv", "not exist"), (tmp_path, "is a directory")):
        with pytest.raises(PvidError, match=part) as caught:
            read_run(path)
        assert str(path) in str(caught.value)
    (tmp_path / "run.tdms").write_bytes(b"TDSm")
    with pytest.raises(PvidError, match="must end in"):
        read_run(tmp_path / "run.tdms")
    folder = tmp_path / "folder.csv"
    folder.mkdir()
    with pytest.raises(PvidError, match="directory"):
        read_run(folder)


def test_binary_content_is_no_csv(tmp_path: Path) -> None:
    assert "zero byte" in refused(tmp_path / "a.csv", b"t,phi\x00,y\n")
    assert "line 2, column phi" in refused(tmp_path / "b.csv", "t,phi,y\n0,é,1\n".encode("latin-1"))
    refused(tmp_path / "d.csv", bytes(range(256)) * 40)


def whole_npz(**arrays: npt.NDArray[np.generic]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def test_faults_of_archives_are_named(tmp_path: Path) -> None:
    t = np.arange(50) / 1000.0
    path = tmp_path / "run.npz"
    assert "no column y" in refused(path, whole_npz(t=t, phi=t))
    assert "column phi" in refused(path, whole_npz(t=t, phi=np.zeros((50, 2)), y=t))
    assert "column y" in refused(path, whole_npz(t=t, phi=t, y=np.array(["a"] * 50)))
    assert "column y" in refused(path, whole_npz(t=t, phi=t, y=np.array([1j] * 50)))
    assert "50, 50 and 49" in refused(path, whole_npz(t=t, phi=t, y=t[1:]))
    assert "row 2, column t" in refused(path, whole_npz(t=t * np.resize([1, -1], 50), phi=t, y=t))
    refused(path, whole_npz(t=t, phi=t, y=np.array([{}] * 50, dtype=object)))
    single = io.BytesIO()
    np.save(single, t)
    assert "bare array" in refused(path, single.getvalue())
    whole = whole_npz(t=t, phi=t, y=t)
    refused(path, whole[: len(whole) // 2])
    refused(tmp_path / "run.parquet", b"PAR1 this is not")
    zipped = gzip.compress("\n".join(GOOD).encode())
    assert "gzip" in refused(tmp_path / "run.csv.gz", zipped[:-100])
    assert "gzip" in refused(tmp_path / "run.csv.gz", b"t,phi,y\n")
    assert "empty" in refused(tmp_path / "run.csv.gz", gzip.compress(b""))


# ---- never anything but a run or a sentence


def run_or_sentence(path: Path) -> None:
    try:
        run = read_run(path)
    except PvidError as error:
        assert str(path) in str(error) and "\n" not in str(error)
        return
    assert len(run) >= MIN_ROWS
    for signal in (run.t, run.phi, run.y):
        assert signal.dtype == np.float64 and signal.shape == run.t.shape
    assert np.all(np.isfinite(run.t))
    assert np.array_equal(np.isnan(run.phi), np.isnan(run.y))  # a missing tick lacks both
    assert run.notes or np.all(np.isfinite(run.phi))
    assert np.all(np.diff(run.t) > 0.0)
    assert math.isfinite(run.sample_rate) and run.sample_rate > 0.0


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(content=st.binary(max_size=400))
@relaxed
def test_any_bytes(suffix: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"any{suffix}"
    path.write_bytes(content)
    run_or_sentence(path)


@given(
    header=st.sampled_from(["t,phi,y", "t,phi,y,x", "y,t,phi", "t,phi", "t;phi;y", " t , phi,y"]),
    rows=st.lists(
        st.lists(
            st.one_of(
                st.floats().map(repr),
                st.integers(0, 20).map(lambda k: str(k / 10)),
                st.text(alphabet='0123456789.eE+-_,;"\t nainf\r\n\x00é', max_size=6),
            ),
            min_size=2,
            max_size=4,
        ).map(",".join),
        max_size=12,
    ),
    end=st.sampled_from(["", "\n", "\r\n", "\n\n"]),
)
@relaxed
def test_any_table_of_text(header: str, rows: list[str], end: str, tmp_path: Path) -> None:
    path = tmp_path / "any.csv"
    path.write_bytes(("\n".join([header, *rows]) + end).encode())
    run_or_sentence(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(data=st.data())
@relaxed
def test_a_good_file_with_damaged_bytes(suffix: str, data: st.DataObject, tmp_path: Path) -> None:
    path = tmp_path / f"good{suffix}"
    path.unlink(missing_ok=True)  # that of the example before, which is damaged
    write_run(path, run_of())
    content = bytearray(path.read_bytes())
    for position in data.draw(st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=4)):
        content[position] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(content)))
    path.write_bytes(bytes(content[:cut] if data.draw(st.booleans()) else content))
    run_or_sentence(path)


# ---- writing


def test_a_run_that_could_not_be_read_back_is_not_written(tmp_path: Path) -> None:
    good = run_of()
    bad = Run(good.t, np.where(np.arange(50) == 3, np.nan, good.phi), good.y, 1000.0)
    with pytest.raises(PvidError, match="row 4, column phi"):
        write_run(tmp_path / "run.csv", bad)
    with pytest.raises(PvidError, match="is not written: t runs at 1000 Hz"):
        write_run(tmp_path / "run.csv", Run(good.t, good.phi, good.y, 1010.0))
    with pytest.raises(PvidError, match="must end in"):
        write_run(tmp_path / "run.txt", good)
    with pytest.raises(PvidError, match="cannot be written"):
        write_run(tmp_path / "absent" / "run.csv", good)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_same_run_gives_the_same_bytes(suffix: str, tmp_path: Path) -> None:
    one, two = tmp_path / f"one{suffix}", tmp_path / f"two{suffix}"
    write_run(one, run_of())
    time.sleep(0.01)
    write_run(two, run_of())
    assert one.read_bytes() == two.read_bytes()
