"""Tables as instruments, loggers, boards and middleware write them: the same samples come out of each."""

import datetime
import re
from pathlib import Path

import numpy as np
import pytest

from pvid.base.errors import PvidError
from pvid.rig.columns import Channel, Columns
from pvid.rig.csv_table import read_csv
from pvid.rig.layout import find
from pvid.rig.table import Table

CHANNELS = (Channel("F", "N"), Channel("x", "m"))
ROWS = 120
T = np.round(np.arange(ROWS) * 0.002, 3)
F = np.round(5.0 * np.sin(9.0 * T) + 0.4, 3)
X = np.round(0.02 * np.cos(7.0 * T) + 0.001, 5)
CELLS = [(f"{t:.4f}", f"{f:.3f}", f"{x:.5f}") for t, f, x in zip(T, F, X, strict=True)]
PLAIN = [",".join(cells) for cells in CELLS]


def of(*lines: str) -> str:
    return "\n".join(lines) + "\n"


def table(path: Path, content: str | bytes, columns: str | None = None) -> Table:
    file = path / "run.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_csv(file, Columns(CHANNELS) if columns is None else Columns.parse(columns, CHANNELS))


def assert_same(found: Table, left_out: tuple[int, ...] = (), rtol: float = 0.0) -> None:
    kept = np.delete(np.arange(ROWS), left_out)
    np.testing.assert_allclose(found.t - found.t[0], T[kept] - T[kept[0]], rtol=0, atol=max(1e-12, rtol))
    np.testing.assert_allclose(found.signals["F"], F[kept], rtol=max(rtol, 1e-15))
    np.testing.assert_allclose(found.signals["x"], X[kept], rtol=max(rtol, 1e-15))


HEAD = "t,F,x"
OWN = [*enumerate(CELLS)]
BARE = [f"{f},{x}" for _, f, x in CELLS]
NAMES = "t=time,F=force,x=place"
IN_MM = [f"{t},{f},{float(x) * 1000:.2f}" for t, f, x in CELLS]
EARLY = [
    "ets Jun  8 2016 00:22:57",
    "",
    "rst:0x1 (POWERON_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT)",
    "configsip: 0, SPIWP:0xee",
    "clk_drv:0x00,q_drv:0x00,d_drv:0x00,cs0_drv:0x00,hd_drv:0x00,wp_drv:0x00",
    "mode:DIO, clock div:2",
    "load:0x3fff0030,len:1344",
    "entry 0x400805e4",
    "I (27) boot: ESP-IDF v5.1, 2nd stage bootloader",
]

# What stands around the table: the content, --columns, and what a note has to contain.
AROUND: dict[str, tuple[str | bytes, str | None, str]] = {
    "scope": (
        of("Record Length,120", "Sample Interval,2.0e-03", "Vertical Units,V", "", "Time,CH1,CH2", *PLAIN),
        "t=Time,F=CH1,x=CH2",
        "in front",
    ),
    "scope without names typed by place": (
        of("Record Length,120", "Sample Interval,2.0e-03", "", "Time,CH1,CH2", *PLAIN),
        "t=1,F=2,x=3",
        "in front",
    ),
    "titles without commas": (of("PASCO Capstone export", "Lab 3 group 5", "", HEAD, *PLAIN), None, "in front"),
    "titles with as many commas": (of("Group, of, 3", "recorded, by, hand", HEAD, *PLAIN), None, "in front"),
    "a sentence with the names": (of("The columns are t, F and x.", HEAD, *PLAIN), None, "in front"),
    "numbers in front": (of("1,2,3", "0,0,0", HEAD, *PLAIN), None, "in front"),
    "settings of two columns": (of(*(f"setting {k},{k * 3}" for k in range(150)), HEAD, *PLAIN), None, "150 lines"),
    "many settings": (of(*(f"setting {k},{k * 3}" for k in range(900)), HEAD, *PLAIN), None, "in front"),
    "settings behind": (
        of(HEAD, *(f"{line},set {k},{k}" if k < 8 else line for k, line in enumerate(PLAIN))),
        None,
        "",
    ),
    "settings behind with names": (
        of(f"{HEAD},,Key,Value", *(f"{line},,rate,500" if k < 5 else f"{line},,," for k, line in enumerate(PLAIN))),
        None,
        "",
    ),
    "settings in front": (
        of(*((f"Record Length,{k},pts," if k < 9 else ",,,") + line for k, line in enumerate(PLAIN))),
        "t=4,F=5,x=6",
        "",
    ),
    "settings in front, short names": (
        of(",,,t,F,x", *((f"Set,{k},V," if k < 9 else ",,,") + line for k, line in enumerate(PLAIN))),
        None,
        "",
    ),
    "boot text": (of(*EARLY, HEAD, *PLAIN), None, "in front"),
    "boot text, no names": (of(*EARLY, *PLAIN), "t=1,F=2,x=3", "in front"),
    "restart": (of(HEAD, *PLAIN[:60], *EARLY, HEAD, *PLAIN[60:]), None, "names come again"),
    "names again each 20 rows": (
        of(*(line for k in range(0, ROWS, 20) for line in (HEAD, *PLAIN[k : k + 20]))),
        None,
        "names come again 5 times",
    ),
    "footer": (of(HEAD, *PLAIN, "end"), None, "behind the table: line 122"),
    "interrupted": (of(HEAD, *PLAIN) + "^C", None, "behind the table"),
    "totals": (of(HEAD, *PLAIN, "", "Mean,0.4,0.001", "Total,3.2,0.2"), None, "behind the table"),
    "long footer": (
        of(HEAD, *PLAIN, "", "--- statistics", *(f"key {k} = {k}" for k in range(40))),
        None,
        "behind the table",
    ),
    "garbage first": (b"\xff\xfe" + of(HEAD, *PLAIN).encode(), None, ""),
    "garbage line first": (b"\xff\xfe\x00\xf8\x80\n" + of(HEAD, *PLAIN).encode(), None, "in front"),
    "garbage stuck to the names": (b"\x00\xe0\xfe" + of(HEAD, *PLAIN).encode(), None, ""),
    "names in a comment": (of("# made by a logger", "# t,F,x,mode", *(f"{line},auto" for line in PLAIN)), None, ""),
    "middleware": (
        of("%time,field.frame,field.F,field.x", *(f"{t},base link,{f},{x}" for t, f, x in CELLS)),
        "t=%time,F=field.F,x=field.x",
        "",
    ),
    "middleware, no mark typed": (of("%time,frame,F,x", *(f"{t},base,{f},{x}" for t, f, x in CELLS)), "t=time", ""),
    "names in another order in a comment": (of("# t,x,F", "# as above", HEAD, *PLAIN), None, ""),
    "a column of remarks": (of(HEAD + ",Comment", *PLAIN), None, ""),
    "LabVIEW": (
        of(
            "LabVIEW Measurement",
            "Separator\tTab",
            "***End_of_Header***",
            "",
            "Channels\t2",
            "Samples\t120\t120",
            "***End_of_Header***",
            "X_Value\tForce\tPlace\tComment",
            *("\t".join(cells) for cells in CELLS),
        ),
        "t=X_Value,F=Force,x=Place",
        "in front",
    ),
    "names and units in comments": (of("# t,F,x", "# s,N,mm", *IN_MM), None, "units"),
    "text with a comma beside": (of("t;F;x;ch", *(";".join(c) + ";1,2" for c in CELLS)), None, ""),
    "quoted text beside": (
        of("t,note,F,x", *(f'{t},"ok, {k}",{f},{x}' for k, (t, f, x) in enumerate(CELLS))),
        None,
        "",
    ),
    "text of any kind beside": (
        of("t,F,x,what", *(f"{line},{('up', '', '12', 'a b', '-')[k % 5]}" for k, line in enumerate(PLAIN))),
        None,
        "",
    ),
    "lines in quotes": (of(*(f'"{line}"' for line in (HEAD, *PLAIN))), None, ""),
    "pipes": (of("t|F|x", *("|".join(c) for c in CELLS)), None, ""),
    "table of markdown": (of("| t | F | x |", "|---|---|---|", *(f"| {' | '.join(c)} |" for c in CELLS)), None, ""),
    "blanks in columns": (
        of("       t        F         x", *(f"{t:>10} {f:>8}  {x:>8}" for t, f, x in CELLS)),
        None,
        "",
    ),
    "numbers of rows": (of('"t" "F" "x"', *(f'"{k + 1}" ' + " ".join(c) for k, c in enumerate(CELLS))), None, ""),
    "index of pandas": (of(",t,F,x", *(f"{k},{line}" for k, line in enumerate(PLAIN))), None, ""),
    "plotter": (of(*(f"t:{t},F:{f},x:{x}" for t, f, x in CELLS)), None, ""),
    "plotter with tabs": (of(*(f"t:{t}\tF:{f}\tx:{x}" for t, f, x in CELLS)), None, ""),
    "plotter with blanks": (of("ready", *(f"t: {t}, F: {f}, x: {x}" for t, f, x in CELLS)), None, ""),
    "plotter with equals": (of(*(f"t={t} F={f} x={x}" for t, f, x in CELLS)), None, ""),
    "doubled names": (of("t,F,x,x", *(f"{line},9" for line in PLAIN)), "x=3", ""),
    "utf-16": (of(HEAD, *PLAIN).encode("utf-16"), None, ""),
    "utf-16 be": (b"\xfe\xff" + of(HEAD, *PLAIN).encode("utf-16-be"), None, ""),
    "utf-16 le, no mark": (of(HEAD, *PLAIN).encode("utf-16-le"), None, ""),
    "utf-16 be, no mark": (of(HEAD, *PLAIN).encode("utf-16-be"), None, ""),
    "utf-8 mark": (b"\xef\xbb\xbf" + of(HEAD, *PLAIN).encode(), None, ""),
    "latin-1": (
        of("Zeit,Kraft,Weg [µm]", *(f"{t},{f},{float(x) * 1e6:.0f}" for t, f, x in CELLS)).encode("latin-1"),
        "t=Zeit,F=Kraft,x=Weg [µm]:um",
        "",
    ),
    "windows-1252": (
        of("Zeit;Kraft;Länge – Weg;€", *(";".join(c) + ";ü" for c in CELLS)).encode("cp1252"),
        "t=Zeit,F=Kraft,x=Länge – Weg",
        "",
    ),
    "names with commas": (of('t,"Force, N","Place, m: left"', *PLAIN), 'F="Force, N",x="Place, m: left":m', ""),
    "names with quotes": (of('t,F,"5"" rail"', *PLAIN), 'x="5"" rail"', ""),
    "rows begin with a separator": (of(HEAD, *(f",{line}" for line in PLAIN)), None, ""),
    "names are numbers": (of("x-axis,1,2", "second,Newton,meter", *PLAIN), "t=x-axis,F=2,x=3", "states units"),
    "numbers of samples, settings beside the names": (
        of("X,CH1,CH2,Start,Increment,", "Sequence,Volt,Volt,-1,2e-03,", *(f"{k},{f},{x}," for k, (_, f, x) in OWN)),
        "t=X,F=CH1,x=CH2",
        "X counts rows: one each 0.002 s, as line 2 states",
    ),
    "times in the unit of the stated step": (
        of(
            *("Name;rig", "Name;F;x", "SampleTime[ms];2;2", ""),
            *(f"{2 * k};{f};{x}" for k, (_, f, x) in enumerate(CELLS)),
        ),
        "t=1,F=2,x=3",
        "1 is in ms: a row each 0.002 s, as line 3 states",
    ),
    "no times, settings beside the names": (
        of("CH1,CH2,t0 = -1.5e+00s, tInc = 2.0e-03,", *(f"{f},{x},," for _, f, x in CELLS)),
        "F=CH1,x=CH2",
        "no column of time: a row each 0.002 s, as line 1 states",
    ),
    **{
        f"no times, {line}": (
            of(line, "F,x", *BARE[:50], "", "# halt", *BARE[50:]),
            None,
            "a row each 0.002 s",
        )
        for line in (
            "# dt = 0.002 s",
            "Sampling interval [ms]: 2",
            "sample_rate: 0.5 kHz",
            "# fs=500",
            "Sampling Rate;500;Hz",
            "Sample Interval,2.0e-03",
            "Abtastrate 500 Hz",
        )
    },
    "no times, damaged": (
        of("# Ts: 2 ms", "F;x", *BARE[:9], "?", *BARE[10:]).replace(",", ";"),
        None,
        "a damaged line",
    ),
    "no times, LabVIEW": (
        of(
            "X_Columns\tNo",
            "Delta_X\t0,002\t0,002",
            "***End_of_Header***",
            "F\tx\tComment",
            *(f"{f}\t{x}".replace(".", ",") for _, f, x in CELLS),
        ),
        None,
        "a row each 0.002 s, as line 2 states",
    ),
    "units in the cells": (of(HEAD, *(f"{t} s,{f}N,{float(x) * 1e3:.2f} mm" for t, f, x in CELLS)), None, "x in mm"),
    "tuples": (of("start", *(f"({line})".replace(",", ", ") for line in PLAIN)), "t=1,F=2,x=3", "brackets"),
    "lists": (of(*(f"[{' '.join(cells)}]" for cells in CELLS)), "t=1,F=2,x=3", "brackets"),
    "objects": (of(*(f'{{"t": {t}, "ok": true, "rig": {{"F": {f}, "x": {x}}}}}' for t, f, x in CELLS)), None, "words"),
    "messages": (
        of("boot", *(f"I (123) rig: t={t} s, force = {f} N; x -> x={x}" for t, f, x in CELLS), "end"),
        "F=force",
        "behind the table",
    ),
    "messages with times": (
        of(*(f"2024-05-02T10:00:0{t} [INFO] drive: F={f} x={float(x) * 1e3:.2f}mm" for t, f, x in CELLS)),
        None,
        "x in mm",
    ),
    "records of ROS 2": (
        of(
            *(
                f"stamp:\n  sec: 17\n  nanosec: {round(float(t) * 1e9)}\nforce: {f}\nposition:\n- {x}\n---"
                for t, f, x in CELLS
            )
        ),
        "F=force,x=position",
        "words",
    ),
    "damaged": (
        of(
            HEAD,
            *PLAIN[:40],
            "0.08,1.",
            *PLAIN[40:60],
            "W (81) wifi: reconnect",
            *PLAIN[60:80],
            PLAIN[80] + PLAIN[81],
            *PLAIN[82:],
        ),
        None,
        "3 damaged lines, the first is line 42",
    ),
}


@pytest.mark.parametrize("case", AROUND)
def test_table_is_found_whatever_stands_around_it(case: str, tmp_path: Path) -> None:
    content, columns, note = AROUND[case]
    found = table(tmp_path, content, columns)
    assert_same(found, {"damaged": (80, 81), "no times, damaged": (9,)}.get(case, ()))
    assert note in "; ".join(found.notes), found.notes


def test_names_beside_settings_are_found_where_none_is_sought() -> None:
    """What `look` reads; the line below the names has a number in each of the settings' columns, the rows have none."""
    rows = [f"{k},{x},," for k, (_, _, x) in OWN]
    found = find(["X,CH1,Start,Increment,", "Sequence,VOLT,-3.0e+00,2.0e-03", *rows], ())
    assert found is not None and (found.names, found.header) == (("X", "CH1", "Start", "Increment"), 1)


ABOVE_TIMES = ["time,F,x", "Time (s),F,x", "t_ms,F,x", "Zeit,F,x", "ms,F,x", "n,F,x"]


@pytest.mark.parametrize("names", ABOVE_TIMES)
def test_a_stated_step_does_not_replace_a_column_that_may_be_the_time(names: str, tmp_path: Path) -> None:
    """The nominal rate above real stamps, and a count of rows some of which were lost."""
    with pytest.raises(PvidError, match="no column t"):
        table(tmp_path, of("# fs = 1000 Hz", names, *PLAIN), None)


@pytest.mark.parametrize("front", ["# solver dt = 0.001 s", "# Sample rate: 1000 Hz (ADC)", "# PWM period 20 ms"])
def test_a_column_of_whole_seconds_is_no_count(front: str, tmp_path: Path) -> None:
    rows = [f"{k},{f},{x}" for k, (_, f, x) in enumerate(CELLS)]
    np.testing.assert_array_equal(table(tmp_path, of(front, "t,F,x", *rows)).t, range(len(rows)))


NO_STEPS = [
    *("Baud rate: 115200", "Feed rate: 5", "strain rate: 0.1 1/s", "PWM period: 50 us", "drive period = 2 s"),
    *("Encoder increment: 0.0015", "Delta X: 5", "Ts = 0.4 s settling time of the loop", "Sample rate: 1,000 Hz"),
    "Sample rate: 1 kHz, stored every 10th: dt = 0.01 s",
]


@pytest.mark.parametrize("front", NO_STEPS)
def test_what_may_be_another_rate_is_no_step(front: str, tmp_path: Path) -> None:
    with pytest.raises(PvidError, match="no column t"):
        table(tmp_path, of(f"# {front}", "F,x", *BARE), None)


@pytest.mark.parametrize("line", ["t={} ms F={},47 N x=0,0{}7 m", "({}; {},12; 0,1{})", "t={} F={} x=- 0.{}1"])
def test_printed_decimal_commas_and_lone_signs_are_not_read_as_other_numbers(line: str, tmp_path: Path) -> None:
    rows = [line.format(k, 1 + k % 3, k % 10) for k in range(40)]
    with pytest.raises(PvidError):
        table(tmp_path, of(*rows), "t=1,F=2,x=3" if line.startswith("(") else None)


# ---- numbers

MN = [(f"{round(t * 1000)}", round(f * 1000), round(x * 1e6)) for t, f, x in zip(T, F, X, strict=True)]
MILLI = "t=t:ms,F=F:mN,x=x:um"


def comma(line: str) -> str:
    return line.replace(",", ";").replace(".", ",")


def german(value: float, digits: int) -> str:
    return f"{value:,.{digits}f}".translate(str.maketrans(",.", ".,"))


def swiss(value: float, mark: str) -> str:
    return f"{value:,}".replace(",", mark)


NUMBERS: dict[str, tuple[str | bytes, str | None]] = {
    "decimal commas": (of("t;F;x", *map(comma, PLAIN)), None),
    "decimal commas and tabs": (of("t;F;x", *map(comma, PLAIN)).replace(";", "\t"), None),
    "decimal commas and blanks": (of("t;F;x", *map(comma, PLAIN)).replace(";", "   "), None),
    "decimal commas in quotes": (
        of(HEAD, *(",".join(f'"{c}"'.replace(".", ",") for c in cells) for cells in CELLS)),
        None,
    ),
    "decimal commas, some whole numbers": (
        of("t;F;x", *(f"{k * 2};{f:g};{x:g}".replace(".", ",") for k, (f, x) in enumerate(zip(F, X, strict=True)))),
        "t=t:ms",
    ),
    "three decimals with commas": (
        of(
            "t;F;x",
            *(f"{t:.3f};{f:.3f};{x * 1000 + 30:.3f}".replace(".", ",") for t, f, x in zip(T, F, X, strict=True)),
        ),
        "offset",
    ),
    "exponents": (of(HEAD, *(f"{t:.6e},{f:+.6E},{x:.6e}" for t, f, x in zip(T, F, X, strict=True))), None),
    "exponents of Fortran": (
        of(
            "t F x",
            *(f"{t:.6e} {f:.6E} {x:.6e}".replace("e", "D").replace("E", "D") for t, f, x in zip(T, F, X, strict=True)),
        ),
        None,
    ),
    "thousands and point": (
        of(HEAD, *(f'"{1000 * k * 2:,}","{f:,}.0","{x:,}.0"' for k, (_, f, x) in enumerate(MN))),
        "t=t:us,F=F:mN,x=x:um",
    ),
    "thousands of whole numbers": (of(HEAD, *(f'{t},"{f:,}","{x:,}"' for t, f, x in MN)), MILLI),
    "thousands of whole numbers behind tabs": (
        of(HEAD.replace(",", "\t"), *(f"{t}\t{f:,}\t{x:,}" for t, f, x in MN)),
        MILLI,
    ),
    "thousands in a few rows": (
        of(HEAD, *(f'{k * 10 + 9_000:d},{f},"{x:,}"' for k, (_, f, x) in enumerate(MN))),
        "t=t:0.0002,F=F:mN,x=x:um",
    ),
    "thousands of a later row": (
        of(HEAD, *(f'"{k * 20:,}",{f},{x}' for k, (_, f, x) in enumerate(MN))),
        "t=t:1e-4,F=F:mN,x=x:um",
    ),
    "points and decimal commas": (of("t;F;x", *(f"{t};{german(f, 1)};{german(x, 2)}" for t, f, x in MN)), MILLI),
    "apostrophes": (of(HEAD, *(f"{t},{swiss(f, chr(39))},{swiss(x, chr(39))}" for t, f, x in MN)), MILLI),
    "blanks between": (of("t;F;x", *(f"{t};{swiss(f, ' ')},0;{swiss(x, ' ')},0" for t, f, x in MN)), MILLI),
    "no-break blanks": (of("t;F;x", *(f"{t};{swiss(f, chr(0xA0))};{swiss(x, chr(0x202F))}" for t, f, x in MN)), MILLI),
    "no-break blanks of Windows": (
        of("t;F;x", *(f"{t};{swiss(f, chr(0xA0))};{swiss(x, chr(0xA0))}" for t, f, x in MN)).encode("cp1252"),
        MILLI,
    ),
    "commas beside": (of("t;F;x;list", *(f"{t};{f};{x};1,5" for t, f, x in CELLS)), None),
    "thousands beside": (of("t,F,x,bytes", *(f'{line},"{k * 1000:,}"' for k, line in enumerate(PLAIN))), None),
    "minus sign of typesetting": (of(HEAD, *(line.replace("-", "−") for line in PLAIN)), None),
    "plus signs": (of(HEAD, *(f"+{t},{float(f):+.3f},{float(x):+.5f}" for t, f, x in CELLS)), None),
    "no digit in front of the point": (
        of(HEAD, *(line.replace(",0.", ",.").replace("-0.", "-.") for line in PLAIN)),
        None,
    ),
    "quoted": (of('"t","F","x"', *('"' + line.replace(",", '","') + '"' for line in PLAIN)), None),
    "blanks behind commas": (of("t, F, x", *(line.replace(",", ",  ") for line in PLAIN)), None),
    "quotes behind blanks": (of('t, "F", "x"', *(f'{t}, "{f}", "{x}"' for t, f, x in CELLS)), None),
}


@pytest.mark.parametrize("case", NUMBERS)
def test_numbers_are_read_in_every_style(case: str, tmp_path: Path) -> None:
    content, columns = NUMBERS[case]
    if columns == "offset":
        found = table(tmp_path, content)
        np.testing.assert_array_equal(found.signals["x"], [float(f"{x * 1000 + 30:.3f}") for x in X])
        np.testing.assert_array_equal(found.t, T)
        return
    assert_same(table(tmp_path, content, columns), rtol=1e-12)


def test_a_column_of_decimal_commas_is_read_where_the_file_groups_no_digits(tmp_path: Path) -> None:
    """Behind a semicolon: 980 and 1000 beside 171,562, which alone can be 171562."""
    found = table(tmp_path, of("t;F;x", *(f"{20 * k};{k + 1},250;{k + 2},375" for k in range(60))), "t=t:ms")
    assert found.signals["F"][:2].tolist() == [1.25, 2.25] and found.signals["x"][-1] == 61.375


def test_what_is_wrong_with_every_line_has_its_likely_cause(tmp_path: Path) -> None:
    with pytest.raises(PvidError, match="one column alone: that of the time, t .s. or another name, is missing"):
        table(tmp_path, of("x", *map(str, X)))
    both = [f"{k + 7},1,25,7,5" for k in range(50)]
    with pytest.raises(PvidError, match="5 columns where the header has 3, as if the comma separated columns and were"):
        table(tmp_path, of(HEAD, *both))
    assert "3 names for 5 columns, as if the comma" in table(tmp_path, of(HEAD, *both), "t=1,F=2,x=4").notes[0]


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        (of(HEAD, *(f'{k},"{k + 1},125","{k + 2},375"' for k in range(50))), ["'1,125' can be 1125 or 1.125"]),
        (of("t;F;x", *(f"{k};{k + 1},250;{k + 2},375" for k in range(50))), ["can be 1250 or 1.250"]),
        (
            of("t;F;x", *(f"{k};{german(k * 40, 0)};{german(k * 130, 0)}" for k in range(60))),
            ["'1.000' can be 1000 or 1.000"],
        ),
        (
            of(
                "t;F;x",
                *(f"{k};{k / 7:.2f};{k / 9:.2f}" + "" for k in range(30)),
                *(f"{k};{k / 7:.2f};{k / 9:.2f}".replace(".", ",") for k in range(30, 60)),
            ),
            ["both the comma and the point"],
        ),
    ],
)
def test_numbers_that_can_be_read_in_two_ways_are_refused(content: str, parts: list[str], tmp_path: Path) -> None:
    with pytest.raises(PvidError) as caught:
        table(tmp_path, content)
    for part in parts:
        assert part in str(caught.value)


MISSING = [
    *"NaN nan -nan NA N/A n/a #N/A null NULL None -nan(ind) nan(ind) 1.#QNAN -1.#IND -1.#IND00".split(),
    *"1.#INF #NV --- -- - OL OVERLOAD OVERFLOW Over".split(),
    *"+OL inf -inf Infinity ***** 9.9E+37 9.91E37 #DIV/0! ?".split(),
    "",
    "   ",
    "\t",
]


@pytest.mark.parametrize("separator", [",", ";"])
def test_cells_that_mean_missing(separator: str, tmp_path: Path) -> None:
    rows = [list(cells) for cells in CELLS]
    at = [3 + 3 * k for k in range(len(MISSING))]
    for k, word in zip(at, MISSING, strict=True):
        rows[k][2] = word
    content = of(HEAD, *(",".join(cells) for cells in rows)).replace(",", separator)
    found = table(tmp_path, content)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.signals["x"])), at)
    np.testing.assert_array_equal(found.signals["F"], F)
    assert any("OVERLOAD" in note or "of x (" in note for note in found.notes)


# ---- time

START = datetime.datetime(2024, 5, 2, 23, 59, 59, 900_000)
AT = [START + datetime.timedelta(milliseconds=2 * k) for k in range(ROWS)]
TIMES = {
    "iso": [one.isoformat(timespec="microseconds") for one in AT],
    "iso with a zone": [one.isoformat(timespec="milliseconds") + "+02:00" for one in AT],
    "iso with Z": [one.isoformat(timespec="milliseconds") + "Z" for one in AT],
    "iso with a blank": [str(one) for one in AT],
    "iso with nanoseconds": [one.isoformat(timespec="microseconds") + "000" for one in AT],
    "iso with a comma": ['"' + one.isoformat(timespec="milliseconds").replace(".", ",") + '"' for one in AT],
    "slashes": [one.strftime("%Y/%m/%d %H:%M:%S.%f") for one in AT],
    "points": [one.strftime("%d.%m.%Y %H:%M:%S.%f") for one in AT],
    "named month": [one.strftime("%d-%b-%Y %H:%M:%S.%f") for one in AT],
    "clock past midnight": [one.strftime("%H:%M:%S.%f") for one in AT],
    "clock of 12 hours": [one.strftime("%I:%M:%S.%f %p") for one in AT],
    "clock with a third colon": [one.strftime("%H:%M:%S:%f")[:-3] for one in AT],
    "compact": [one.strftime("%Y%m%d %H:%M:%S.%f") for one in AT],
    "minutes": [one.strftime("%M:%S.%f") for one in AT],
    "elapsed": [f"0:00:{2 * k / 1000:06.3f}" for k in range(ROWS)],
    "days since": [f"0 days 00:00:{2 * k / 1000:09.6f}" for k in range(ROWS)],
    "epoch": [f"{one.replace(tzinfo=datetime.UTC).timestamp():.3f}" for one in AT],
}


@pytest.mark.parametrize("case", TIMES)
def test_time_as_text_becomes_seconds(case: str, tmp_path: Path) -> None:
    content = of("stamp,F,x", *(f"{at},{f},{x}" for at, (_, f, x) in zip(TIMES[case], CELLS, strict=True)))
    found = table(tmp_path, content, "t=stamp")
    assert_same(found, rtol=3e-7 if case == "epoch" else 0.0)
    if case != "epoch":
        np.testing.assert_array_equal(found.t, T)


@pytest.mark.parametrize("unit", ["s", "ms", "us"])
def test_stamps_of_a_serial_monitor(unit: str, tmp_path: Path) -> None:
    stamps = [one.strftime("%H:%M:%S.%f")[:-3] for one in AT]
    lines = [f"{at} -> {f},{x}" for at, (_, f, x) in zip(stamps, CELLS, strict=True)]
    assert_same(table(tmp_path, of("23:59:59.870 -> F,x", *lines)))
    assert_same(table(tmp_path, of("23:59:59.800 -> starting", "23:59:59.870 -> F,x", *lines)))
    own = [f"[{at}] {line}" for at, line in zip(stamps, PLAIN, strict=True)]
    assert_same(table(tmp_path, of("[23:59:59.870] t,F,x", *own)))
    plotted = [f"{at} -> F:{f}\tx:{x}" for at, (_, f, x) in zip(stamps, CELLS, strict=True)]
    assert_same(table(tmp_path, of(*plotted)))
    scaled = {"s": "", "ms": ":1", "us": ":1"}[unit]
    assert_same(table(tmp_path, of(HEAD, *own), f"t=stamp{scaled}"))


def test_dates_that_can_be_read_in_two_ways_are_refused_past_midnight(tmp_path: Path) -> None:
    stamps = [one.strftime("%m/%d/%Y %H:%M:%S.%f") for one in AT]
    content = of("t,F,x", *(f"{at},{f},{x}" for at, (_, f, x) in zip(stamps, CELLS, strict=True)))
    with pytest.raises(PvidError, match="two ways"):
        table(tmp_path, content)
    assert_same(table(tmp_path, content.replace("05/03/2024", "05/13/2024").replace("05/02/2024", "05/12/2024")))
    first = of("t,F,x", *(f"05/02/2024 {at[11:]},{f},{x}" for at, (_, f, x) in zip(stamps[51:], CELLS, strict=False)))
    assert len(table(tmp_path, first).t) == ROWS - 51


# ---- units


@pytest.mark.parametrize(
    ("head", "columns", "note"),
    [
        ([HEAD, "s,N,mm"], None, "x in mm"),
        ([HEAD, "[s],[N],[mm]"], None, "x in mm"),
        ([HEAD, "(s),(N),(mm)"], None, "x in mm"),
        ([HEAD, "second,Newton,millimeter"], "x=x:mm", "line 2 states units"),
        ([HEAD, "s,N,m"], "x=x:mm", "line 2 states units"),
        ([HEAD, '"s","N","mm"'], None, "x in mm"),
        ([HEAD, "", "s,N,mm", ""], None, "x in mm"),
        (['"TOA5","CR1000","1234"', '"t","F","x"', '"s","N","mm"', '"Smp","Smp","Avg"'], None, "x in mm"),
        (
            ['"TOA5","lab","CR1000","1234","x.Std.22"', '"t","F","x"', '"TS","N","mm"', '"","Smp","Smp"'],
            None,
            "x in mm",
        ),
        (["t,F,x [mm]"], "x=x [mm]", "x in mm"),
        (["t [s],F (N),x [mm]"], None, "x in mm"),
        (["t,F,x (mm)"], "x=3", "x in mm"),
        (["time,force,place", "s,N,mm"], "t=1,F=2,x=3", "x in mm"),
        (["Source,CH1,CH2,,", "s,N,mm"], "t=1,F=2,x=3", "x in mm"),
        (["Source,CH1,CH2,,", "s,N,mm"], "t=Source,F=CH1,x=CH2", "x in mm"),
        (["Scope 1000", "s,N,mm"], "t=1,F=2,x=3", "x in mm"),
        (["s,N,mm"], "t=1,F=2,x=3", "x in mm"),
        (["time,force,place", "sec,N,V"], f"{NAMES}:mm", "line 2 states units"),
        ([HEAD, "second,Volt,Volt"], "x=x:mm", "'Volt' of column 'F' is no unit of its signal"),
    ],
)
def test_units_of_the_file(head: list[str], columns: str | None, note: str, tmp_path: Path) -> None:
    found = table(tmp_path, of(*head, *IN_MM), columns)
    assert_same(found, rtol=1e-14)
    assert note in "; ".join(found.notes), found.notes


def test_an_index_in_brackets_is_no_unit(tmp_path: Path) -> None:
    found = table(tmp_path, of("t,u[1],u[2]", *PLAIN), "F=u[1],x=u[2]")
    assert_same(found)
    assert found.notes == ()


@pytest.mark.parametrize(
    ("si", "unit", "one"),
    [
        ("rad/s", "rpm", 2 * np.pi / 60),
        ("rad/s", "rev/min", 2 * np.pi / 60),
        ("rad/s", "U/min", 2 * np.pi / 60),
        ("rad/s", "1/min", 2 * np.pi / 60),
        ("rad/s", "deg/s", np.pi / 180),
        ("rad/s", "°/s", np.pi / 180),
        ("rad/s", "-rev/s/4", -np.pi / 2),
        ("rad/s^2", "deg/s^2", np.pi / 180),
        ("m/s^2", "g", 9.80665),
        ("m/s^2", "mg", 9.80665e-3),
        ("kg", "g", 1e-3),
        ("m/s", "km/h", 1 / 3.6),
        ("N*m", "mN*m", 1e-3),
        ("N*m", "mNm", 1e-3),
        ("N*m", "N cm", 1e-2),
        ("N", "kN", 1e3),
        ("V", "mV", 1e-3),
        ("A", "µA", 1e-6),
        ("ohm", "kOhm", 1e3),
        ("Pa", "bar", 1e5),
        ("kg*m^2", "g*cm^2", 1e-7),
        ("", "%", 1e-2),
        ("s", "h", 3600.0),
    ],
)
def test_units_of_every_dimension(si: str, unit: str, one: float) -> None:
    columns = Columns.parse(f"n=n:{unit}", (Channel("n", si),))
    assert columns["n"].in_si(np.ones(1))[0] == pytest.approx(one, rel=1e-15)


def test_temperatures_have_an_offset() -> None:
    kelvin = (Channel("T", "K"),)
    assert Columns.parse("T=T:degC", kelvin)["T"].in_si(np.array([20.0]))[0] == 293.15
    assert Columns.parse("T=T:C", kelvin)["T"].in_si(np.array([20.0]))[0] == 293.15  # no charge
    assert Columns.parse("T=T:degF", kelvin)["T"].in_si(np.array([68.0]))[0] == pytest.approx(293.15, rel=1e-12)
    for unit, part in (("-degC", "offset"), ("degC/10", "offset"), ("V", "'V' is no unit of T; it is K, degC or")):
        with pytest.raises(PvidError, match=re.escape(part)):
            Columns.parse(f"T=T:{unit}", kelvin)
