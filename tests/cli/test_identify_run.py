"""Mechanisms through the command line: check, simulate, identify, predict, build, and what is refused."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from conftest import ROOT
from in_process import pvid
from rich.console import Console

from pvid.base import console
from pvid.base.console import BAD_INPUT, DIFFERENT, DONE, NOTHING_IDENTIFIED
from pvid.base.errors import PvidError
from pvid.cli.identify_run import table_of
from pvid.cli.main import commands
from pvid.identification.answer import Value

TRUTH = {"R": 1.2, "L": 3e-3, "k": 0.05, "J": 2e-4, "b": 1e-4, "Tc": 0.012, "i0": 0.03}
HIDDEN = """
from pvid.model import Model, sin
model = Model("pendulum without a sensor")
F, a = model.input("F", "N*m", hold="zoh"), model.unmeasured("a", "rad")
J, G = model.unknown("J", "kg*m^2", 1.0), model.unknown("G", "N*m", 1.0)
model.equation(J * a.d(2) + G * sin(a) - F)
"""

SWING = """
from pvid.model import Model, sin
model = Model("free pendulum")
theta = model.sensor("theta", "rad", resolution=1e-3, reach=2)
w, b = model.unknown("w", "1/s^2", 20.0), model.unknown("b", "1/s", 0.1)
model.equation(theta.d(2) + b * theta.d() + w * sin(theta))
"""


def test_a_table_of_80_columns_loses_no_letter() -> None:
    one = Value("N*m/A", 7.811e-07, 7.8e-09, se_noise=4.1e-09, se_scale=7.8e-09, se_model=6.5e-09, word="not_explained")
    shown = StringIO()
    values = {"k": one, "torque": replace(one, word="not_identified")}
    Console(file=shown, width=80).print(table_of(values, "motor", {}, parts=True))
    assert "…" not in shown.getvalue() and "not_identified" in shown.getvalue() and "7.811" in shown.getvalue()


@pytest.fixture(scope="module")
def motor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated run of the motor with its rig file beside it."""
    path = tmp_path_factory.mktemp("motor") / "motor.csv"
    assert pvid("model", "simulate", "dc_motor", path, "--duration", "6", "--seed", "2").return_value == DONE
    return path


@pytest.fixture(scope="module")
def shown(motor: Path) -> dict[str, Any]:
    """What `identify --json` prints of it."""
    answer: dict[str, Any] = json.loads(pvid("identify", motor, "--json").stdout)
    return answer


def test_a_simulated_run_is_identified_with_the_rig_file_beside_it(
    motor: Path, shown: dict[str, Any], tmp_path: Path
) -> None:
    figure = tmp_path / "figure.svg"
    answer = pvid("identify", motor, "--figure", figure)
    assert answer.return_value == DONE and "verdict good" in answer.stdout and figure.stat().st_size > 10_000
    assert shown["identified"] and shown["model"] == "dc_motor" and set(shown["parameters"]) == set(TRUTH)
    for name, truth in TRUTH.items():
        one = shown["parameters"][name]
        # the law of friction of the simulation is soft, that of the model is sharp: 4 standard errors and a warning
        assert abs(one["value"] - truth) < 4 * one["se"] or shown["warning"], name


def test_a_run_is_refined_and_shown_beside_its_simulation(motor: Path, tmp_path: Path) -> None:
    figure = tmp_path / "refined.svg"
    answer = pvid("identify", motor, "--refine", "--figure", figure)
    assert answer.return_value == DONE and "refined over" in answer.stdout and figure.stat().st_size > 10_000
    shown = json.loads(pvid("identify", motor, "--refine", "--json").stdout)
    assert "refined over" in shown["refinement"]["text"] and shown["refinement"]["slow_chi2"] < 2
    for name, truth in TRUTH.items():
        one = shown["parameters"][name]
        assert abs(one["value"] - truth) < 4 * one["se"], name
    with pytest.raises(PvidError, match="--refine is in float32 and float64; omit --core q31"):
        pvid("identify", motor, "--refine", "--core", "q31")
    on_a_board = json.loads(pvid("identify", motor, "--refine", "--core", "f32", "--json").stdout)
    assert on_a_board["identified"]
    for name, truth in TRUTH.items():
        one = on_a_board["parameters"][name]
        assert abs(one["value"] - truth) < max(4 * one["se"], 1e-3 * abs(truth)), name


def test_the_help_of_a_command_is_shown_without_loading_sympy() -> None:
    """It takes a third of a second, for nothing there."""
    loaded = "import sys, pvid.cli.identify, pvid.cli.tune; print('sympy' in sys.modules)"
    assert (
        subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=True).stdout == "False\n"
    )


def test_a_good_run_of_a_mechanism_loads_no_package_that_it_does_not_need(motor: Path) -> None:
    """SciPy's signals, numpy's Fortran compiler and SymPy's mechanics take a second."""
    others = ("scipy.signal", "numpy.f2py", "sympy.physics.mechanics", "pvid.board", "matplotlib")
    code = f"import sys; sys.argv[1:] = ['identify', {str(motor)!r}, '--json']\nfrom pvid.cli.main import main\n"
    code += "try:\n    main()\nexcept SystemExit as end:\n"
    code += f"    print(end.code, [one for one in {others} if one in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "0 []"


def test_long_work_is_shown_on_a_terminal(motor: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = StringIO()
    monkeypatch.setattr(console, "messages", Console(file=shown, force_terminal=True))
    pvid("identify", motor, "--refine")
    pvid("identify", motor, "--core", "q31")
    for stage in ("identifying", "refining", "identifying in fixed point"):
        assert f"{stage} " in shown.getvalue(), shown.getvalue()
    monkeypatch.setattr(console, "messages", Console(file=(elsewhere := StringIO())))
    pvid("identify", motor)
    assert not elsewhere.getvalue()


def test_columns_and_units_are_mapped(motor: Path, shown: dict[str, Any], tmp_path: Path) -> None:
    lines = motor.read_text().splitlines()
    head, rows = lines[0].split(","), [line.split(",") for line in lines[1:]]
    assert head == ["t", "V", "i", "phi"]
    renamed = ["time,drive,current_mA,angle"]
    renamed += [f"{t},{v},{1e3 * float(i)!r},{phi}" for t, v, i, phi in rows]
    path = tmp_path / "other.csv"
    path.write_text("\n".join(renamed) + "\n", encoding="utf-8")
    columns = "t=time,V=drive,i=current_mA:mA,phi=angle"
    same = json.loads(pvid("identify", path, "--model", "dc_motor", "--columns", columns, "--json").stdout)
    for name in TRUTH:
        assert same["parameters"][name]["value"] == pytest.approx(shown["parameters"][name]["value"], rel=1e-6)
    with pytest.raises(PvidError, match=r"no column t \(s\) and V \(V\) and .*: use --columns t=time:s"):
        pvid("identify", path, "--model", "dc_motor")


def test_settings_reach_the_model(motor: Path, shown: dict[str, Any]) -> None:
    coarse = json.loads(pvid("identify", motor, "--set", "sensor.i.resolution=0.5", "--json").stdout)
    assert coarse["chi2"] < shown["chi2"]
    with pytest.raises(PvidError, match="nominal.M: the model has no 'M'; it has R, L"):
        pvid("identify", motor, "--set", "nominal.M=3")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--law", "pseudovelocity"), "--law pseudovelocity: dc_motor is identified in float64"),
        (("--model", "dc_moter"), "dc_moter: no such model; give a .py file or one of ball_on_beam"),
    ],
)
def test_what_this_mechanism_cannot_do_is_refused(motor: Path, arguments: tuple[str, ...], sentence: str) -> None:
    with pytest.raises(PvidError) as caught:
        pvid("identify", motor, *arguments)
    assert sentence in str(caught.value)


def test_standard_deviation_of_a_constant_is_part_of_the_errors(tmp_path: Path) -> None:
    """The torque constant scales every other torque of the drive."""
    path = tmp_path / "drive.csv"
    pvid("model", "simulate", "two_mass_drive", path, "--duration", "6")
    exact, known = (
        json.loads(pvid("identify", path, "--json", *more).stdout)["parameters"]["J1"]
        for more in ((), ("--set", "known_sd.kt=0.002"))
    )
    assert known["value"] == exact["value"]
    assert known["se"] == pytest.approx(0.02 * known["value"], rel=0.05)  # 0.002 of 0.1 N*m/A
    assert known["se_noise"] == pytest.approx(exact["se"], rel=1e-6)
    with pytest.raises(PvidError, match="known_sd.kt must not be negative"):
        pvid("identify", path, "--set", "known_sd.kt=-1")


def test_advice_is_printed_and_part_of_the_json(motor: Path) -> None:
    """Whatever stage answers."""
    sentence = "V seems to have the opposite sign: --columns V=V:-1"
    shown = {}
    for stage in ("", "--refine", "--core=f32"):
        answer = pvid("identify", motor, "--columns", "V=V:-1", "--json", *filter(None, [stage]))
        shown[stage] = json.loads(answer.stdout)
        assert shown[stage]["advice"] == [sentence], stage
        assert f"pvid: advice: {sentence}" in answer.stderr
    refinement = shown["--refine"]["refinement"]  # no search that could not end well
    assert refinement == {"adopted": False, "text": "not refined: the advice about the columns comes first"}
    assert json.loads(pvid("identify", motor, "--json").stdout)["advice"] == []


def test_weights_are_chosen_and_reported(motor: Path, shown: dict[str, Any]) -> None:
    by_sensors = json.loads(pvid("identify", motor, "--json", "--weights", "sensors").stdout)
    assert [one["weights"] for one in (shown, by_sensors)] == ["residuals", "sensors"]
    assert by_sensors["identified"]


def test_a_dead_sensor_is_named(motor: Path, tmp_path: Path) -> None:
    lines = motor.read_text().splitlines()
    dead = [lines[0], *(line.rsplit(",", 1)[0] + ",0.5" for line in lines[1:])]
    (tmp_path / "dead.csv").write_text("\n".join(dead) + "\n", encoding="utf-8")
    with pytest.raises(PvidError, match="phi has the same value in all 6000 samples: is the sensor connected?"):
        pvid("identify", tmp_path / "dead.csv", "--model", "dc_motor")


def test_check_reports_rows_and_verdict() -> None:
    answer = pvid("model", "check", "kapitza")
    assert answer.return_value == DONE
    assert "sum of theta * N = Y" in answer.stdout and "Identifiable: all" in answer.stdout


def test_check_names_what_cannot_be_identified(tmp_path: Path) -> None:
    text = ROOT / "host/src/pvid/models/dc_motor/mechanism.py"
    split = text.read_text(encoding="utf-8").replace(
        'model.unknown("b", "N*m*s", 1e-4)', 'model.unknown("b", "N*m*s", 1e-4) + model.unknown("b2", "N*m*s", 1e-4)'
    )
    (tmp_path / "split.py").write_text(split, encoding="utf-8")
    answer = pvid("model", "check", tmp_path / "split.py")
    assert answer.return_value == NOTHING_IDENTIFIED
    assert "b and b2: only b + b2 can be identified" in answer.stdout


def test_a_hidden_coordinate_that_cannot_be_removed_is_refused(tmp_path: Path) -> None:
    (tmp_path / "hidden.py").write_text(HIDDEN, encoding="utf-8")
    with pytest.raises(PvidError, match="hidden.py, line 6: a cannot be eliminated: 1 equation"):
        pvid("model", "check", tmp_path / "hidden.py")


CARTS = """
from pvid.model import Model
model = Model("six carts")
F, k, c, m, x = model.input("F", "N", hold="zoh"), [], [], [], []
for n in range(6):
    x.append(model.sensor(f"x{n}", "m", noise=1e-4))
    m.append(model.unknown(f"m{n}", "kg", 1.0))
    k.append(model.unknown(f"k{n}", "N/m", 50.0))
    c.append(model.unknown(f"c{n}", "N*s/m", 1.0))
for n in range(6):
    model.equation(m[n] * x[n].d(2) + c[n] * x[n].d() + k[n] * x[n] - (F if n == 5 else k[n + 1] * x[n + 1]))
"""


def test_more_unknowns_than_the_c_core_takes_are_one_sentence(tmp_path: Path) -> None:
    """From every command that needs the core, before it analyses the run; in float64 all are identified."""
    path, run = tmp_path / "carts.py", tmp_path / "carts.csv"
    path.write_text(CARTS, encoding="utf-8")
    sentence = r"carts has 18 unknowns and the C core takes at most 16: declare some of them as known"
    found = pvid("model", "check", path)
    assert re.search(sentence, found.stderr) and "all 18 unknowns" in found.stdout
    assert pvid("model", "simulate", path, run, "--duration", "10").return_value == DONE
    for arguments in (
        ("model", "build", path, "-o", tmp_path / "c"),
        ("deploy", path, "--run", run, "--for", "cmake", "-o", tmp_path / "d"),
        ("identify", run, "--core", "f32"),
        ("identify", run, "--core", "q31"),
        ("identify", run, "--core", "f32", "--refine"),
        ("identify", run, "--form", "strong"),
        ("compare", run),
    ):
        given = (*arguments, "--model", path) if arguments[0] in ("identify", "compare") else arguments
        with pytest.raises(PvidError, match=sentence):
            pvid(*given)
    assert not (tmp_path / "c").exists() and not (tmp_path / "d").exists()
    answer = json.loads(pvid("identify", run, "--model", path, "--refine", "--json").stdout)
    assert answer["identified"] and len(answer["parameters"]) == 18


def test_predict_compares_drives() -> None:
    answer = json.loads(pvid("model", "predict", "dc_motor", "--drive", "steps", "--duration", "5", "--json").stdout)
    assert set(answer["relative_se"]) == {"steps"} and answer["relative_se"]["steps"]["R"] < 0.01
    assert answer["advice"].startswith("Best drive: steps. Its worst parameter is ")
    with pytest.raises(PvidError, match="zigzag is no drive; known are constant, steps"):
        pvid("model", "predict", "dc_motor", "--drive", "zigzag")


def test_mechanism_without_an_input_needs_a_release(tmp_path: Path) -> None:
    """At rest it stays there: no run is long enough."""
    model = tmp_path / "swing.py"
    model.write_text(SWING, encoding="utf-8")
    short = ("--duration", "10", "--rate", "100")
    for command in (("predict", model), ("simulate", model, tmp_path / "swing.csv")):
        sentence = (
            "swing has no input and starts at rest, so that nothing moves: give a release, as in --start theta=0.5"
        )
        if command[0] == "simulate":
            with pytest.raises(PvidError, match=sentence):
                pvid("model", *command, *short)
        else:
            answer = pvid("model", *command, *short)
            assert answer.return_value == NOTHING_IDENTIFIED and sentence in answer.stderr
    answer = json.loads(pvid("model", "predict", model, *short, "--start", "theta=0.8", "--json").stdout)
    assert set(answer["relative_se"]) == {"a release"} and answer["relative_se"]["a release"]["w"] < 0.01
    with pytest.raises(PvidError, match="x is no state of the simulation; states are theta, theta_1"):
        pvid("model", "simulate", model, tmp_path / "swing.csv", *short, "--start", "x=1")
    pvid("model", "simulate", model, tmp_path / "swing.csv", *short, "--start", "theta=0.8")
    assert json.loads(pvid("identify", tmp_path / "swing.csv", "--model", model, "--json").stdout)["identified"]


def test_build_writes_what_check_accepts(tmp_path: Path) -> None:
    assert pvid("model", "build", "furuta", "-o", tmp_path / "out").return_value == DONE
    assert pvid("model", "build", "furuta", "-o", tmp_path / "out", "--check").return_value == DONE
    header = tmp_path / "out" / "furuta.h"
    header.write_text(header.read_text(encoding="utf-8").replace("J0", "J9"), encoding="utf-8")
    assert pvid("model", "build", "furuta", "-o", tmp_path / "out", "--check").return_value == DIFFERENT


def test_build_takes_what_the_description_does_not_tell(tmp_path: Path) -> None:
    """Reaches of derivatives for the formats, a soft sign, the strong form; the files name them: check needs them."""
    options = ("--strong", "--reach", "phi_1=300", "--soft-sign", "phi_1=0.5", "--bandwidth", "20")
    assert pvid("model", "build", "dc_motor", "-o", tmp_path, *options).return_value == DONE
    header = (tmp_path / "dc_motor_q31.h").read_text(encoding="utf-8")
    command = "dc_motor --strong --soft-sign phi_1=0.5 --reach phi_1=300 --bandwidth 20`: do not edit."
    assert command in (tmp_path / "dc_motor_twin.py").read_text(encoding="utf-8")
    assert "|in[3]| <= 300 rad/s" in header and (tmp_path / "dc_motor_strong_f32.c").is_file()
    assert pvid("model", "build", "dc_motor", "-o", tmp_path, *options, "--check").return_value == DONE
    assert pvid("model", "build", "dc_motor", "-o", tmp_path, "--check").return_value == DIFFERENT
    for wrong, sentence in (("x=3", "dc_motor has no input x"), ("phi_1", "write NAME=VALUE, as in --reach phi_1=40")):
        with pytest.raises(PvidError, match=sentence):
            pvid("model", "build", "dc_motor", "-o", tmp_path, "--reach", wrong)


def test_a_wrong_model_file_gives_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "wrong.py").write_text("from pvid.model import Model\nmodel = Model('x')\nmodel.sensor('y')\n", "utf-8")
    done = CliRunner().invoke(commands, ["model", "check", str(tmp_path / "wrong.py")])
    assert isinstance(done.exception, PvidError) and "wrong.py, line 3" in str(done.exception)
    assert BAD_INPUT == 2
