"""`pvid look`: what is in a file, and a next command that works."""

import gzip
import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from in_process import pvid

from pvid.base.console import DONE
from pvid.base.errors import PvidError
from pvid.cli.main import main
from pvid.identification.survey import lines_of_a_model, proposals, surveyed, unit_of_name
from pvid.models.simulated_rig import simulated_rig


def written(path: Path, head: str, columns: list[list[str]]) -> Path:
    rows = [",".join(row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


N = 3000
T = np.arange(N) / 500
SLOW = 0.1 * np.sin(2 * np.pi * 1.3 * T)


def numbers(values: np.ndarray, digits: int = 5) -> list[str]:
    return [f"{one:.{digits}f}" for one in values]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Of an instrument: a title, a row of units, and a column of every kind."""
    random = np.random.default_rng(1)
    force = np.repeat(random.uniform(-5, 5, N // 100), 100)
    counts = np.round(20000 * T + 2000 * np.sin(3 * T)) % 65536
    wild = np.where(np.arange(N) % 300 == 7, -1.0, SLOW)
    half = [one if k % 2 == 0 else "" for k, one in enumerate(numbers(SLOW))]
    clipped = np.clip(SLOW + 1e-4 * random.standard_normal(N), -1.0, 0.08)
    head = ("scope 7\ntime,force,angle,counts,wild,half,clipped,name,level,row\nms,N,deg,,mm,m,V,,A,\n").rstrip("\n")
    columns = [numbers(1000 * T, 1), numbers(force, 3), numbers(573 * SLOW, 2), numbers(counts, 0), numbers(wild)]
    columns += [half, numbers(clipped), ["arm"] * N, ["1.5"] * N, [str(k) for k in range(N)]]
    return written(tmp_path / "of an instrument.csv", head, columns)


def test_every_column_is_told_in_the_numbers_of_the_file(file: Path) -> None:
    survey = surveyed(file)
    facts = {one.name: one for one in survey.facts}
    assert survey.recording.sample_rate == 500 and len(survey.recording) == N - 1 and survey.time == "t=time"
    assert {name: one.unit for name, one in facts.items() if one.unit} == {
        "force": "N", "angle": "deg", "wild": "mm", "half": "m", "clipped": "V", "level": "A",
    }  # fmt: skip
    assert facts["force"].is_set and "29 changes" in facts["force"].remarks[0]
    assert facts["angle"].step == pytest.approx(0.01) and facts["angle"].high == pytest.approx(57.3, abs=0.01)
    assert facts["angle"].reaches == pytest.approx(1.3, abs=0.5) and facts["angle"].remarks == ()
    assert "starts over after 65536" in facts["counts"].remarks[0]
    assert facts["wild"].remarks == ("10 samples are far from those about them, most often -1 mm",)
    assert facts["half"].remarks == ("50 % of the rows have no number",)
    assert len(facts["clipped"].remarks) == 1 and "largest value 0.08 V in 8 stretches" in facts["clipped"].remarks[0]
    assert facts["name"].remarks == ("no numbers, as in 'arm'",) and np.isnan(facts["name"].low)
    assert facts["level"].remarks == ("never changes",)
    assert facts["row"].is_even
    assert lines_of_a_model(survey)[:2] == (
        "force = model.input('force', 'N', hold='zoh')",
        "angle = model.sensor('angle', 'rad')",
    )


def test_it_is_printed_and_drawn(file: Path, tmp_path: Path) -> None:
    shown = pvid("look", file, "--figure", tmp_path / "columns.png")
    assert shown.return_value == DONE and shown.stdout.startswith("of an instrument.csv: 2999 samples, 500 Hz, 5.996 s")
    assert "never changes" in shown.stdout and "pvid: input: half has a sample every 2 ticks" in shown.stderr
    assert (tmp_path / "columns.png").stat().st_size > 10_000


def test_a_table_of_a_motor_is_known_as_people_write_it(tmp_path: Path) -> None:
    """Names of several languages; a speed without a unit is doubted; the smooth top of a motion is not clipped."""
    turns = np.round(3000 * np.sin(2 * np.pi * 0.3 * T), 0)
    slow = np.round(SLOW, 3)
    doubt = "speed states no unit: rad/s is assumed; write w=speed:rpm for rpm"
    german = "'t=Zeit [s],V=Spannung [V],i=Strom [A],w=n [1/min]'"
    for head, columns, doubts in (
        ("time,V,i,speed", "t=time,w=speed", (doubt,)),
        ("Zeit [s],Spannung [V],Strom [A],n [1/min]", german, ()),
        ("t,U,I,n_rpm", "V=U,i=I,w=n_rpm:rev/min", ()),
        ("t,V,i,w", "", (doubt.replace("speed", "w"),)),
        ("t,V,i,n_soll_rpm,n_ist_rpm", "w=n_ist_rpm:rev/min", ()),
        ("t,V,i,speed_ref,n_meas_rpm", "w=n_meas_rpm:rev/min", ()),
        ("t,V,i,N,n_rpm", "w=n_rpm:rev/min", ()),
    ):
        speeds = [numbers(turns + k, 0) for k in range(head.count(",") - 2)]
        file = written(tmp_path / "motor.csv", head, [numbers(T), numbers(slow), numbers(SLOW), *speeds])
        first = proposals(survey := surveyed(file))[0]
        assert (first.mechanism, first.columns, first.doubts) == ("motor_speed", columns, doubts)
        assert all("clip" not in remark for one in survey.facts for remark in one.remarks)


@pytest.mark.parametrize(
    ("mechanism", "head", "columns"),
    [
        ("buck_converter", "t,duty,Vout,Vin,IL", "d=duty,vin=Vin,i=IL,v=Vout"),
        ("heater", "t,power_W,ambient_C,temp_C", "P=power_W,T=temp_C:C,Ta=ambient_C:C"),
        ("quadrotor_axis", "t,throttle,gyro_x (deg/s)", "'u=throttle,p=gyro_x (deg/s)'"),
        ("mecanum", "t,tau_fl,tau_fr,tau_rl,tau_rr,vx,vy,wz", "t1=tau_fl,t2=tau_fr,t3=tau_rl,t4=tau_rr,w=wz"),
        ("first_order_step", "t,valve_percent,temp (°C)", "'u=valve_percent:%,y=temp (°C):1'"),
        ("tank", "t,flow_lpm,level_cm", "q=flow_lpm,h=level_cm:cm"),
        ("coasting_motor", "t,counts", "phi=counts:rev/N"),
    ],
)
def test_columns_of_other_trades_are_known_by_their_names(
    mechanism: str, head: str, columns: str, tmp_path: Path
) -> None:
    """In any order: the air before the heated body, the supply before the output."""
    signals = [numbers(1000 * np.sin((3 + k) * T), 0) for k in range(head.count(","))]
    survey = surveyed(written(tmp_path / "lab.csv", head, [numbers(T), *signals]))
    assert columns in [one.columns for one in proposals(survey) if one.mechanism == mechanism]
    assert all("whole numbers" in one.remarks[-1] for one in survey.facts if not one.unit)


def test_a_refusal_ends_with_the_commands_that_look_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path / "lab.csv", "time,U_in,U_C", [numbers(T), ["5"] * 1500 + ["0"] * 1500, numbers(SLOW)])
    monkeypatch.setattr("sys.argv", ["pvid", "identify", str(file)])
    with pytest.raises(SystemExit) as left:
        main()
    refusal, *commands = capsys.readouterr().err.splitlines()
    assert left.value.code == 2 and "has the names of its columns time, U_in, U_C" in refusal
    assert commands == pvid("look", file).stdout.splitlines()[-len(commands) :]
    assert any("--model rc_step --columns t=time,u=U_in,v=U_C" in one for one in commands)


FOREIGN = {
    "dc_motor": {"t": "Time [ms]", "V": "Voltage (V)", "i": "Current [mA]", "phi": "shaft_rev"},
    "kapitza": {"t": "time_us", "y": "height_mm", "phi": "encoder_deg"},
    "battery_2rc": {"t": "stamp", "i": "current_mA", "v": "voltage_mV"},
}
IN_SI = {"ms": 1e-3, "us": 1e-6, "mm": 1e-3, "mA": 1e-3, "mV": 1e-3, "V": 1, "rev": 2 * np.pi, "deg": np.pi / 180}


def test_commands_begin_as_the_caller_typed_pvid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "recorded.csv"
    file.write_text("t,q\n" + "".join(f"{k / 50},{np.sin(k / 9)}\n" for k in range(400)))
    for called, first in (
        (None, "pvid"),
        ("./tools/pvid", "./tools/pvid"),
        ("/my clone/tools/pvid", "/my clone/tools/pvid"),
    ):
        monkeypatch.setenv("PVID_CALLED", called) if called else monkeypatch.delenv("PVID_CALLED", raising=False)
        line = next(one for one in pvid("look", file).stdout.splitlines() if "--model" in one)
        assert shlex.split(line) == [first, "identify", str(file), "--model", "free_pendulum"]


def test_a_mechanism_that_ignores_a_drive_is_not_taken_silently(tmp_path: Path) -> None:
    """A motor without its current: the one that runs out has the other columns."""
    file = tmp_path / "recorded.csv"
    file.write_text("t,V,phi\n" + "".join(f"{k / 1000},{k % 7},{np.sin(k / 99)}\n" for k in range(400)))
    clause = "column V is not used: dc_motor needs i as well"
    assert f"    but {clause}" in pvid("look", file).stdout.splitlines()
    with pytest.raises(
        PvidError, match=f"has the columns of coasting_motor, but {clause}: name the mechanism with --model"
    ):
        pvid("identify", file)
    with pytest.raises(PvidError, match="J .* of the rig is missing"):
        pvid("identify", file, "--model", "coasting_motor")
    file.write_text(file.read_text().replace("t,V,", "t,W,"))
    assert "not used" not in pvid("look", file).stdout


@pytest.mark.parametrize("mechanism", ["dc_motor", "kapitza", "battery_2rc"])
@pytest.mark.parametrize("foreign", [False, True])
def test_the_command_that_is_printed_identifies(mechanism: str, foreign: bool, tmp_path: Path) -> None:
    run, file = tmp_path / "simulated.csv", tmp_path / "recorded.csv"
    length = () if mechanism == "battery_2rc" else ("--duration", "12")
    assert pvid("model", "simulate", mechanism, run, *length).return_value == DONE
    own = run.read_text(encoding="utf-8").splitlines()
    table = np.loadtxt(own[1:], delimiter=",")
    names = own[0].split(",")
    if foreign:
        names = [FOREIGN[mechanism][one] for one in names]
        table /= [IN_SI.get(unit_of_name(one), 1) for one in names]
    np.savetxt(file, table, "%.12g", ",", header=",".join(names), comments="")
    found = proposals(surveyed(file))
    assert found[0].mechanism == mechanism and bool(found[0].columns) == foreign
    command = shlex.split(found[0].command(str(file)))[1:]
    command = [one.replace("l1=VALUE", "l1=0.3") for one in command]
    answer = json.loads(pvid(*command, "--json", "--no-refine").stdout)
    assert answer["identified"]
    for name, truth in simulated_rig(mechanism).truth.items():
        one = answer["parameters"][name]
        assert one["value"] is None or abs(one["value"] - truth) < 5 * one["se"], name


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("angle_deg", "deg"),
        ("h (mm)", "mm"),
        ("speed_rpm", "rpm"),
        ("i [A]", "A"),
        ("motor_a", ""),
        ("ref_V", "V"),
        ("T_air(C)", "C"),
        ("theta_m", ""),
        ("x", ""),
    ],
)
def test_a_unit_in_a_name_is_one_beyond_doubt(name: str, unit: str) -> None:
    assert unit_of_name(name) == ("rev/min" if unit == "rpm" else unit)
    assert unit_of_name("i_V", ("i_U", "i_V", "i_W")) == unit_of_name("coil_A", ("coil_A", "coil_B")) == ""


def test_what_students_export_has_names_units_and_the_command_to_type(tmp_path: Path) -> None:
    """A track of a film, whose first row has blank cells; a thermometer with a date and words; a switched voltage."""
    t = np.arange(600) / 60
    x = 6.3 * np.exp(-0.11 * t) * np.cos(11.3 * t) + 1.7
    rows = [f"{a:.6E}\t{b:.6E}\t" if k % 97 else f"{a:.6E}\t\t" for k, (a, b) in enumerate(zip(t, x, strict=True))]
    (tmp_path / "track.txt").write_text("\n".join(["mass A\t\t", "t\tx (cm)\tnote", *rows]) + "\n", encoding="utf-8")
    seen = pvid("look", tmp_path / "track.txt").stdout
    assert "track.txt --model ring_down --columns 'x=x (cm)'" in seen and "note" in seen and "no numbers" in seen
    clock = [
        f"2026-03-02,14:{k // 60:02}:{k % 60:02},{50 - k / 100 + (k % 3) / 50:.2f},{21.4 + k % 2 / 100}"
        for k in range(900)
    ]
    (tmp_path / "tea.csv").write_text("\n".join(["Date,Time,Temp(C),Air(C)", *clock]) + "\n", encoding="utf-8")
    seen = pvid("look", tmp_path / "tea.csv").stdout
    assert "--model cooling --columns 't=Time,T=Temp(C),Ta=Air(C)'" in seen and "no numbers, as in '2026-03-02'" in seen
    switched = 5.0 * (np.arange(900) // 200 % 2) + 0.04 * np.random.default_rng(1).integers(-1, 2, 900)
    rows = [f"{k / 100},{one:.2f}" for k, one in enumerate(switched)]
    (tmp_path / "scope.csv").write_text("\n".join(["t,CH1", *rows]) + "\n", encoding="utf-8")
    assert "a counter" not in pvid("look", tmp_path / "scope.csv").stdout
    (tmp_path / "still.csv").write_text(
        "\n".join(["t,V", *(f"{k / 100},5" for k in range(900))]) + "\n", encoding="utf-8"
    )
    assert "Nothing moves in this recording" in pvid("look", tmp_path / "still.csv").stdout


def test_what_is_no_table_is_one_sentence(tmp_path: Path) -> None:
    words = tmp_path / "notes.csv"
    words.write_text("only words\nand more\n", encoding="utf-8")
    with pytest.raises(PvidError, match="has no line of two numbers or more"):
        pvid("look", words)
    with pytest.raises(PvidError, match="does not exist"):
        pvid("look", tmp_path / "none.csv")
    with pytest.raises(PvidError, match="is a log of a board"):
        pvid("look", tmp_path / "run.pvlog")


@pytest.mark.parametrize(
    ("names", "typed"),
    [
        ("x y z yaw pitch roll fz", "model from robot.urdf --free-base -o robot.py"),
        ("q1 i1", "model from robot.urdf -o robot.py"),
        ("x y z yaw q1", ""),
    ],
)
def test_a_log_of_a_robot_is_known_by_its_columns(names: str, typed: str, tmp_path: Path) -> None:
    t, path = np.arange(400) * 0.002, tmp_path / "log.csv"
    moves = [np.sin((k + 3) * t) for k in range(len(names.split()))]
    np.savetxt(path, np.array([t, *moves]).T, delimiter=",", header=",".join(["t", *names.split()]), comments="")
    told = pvid("look", path).stdout
    assert ("By names it is a robot" in told) == bool(typed) and typed in told
    assert ("ring-down" in told) != bool(typed)


def test_stamps_since_1970_in_a_compressed_file_are_in_their_unit(tmp_path: Path) -> None:
    stamps = [str(1_700_000_000_123_456_789 + 2_000_000 * k) for k in range(N)]
    plain = written(tmp_path / "topic.csv", "%time,field.x", [stamps, numbers(SLOW)])
    packed = tmp_path / "topic.csv.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    survey = surveyed(packed)
    assert survey.time == "t=time" and survey.recording.sample_rate == 500


def test_what_is_set_is_no_sensor_and_a_step_of_a_sensor_is_not_wild(tmp_path: Path) -> None:
    heaters = [np.repeat(levels, N // 3) for levels in ([0.0, 60.0, 20.0], [0.0, 0.0, 50.0])]
    slow = [20 + np.cumsum(one) * 1e-3 for one in heaters]
    lab = written(tmp_path / "lab.csv", "t,Q1,Q2,T1,T2", [numbers(T), *map(numbers, (*heaters, *slow))])
    assert proposals(surveyed(lab)) == ()  # no arm with the angles q and the torques T
    coarse = [numbers(np.round(one / 8) * 8) for one in slow]  # steps of a slow motion are those of a sensor
    cooling = written(tmp_path / "cooling.csv", "t,T [K],Ta [K]", [numbers(T), *coarse])
    assert [one.mechanism for one in proposals(surveyed(cooling))] == ["cooling"]
    rest = np.where(np.isin(np.arange(N) % 61, (5, 7, 9)), 101.0, 100.0)
    file = written(tmp_path / "rest.csv", "t,counts,x", [numbers(T), numbers(rest, 0), numbers(SLOW)])
    assert surveyed(file).facts[0].remarks == ("has two values alone",)


def test_a_note_has_names_and_not_positions(tmp_path: Path) -> None:
    late = T + np.random.default_rng(1).uniform(-6e-4, 6e-4, N)
    for count, called in ((2, "sensor 0, which is long beyond measure and sensor 1"), (6, ": 6 columns are")):
        names = [f"'sensor {k}, which is long beyond measure'".replace("'", '"') for k in range(count)]
        signals = [numbers(np.sin((3 + k) * late)) for k in range(count)]
        file = written(tmp_path / "late.csv", ",".join(["t", *names]), [numbers(late, 7), *signals])
        assert called in surveyed(file).recording.notes[0]


def test_stamps_in_microseconds_without_a_unit_are_not_passed_over(tmp_path: Path) -> None:
    rows = [str(k) for k in range(N)]
    file = written(tmp_path / "box.csv", "loopIteration,time,x", [rows, numbers(5e5 + 1e6 * T, 0), numbers(SLOW)])
    survey = surveyed(file)
    assert survey.time == "t=time:us" and survey.recording.sample_rate == 500
