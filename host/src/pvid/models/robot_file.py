"""A model file from a robot's URDF or MJCF file, which MuJoCo reads."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.packages import lacking
from pvid.base.wording import listed, printable, reason
from pvid.model.robot import MOST_JOINTS

Float = npt.NDArray[np.float64]
_ROUNDED = 10  # digits behind the point
_TWELFTHS = 1e-9  # of pi: an angle that is as close to a twelfth of a half turn is that
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_LEAST_SECOND, _ROUGH = 1e-12, 1e-6  # [kg*m^2]; of the largest second moment
_LOCKED = 1e-6  # cosine of the pitch below which roll and yaw turn about one axis
_LEAST_MASS = 1e-11  # [kg]


def model_text(path: Path, chosen: Sequence[str] = ()) -> str:
    """The text of a model file.

    Raises PvidError where the file cannot be read, or is no robot on a fixed base with known inertias.

    Parameters
    ----------
    path : URDF or MJCF
    chosen : names of the joints that move and are recorded, in the order of the columns; others are held at their zero;
        (): all
    """
    mujoco, model, speeds, notes = _read(path)
    joints = _chosen(mujoco, model, path, chosen)
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr] = 0.0
    mujoco.mj_kinematics(model, data)
    carrier = _carriers(model, joints)
    _refuse_loops(mujoco, model, carrier, path)
    lines = [
        json.dumps(f"{printable(path.name)}: {len(joints)} joints, by `pvid model from`."),
        "",
        "from pvid.model import Robot, pi",
        "",
        *(f"# {one}" for one in notes),
        f"model = Robot({json.dumps(printable(path.stem))}, gravity={_numbers(model.opt.gravity)})",
    ]
    frames: dict[int, tuple[Float, Float]] = {-1: (np.zeros(3), np.eye(3))}
    names: list[str] = []
    for place, joint in enumerate(joints):
        body = int(model.jnt_bodyid[joint])
        turned = data.xmat[body].reshape(3, 3)
        frames[place] = data.xanchor[joint].copy(), turned
        before = max((k for k in range(place) if _is_under(model, joint, joints[k])), default=-1, key=lambda k: (
            int(model.jnt_bodyid[joints[k]]), joints[k]))  # fmt: skip
        at, base = frames[before]
        name = printable(model.joint(joint).name or f"joint{place + 1}")
        given = {"axis": _numbers(turned.T @ data.xaxis[joint])}
        origin = _numbers(base.T @ (frames[place][0] - at))
        given |= {"origin": origin} if origin != "(0, 0, 0)" else {}
        rpy = _rpy(base.T @ turned)
        given |= {"rpy": rpy} if rpy != "(0, 0, 0)" else {}
        if before != place - 1:
            given["parent"] = repr(names[before] if before >= 0 else "base")
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
            given["prismatic"] = "True"
        if model.dof_armature[model.jnt_dofadr[joint]] > 0:
            given["rotor"] = _number(float(model.dof_armature[model.jnt_dofadr[joint]]))
        dof = int(model.jnt_dofadr[joint])
        if (rubbed := (model.dof_damping[dof], model.dof_frictionloss[dof])) != (0, 0):
            given["friction"] = _numbers(rubbed)
        if model.jnt_limited[joint]:
            given["limits"] = _numbers(model.jnt_range[joint])
        if speeds.get(name, 0) > 0:
            given["speed"] = _number(speeds[name])
        if model.jnt_actfrclimited[joint] and (most := min(abs(model.jnt_actfrcrange[joint]))) > 0:
            given["torque"] = _number(most)
        own = [k for k in range(1, model.nbody) if carrier[k] == place]
        given["inertial"] = _numbers(_inertial(model, data, own, *frames[place]))
        names.append(name)
        last = given.pop("inertial")
        first = ", ".join([json.dumps(name), *(f"{key}={value}" for key, value in given.items())])
        lines += [f"model.joint({first},", f"            inertial={last})"]
    return "\n".join([*lines, ""])


def _read(path: Path) -> tuple[Any, Any, dict[str, float], list[str]]:
    """MuJoCo, its model of a file, the speeds that URDF allows, and what was changed; what is only drawn is not needed
    of URDF."""
    try:
        import mujoco
    except ImportError:
        raise lacking(f"{path}: reading URDF and MJCF", "mujoco") from None
    try:
        tree = ElementTree.fromstring(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise PvidError(f"{path}: cannot be read: {error.strerror}") from None
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise PvidError(f"{path}: is no URDF or MJCF file: {reason(error)}") from None
    speeds: dict[str, float] = {}
    notes: list[str] = []
    if tree.tag == "robot":
        try:
            speeds, notes = prepared_urdf(tree)
        except ValueError as error:
            raise PvidError(f"{path}: is no URDF file: {printable(reason(error))}") from None
    usual = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: notes.append(printable(text)))  # or it writes a file into this folder
    try:
        if tree.tag == "robot":
            model = mujoco.MjModel.from_xml_string(ElementTree.tostring(tree, encoding="unicode"))
        else:
            model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise PvidError(f"{path}: MuJoCo does not read it: {printable(reason(error))}") from None
    finally:
        mujoco.set_mju_user_warning(usual)
    return mujoco, model, speeds, notes


def prepared_urdf(tree: ElementTree.Element) -> tuple[dict[str, float], list[str]]:
    """Makes of a URDF what MuJoCo reads: without what is only drawn, with masses and inertias that bodies can have.

    Raises ValueError where a number is none.

    Returns
    -------
    Speeds of joints that have a limit of it, and what was changed.
    """
    for link in tree.iter("link"):
        for one in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(one)
    moved = {one.find("child").get("link", "") for one in tree.findall("joint")  # type: ignore[union-attr]
             if one.get("type") != "fixed" and one.find("child") is not None}  # fmt: skip
    bare = [one for one in tree.iter("link") if one.find("inertial") is None and one.get("name") in moved]
    changed = [one for one in tree.iter("link") if one.find("inertial") is not None and _made_possible(one)]
    for one in bare:
        ElementTree.SubElement(one, "inertial")
        _made_possible(one)
    kinds = {"without an inertial, taken as 0": bare, "with an impossible inertia, the nearest is taken": changed}
    notes = [f"{what}: {', '.join(printable(one.get('name', '')) for one in some)}"
             for what, some in kinds.items() if some]  # fmt: skip
    limits = {one.get("name", ""): one.find("limit") for one in tree.findall("joint")}
    speeds = {name: float(one.get("velocity", 0)) for name, one in limits.items() if one is not None}
    return {name: one for name, one in speeds.items() if math.isfinite(one)}, notes


def _made_possible(link: ElementTree.Element) -> bool:
    """Whether no body has the mass and the inertia of a link: the nearest that one has are taken.

    MuJoCo's bodies have no 0 in them: a point, a rod and a massless link become a little larger.
    """
    inertial = link.find("inertial")
    assert inertial is not None
    mass, about = (ElementTree.SubElement(inertial, name) if (found := inertial.find(name)) is None else found
                   for name in ("mass", "inertia"))  # fmt: skip
    i = np.zeros((3, 3))
    i[np.triu_indices(3)] = [float(about.get(name, 0)) for name in _MOMENTS]
    i += np.triu(i, 1).T
    # Second moments about the centre, which no body has below 0.
    sizes, axes = np.linalg.eigh(np.trace(i) / 2 * np.eye(3) - i)
    least = max(_LEAST_SECOND, _ROUGH * float(sizes[-1]))
    heavy = float(mass.get("value", 0))
    impossible = heavy < 0 or sizes[0] < -_ROUGH * np.abs(sizes).max()
    if heavy > _LEAST_MASS and sizes[0] >= least:
        return False
    second = (axes * np.maximum(sizes, least)) @ axes.T
    i = np.trace(second) * np.eye(3) - second
    mass.set("value", repr(max(heavy, _LEAST_MASS)))
    for name, one in zip(_MOMENTS, i[np.triu_indices(3)], strict=True):
        about.set(name, repr(float(one)))
    return bool(impossible)


def _chosen(mujoco: Any, model: Any, path: Path, chosen: Sequence[str]) -> list[int]:
    """Numbers of the joints, those of a body before those that it carries."""
    names = [model.joint(one).name for one in range(model.njnt)]
    for one in range(model.njnt):
        if model.jnt_type[one] == mujoco.mjtJoint.mjJNT_FREE:
            raise PvidError(f"{path}: its base floats (a free joint): only robots on a fixed base are identified")
        if model.jnt_type[one] == mujoco.mjtJoint.mjJNT_BALL:
            raise PvidError(f"{path}: {printable(names[one])} is a ball joint: only joints of one axis are identified")
    for name in chosen:
        if name not in names:
            raise PvidError(
                f"{path}: there is no joint {printable(name)}: it has {listed(map(printable, names or ['none']))}"
            )
    joints = [names.index(one) for one in chosen] if chosen else list(range(model.njnt))
    if not joints:
        raise PvidError(f"{path}: no joint moves")
    for place, joint in enumerate(joints):
        if any(_is_under(model, one, joint) for one in joints[:place]):
            raise PvidError(f"{path}: {printable(names[joint])} carries a joint before it in the list: name it first")
    if len(joints) > MOST_JOINTS:
        raise PvidError(
            f"{path}: {len(joints)} joints are more than {MOST_JOINTS}: choose some of them with --joints: "
            f"{','.join(map(printable, names))}"
        )
    for one in joints:
        if model.jnt_stiffness[one] > 0:
            raise PvidError(
                f"{path}: {printable(names[one])} has a spring (stiffness), which no base parameter describes"
            )
    return joints


def _is_under(model: Any, joint: int, other: int) -> bool:
    """Whether a joint is carried by another one."""
    body, above = int(model.jnt_bodyid[joint]), int(model.jnt_bodyid[other])
    if body == above:
        return joint > other
    while body > 0:
        body = int(model.body_parentid[body])
        if body == above:
            return True
    return False


def _carriers(model: Any, joints: Sequence[int]) -> list[int]:
    """Of each body the place of the joint that moves it; -1: it rests."""
    out = [-1] * model.nbody
    for body in range(1, model.nbody):
        own = [place for place, joint in enumerate(joints) if model.jnt_bodyid[joint] == body]
        out[body] = max(own, key=lambda place: joints[place]) if own else out[int(model.body_parentid[body])]
    return out


def _refuse_loops(mujoco: Any, model: Any, carrier: Sequence[int], path: Path) -> None:
    kinds = mujoco.mjtEq
    for k in range(model.neq):
        kind, one, other = model.eq_type[k], int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        bodies, tied = [one, other], ""
        if kind == kinds.mjEQ_JOINT:
            both = [model.joint(at).name for at in bodies if at >= 0]
            free = [name for name in map(lambda at: model.joint(at).name, range(model.njnt)) if name not in both]
            tied = f"; hold {listed(map(printable, both))}: --joints {','.join(map(printable, free))}"
            bodies = [int(model.jnt_bodyid[at]) for at in bodies if at >= 0]
        elif kind not in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD) or model.eq_objtype[k] != mujoco.mjtObj.mjOBJ_BODY:
            bodies = [0, model.nbody - 1]
        if len({carrier[at] for at in bodies} | ({-2} if len(bodies) < 2 else set())) > 1:
            raise PvidError(
                f"{path}: an equality ties its bodies (a closed loop, or coupled joints): only trees of free joints "
                f"are identified{tied}"
            )


def _inertial(model: Any, data: Any, bodies: Sequence[int], at: Float, turned: Float) -> Float:
    """Mass, first moments and inertia of bodies about a frame [10]."""
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for body in bodies:
        m = float(model.body_mass[body])
        centre = turned.T @ (data.xipos[body] - at)
        axes = turned.T @ data.ximat[body].reshape(3, 3)
        mass, first = mass + m, first + m * centre
        spread = centre @ centre * np.eye(3) - np.outer(centre, centre)
        second += axes @ np.diag(model.body_inertia[body]) @ axes.T + m * spread
    return np.array([mass, *first, *second[np.triu_indices(3)]])


def _rpy(turned: Float) -> str:
    """Roll, pitch and yaw."""
    level = math.hypot(turned[0, 0], turned[1, 0])
    pitch = math.atan2(-turned[2, 0], level)
    if level > _LOCKED:
        roll, yaw = math.atan2(turned[2, 1], turned[2, 2]), math.atan2(turned[1, 0], turned[0, 0])
    else:
        roll, yaw = 0.0, math.atan2(-turned[0, 1], turned[1, 1])
    return f"({', '.join(_angle(one) for one in (roll, pitch, yaw))})"


def _angle(value: float) -> str:
    """In parts of pi where it is a twelfth."""
    part = round(12 * value / math.pi)
    if abs(12 * value / math.pi - part) > _TWELFTHS or part == 0:
        return _number(value)
    shared = math.gcd(part, 12)
    above, below = part // shared, 12 // shared
    return (
        f"{'-' if above < 0 else ''}{'' if abs(above) == 1 else f'{abs(above)}*'}pi{'' if below == 1 else f'/{below}'}"
    )


def _number(value: float) -> str:
    rounded = round(float(value), _ROUNDED)
    return repr(int(rounded)) if rounded == int(rounded) else repr(rounded)


def _numbers(values: Sequence[float] | Float) -> str:
    return f"({', '.join(map(_number, values))})"
