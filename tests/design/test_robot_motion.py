"""Motions of robots: limits that MuJoCo finds kept, errors beside simple drives, and the same motion in C."""

from __future__ import annotations

import ctypes
import json
import math
import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from bench.robot_motion import arm, compiled, errors, report, verdict
from pvid.base.errors import PvidError
from pvid.cli.main import commands
from pvid.configuration.robot_motion import Motion, designed_motion, simple_drives
from pvid.core.sources import INCLUDES, source
from pvid.deploy.motion import motion_header, motion_table
from pvid.model.compiled import CompiledModel

BOX = ((-1.0, -1.0, 0.0), (1.0, 1.0, 1.5))
ROBOT = """from pvid.model import Robot
model = Robot("one arm")
model.joint("a", (0, 0, 1), rpy=(1.57, 0, 0), limits=(-1, 1), speed=2,
            inertial=(1, 0.1, 0, 0, 0.1, 0, 0, 0.1, 0, 0.1){})
"""


def model_of(joints: int = 2, box: Any = BOX, **changed: Any) -> CompiledModel:
    given: dict[str, Any] = {"limits": (-1.5, 2.0), "speed": 2.0, "torque": 60.0} | changed
    return compiled([replace(one, **given) for one in arm(joints, np.random.default_rng(1))], box)


@pytest.fixture(scope="module")
def motion() -> Motion:
    return designed_motion(model_of(), 5.0, 500.0, turns=15)


def test_random_limits_are_kept() -> None:
    found = [verdict(seed, 1) for seed in range(12)]
    kept = [one for one in found if one is not None]
    assert len(kept) >= 6  # the others are refused
    assert max(max(one.values()) for one in kept) <= 1.0
    assert max(one["speed"] for one in kept) > 0.99  # limits are used, not avoided


def test_a_motion_that_is_larger_than_its_limits_is_seen() -> None:
    task, series = simple_drives(model_of(), 4.0)[0]
    wider = replace(series, waves=3 * series.waves)
    assert max(one for one in task.used(wider).values() if one is not None) > 1.0
    fitted = task.fitted(wider)
    assert fitted is not None and max(one for one in task.used(fitted).values() if one is not None) <= 1.0


def test_a_third_of_the_time_gives_the_same_errors() -> None:
    cells = errors(2, 4, 18.0, 6.0)
    assert (
        float(cells[5]) > 1.0 and float(cells[7]) > 1.0
    )  # 1.9 and 2.1; `bench robot-motion` has 20 runs of more joints
    assert float(cells[8]) > 85.0  # of 52 values


def test_the_search_follows_the_derivative() -> None:
    task, series = simple_drives(model_of(), 5.0)[0]
    start = np.hstack([series.centre[:, np.newaxis], 1.4 * series.waves]).reshape(-1)

    def cost(x: Any) -> Any:
        whole = x.reshape(len(series.centre), -1)
        return task.cost(replace(series, centre=whole[:, 0], waves=whole[:, 1:]), 100.0)

    slope = cost(start)[1]
    for place in np.random.default_rng(0).integers(0, len(start), 8):
        step = 1e-6 * np.eye(len(start))[place]
        numeric = (cost(start + step)[0] - cost(start - step)[0]) / 2e-6
        assert slope[place] == pytest.approx(numeric, rel=1e-4, abs=1e-6)


def test_the_c_moves_as_the_table(motion: Motion, tmp_path: Path) -> None:
    (tmp_path / "motion.h").write_text(motion_header(motion, "motion", "pvid design"))
    assert "#define MOTION_2__JOINTS 2\n" in motion_header(motion, "2\u00fc", "pvid design")  # any name of a file
    (tmp_path / "run.c").write_text(
        '#include "motion.h"\nint run(int joint, float *out, int ticks)\n{\n    static pvid_excite_f32 self;\n'
        "    const int status = (int)pvid_excite_init_f32(&self, &motion_excite[joint]);\n"
        "    (void)pvid_excite_start_f32(&self, 1.0f, 0u);\n"
        "    for (int k = 0; k < ticks; k++) { out[k] = motion_centre[joint] + pvid_excite_step_f32(&self, NULL); }\n"
        "    return (status * 2) + (pvid_excite_restrained_f32(&self) > 0.0f ? 1 : 0);\n}\n"
    )
    core = [source(f"{one}.c") for one in ("excite_f32", "elementary_f32", "finite_f32")]
    options = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-ffp-contract=off", *INCLUDES)
    subprocess.run(["gcc", *options, tmp_path / "run.c", *core, "-o", tmp_path / "run.so", "-lm"], check=True)
    library = ctypes.CDLL(str(tmp_path / "run.so"))
    table = np.array([row.split(",") for row in motion_table(motion).splitlines()[1:]], float)
    for joint in range(2):
        out = np.zeros(len(table), np.float32)
        assert library.run(joint, out.ctypes.data_as(ctypes.c_void_p), len(out)) == 0  # no limit of the C touches it
        np.testing.assert_allclose(out, table[:, 1 + joint], atol=1e-5)  # float32 of 2 rad: 2e-7, a tone's phase 1e-6
    q, qd, qdd = table[:, 1:3], table[:, 3:5], table[:, 5:7]
    inner = np.r_[2:245, 255:2245, 2255:2499]  # at the ends of a ramp the acceleration jumps
    np.testing.assert_allclose(np.gradient(q, 1 / 500, axis=0)[inner], qd[inner], atol=2e-3)  # h^2/6 of 2 Hz: 1e-3
    np.testing.assert_allclose(np.gradient(qd, 1 / 500, axis=0)[inner], qdd[inner], atol=2e-2)
    assert abs(qd[[0, -1]]).max() == 0 and (q[0] == q[-1]).all()  # from rest to rest


REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "speed": (lambda: simple_drives(model_of(speed=None), 5.0), "j0 and j1 have no limits of their speeds: model."),
    "noise": (lambda: simple_drives(model_of(torque=None), 5.0), "j0 has neither a limit nor a noise of its torque"),
    "range": (
        lambda: simple_drives(model_of(limits=None, prismatic=True), 5.0),
        "j0 and j1 have no limits: model.joint",
    ),
    "inertial": (lambda: simple_drives(model_of(inertial=None), 5.0), "a limit of a torque needs the inertias"),
    "weak": (lambda: simple_drives(model_of(torque=0.9), 5.0), "within its limits: j1 needs 111% of its torque"),
    "box": (lambda: simple_drives(model_of(box=((5, 5, 5), (6, 6, 6))), 5.0), "a point is outside the box"),
    "short": (lambda: simple_drives(model_of(), 1.0), "a motion of 1 s: --duration must be from 2.4 to 600"),
    "long": (lambda: simple_drives(model_of(), 3600.0), "a motion of 3600 s: --duration must be from 2.4 to 600"),
    "slow": (lambda: simple_drives(model_of(), 5.0, 20.0), "20 samples a second are too few for a robot"),
    "empty box": (
        lambda: simple_drives(model_of(1, torque=None, noise=0.1, inertial=None), 5.0),
        "the box holds nothing",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_motion_is_refused(name: str) -> None:
    make, sentence = REFUSED[name]
    with pytest.raises(PvidError, match=re.escape(sentence)):
        make()


def test_without_a_limit_of_the_torque_its_noise_is_enough() -> None:
    found = designed_motion(model_of(torque=None, noise=0.5, limits=None, box=None, friction=None), 4.0, 500.0, turns=2)
    assert found.used["torque"] is None and found.used["box"] is None and found.gain >= 1.0
    assert not found.predicted().undetermined.all()


def test_the_command_writes_the_motion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    def run(words: str) -> tuple[str, int]:
        found = CliRunner().invoke(commands, words.split(), standalone_mode=False)
        return str(found.exception or found.output), found.return_value

    Path("arm.py").write_text(ROBOT.format(", torque=20, friction=(0.1, 0.2)"))
    told, done = run("design --model arm.py --duration 6 -o motion.csv")
    assert done == 0 and "errors of a multisine within the same limits: " in told and "% of the speed" in told
    assert (
        Path("motion.csv").read_text().startswith("t,q1,qd1,qdd1\n")
        and "motion_excite[" in Path("motion.h").read_text()
    )
    told, _ = run("design --model arm.py --duration 6 -o motion.csv --json")
    friction = json.loads(told)["parameters"]["Fc1"]
    _, q, v, qdd = np.loadtxt("motion.csv", delimiter=",", skiprows=1).T
    rows = np.array([qdd, np.sin(q), np.cos(q), v, np.sign(v)])
    bound = 0.01 * 20 * math.sqrt(np.linalg.inv(rows @ rows.T)[4, 4])  # of what knows accelerations, and slow steps
    assert friction == {"file": 0.2, "se": friction["se"], "unit": "N*m"} and 1.2 < friction["se"] / bound < 1.8  # 1.56
    assert "the motion of a robot needs its length and a file" in run("design --model arm.py")[0]
    assert "dc_motor is no robot, whose motion --out writes" in run("design --model dc_motor -o x.csv")[0]
    assert "omit --run, --tone and --on" in run("design --model arm.py --duration 6 -o motion.csv --tone 1,1,0")[0]
    assert "name the table, motion.csv" in run("design --model arm.py --duration 6 -o motion.h")[0]
    Path("2.h").write_text("mine")
    assert "2.h is not replaced" in run("design --model arm.py --duration 6 -o 2.csv")[0] and not Path("2.csv").exists()


def test_the_bench_counts_what_is_beyond_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    found = report(2, 0, 1, (), lambda: None)
    assert found.tables[0][2] == [["2", *list(found.tables[0][2])[0][1:]]] and not found.faults
    monkeypatch.setattr("bench.robot_motion.verdict", lambda *_: {"speed": 1.01})
    assert report(2, 0, 1, (), lambda: None).faults == ["2 motions are beyond a limit"]
