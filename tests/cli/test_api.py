"""`import pvid`: what a program or a notebook uses."""

import importlib
import os
import subprocess
import sys
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from own_mechanisms import OWN, own_recording
from threadpoolctl import threadpool_info, threadpool_limits

import pvid
from pvid.cli.main import commands

api = importlib.import_module("pvid.api.identify")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated run, with its rig file beside it."""
    path = tmp_path_factory.mktemp("api") / "run.csv"
    CliRunner().invoke(commands, ["simulate", str(path)], standalone_mode=False, catch_exceptions=False)
    return path


def test_a_file_a_frame_and_arrays_have_the_same_answer(run: Path, tmp_path: Path) -> None:
    of_file = pvid.identify(run)
    assert of_file.identified and of_file.warning is None and of_file.verdict == "good"
    g = of_file["g"]
    assert abs(g.value - 9.5) < 4 * g.se and g.unit == "m/s^2" and str(g).startswith("9.")
    frame = pd.read_csv(run)
    rig = run.with_suffix(".toml")
    arrays = {name: frame[name].to_numpy() for name in frame}
    for data in (frame, arrays):
        assert pvid.identify(data, rig=rig).parameters == of_file.parameters
    other = frame.rename(columns={"phi": "angle"}).assign(angle=np.degrees(frame.phi))
    renamed = pvid.identify(other, rig=rig, columns="phi=angle:deg")
    assert renamed["g"].value == pytest.approx(g.value, rel=1e-6)
    assert of_file.plot(tmp_path / "a.png").stat().st_size > 10_000
    assert "<table>" in of_file._repr_html_() and "g = 9." in repr(of_file)
    assert of_file.details["core"] == "f64" and of_file.details["refinement"]["adopted"]


def blas_threads() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_an_identification_has_one_thread_and_leaves_those_of_the_program(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two threads on two busy processors took 12 s of CPU in place of 5."""
    within: list[set[int]] = []
    inner = api.identified

    def seen(*given: Any, **options: Any) -> Any:
        within.append(blas_threads())
        return inner(*given, **options)

    monkeypatch.setattr(api, "identified", seen)
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        pvid.identify(run)
        assert blas_threads() == before
    assert within == [{1}]


def test_a_command_has_one_thread() -> None:
    code = "import sys; sys.argv[1:] = ['models', '--help']\nfrom pvid.cli.main import main\ntry:\n    main()\n"
    code += "except SystemExit:\n    import numpy, threadpoolctl\n"
    code += "    print({one['num_threads'] for one in threadpoolctl.threadpool_info()})"
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.splitlines()[-1] == "{1}"


def test_data_that_say_nothing_have_an_answer_without_parameters() -> None:
    t = np.arange(5000) / 1000
    noise = np.random.default_rng(1).normal(size=(2, t.size))
    result = pvid.identify({"t": t, "phi": 1e-4 * noise[0], "y": 1e-6 * noise[1]}, l1=0.3)
    assert not result.identified and not result.parameters and "nothing identified" in str(result)


@pytest.mark.parametrize(
    ("data", "keys", "sentence"),
    [
        (3, {"l1": 0.3}, "^data: a path, a data frame, .* or a mapping of arrays is wanted, such as .*, not int"),
        ({"t": [0, 1], "phi": [0, 1]}, {"l1": 0.3}, 'no column y.* use columns="y=NAME:m"\\.'),
        ({"t": [0, 1], "phi": [0, 1], "y": [0, 1]}, {}, "l1 .m. of the rig is missing: use l1=0.3 with"),
        ({"t": [0, 1], "phi": [0, 1], "y": [0, 1]}, {"columns": {"q": "a"}}, "no shipped mechanism has these"),
        ({"t": [0, 1], "q": [0, 1]}, {"model": "free_pendulum", "columns": {"a": "q"}}, "^columns: 'a' is no signal; "),
        ({"t": [0, 1], "phi": [0, 1], "y": [0, 1]}, {"columns": ["t"]}, "^columns: a text is wanted, .*not list"),
        ({"t": [0, 1], "phi": [0, 1], "y": [0, 1]}, {"sensor": 3}, "sensor must be a table"),
        ({"t": [0, 1]}, {}, "name yours with model=\\.\\.\\., and its columns with columns=\\.\\.\\.;"),
        ({"t": [0, 1], "phi": ["a", "b"], "y": [0, 1]}, {"l1": 0.3}, "row 1, column phi: 'a' is not a number"),
        ({"t": np.arange(9) / 1e3, "phi": np.zeros(8), "y": np.zeros(9)}, {"l1": 0.3}, "have"),
        ("nowhere.csv", {"l1": 0.3}, "nowhere.csv does not exist"),
    ],
)
def test_bad_input_is_one_sentence(data: object, keys: dict[str, object], sentence: str) -> None:
    with pytest.raises(pvid.PvidError, match=sentence):
        pvid.identify(data, **keys)  # type: ignore[arg-type]


def test_a_mechanism_of_the_list_is_identified(tmp_path: Path) -> None:
    path = tmp_path / "motor.csv"
    arguments = ["model", "simulate", "dc_motor", str(path), "--duration", "10"]
    CliRunner().invoke(commands, arguments, standalone_mode=False, catch_exceptions=False)
    result = pvid.identify(path)
    assert result.identified and {"R", "L", "k", "J", "b"} <= set(result.parameters)
    assert result.plot(tmp_path / "motor.png").exists()
    in_c = pvid.identify(path, core="f32")
    assert in_c.identified and in_c.details["core"] == "f32" and in_c["R"].value == pytest.approx(1.2, rel=1e-3)


def test_a_model_file_is_identified_and_advice_is_part_of_the_result() -> None:
    name, sentence = "heated_plate", 'P seems to have the opposite sign: columns="P=P:-1" (or T: columns="T=T:-1")'
    recording, model = own_recording(name), OWN[name].path
    data = {"t": recording.t, **recording.signals}
    for result in (pvid.identify(data, model=model), pvid.identify(data, model=model, core="f32")):
        assert result.identified and result.advice == () and result.details["advice"] == []
        for one in OWN[name].compiled.unknowns:
            assert abs(result[one.name].value - one.guess) < 4 * result[one.name].se
    wrong = pvid.identify(data, model=model, columns="P=P:-1")
    assert wrong.advice == (sentence,) and f"advice: {sentence}" in str(wrong)
    assert wrong.details["advice"] == ["P seems to have the opposite sign: --columns P=P:-1 (or T: --columns T=T:-1)"]
    assert escape(sentence) in wrong._repr_html_()


def test_the_estimator_takes_a_model_of_ones_own() -> None:
    """A motor: J, b, Coulomb friction; and the pendulum's tie of eleven coefficients to three, by rows of its form."""
    rng = np.random.default_rng(1)
    n = 3000
    angle = 0.01 * np.arange(n)
    speed, acceleration = 3 * np.sin(angle), 3 * np.cos(angle)
    rows = np.stack([acceleration, speed, np.sign(speed)], axis=1)
    truth = np.array([0.02, 0.05, 0.1])
    torque = rows @ truth + 0.01 * rng.normal(size=n)
    motor = pvid.Estimator(lambda p: p, start=[0.01, 0.1, 0.05], start_sd=[0.01, 0.1, 0.05], row_sd=0.01)
    found = motor.add(rows, torque).estimate
    assert np.all(np.abs(found.p - truth) < 4 * found.se) and np.all(found.se < 0.02 * truth)
    assert found.residual_sd == pytest.approx(0.01, rel=0.1)
    least_squares = np.linalg.lstsq(rows, torque, rcond=None)[0]
    assert found.p == pytest.approx(least_squares, rel=1e-3)


def test_the_estimator_drives_few_parameters_by_many_coefficients() -> None:
    p = np.array([9.5 / 0.3, 8.875, 5.625])

    def theta(p: np.ndarray) -> np.ndarray:
        w, d1, d2 = p
        return np.array([w * d1, w * w * d2, w * d2, d2, d1])

    rng = np.random.default_rng(2)
    rows = rng.normal(size=(2000, 5)) / theta(p)
    right = rows @ theta(p) + 0.01 * rng.normal(size=2000)
    start = 1.3 * p
    found = pvid.Estimator(theta, start=start, start_sd=0.5 * start, row_sd=0.01).add(rows, right).estimate
    assert np.all(np.abs(found.p - p) < 4 * found.se) and np.all(found.se < 1e-3 * p)


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"start": np.ones(60), "start_sd": np.ones(60)}, "more than the installed core has room for"),
        ({"start": [1.0], "start_sd": [0.0]}, "the core refused the estimator: bad start sd"),
        ({"start": [1.0], "start_sd": [0.5], "lower": [1.0, 2.0]}, "lower has shape"),
    ],
)
def test_an_estimator_that_cannot_be_is_refused(keys: dict[str, object], sentence: str) -> None:
    with pytest.raises(pvid.PvidError, match=sentence):
        pvid.Estimator(lambda p: p, row_sd=1.0, **keys)  # type: ignore[arg-type]


def test_rows_of_another_shape_are_refused_and_bad_ones_have_a_reason() -> None:
    estimator = pvid.Estimator(lambda p: p, start=[1.0], start_sd=[0.5], row_sd=0.1)
    with pytest.raises(pvid.PvidError, match="a row has 1 entries"):
        estimator.step([1.0, 2.0], 0.0)
    assert estimator.step([np.nan], 0.0) == "rejected not finite"
