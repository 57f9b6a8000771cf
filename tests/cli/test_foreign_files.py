"""Files from somebody else never choose what runs: a model file that a log or a rig file names is not executed."""

import threading
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result
from logs import log_of
from lying_board import LyingBoard

import pvid
from pvid.base.errors import PvidError
from pvid.cli.main import GROUPS, commands
from pvid.models.mechanisms import compiled_of, described
from pvid.models.registry import asked_for
from pvid.rig.mechanism_file import MechanismRig

MODEL = """
from pathlib import Path
from pvid.model import Model
Path(__file__).with_name("executed").touch()
model = Model("mass on a spring")
F, x = model.input("F", "N", hold="zoh"), model.sensor("x", "m", resolution=1e-5)
m, c, k = model.unknown("m", "kg", 1.0), model.unknown("c", "N*s/m", 1.0), model.unknown("k", "N/m", 50.0)
model.equation(m * x.d(2) + c * x.d() + k * x - F)
"""
RIG = 'sample_rate = 500.0\n[model]\nname = "notes.py"\n'
REFUSAL = "names the model file notes.py: add --model notes.py to run it"
OF_A_RUN = {
    "identify": ["identify", "FILE"],
    "identify in C": ["identify", "FILE", "--core", "f32"],
    "tune": ["tune", "FILE"],
    "compare": ["compare", "FILE"],
    "batch": ["batch", "FILE", "-o", "rows.parquet", "--workers", "1"],
    "design": ["design", "--run", "FILE"],
    "plot": ["plot", "FILE", "-o", "figure.png"],
    "validate": ["validate", "FILE", "--from", "answer.json"],
}
OF_A_LOG = {
    "verify": ["verify", "FILE"],
    "export": ["export", "FILE", "--to", "csv", "-o", "exported"],
    "layout": ["layout", "FILE", "--for", "foxglove"],
    "view": ["view", "FILE", "--web", "127.0.0.1:0"],
}
WITH_A_MODEL = {  # of the list, while the file beside the run names another one
    "model build": ["model", "build", "dc_motor", "--run", "FILE", "-o", "built"],
    "deploy": ["deploy", "dc_motor", "--run", "FILE", "-o", "deployed", "--for", "arduino"],
    "log --run": ["log", "stream-host", "new.pvlog", "--model", "dc_motor", "--run", "FILE"],
}
NAMED = {  # with the rig file in the place of its own option
    "identify": ["identify", "plain.csv", "--rig", "FILE"],
    "tune": ["tune", "plain.csv", "--rig", "FILE"],
    "compare": ["compare", "plain.csv", "--rig", "FILE"],
    "batch": ["batch", "plain.csv", "--rig", "FILE", "-o", "rows.parquet", "--workers", "1"],
    "design": ["design", "--rig", "FILE"],
    "plot": ["plot", "plain.csv", "--rig", "FILE"],
    "log": ["log", "stream-host", "new.pvlog", "--rig", "FILE"],
    "verify": ["verify", "foreign.pvlog", "--rig", "FILE"],
    "export": ["export", "foreign.pvlog", "--rig", "FILE", "--to", "csv"],
    "layout": ["layout", "foreign.pvlog", "--rig", "FILE", "--for", "foxglove"],
    "model build": ["model", "build", "dc_motor", "--rig", "FILE", "-o", "built"],
    "deploy": ["deploy", "dc_motor", "--rig", "FILE", "-o", "deployed", "--for", "arduino"],
}
AS_BATCH = {"watch"}  # the same code, until Ctrl-C
READ_NO_FILES = {"demo", "look", "simulate", "ports", "sizes", "schema", "tables", "models", "bench"}


def run(arguments: list[str]) -> Result:
    return CliRunner().invoke(commands, arguments, standalone_mode=False)


def recorded(path: Path) -> None:
    """A mass on a spring under random steps, exact to 1e-5 m."""
    rate, m, c, k = 500.0, 1.3, 2.0, 60.0
    force = np.repeat(np.random.default_rng(1).uniform(-5, 5, 60), 50)
    x, v, rows = 0.0, 0.0, ["t,F,x"]
    for tick, f in enumerate(force):
        rows.append(f"{tick / rate:.4f},{f:.5f},{round(x, 5):.5f}")
        for _ in range(20):
            v += (f - c * v - k * x) / m / rate / 20
            x += v / rate / 20
    path.write_text("\n".join(rows) + "\n")


@pytest.fixture(params=["beside", "from another folder"])
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Path:
    """The recordings of somebody else, with his model file beside them."""
    recorded(tmp_path / "foreign.csv")
    (tmp_path / "foreign.toml").write_text(RIG)
    (tmp_path / "plain.csv").write_bytes((tmp_path / "foreign.csv").read_bytes())
    (tmp_path / "notes.py").write_text(MODEL)
    log_of(tmp_path / "foreign.pvlog", LyingBoard().honest(), rig=f"{RIG}[engine]\nrate = 1\n", why=None)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(tmp_path if request.param == "beside" else elsewhere)
    return tmp_path


@pytest.fixture
def mark(folder: Path) -> Iterator[Path]:
    """What the model file leaves when it runs: it must not be there at the end."""
    yield folder / "executed"
    assert not (folder / "executed").exists()


def filled(folder: Path, command: list[str], file: str) -> list[str]:
    names = {"FILE": file, "plain.csv": "plain.csv", "foreign.pvlog": "foreign.pvlog"}
    return [str(folder / names[one]) if one in names else one for one in command]


def test_every_command_is_tried() -> None:
    tried = {one[0] for table in (OF_A_RUN, OF_A_LOG, WITH_A_MODEL, NAMED) for one in table.values()}
    assert tried | AS_BATCH | READ_NO_FILES == {name for group in GROUPS.values() for name in group}


@pytest.mark.parametrize("name", OF_A_RUN)
@pytest.mark.parametrize("file", ["foreign.csv", "foreign.pvlog"])
def test_a_model_file_that_a_recording_names_is_refused(folder: Path, mark: Path, name: str, file: str) -> None:
    found = run(filled(folder, OF_A_RUN[name], file))
    sentence = f"{found.exception} {found.output}"
    assert found.return_value != 0 or isinstance(found.exception, PvidError | SystemExit)
    if name != "plot":  # which is of the pendulum's runs, or draws what the board sent
        assert REFUSAL in sentence.replace("\n", " "), sentence


@pytest.mark.parametrize("name", OF_A_LOG)
def test_what_shows_a_log_runs_nothing(folder: Path, mark: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    ended = threading.Event()
    ended.set()
    monkeypatch.setattr("pvid.cli.view.threading.Event", lambda: ended)
    monkeypatch.setattr("pvid.cli.view.signal.signal", lambda *_: None)
    found = run(filled(folder, OF_A_LOG[name], "foreign.pvlog"))
    assert found.exception is None or isinstance(found.exception, PvidError), found.exception


@pytest.mark.parametrize("name", WITH_A_MODEL)
def test_the_model_of_the_call_is_taken_and_not_that_of_the_rig_file(folder: Path, mark: Path, name: str) -> None:
    found = run(filled(folder, WITH_A_MODEL[name], "foreign.csv"))
    assert isinstance(found.exception, PvidError) and " V" in str(found.exception)  # the motor's column


@pytest.mark.parametrize("name", NAMED)
def test_a_model_file_that_a_named_rig_file_names_is_refused(folder: Path, mark: Path, name: str) -> None:
    found = run(filled(folder, NAMED[name], "foreign.toml"))
    if NAMED[name][1] not in ("dc_motor", "build"):
        assert "notes.py" in f"{found.exception} {found.output}" or '"kapitza"' in str(found.exception)


def test_python_refuses_it_as_well(folder: Path, mark: Path) -> None:
    for given in (
        {"data": folder / "foreign.csv"},
        {"data": folder / "foreign.pvlog"},
        {"data": folder / "plain.csv", "rig": folder / "foreign.toml"},
        {"data": folder / "plain.csv", "settings": {"model.name": str(folder / "notes.py")}},
    ):
        with pytest.raises(PvidError):
            pvid.identify(**given)
    rig = MechanismRig.parse(RIG)
    for door in (compiled_of, described):
        with pytest.raises(PvidError, match=REFUSAL):
            door(rig.model)


def test_the_same_file_runs_by_the_option_of_the_call(folder: Path) -> None:
    model = str(folder / "notes.py")
    answer = pvid.identify(folder / "foreign.csv", model=model)
    assert (folder / "executed").exists() and abs(answer["m"].value / 1.3 - 1) < 0.02
    assert isinstance(asked_for(model), Path) and asked_for("dc_motor") == "dc_motor"


def test_a_log_of_an_own_mechanism_is_verified_with_its_model_file(folder: Path) -> None:
    """Recorded from a board that runs it, named by another path, and refused where the file has changed since."""
    (folder / "foreign.toml").unlink()
    model, log = folder / "notes.py", folder / "own.pvlog"
    given = ["--model", str(model), "--run", str(folder / "foreign.csv"), "--paced", "-q"]
    assert run(["log", "stream-host", str(log), *given]).return_value == 0
    (folder / "moved").mkdir()
    moved = model.rename(folder / "moved" / "notes.py")
    checked = run(["verify", str(log), "--model", str(moved)])
    assert checked.return_value == 0 and "equal in every bit" in checked.output, checked.output
    assert abs(pvid.identify(log, model=moved)["m"].value / 1.3 - 1) < 0.02
    (folder / "moved" / "executed").unlink()
    for refused in (["verify", str(log)], ["verify", str(log), "--model", "dc_motor"]):
        assert "notes.py" in str(run(refused).exception)
    assert not (folder / "moved" / "executed").exists()
    moved.write_text(MODEL.replace("c * x.d() + ", "c * x.d() + 2 * "))
    changed = run(["verify", str(log), "--model", str(moved)])
    assert changed.return_value != 0 and "another model than the log's" in changed.output


@pytest.mark.parametrize("name", ["../notes.py", "C:\\x\\notes.py", "notes", "", "x\x1b[31m.py", "dc_motor.py"])
def test_no_text_names_a_file(name: str) -> None:
    with pytest.raises(PvidError) as refused:
        compiled_of(name)
    assert str(refused.value).isprintable()


def test_a_rig_file_may_name_a_shipped_mechanism(tmp_path: Path) -> None:
    assert isinstance(run(["model", "simulate", "dc_motor", str(tmp_path / "a.csv"), "--duration", "3"]), Result)
    (tmp_path / "dc_motor.py").write_text("raise SystemExit")  # a file of the name is not looked at
    found = run(["design", "--run", str(tmp_path / "a.csv")])
    assert found.exception is None, found.exception
    assert isinstance(commands, click.Group)
