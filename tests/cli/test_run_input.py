"""Runs as people have them, through the command line: no rig file, other columns, gaps, jitter; and their cost."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from in_process import pvid
from own_mechanisms import OWN, own_recording
from pendulum_plant import STANDARD_PENDULUM, simulate, standard_sensors
from pendulum_run import Run, read_run, write_run

from pvid.base.errors import PvidError
from pvid.log.rig_choice import rig_of
from pvid.rig.mechanism_file import MechanismRig, rig_path_of
from pvid.rig.run import Recording
from pvid.sim.simulated_run import simulation_of

Float = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def run() -> Run:
    """The standard rig, small angles, 14 bits, 20 s at 1 kHz."""
    return simulate(sensors=standard_sensors(14), release=(0.02, 0.05), truth="full", duration=20.0, seed=4).run


def write(path: Path, run: Run | Recording, rows: npt.NDArray[np.int64] | None = None, t: Float | None = None) -> Path:
    """The rows of a run, with other times where they are given."""
    recording = run.recording if isinstance(run, Run) else run
    rows = np.arange(len(recording)) if rows is None else rows
    columns = {"t": recording.t if t is None else t, **recording.signals}
    lines = [
        ",".join(map(repr, cells)) for cells in zip(*(one[rows].tolist() for one in columns.values()), strict=True)
    ]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n")
    return path


def answer(*arguments: str | Path) -> dict[str, Any]:
    known = ("--set", "l1=0.3") if "kapitza" in arguments or "--model" not in arguments else ()
    done = pvid("identify", *arguments, *known, "--json")
    assert done.return_value == 0, done.output
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def settings_of(core: str) -> tuple[str, ...]:
    """By the weak form alone."""
    return ("--core", core, "--no-refine")


@pytest.fixture(scope="module")
def clean(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict[str, Any]]:
    """The answer of a core to the run as it is."""
    path = write(tmp_path_factory.mktemp("clean") / "clean.csv", run)
    return cache(lambda core: answer(path, *settings_of(core)))


# ---- the rig


def test_l1_is_all_that_is_needed(run: Run, clean: Callable[[str], dict[str, Any]], tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", run)
    found = clean("f64")
    assert found["parameters"]["g"]["value"] == pytest.approx(STANDARD_PENDULUM.g, rel=0.01)  # the README's promise
    assert found["input"] == []
    with pytest.raises(PvidError, match=r"l1 \[m\] of the rig is missing: use --set known\.l1=0\.3 with the value"):
        pvid("identify", path)
    with pytest.raises(PvidError, match="does not exist"):
        pvid("identify", tmp_path / "absent.csv")


@pytest.mark.parametrize("name", ["run.csv", "run.csv.gz", "run.npz", "run.parquet"])
def test_the_rig_file_beside_a_run_is_taken_by_itself(name: str, run: Run, tmp_path: Path) -> None:
    path = tmp_path / name
    write_run(path, run)
    rig = MechanismRig("kapitza", 1000.0, known={"l1": 0.3})
    rig.write(tmp_path / "run.toml")
    assert rig_path_of(path) == tmp_path / "run.toml"
    assert rig_of(path) == rig
    assert rig_of(path, None, ["known.l1=0.5"]).known == {"l1": 0.5}
    (tmp_path / "other.toml").write_text("[known]\nl1 = 0.7\n")
    assert rig_of(path, tmp_path / "other.toml").known == {"l1": 0.7}


def test_settings_come_before_what_the_file_holds(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text("sample_rate = 500\n[sensor]\nphi.resolution = 1e-3\ny.resolution = 2e-5\n")
    with pytest.raises(PvidError, match=r"l1 \[m\] of the rig is missing"):
        rig_of(None, file, [], "kapitza")
    rig = rig_of(None, file, ["known.l1=0.25", "sensor.phi.resolution = 0.0015", "nominal.l2=1"], "kapitza")
    assert (rig.known, rig.sample_rate, rig.nominal) == ({"l1": 0.25}, 500.0, {"l2": 1.0})
    assert rig.sensor == {"phi": {"resolution": 0.0015}, "y": {"resolution": 2e-5}}
    file.write_text("sensor = 3\n[known]\nl1 = 0.3\n")
    with pytest.raises(PvidError, match="sensor is a number, not a table"):
        rig_of(None, file, ["sensor.phi.resolution=0.1"], "kapitza")


@pytest.mark.parametrize(
    ("setting", "part"),
    [
        ("known.l1", "--set 'known.l1' is not KEY=VALUE, as in --set known.g=9.81"),
        ("=3", "--set '=3' is not KEY=VALUE"),
        ("known.l1=", "--set 'known.l1=' is not KEY=VALUE"),
        ("known.l1=long", "known.l1 must be a number, not 'long'"),
        ("known.l1=nan", "known.l1 must be a number, not 'nan'"),
        ("known.l1=[1,2]", "known.l1 must be a number"),
        ("known.l3=1", "known.l3: the model has no 'l3'; it has l1"),
        (
            "l3=1",
            "'l3' is not a key of the rig file of a mechanism: is known.l1 meant?; constants of kapitza: known.l1; ",
        ),
        ("L1=1", "'L1' is not a key of the rig file of a mechanism: is known.l1 meant?"),
        ("sample_rat=1", "'sample_rat' is not a key of the rig file of a mechanism: is sample_rate meant?"),
        ("g=9.7", "'g' is no constant of kapitza but is identified: nominal.g is its rough guess"),
        ("sensor.phi.lsb=1", "sensor.phi: 'lsb' is not a key: resolution, noise"),
        ("sensor.phi.resolution=-2", "sensor.phi.resolution must not be negative"),
        ("identifier.divider=4", "identifier.divider = '4' is of the strong form"),
        ("motor.torque=1", "'motor' is not a key of the rig file"),
    ],
)
def test_a_wrong_setting_is_one_sentence_that_names_the_key(setting: str, part: str) -> None:
    with pytest.raises(PvidError, match=f"^{re.escape(part)}") as caught:
        rig_of(None, None, ["known.l1=0.3", setting], "kapitza").compiled()
    assert str(caught.value).isprintable()


def test_every_command_that_reads_a_run_takes_rig_settings_and_columns(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "mine.csv"
    rows = zip(range(8000), np.rad2deg(run.phi).tolist(), (1e3 * run.y).tolist(), strict=False)
    path.write_text("time_ms;angle_deg;h\n" + "".join(f"{k};{a!r};{b!r}\n".replace(".", ",") for k, a, b in rows))
    given = ["--set", "l1=0.3", "--columns", "t=time_ms:ms,phi=angle_deg:deg,y=h:mm"]
    assert pvid("identify", path, *given, "--no-refine").return_value == 0
    assert pvid("compare", path, *given).return_value == 0
    assert pvid("plot", path, *given, "-o", tmp_path / "a.png").return_value == 0
    assert pvid("design", "--run", path, *given, "--set", "sample_rate=1000").return_value == 0
    with pytest.raises(PvidError, match="use --columns t=time_ms:ms,y=h:m,phi=angle_deg:deg"):
        pvid("identify", path, *given[:2])
    with pytest.raises(PvidError, match="--columns needs --run"):
        pvid("design", *given)


# ---- gaps and jitter, up to the answer


def test_dropped_samples_and_jitter_leave_the_answer(
    run: Run, clean: Callable[[str], dict[str, Any]], tmp_path: Path
) -> None:
    whole = clean("f64")["parameters"]
    random = np.random.default_rng(1)
    kept = np.delete(np.arange(len(run)), random.choice(np.arange(1, len(run) - 1), 20, replace=False))
    dropped = answer(write(tmp_path / "dropped.csv", run, kept), *settings_of("f64"))
    late = answer(
        write(tmp_path / "late.csv", run, t=run.t + 2e-4 * random.uniform(-1, 1, len(run))), *settings_of("f64")
    )
    for found, told in ((dropped, "missing samples: 20 of 20000, in 20 gaps"), (late, "smoother without that")):
        assert told in str(found["input"])
        for name in ("w", "d1", "d2"):
            # other noise at 20 of 20 000 samples
            one = found["parameters"][name]
            assert abs(one["value"] - whole[name]["value"]) < 0.3 * whole[name]["se"], name


def test_clock_error_of_a_thousandth_is_reported(run: Run, tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", run, t=run.t * 1.001)
    MechanismRig("kapitza", 1000.0, known={"l1": 0.3}).write(tmp_path / "run.toml")
    done = pvid("identify", path, "--no-refine", "--json")
    assert done.stderr.startswith("pvid: input: t runs at 999 Hz, -0.1 % off the rig's sample rate: t is used")
    assert json.loads(done.stdout)["input"] == [done.stderr.splitlines()[0].removeprefix("pvid: input: ")]


GAPPED = {  # core, by which each is identified; a shipped rig or a model file of a user's own, one without an input
    "kapitza": "f32",
    "dc_motor": "q31",
    "heated_plate": "f64",
    "free_pendulum": "f64",
}


def recording_of(name: str) -> Recording:
    if name in OWN:
        return own_recording(name)
    simulation = simulation_of(name)
    found = {one: values[:20000] for one, values in simulation.run(seed=4).items()}
    return Recording(found.pop("t"), found, simulation.rig.sample_rate)


@pytest.mark.parametrize(("name", "core"), GAPPED.items())
def test_a_long_gap_costs_windows_and_no_answer(name: str, core: str, tmp_path: Path) -> None:
    recording = recording_of(name)
    ticks, rate = len(recording), recording.sample_rate
    gap = np.arange(3 * ticks // 10, 3 * ticks // 10 + ticks // 40)
    model = ("--model", OWN[name].path if name in OWN else name, *settings_of(core))
    whole = answer(write(tmp_path / "whole.csv", recording), *model)
    found = answer(write(tmp_path / "run.csv", recording, np.delete(np.arange(ticks), gap)), *model)
    where = f"first at {gap[0] / rate:.6g} s, longest {len(gap) / rate:.6g} s"
    assert f"missing samples: {len(gap)} of {ticks}, in 1 gap ({where})" in found["input"][0]
    assert "identified from 2 segments together" in found["input"][1]
    for parameter, one in found["parameters"].items():
        # a few windows less: well below the errors that both share
        assert abs(one["value"] - whole["parameters"][parameter]["value"]) < 2 * one["se"], parameter


def test_a_piece_behind_a_gap_that_is_too_short_for_a_window_is_named(tmp_path: Path) -> None:
    recording = recording_of("dc_motor")
    ticks, rate = len(recording), recording.sample_rate
    rows = np.delete(np.arange(ticks), np.arange(ticks - 540, ticks - 40))
    found = answer(write(tmp_path / "run.csv", recording, rows), "--model", "dc_motor")
    expected = f"identified from one segment of {(ticks - 540) / rate:.3g} s; left out, as too short for a window"
    assert any(expected in one for one in found["input"])


def test_both_cores_and_their_twins_take_gaps_alike(tmp_path: Path) -> None:
    recording = recording_of("heated_plate")
    rows = np.delete(np.arange(len(recording)), np.r_[1200:1201, 1600:1700])
    path = write(tmp_path / "run.csv", recording, rows)
    done = pvid("compare", path, "--model", OWN["heated_plate"].path, "--core", "all")
    assert done.return_value == 0, done.output


# ---- what reading costs

# VmHWM and not getrusage, whose peak a child has from its parent.
_MEASURED = """
import re, sys, time
import numpy, pyarrow.csv
from pvid.rig.columns import Channel, Columns
from pvid.rig.run import read_recording
columns = Columns((Channel("phi", "rad"), Channel("y", "m")))
def peak():
    return int(re.search("VmHWM:\\s+(\\d+) kB", open("/proc/self/status").read())[1])
before, begin = peak(), time.process_time()
rows = len(read_recording(sys.argv[1], None, columns))
print(rows, peak() - before, time.process_time() - begin)
"""


def reading(path: Path) -> tuple[int, float, float]:
    """Rows, growth of the largest resident memory [bytes] and processor time [s]."""
    done = subprocess.run([sys.executable, "-c", _MEASURED, str(path)], capture_output=True, text=True, check=True)
    rows, kilobytes, seconds = done.stdout.split()
    return int(rows), 1024.0 * float(kilobytes), float(seconds)


@pytest.mark.parametrize("jitter", [0.0, 2e-4])
def test_a_row_costs_a_few_numbers_of_memory_and_time_grows_with_the_rows(jitter: float, tmp_path: Path) -> None:
    """The same per row at 200 000 rows as at 10^7: three numbers, and as many again while they grow."""
    random = np.random.default_rng(1)
    small, large = 20_000, 220_000
    costs = []
    for rows in (small, large):
        t = np.arange(rows) / 1000.0 + jitter * random.uniform(-1, 1, rows)
        table = np.stack([t, 0.1 * np.sin(5 * t), 0.01 * np.cos(7 * t)], axis=1).tolist()
        path = tmp_path / f"{rows}.csv"
        path.write_text("t,phi,y\n" + "".join(f"{a!r},{b!r},{c!r}\n" for a, b, c in table))
        costs.append(reading(path))
        assert costs[-1][0] == pytest.approx(rows, abs=1)
    (_, low, short), (_, high, long) = costs
    # 10^7 rows within 500 MB leave 40 bytes a row beside the interpreter's own 100 MB; the blocks of what is read take
    # 8 MB more until there are several, and 4 where the threads that read are ahead of a busy machine
    assert high - low < 40 * (large - small) + 12e6
    assert high < 100e6
    # Eleven times the rows in eleven times the processor time, and half as much again on a busy machine; a step that
    # went through all rows for each block would take 121 times.
    assert long < 1.5 * large / small * short


def test_the_run_in_a_file_of_many_blocks_is_whole(tmp_path: Path) -> None:
    rows = 100_000
    t = np.arange(rows) / 1000.0
    run = Run(t, np.random.default_rng(2).standard_normal(rows), np.sqrt(t), 1000.0)
    write_run(tmp_path / "run.csv", run)
    again = read_run(tmp_path / "run.csv")
    for name in ("t", "phi", "y"):
        assert getattr(again, name).tobytes() == getattr(run, name).tobytes()
