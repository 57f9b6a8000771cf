"""A model file from a robot's URDF or MJCF file, which MuJoCo reads."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.packages import lacking
from pvid.base.wording import listed, printable, reason
from pvid.model.chain import POSE, POSE_AXES, SLIDING
from pvid.model.robot import MOST_JOINTS

Float = npt.NDArray[np.float64]
_ROUNDED = 10  # digits behind the point
_TWELFTHS = 1e-9  # of pi: an angle that is as close to a twelfth of a half turn is that
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_LEAST_SECOND, _ROUGH = 1e-12, 1e-6  # [kg*m^2]; of the largest second moment
_LOCKED = 1e-6  # cosine of the pitch below which roll and yaw turn about one axis
_LEAST_MASS = 1e-11  # [kg]
_SLIDES = 2  # mjJNT_SLIDE
_INERTIAL = "inertial"  # link and joint that are put before a free base of URDF


@dataclass(frozen=True)
class Placed:
    """A robot's file as MuJoCo has it, at the zero of all joints.

    Attributes
    ----------
    model, data : MuJoCo's
    speeds, notes : that URDF allows; what was changed
    bare : names of bodies whose inertia the file does not have
    joints, names : MuJoCo's numbers of those that move, and their names; the six of a free base first
    free : how many these six are: 6 or 0
    before : of each the place of the joint that carries it; -1: the base
    carrier : of each body the place of the joint that moves it; -1: it rests
    frames : of each joint's body its origin on the axis, and its rotation; the last is the base's
    """

    model: Any
    data: Any
    speeds: Mapping[str, float]
    notes: Sequence[str]
    bare: Collection[str]
    joints: Sequence[int]
    names: Sequence[str]
    free: int
    before: Sequence[int]
    carrier: Sequence[int]
    frames: Sequence[tuple[Float, Float]]

    def joint(self, place: int) -> tuple[Float, Float, Float]:
        """Axis of a joint, and origin and rotation of its body in the frame of the joint before."""
        (at, turned), (start, base) = self.frames[place], self.frames[self.before[place]]
        return turned.T @ self.data.xaxis[self.joints[place]], base.T @ (at - start), base.T @ turned

    def slides(self, place: int) -> bool:
        """Whether a joint is prismatic."""
        return bool(self.model.jnt_type[self.joints[place]] == _SLIDES)

    def into(self, place: int, body: int) -> Float:
        """From the frame of a joint's body to that of a body, of homogeneous points [4, 4]."""
        at, turned = self.frames[place]
        back = self.data.xmat[body].reshape(3, 3).T
        return np.block([[back @ turned, (back @ (at - self.data.xpos[body]))[:, np.newaxis]], [np.eye(4)[3:]]])

    def inertial(self, place: int, bodies: Sequence[int] | None = None) -> Float:
        """Mass, first moments and inertia of all that a joint moves, or of some bodies, in the joint's frame [10]."""
        own = self.bodies(place) if bodies is None else bodies
        return _inertial(self.model, self.data, own, *self.frames[place])

    def knows(self, place: int) -> bool:
        """Whether the file has the inertias of all that a joint moves."""
        own = [k for k in self.bodies(place) if self.model.body(k).name in self.bare]
        tied = place < self.free and all(self.model.body_mass[k] > 2 * _LEAST_MASS for k in own)
        return not own or tied  # the first link of a URDF has often none, and the body is a link that is fixed to it

    def bodies(self, place: int) -> list[int]:
        """MuJoCo's numbers of all that a joint moves, up to the next joint that does."""
        return [k for k, one in enumerate(self.carrier) if one == place]


def placed(path: Path, chosen: Sequence[str] = (), *, fused: bool = True, free_base: bool = False) -> Placed:
    """A robot's file. A free joint becomes six, in the order of pvid.model.chain.POSE.

    Raises PvidError where it cannot be read, or is no tree of joints of one axis.

    Parameters
    ----------
    path : URDF or MJCF
    chosen : names of the joints that move and are recorded, in the order of the columns; others are held at their zero;
        (): all
    fused : links of URDF that fixed joints tie are one body
    free_base : the first link of URDF is fixed to nothing, as it is where a joint says so
    """
    mujoco, model, base, speeds, notes, bare = _read(path, chosen, fused=fused, free_base=free_base)
    joints = [*base, *_chosen(mujoco, model, path, chosen, base)]
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr] = 0.0
    mujoco.mj_kinematics(model, data)
    carrier = _carriers(model, joints)
    _refuse_loops(mujoco, model, carrier, path)
    before = [
        max((k for k in range(place) if _is_under(model, joint, joints[k])), default=-1, key=lambda k: (
            int(model.jnt_bodyid[joints[k]]), joints[k]))
        for place, joint in enumerate(joints)
    ]  # fmt: skip
    frames = [(data.xanchor[k].copy(), data.xmat[int(model.jnt_bodyid[k])].reshape(3, 3)) for k in joints]
    names = [_names(model)[joint] for joint in joints]
    frames.append((np.zeros(3), np.eye(3)))
    return Placed(model, data, speeds, notes, bare, joints, names, len(base), before, carrier, frames)


def model_text(path: Path, chosen: Sequence[str] = (), folder: Path | None = None) -> str:
    """The text of a model file, as `text_of`. Raises PvidError, and has the parameters, as `placed`."""
    return text_of(placed(path, chosen), path, folder)


def text_of(robot: Placed, path: Path, folder: Path | None = None) -> str:
    """The text of a model file of a robot's file, which lies in a folder, that of the robot's file by default."""
    model, names = robot.model, robot.names
    source = os.path.relpath(path, folder or path.parent).replace(os.sep, "/")
    lines = [
        json.dumps(
            f"{printable(path.name)}: {len(names) - robot.free} joints, by `pvid model from`. Torques that are "
            "commanded and held, not measured, have hold='zoh'."
        ),
        "",
        "from pvid.model import Robot, pi",
        "",
        *(f"# {one}" for one in robot.notes),
        f"model = Robot({json.dumps(printable(path.stem))}, gravity={_numbers(model.opt.gravity)}, "
        f"file={json.dumps(source)})",
    ]
    if robot.free:
        last, name = robot.free - 1, names[robot.free - 1]
        inertial = f", inertial={_numbers(robot.inertial(last))}" if robot.knows(last) else ""
        wrench = ", wrench=True" if len(names) == robot.free else ""
        lines += ["# wrench=True: fx, fy, fz, mx, my, mz, which act on this body from outside, are recorded",
                  f"model.free_base({json.dumps(name)}{inertial}{wrench})"]  # fmt: skip
    for place, (joint, name) in enumerate(zip(robot.joints, names, strict=True)):
        if place < robot.free:
            continue
        axis, at, turned = robot.joint(place)
        given = {"axis": _numbers(axis)}
        given |= {"origin": origin} if (origin := _numbers(at)) != "(0, 0, 0)" else {}
        given |= {"rpy": rpy} if (rpy := _rpy(turned)) != "(0, 0, 0)" else {}
        if (before := robot.before[place]) != place - 1:
            given["parent"] = repr(names[before] if before >= 0 else "base")
        if robot.slides(place):
            given["prismatic"] = "True"
        dof = int(model.jnt_dofadr[joint])
        if model.dof_armature[dof] > 0:
            given["rotor"] = _number(float(model.dof_armature[dof]))
        if (rubbed := (model.dof_damping[dof], model.dof_frictionloss[dof])) != (0, 0):
            given["friction"] = _numbers(rubbed)
        if model.jnt_limited[joint]:
            given["limits"] = _numbers(model.jnt_range[joint])
        if robot.speeds.get(name, 0) > 0:
            given["speed"] = _number(robot.speeds[name])
        if model.jnt_actfrclimited[joint] and (most := min(abs(model.jnt_actfrcrange[joint]))) > 0:
            given["torque"] = _number(most)
        first = ", ".join([json.dumps(name), *(f"{key}={value}" for key, value in given.items())])
        known = robot.knows(place)
        lines += [f"model.joint({first}{',' if known else ')'}"]
        lines += [f"            inertial={_numbers(robot.inertial(place))})"] * known
    return "\n".join([*lines, ""])


def _read(
    path: Path, chosen: Sequence[str], *, fused: bool, free_base: bool
) -> tuple[Any, Any, list[int], dict[str, float], list[str], list[str]]:
    """MuJoCo, its model of a file, the joints of a free base, and what `prepared_urdf` returns of URDF; what is only
    drawn is not needed of URDF."""
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
    bare: list[str] = []
    if tree.tag == "robot":
        try:
            speeds, notes, bare = prepared_urdf(tree)
        except ValueError as error:
            raise PvidError(f"{path}: is no URDF file: {printable(reason(error))}") from None
        if free_base:
            _set_free(tree)
        if not fused:
            options = tree
            for name in ("mujoco", "compiler"):
                found = options.find(name)
                options = ElementTree.SubElement(options, name) if found is None else found
            options.set("fusestatic", "false")
    usual = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: notes.append(printable(text)))  # or it writes a file into this folder
    try:
        urdf = ElementTree.tostring(tree, encoding="unicode") if tree.tag == "robot" else None
        model = mujoco.MjModel.from_xml_string(urdf) if urdf else mujoco.MjModel.from_xml_path(str(path))
        base: list[int] = []
        if (joint := _free_joint(mujoco, model, path, chosen)) is not None:
            spec = mujoco.MjSpec.from_string(urdf) if urdf else mujoco.MjSpec.from_file(str(path))
            spec.compile()
            names = _split(mujoco, spec, joint)
            model = spec.compile()
            base = [int(model.joint(one).id) for one in names]
        elif free_base:
            raise PvidError(f"{path}: has no free joint, which MJCF has for a free base")
    except ValueError as error:
        raise PvidError(f"{path}: MuJoCo does not read it: {printable(reason(error))}") from None
    finally:
        mujoco.set_mju_user_warning(usual)
    return mujoco, model, base, speeds, notes, bare


def prepared_urdf(tree: ElementTree.Element) -> tuple[dict[str, float], list[str], list[str]]:
    """Makes of a URDF what MuJoCo reads: without what is only drawn, with masses and inertias that bodies can have.

    Raises ValueError where a number is none.

    Returns
    -------
    Speeds of joints that have a limit of it, what was changed, and names of moving links without an inertial.
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
    kinds = {"without an inertial": bare, "with an impossible inertia, the nearest is taken": changed}
    notes = [f"{what}: {', '.join(printable(one.get('name', '')) for one in some)}"
             for what, some in kinds.items() if some]  # fmt: skip
    limits = {one.get("name", ""): one.find("limit") for one in tree.findall("joint")}
    speeds = {name: float(one.get("velocity", 0)) for name, one in limits.items() if one is not None}
    speeds = {name: one for name, one in speeds.items() if math.isfinite(one)}
    return speeds, notes, [one.get("name", "") for one in bare]


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


def _names(model: Any) -> list[str]:
    """Of all joints."""
    return [printable(model.joint(one).name or f"joint{one + 1}") for one in range(model.njnt)]


def _set_free(tree: ElementTree.Element) -> None:
    """Ties the first link of a URDF to nothing, unless a joint does so."""
    if any(one.get("type") == "floating" for one in tree.findall("joint")):
        return
    moved = {child.get("link") for child in tree.iterfind("joint/child")}
    first = next((one.get("name", "") for one in tree.iter("link") if one.get("name") not in moved), "")
    ElementTree.SubElement(tree, "link", name=_INERTIAL)
    joint = ElementTree.SubElement(tree, "joint", name=_INERTIAL, type="floating")
    ElementTree.SubElement(joint, "parent", link=_INERTIAL)
    ElementTree.SubElement(joint, "child", link=first)


def _free_joint(mujoco: Any, model: Any, path: Path, chosen: Sequence[str]) -> int | None:
    """That of the free base: the only one that carries joints that move, or that there is; None: no base is free."""
    free = [k for k in range(model.njnt) if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_FREE]
    names = _names(model)
    others = [k for k in range(model.njnt) if k not in free and (not chosen or names[k] in chosen)]
    carrying = [k for k in free if any(_is_under(model, one, k) for one in others)]
    if len(carrying) > 1 or (not others and len(free) > 1):
        raise PvidError(
            f"{path}: {listed(names[k] for k in carrying or free)} are free: a robot has one free base; name the "
            "joints of one robot by --joints"
        )
    return carrying[0] if carrying else free[0] if free and not others else None


def _split(mujoco: Any, spec: Any, number: int) -> list[str]:
    """Makes six joints of a free joint, whose body's frame is the inertial one where they are 0; returns their
    names."""
    joint = next(one for one in spec.joints if one.id == number)
    body, base = joint.parent, printable(joint.parent.name) or "base"
    spec.delete(joint)
    base += "_body" if base in [one.name for one in spec.joints] else ""
    body.pos, body.quat = np.zeros(3), np.eye(4)[0]
    names = [*(f"{base}_{pose}" for pose in POSE[:-1]), base]
    for k, (name, axis) in enumerate(zip(names, POSE_AXES, strict=True)):
        kind = mujoco.mjtJoint.mjJNT_SLIDE if k < SLIDING else mujoco.mjtJoint.mjJNT_HINGE
        added = body.add_joint(name=name, type=kind, axis=axis)
        added.pos = np.zeros(3)  # a class of the file may have another
    return names


def _chosen(mujoco: Any, model: Any, path: Path, chosen: Sequence[str], base: Sequence[int]) -> list[int]:
    """Numbers of the joints without those of a free base, those of a body before those that it carries."""
    names = _names(model)
    for one in range(model.njnt):
        if model.jnt_type[one] == mujoco.mjtJoint.mjJNT_BALL:
            raise PvidError(f"{path}: {printable(names[one])} is a ball joint: only joints of one axis are identified")
    for name in chosen:
        if name not in names:
            raise PvidError(
                f"{path}: there is no joint {printable(name)}: it has {listed(map(printable, names or ['none']))}"
            )
    free = [k for k in range(model.njnt) if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_FREE]  # of other things
    joints = [names.index(one) for one in chosen] if chosen else [
        k for k in range(model.njnt) if k not in free and k not in base]  # fmt: skip
    if not joints and not base:
        raise PvidError(f"{path}: no joint moves; --free-base: its first link is fixed to nothing")
    for place, joint in enumerate(joints):
        if any(_is_under(model, one, joint) for one in joints[:place]):
            raise PvidError(f"{path}: {printable(names[joint])} carries a joint before it in the list: name it first")
    if len(joints) > MOST_JOINTS:
        raise PvidError(
            f"{path}: {len(joints)} joints are more than {MOST_JOINTS}: choose some of them with --joints: "
            f"{','.join(names)}"
        )
    loose = [names[k] for k in joints if base and not _is_under(model, k, base[-1])]
    if loose:
        raise PvidError(f"{path}: {listed(loose)} move on a fixed base, and another base is free: one robot at a time")
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
            names = _names(model)
            both = [names[at] for at in bodies if at >= 0]
            free = [name for name in names if name not in both]
            tied = f"; hold {listed(both)}" + (f": --joints {','.join(free)}" if free else "")
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
