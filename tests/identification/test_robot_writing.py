"""Robots' files with identified values: read again, against MuJoCo's torques and those of Newton and Euler."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import robot_arms
from click.testing import CliRunner
from test_bodies import off_file

from pvid.cli.main import commands
from pvid.model.chain import INERTIAL, Chain
from pvid.models.mechanisms import compiled_of
from pvid.models.robot_file import model_text

DATA = Path(__file__).parents[1] / "data/robot"
URDF = "<!-- of a firm -->\n" + (DATA / "arm.urdf").read_text(encoding="utf-8")
MJCF = (DATA / "arm.xml").read_text(encoding="utf-8")
TWO = MJCF.replace('<joint name="turn"', '<joint name="tilt" axis="1 0 0"/><joint name="turn"')
ROBOTS = {
    "URDF, a tool": ("arm.urdf", URDF, ()),
    "URDF, a held joint": ("arm.urdf", URDF.replace('"flange" type="fixed"', '"flange" type="continuous"'),
                           ("shoulder", "elbow")),
    "MJCF, a tool": ("arm.xml", MJCF, ()),
    "MJCF, a held joint": ("arm.xml", MJCF, ("turn", "joint3")),
    "MJCF, two joints of a body": ("arm.xml", TWO, ()),
    "MJCF, a rotor below 0": ("arm.xml", MJCF, ("turn", "joint3")),
}  # fmt: skip


def run(*arguments: str) -> Any:
    return CliRunner().invoke(commands, ["identify", "log.csv", "--model", "arm.py", *arguments], standalone_mode=False)


def chain_of(path: Path, joints: tuple[str, ...], model: str = "again.py") -> Chain:
    """A robot's file, by way of a model file."""
    Path(model).write_text(model_text(path, joints, Path()))
    chain = compiled_of(Path(model)).chain
    assert chain is not None
    return chain


def recorded(text: str, name: str, joints: tuple[str, ...], **how: Any) -> Chain:
    """A robot's file, its model file, and a recording of an arm that differs from it."""
    Path("sub").mkdir()
    Path("sub", name).write_text(text)
    Path("sub/more.xml").write_text("<mujoco><option/></mujoco>")
    chain = chain_of(Path("sub", name), joints, "arm.py")
    possible = all(one.inertial and one.inertial[0] for one in chain.joints)
    log = robot_arms.log_of(off_file(chain, 3) if possible else chain, 1, **how)
    np.savetxt("log.csv", np.array(list(log.values())).T, delimiter=",", header=",".join(log), comments="")
    return chain


@pytest.mark.parametrize("name", ROBOTS)
def test_a_written_file_has_the_answer(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file, text, joints = ROBOTS[name]
    low = name.endswith("below 0")
    chain = recorded(text, file, joints, noise=0.02 if low else 0.002)
    out = Path(f"new{Path(file).suffix}")
    found = run("--write-model", str(out), "--json")
    assert found.exception is None and found.return_value == 0, found.exception or found.output
    answer = json.loads(found.stdout)
    p, bodies = answer["parameters"], answer["bodies"]
    written = out.read_text()
    assert "Made by `pvid identify` from log.csv, by arm.py" in written
    assert re.search("(?s)<!-- of a firm -->.*nowhere/upper.stl|<!-- no name -->", written)
    again = chain_of(out, joints)
    assert [one.name for one in again.joints] == [one.name for one in chain.joints]
    assert ("no robot has Ia2 below 0" in written) == (p.get("Ia2", {"value": 0.0})["value"] < 0) == low
    for one in again.base if not low else ():
        value, (kind, known) = again.of_file(one), (again.standard[one.standard].kind, p[again.name_of(one)])
        near = 0.1 * known["se"] if kind in INERTIAL else 1e-6 * abs(known["value"])  # as REACHED
        assert value == pytest.approx(known["value"], rel=0, abs=near), again.name_of(one)
    assert abs(p["Fv1"]["value"] - 0.5) < 0.1 and abs(p["Fc1"]["value"] - 1.0) < 0.1

    own = tuple(
        replace(one, inertial=tuple(bodies[one.name].values()),
                rotor=max(0.0, p[f"Ia{k}"]["value"]) if f"Ia{k}" in p else one.rotor)
        for k, one in enumerate(chain.joints, 1)
    )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(re.sub("(?s)<visual>.*?</visual>", "", written))
    moved = [model.jnt_dofadr[k] for k in range(model.njnt)
             if model.joint(k).name in joints or not joints or not model.joint(k).name]  # fmt: skip
    states = np.zeros((3, model.nv, 10))
    states[:, moved] = np.random.default_rng(2).uniform(-1, 1, (3, len(moved), 10))
    viscous, dry = (np.array([p[f"{kind}{k + 1}"]["value"] for k in range(len(moved))]) for kind in ("Fv", "Fc"))
    off = 0.002 if low else 1e-12  # with Ia2 of 0 in place of -1.5 standard errors
    np.testing.assert_allclose(model.dof_frictionloss[moved], dry, rtol=off)
    np.testing.assert_allclose(model.dof_damping[moved], viscous, rtol=off)
    model.dof_frictionloss[:] = 0.0  # MuJoCo's is a soft constraint
    expected = robot_arms.torques(replace(chain, joints=own), *states[:, moved])
    expected += model.dof_damping[moved][:, np.newaxis] * states[1, moved]
    data = mujoco.MjData(model)
    for k, (q, v, a) in enumerate(states.transpose(2, 0, 1)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(data.qfrc_inverse[moved], expected[:, k], atol=1e-7)  # a file has ten digits


def test_what_is_not_in_the_written_file_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    chain = recorded(URDF, "arm.urdf", (), seconds=6.0)
    model = Path("arm.py").read_text()
    Path("arm.py").write_text(model.replace('"elbow",', '"elbow", offset=True, rotor=0.02,'))
    t, q, v, a = robot_arms.motion(2, 10.0, 500.0, 1)
    q[0], v[0], a[0] = 0.3 * t, 0.3, 0.0  # without a change of its rate
    tau = robot_arms.torques(chain, q, v, a) + 0.4 * v + 0.7 * np.sign(v) + [[0.0], [0.1]] + 0.02 * a * [[0.0], [1.0]]
    tau += 0.01 * np.random.default_rng(2).normal(size=tau.shape)
    np.savetxt("log.csv", np.array([t, *q, *tau]).T, delimiter=",", header="t,q1,q2,tau1,tau2", comments="")
    found = run("--write-model", "new.urdf")
    written = Path("new.urdf").read_text()
    assert re.search("not determined by the motion, as in that file or near it: .*Fv1", written), found.output
    assert re.search("without a place in such a file: Ia2 = .*, Offset2 = ", written)
    assert chain_of(Path("new.urdf"), ()).joints[0].friction == chain.joints[0].friction


REFUSED = {
    "no source": (URDF, (), 'file="sub/arm.xml"', "file=None", "names no URDF or MJCF file to write again"),
    "moved": (URDF, (), "sub/arm.xml", "arm.xml", "arm.xml: cannot be read"),
    "changed": (URDF, (), "origin=.0.4, 0, 0.", "origin=(0.5, 0, 0)", "elbow has another place, axis, parent or inert"),
    "no inertias": (URDF, (), "inertial=.*", ")", "arm.xml is not written again: arm.py has no inertias, or"),
    "replica": (MJCF.replace("<frame ", '<replicate count="1"><frame ').replace("</frame>", "</frame></replicate>"),
                ("turn",), "", "", "has bodies that an include, attach or replicate makes"),
    "elsewhere": (MJCF.replace("<default>", '<include file="more.xml"/><default>'), (), "", "",
                  "new.xml: is not written: files that it names are sought beside it, and it: MuJoCo does not read it"),
    "scaled": (MJCF.replace('"radian"', '"radian" settotalmass="14"'), (), "", "",
               "new.xml: is not written: MuJoCo would not find these bodies in it"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_written_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text, joints, old, new, sentence = REFUSED[name]
    recorded(text, "arm.xml", joints, seconds=6.0)
    model, changed = re.subn(old, new, Path("arm.py").read_text())
    Path("arm.py").write_text(model)
    assert changed
    found = run("--write-model", "new.xml")
    assert sentence in str(found.exception), found.output
    assert not Path("new.xml").exists()
    if name == "moved":
        assert "of a robot its own file is written, arm.xml" in str(run("--write-model", "new.py").exception)
        assert "is not replaced: pvid did not write it" in str(run("--write-model", "sub/arm.xml").exception)
