"""Robots on a free base, moved by MuJoCo: one that nothing holds in space, and one that thrust holds."""

import math
import re
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner

from pvid.base.errors import PvidError
from pvid.cli.main import commands
from pvid.identification.robot import RobotAnswer, answer_of_robot
from pvid.identification.robot_writing import source_of, write_robot
from pvid.model.chain import POSE, WRENCH
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.models.registry import asked_for
from pvid.models.robot_file import model_text, placed
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]
RATE, SECONDS, SUBSTEPS = 400, 20, 2
_AXES = ("1 0 0 0 0 0", "0 1 0 0 0 0", "0 0 1 0 0 0", "0 0 0 1 0 0", "0 0 0 0 1 0", "0 0 0 0 0 1")
THRUST = "".join(f'<general site="s" gear="{one}"/>' for one in _AXES)
MJCF = f"""
<mujoco><compiler angle="radian"/><option timestep="{1 / RATE / SUBSTEPS}" gravity="0 0 {{gravity}}" integrator="RK4"/>
<default><joint stiffness="0" damping="0.04"/></default>
<worldbody><body name="hull" pos="1 2 3" quat="0.8 0 0.6 0"><freejoint/><site name="s"/>
  <inertial pos="0.02 -0.01 0.03" mass="3" fullinertia="0.05 0.06 0.08 0.002 -0.003 0.001"/>
  <body pos="0.15 0 -0.05"><joint name="shoulder" axis="0 1 0" frictionloss="0.02"/>
    <inertial pos="0.1 0.01 0" mass="0.6" fullinertia="0.001 0.004 0.004 0 0 0"/>
    <body pos="0.25 0 0"><joint name="elbow" axis="0 0 1"/>
      <inertial pos="0.08 0 0.01" mass="0.4" fullinertia="0.0006 0.002 0.002 0 0.0001 0"/>
    </body>
  </body>
</body></worldbody>
<actuator><motor joint="shoulder"/><motor joint="elbow"/>{THRUST}</actuator></mujoco>"""
URDF = """<robot name="flyer">
<link name="root"/><joint name="tie" type="fixed"><parent link="root"/><child link="hull"/></joint>
<link name="hull"><inertial><origin xyz="0.1 0 0"/><mass value="3"/>
  <inertia ixx="0.05" iyy="0.06" izz="0.08" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="revolute"><parent link="hull"/><child link="leg"/><axis xyz="0 1 0"/>
  <limit effort="5" lower="-1" upper="1" velocity="4"/></joint>
<link name="leg"><inertial><origin xyz="0 0 -0.1"/><mass value="0.5"/>
  <inertia ixx="0.002" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


def turned(quaternion: Float) -> tuple[Float, list[float]]:
    """Rotation from the body to the inertial frame; yaw, pitch and roll."""
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, quaternion)
    r = flat.reshape(3, 3)
    return r, [math.atan2(r[1, 0], r[0, 0]), math.asin(-r[2, 0]), math.atan2(r[2, 1], r[2, 2])]


@cache
def log_of(thrust: bool, seed: int, drag: float = 0.0) -> dict[str, Float]:
    """Columns of a recording, whose commands are held from sample to sample; poses have noise, joints encoders."""
    random = np.random.default_rng(seed)
    robot = mujoco.MjModel.from_xml_string(MJCF.format(gravity=-9.81 if thrust else 0))
    data = mujoco.MjData(robot)
    data.qpos[:7] = np.eye(7)[3]
    phases, rows = random.uniform(0, 2 * math.pi, (8, 5)), []
    for k in range(RATE * SECONDS):
        aim = np.sum(np.sin(1.6 * np.arange(1, 6) * k / RATE + phases), axis=1) / 4
        r, angles = turned(data.qpos[3:7])
        command = np.zeros(8)
        command[:2] = 4 * (1.4 * aim[:2] - data.qpos[7:]) - 0.4 * data.qvel[6:]
        if thrust:
            push = [0, 0, 4 * 9.81] + 20 * (0.6 * aim[2:5] - data.qpos[:3]) - 12 * data.qvel[:3]
            command[2:5] = r.T @ push
            command[5:] = 4 * (0.5 * aim[5:] - angles[::-1]) - 0.8 * data.qvel[3:6]
        rows.append([*data.qpos[:3], *angles, *data.qpos[7:], *command[2:], *command[:2]])
        data.ctrl = command
        data.qfrc_applied[:3] = -drag * data.qvel[:3]
        mujoco.mj_step(robot, data, SUBSTEPS)
    table = np.array(rows)
    table[:, :6] += 1e-4 * random.normal(size=(len(rows), 6))
    table[:, 6:8] = np.round(table[:, 6:8] / 1e-4) * 1e-4
    table[:, 8:] += [*([0.02] * 3), *([0.002] * 5)] * random.normal(size=(len(rows), 8))
    return dict(zip((*POSE, "q1", "q2", *WRENCH, "tau1", "tau2"), table.T, strict=True))


def modelled(folder: Path, thrust: bool) -> CompiledModel:
    (folder / "robot.xml").write_text(MJCF.format(gravity=-9.81 if thrust else 0))
    text = model_text(folder / "robot.xml").replace('model.free_base("hull", ', 'model.free_base("hull", {}')
    text = text.replace("origin=", 'hold="zoh", origin=').format('wrench=True, hold="zoh", ' if thrust else "")
    (folder / "robot.py").write_text(text)
    return compiled_of(folder / "robot.py")


def answered(model: CompiledModel, log: dict[str, Float]) -> RobotAnswer:
    names = {one.name for one in model.signals}
    run = {name: one for name, one in log.items() if name in names}
    return answer_of_robot(Recording(np.arange(RATE * SECONDS) / RATE, run, RATE), model)


@pytest.mark.parametrize("thrust", [True, False])
def test_all_base_parameters_are_found(thrust: bool, tmp_path: Path) -> None:
    model = modelled(tmp_path, thrust)
    chain = model.chain
    assert chain is not None
    truth = np.array([chain.of_file(one) for one in chain.base], float)
    assert len(truth) == 28
    away = []
    for seed in (1, 2):
        answer = answered(model, log_of(thrust, seed))
        assert answer.verdict.word == "good" and not answer.fit.undetermined.any()
        sd = np.sqrt(np.diag(answer.fit.covariance))
        away.append((answer.fit.p - truth) / sd)
        # Without thrust the common scale of all bodies is in what their motion asks of the two joints alone.
        assert sd[model.p_names.index("m0_R")] < (0.004 if thrust else 0.4)
        assert len(answer.prediction) == (8 if thrust else 2)
    assert np.mean(np.abs(away) < 2) > 0.85 and np.max(np.abs(away)) < 4


def test_thrust_that_is_not_recorded_is_told(tmp_path: Path) -> None:
    modelled(tmp_path, thrust=True)
    text = (tmp_path / "robot.py").read_text().replace('wrench=True, hold="zoh", ', "")
    (tmp_path / "robot.py").write_text(text)
    verdict = answered(compiled_of(tmp_path / "robot.py"), log_of(True, 1)).verdict
    assert verdict.word == "not_explained" and "what touches the base: the ground" in verdict.reasons[-1].text


def test_drag_of_the_air_is_told(tmp_path: Path) -> None:
    model = modelled(tmp_path, thrust=True)
    told = " ".join(one.text for one in answered(model, log_of(True, 1, drag=2.0)).verdict.reasons)
    found = re.findall(r"the force along ([xyz]) has what the equations lack, (\S+) N\*s/m \* its rate: drag", told)
    assert {axis: float(size) for axis, size in found} == pytest.approx(dict.fromkeys("xyz", 2.0), rel=0.05)


def test_the_file_is_written_again(tmp_path: Path) -> None:
    model = modelled(tmp_path, thrust=True)
    answer, out = answered(model, log_of(True, 1)), tmp_path / "new.xml"
    write_robot(answer, source_of(asked_for(str(tmp_path / "robot.py")), out), out, "a log")
    masses = mujoco.MjModel.from_xml_path(str(out)).body_mass[1:]
    assert np.sum(masses) == pytest.approx(4, rel=1e-3) and list(answer.as_json()["bodies"]) == [
        "hull", "shoulder", "elbow"]  # fmt: skip


def refused(model: CompiledModel, log: dict[str, Float], sentence: str) -> None:
    with pytest.raises(PvidError, match=sentence):
        answered(model, log)


def test_what_has_no_answer_is_refused(tmp_path: Path) -> None:
    model, log = modelled(tmp_path, thrust=False), log_of(False, 1)
    refused(model, log | {"pitch": log["pitch"] + 1.1}, "pitch reaches .* turn about one axis")
    refused(model, log | {"pitch": 57.3 * log["pitch"]}, "pitch reaches .* is it in degrees")
    refused(model, log | dict.fromkeys(("tau1", "tau2"), 0 * log["x"]), "every torque is 0 at all times")
    refused(model, log | {"tau2": 0 * log["x"]}, "the torque of joint 2 is 0 in every sample: is it recorded")
    refused(model, log | {"q1": 0 * log["x"]}, "q1 does not change: move it, or hold it")
    noise = 1e-5 * np.random.default_rng(0).normal(size=len(log["x"]))
    refused(model, log | {"q1": noise}, "q1 is nowhere clear of a standstill")
    wrapped = answered(model, log | {"yaw": np.mod(log["yaw"], 2 * math.pi)}).fit.p
    assert wrapped == pytest.approx(answered(model, log).fit.p, rel=1e-6)
    bare = (tmp_path / "robot.py").read_text().split("inertial=(0.4")[0].rstrip().rstrip(",") + ")\n"
    (tmp_path / "bare.py").write_text(bare)
    refused(compiled_of(tmp_path / "bare.py"), log, "nothing drives force along x values are needed to begin with")


def test_no_base_of_mjcf_is_free_on_request(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(MJCF.format(gravity=0).replace("<freejoint/>", '<joint name="j"/>'))
    with pytest.raises(PvidError, match="has no free joint"):
        placed(tmp_path / "arm.xml", free_base=True)


def test_the_first_link_of_urdf_is_free_on_request(tmp_path: Path) -> None:
    (tmp_path / "flyer.urdf").write_text(URDF)
    for more in (["--free-base"], []):
        made = CliRunner().invoke(commands, ["model", "from", str(tmp_path / "flyer.urdf"), *more, "--force", "-o",
                                             str(tmp_path / "flyer.py")])  # fmt: skip
        assert made.exit_code == 0, made.output
        chain = compiled_of(tmp_path / "flyer.py").chain
        assert chain is not None
        joints = chain.joints
        assert [one.free for one in joints] == [*([True] * 6 if more else []), False]
        if more:
            for arguments in (["model", "build"], ["design", "--duration", "20", "--model"]):
                refused = CliRunner().invoke(commands, [*arguments, str(tmp_path / "flyer.py"), "-o", "out"])
                assert isinstance(refused.exception, PvidError) and "free" in str(refused.exception)
            assert "1 joint on a free base, 19 base parameters" in made.output
            assert (joints[5].inertial or ())[:4] == pytest.approx((3, 0.3, 0, 0)) and joints[6].parent == 5
