"""Model files from URDF and MJCF, against MuJoCo's own torques."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
import robot_arms
from click.testing import CliRunner

import pvid
from pvid.base.errors import PvidError
from pvid.cli.main import commands
from pvid.model.chain import Chain
from pvid.models.mechanisms import compiled_of
from pvid.models.robot_file import model_text

MJCF = """
<mujoco model="arm"><compiler angle="radian"/><option gravity="0 0.5 -9.81"/>
<worldbody><body pos="0 0 0.2" quat="0.8 0 0.6 0"><inertial pos="0.1 0 0" mass="9" diaginertia="1 1 1"/>
  <body pos="0.1 0 0.3" quat="0.9 0.1 -0.3 0.2">
    <joint name="turn" axis="0 0 1" pos="0.02 0.01 0" armature="0.03"/>
    <joint name="tilt" axis="0 0.6 0.8"/>
    <inertial pos="0.1 0.02 0.03" mass="2" fullinertia="0.03 0.04 0.05 0.001 0.002 0.003"/>
    <body pos="0.4 0 0" quat="0.7 0.1 0.7 0">
      <joint name="slide" type="slide" axis="1 0 0"/>
      <inertial pos="0 0.1 0" mass="1.5" fullinertia="0.02 0.01 0.02 0.001 0 0.002"/>
      <body pos="0.1 0 0"><inertial pos="0.05 0 0.05" mass="0.5" diaginertia="0.001 0.002 0.002"/></body>
    </body>
    <body pos="-0.2 0 0.1"><joint name="other" axis="1 0 0"/>
      <inertial pos="0 0 0.2" mass="1" fullinertia="0.03 0.03 0.01 0 0 0.001"/>
    </body>
  </body>
</body></worldbody>{more}</mujoco>"""
HELD = MJCF.replace('type="slide"', 'type="slide" ref="0.2"')
URDF = (Path(__file__).parents[1] / "data/robot/arm.urdf").read_text(encoding="utf-8")
LOWER = next(one for one in re.findall(r"(?s)<inertial>.*?</inertial>", URDF) if 'mass value="1"' in one)
FREE = '<mujoco><worldbody><body><freejoint/><geom size="0.1"/></body></worldbody></mujoco>'
BALL = '<mujoco><worldbody><body><joint name="b" type="ball"/><geom size="0.1"/></body></worldbody></mujoco>'
STILL = '<mujoco><worldbody><body><geom size="0.1"/></body></worldbody></mujoco>'
SPRING = '<mujoco><worldbody><body><joint name="s" stiffness="2"/><geom size="0.1"/></body></worldbody></mujoco>'
SMALL = '<mujoco><worldbody><body><joint axis="0 1 0"/><geom size="0.1" pos="0.1 0 0"/></body></worldbody></mujoco>'
ONE = '<body><joint name="j{}"/><geom size="0.1"/>'
MANY = f"<mujoco><worldbody>{''.join(map(ONE.format, range(13)))}{'</body>' * 13}</worldbody></mujoco>"
COUPLED = '<equality><joint joint1="slide" joint2="other"/></equality>'
LOOP = '<equality><connect body1="{}" body2="{}" anchor="0 0 0"/></equality>'


def chain_of(folder: Path, text: str, *joints: str) -> Chain:
    """What a robot's file becomes, by way of a model file."""
    (folder / "robot.xml").write_text(text)
    (folder / "robot.py").write_text(model_text(folder / "robot.xml", joints))
    chain = compiled_of(folder / "robot.py").chain
    assert chain is not None
    return chain


@pytest.mark.parametrize(
    ("text", "joints"),
    [(MJCF.format(more=""), ()), (URDF, ()), (HELD.format(more=""), ("turn", "tilt", "other"))],
    ids=["MJCF", "URDF", "held at zero, with a ref"],
)
def test_a_model_file_has_the_torques_of_mujoco(text: str, joints: tuple[str, ...], tmp_path: Path) -> None:
    chain = chain_of(tmp_path, text, *joints)
    plain = re.sub("<visual>.*?</visual>|<dynamics[^>]*>", "", text)
    model = mujoco.MjModel.from_xml_string(plain)
    data, states = mujoco.MjData(model), np.random.default_rng(2).uniform(-1, 1, (3, model.nv, 10))
    moved = [k for k in range(model.nv) if not joints or model.joint(k).name in joints]
    states[:, [k for k in range(model.nv) if k not in moved]] = 0.0
    found = robot_arms.torques(chain, *states[:, moved])
    for k, (q, v, a) in enumerate(states.transpose(2, 0, 1)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(found[:, k], data.qfrc_inverse[moved], atol=1e-7)  # a file has ten digits


def test_joints_that_are_not_chosen_are_held(tmp_path: Path) -> None:
    chain = chain_of(tmp_path, MJCF.format(more=""), "turn", "other")
    assert [(one.name, one.parent) for one in chain.joints] == [("turn", -1), ("other", 0)]
    mass = chain.joints[0].inertial
    assert mass is not None and mass[0] == pytest.approx(4.0)  # what slides is carried


def test_the_model_file_is_short(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(URDF)
    text = model_text(tmp_path / "arm.urdf")
    assert "rpy=(-pi/2, 0, 0)," in text and 'model.joint("shoulder",' in text
    assert "limits=(-2, 2), speed=3, torque=50," in text and "friction=(0.2, 0.5), speed=4, torque=20," in text
    assert text.startswith('"arm.urdf: 2 joints, by `pvid model from`. Torques that are commanded and held')
    assert len(text.splitlines()) < 12 and max(map(len, text.splitlines())) <= 200


@pytest.mark.parametrize(
    ("inertial", "told"),
    [
        ("", "without an inertial: lower"),
        (LOWER.replace('ixx="', 'ixx="9'), "with an impossible inertia, the nearest is taken: lower"),
        ('<inertial><mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>', ""),
    ],
    ids=["none", "impossible", "of a point"],
)
def test_base_parameters_need_no_inertia_of_the_file(inertial: str, told: str, tmp_path: Path) -> None:
    usual, found = chain_of(tmp_path, URDF), chain_of(tmp_path, URDF.replace(LOWER, inertial))
    assert [*map(found.name_of, found.base)] == [*map(usual.name_of, usual.base)]
    notes = [one for one in (tmp_path / "robot.py").read_text().splitlines() if one.startswith("#")]
    assert notes == ([f"# {told}"] if told else [])
    mass = found.joints[1].inertial
    assert (mass and mass[0]) == (1.4 if inertial else None)  # with the tool; `design` asks for it


def test_a_warning_of_mujoco_is_a_note(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    chain_of(tmp_path, URDF.replace('lower="-2" upper="2"', 'lower="1" upper="1"'))
    assert "# joint 'shoulder' has equal lower and upper limits, limit ignored" in (tmp_path / "robot.py").read_text()
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_a_transmission_hides_no_limit_and_an_endless_speed_is_none(tmp_path: Path) -> None:
    more = '<transmission name="t"><joint name="shoulder"/></transmission></robot>'
    joints = chain_of(tmp_path, URDF.replace("</robot>", more).replace('velocity="4"', 'velocity="inf"')).joints
    assert [one.speed for one in joints] == [3.0, None]
    endless = MJCF.replace('name="tilt"', 'name="tilt" actuatorfrclimited="true" actuatorfrcrange="0 5"')
    assert chain_of(tmp_path, endless.format(more="")).joints[1].torque is None


REFUSED = {
    "no file": (None, (), "cannot be read"),
    "no XML": ("t,q1\n0,1\n", (), "is no URDF or MJCF file"),
    "unknown": ("<mujoco><worldbody><thing/></worldbody></mujoco>", (), "MuJoCo does not read it"),
    "two free": (FREE.replace("</worldbody>", "<body><freejoint/><geom size='1'/></body></worldbody>"), (), "are free"),
    "one held, one free": (
        FREE.replace("</body></worldbody>", "<body><joint name='k'/><geom size='1'/></body></body>"
                     "<body><joint name='j'/><geom size='1'/></body></worldbody>"), (),
        "j move on a fixed base, and another base is free: one robot at a time",
    ),
    "ball": (BALL, (), "b is a ball joint"),
    "no joint": (STILL, (), "no joint moves"),
    "spring": (SPRING, (), "s has a spring (stiffness)"),
    "many": (MANY, (), "13 joints are more than 12: choose some of them with --joints: j0,j1,"),
    "no number": (URDF.replace('velocity="4"', 'velocity="fast"'), (), "is no URDF file: could not convert string to"),
    "no such joint": (MJCF.format(more=""), ("knee",), "there is no joint knee: it has turn, tilt, slide and other"),
    "order": (MJCF.format(more=""), ("slide", "turn"), "turn carries a joint before it in the list"),
    "loop": (
        MJCF.replace('body pos="-0.2', 'body name="a" pos="-0.2').replace('body pos="0.4', 'body name="b" pos="0.4')
        .format(more=LOOP.format("a", "b")), (), "an equality ties its bodies (a closed loop, or coupled joints)",
    ),
    "coupled": (
        MJCF.format(more=COUPLED), (), "are identified; hold slide and other: --joints turn,tilt",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_arm_is_refused(name: str, tmp_path: Path) -> None:
    text, joints, sentence = REFUSED[name]
    path = tmp_path / "arm.xml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(PvidError, match=re.escape(sentence)):
        model_text(path, joints)


def test_coupled_joints_may_be_held(tmp_path: Path) -> None:
    assert len(chain_of(tmp_path, MJCF.format(more=COUPLED), "turn", "tilt").joints) == 2


def test_without_mujoco_the_line_that_installs_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(PvidError, match="needs the Python package mujoco"):
        model_text(tmp_path / "arm.urdf")


def test_from_a_file_to_an_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(URDF)

    def run(*arguments: str) -> str:
        found = CliRunner().invoke(commands, arguments, standalone_mode=False)
        assert found.exception is None and found.return_value == 0, found.exception or found.output
        return found.output

    assert "arm.py: 2 joints, " in run("model", "from", "arm.urdf", "-o", "arm.py")
    chain = compiled_of(Path("arm.py")).chain
    assert chain is not None
    log = robot_arms.log_of(chain, 1)
    np.savetxt("log.csv", np.array(list(log.values())).T, delimiter=",", header=",".join(log), comments="")
    report = run("model", "check", "arm.py")
    assert "2 joints" in report and "No torque depends on" in report
    answer = run("identify", "log.csv", "--model", "arm.py", "--validate", "log.csv")
    assert "predicts torques that were not fitted: tau1" in answer and "log.csv: the answer predicts tau1" in answer
    np.savetxt(
        "empty.csv",
        np.array(list(robot_arms.log_of(chain, 2).values())).T,
        delimiter=",",
        header=",".join(robot_arms.log_of(chain, 2)),
        comments="",
    )
    assert "payload m: " in run("identify", "log.csv", "--model", "arm.py", "--without", "empty.csv")
    told = CliRunner().invoke(
        commands, ["identify", "log.csv", "--model", "dc_motor", "--without", "empty.csv"], standalone_mode=False
    )
    assert "--without is for the payload of a robot, which dc_motor is not" in str(told.exception)
    assert re.search(r"Fc2 \[N\*m\] +│ +(1.0\d*|0.99\d*) ", answer), answer


def test_a_model_file_is_not_written_by_another_name(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(URDF)
    arguments = ["model", "from", str(tmp_path / "arm.urdf"), "-o", str(tmp_path / "arm")]
    found = CliRunner().invoke(commands, arguments, standalone_mode=False)
    assert "arm: the name of a model file ends with .py" in str(found.exception)
    assert not (tmp_path / "arm").exists()


def test_a_coarse_encoder_is_doubted(tmp_path: Path) -> None:
    chain = chain_of(tmp_path, URDF)
    warnings = []
    for bits in (14, 13):
        log = robot_arms.log_of(chain, 1, bits=bits, blur=0.0)
        warnings.append(pvid.identify(log, model=tmp_path / "robot.py").warning)
    assert warnings[0] is None
    assert warnings[1] is not None and "stays on one count in" in warnings[1]


def test_torques_in_the_wrong_columns_are_doubted(tmp_path: Path) -> None:
    log = robot_arms.log_of(chain_of(tmp_path, URDF), 1)
    found = pvid.identify(log | {"tau1": log["tau1"][::-1]}, model=tmp_path / "robot.py")
    assert found.warning is not None and "of tau1 is explained on unseen motion" in found.warning


OTHERS = {
    "predict": "model predict robot.py",
    "simulate": "model simulate robot.py run.csv",
    "deploy": "deploy robot.py --run log.csv -o made --for arduino",
    "compare": "compare log.csv --model robot.py",
    "tune": "tune log.csv --model robot.py",
    "plot": "plot log.csv --model robot.py -o figure.png",
    "validate": "validate log.csv --from answer.json --model robot.py",
    "core": "identify log.csv --model robot.py --core q31",
    "refine": "identify log.csv --model robot.py --refine",
    "report": "identify log.csv --model robot.py --report report.html",
    "add": "identify log.csv --model robot.py --add k*q1",
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_commands_take_no_robot(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    log = robot_arms.log_of(chain_of(tmp_path, SMALL), 1, seconds=4.0)  # of 6 parameters, which C could take
    np.savetxt("log.csv", np.array(list(log.values())).T, delimiter=",", header=",".join(log), comments="")
    Path("answer.json").write_text('{"parameters": {}}')
    found = CliRunner().invoke(commands, OTHERS[name].split(), standalone_mode=False)
    told = str(found.exception or found.output)
    assert "robot is a robot, which" in told and "does not take: `pvid identify` in float64 does" in told


def test_python_has_its_answer_and_no_simulation(tmp_path: Path) -> None:
    log = robot_arms.log_of(chain_of(tmp_path, SMALL), 1)
    found = pvid.identify(log, model=tmp_path / "robot.py")
    assert found.identified and found.covariance.shape == (5, 5)
    assert found["Fc1"].value == pytest.approx(1.0, abs=0.01)  # 5 standard errors
    assert found.details["prediction"]["tau1"]["r2"] > 0.99
    for other in (found.predict, found.validate):
        with pytest.raises(PvidError, match="is a robot, which a simulation does not take"):
            other(log)
