"""The values of a robot's run in its own URDF or MJCF file.

The mass of each body is moved by one affine map that gives it the identified pseudo-inertia: J becomes T J T^T in every
link of the body, those behind fixed and held joints included, with T = U1 U0^-1 of the body's J0 = U0 U0^T before and
J1 = U1 U1^T after (U upper triangular). All links thus stay possible.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from pvid.base.atomic_write import appearing
from pvid.base.errors import PvidError
from pvid.base.wording import printable, with_unit
from pvid.identification.answer import Float
from pvid.identification.bodies import about_centre, pseudo_inertias
from pvid.identification.robot import RobotAnswer
from pvid.model.chain import INERTIAL
from pvid.model.robot import Robot
from pvid.models.mechanisms import described, path_of
from pvid.models.registry import Mechanism
from pvid.models.robot_file import Placed, placed

_PLACE, _MOMENT = 1e-5, 1e-9  # that a model file with ten digits is off by at most [m, 1], [kg, kg*m, kg*m^2]
_READ = 4e-6  # relative, of what is read again: thin links of URDF become a little thicker (robot_file)
_URDF = {"Fv": "damping", "Fc": "friction"}
_MJCF = {"Fv": "damping", "Fc": "frictionloss", "Ia": "armature"}
_PRODUCTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class Source:
    """A robot's file to write again: the name of its model file, its path, what it has, the text before its root, the
    root, and the elements of each of MuJoCo's bodies and of each joint that moves; None: of the six of a free base."""

    model: str
    path: Path
    robot: Placed
    head: str
    root: ElementTree.Element
    bodies: Sequence[ElementTree.Element | None]
    joints: Sequence[ElementTree.Element | None]


def source_of(mechanism: Mechanism, out: Path) -> Source:
    """The file that a robot's model file was made of.

    Raises PvidError where the model file names none, `out` has another ending, it cannot be read, its bodies are not in
    one file, or its joints or inertias are no longer those of the model file.
    """
    model, place = described(mechanism), path_of(mechanism)[1]
    assert isinstance(model, Robot)
    if model.file is None:
        raise PvidError(
            f"{place}: names no URDF or MJCF file to write again: make it by `pvid model from`, or add file= to Robot()"
        )
    path = place.parent / model.file
    if out.suffix != path.suffix:
        raise PvidError(f"{out}: of a robot its own file is written, {path.name}: the name ends with {path.suffix}")
    free = sum(one.free for one in model.joints)
    robot = placed(path, [one.name for one in model.joints[free:]], fused=False, free_base=free > 0)
    if len(robot.joints) != len(model.joints):
        raise PvidError(f"{path}: its base is free, and that of {place.name} is not; repeat `pvid model from`")
    for k, joint in enumerate(model.joints):
        read = zip((joint.axis, joint.origin, joint.turned), robot.joint(k), strict=True)
        same = all(np.abs(np.array(one) - other).max() < _PLACE for one, other in read)
        if joint.inertial is not None:
            same &= np.allclose(joint.inertial, robot.inertial(k), rtol=0, atol=_MOMENT)
        if not same or (joint.parent, joint.prismatic) != (robot.before[k], robot.slides(k)):
            raise PvidError(
                f"{path}: is not the file that {place.name} was made of: {printable(joint.name)} has another place, "
                "axis, parent or inertia; repeat `pvid model from`"
            )
    data, starts = path.read_text(encoding="utf-8-sig").encode(), list[int]()
    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler = lambda *_: starts.append(parser.CurrentByteIndex)
    parser.Parse(data, True)
    builder = ElementTree.TreeBuilder(insert_comments=True, insert_pis=True)
    root = ElementTree.fromstring(data.decode(), ElementTree.XMLParser(target=builder, encoding="utf-8"))
    of_body: list[ElementTree.Element | None] = [None]
    if root.tag == "robot":
        links, tied = ({one.get("name"): one for one in root.findall(tag)} for tag in ("link", "joint"))
        of_body += [links[robot.model.body(k).name] for k in range(1, robot.model.nbody)]
        joints = [tied[robot.model.joint(k).name] for k in robot.joints[robot.free :]]
    else:
        for world in root.findall("worldbody"):
            of_body += _within(world, "body", deep=True)
        if len(of_body) != robot.model.nbody:
            raise PvidError(
                f"{path}: has bodies that an include, attach or replicate makes: write it as one MJCF first"
            )
        moving = robot.joints[robot.free :]
        bodies = [int(robot.model.jnt_bodyid[k]) for k in moving]
        joints = [
            list(_within(of_body[body], "joint"))[k - int(robot.model.body_jntadr[body])]  # type: ignore[arg-type]
            for k, body in zip(moving, bodies, strict=True)
        ]
    return Source(place.name, path, robot, data[: starts[0]].decode(), root, of_body, [*([None] * robot.free), *joints])


def write_robot(answer: RobotAnswer, source: Source, out: Path, made: str) -> list[str]:
    """Writes a robot's file with the values of an answer, whole or not at all; returns what it lacks, in sentences.

    Inertias, damping and friction of joints are replaced, in MJCF armatures as well. Anything else stays, and so does
    what the motion does not determine: combinations of inertias stay near those of the file.

    Raises PvidError where the model file has no possible bodies, the motion determines nothing of them, or MuJoCo finds
    other ones in the written file, and as pvid.base.atomic_write.appearing.

    Parameters
    ----------
    made : what it is made from
    """
    chain, robot = answer.model.chain, source.robot
    p, _, bodies = answer.possible
    assert chain is not None
    if bodies is None:
        raise PvidError(
            f"{source.path.name} is not written again: {source.model} has no inertias, or impossible ones, or the "
            "motion determines none"
        )
    for k, after in enumerate(pseudo_inertias(bodies.inertial)):
        own = [one for one in robot.bodies(k) if robot.model.body_mass[one] > 0]
        if not own:
            continue
        before = pseudo_inertias(np.array([robot.inertial(k, [one]) for one in own]))
        moved = _upper(after) @ np.linalg.inv(_upper(before.sum(axis=0)))
        for one, j in zip(own, before, strict=True):
            frame = robot.into(k, one) @ moved
            _put(source.bodies[one], frame @ j @ frame.T)
    values = {("Ia", k): joint.rotor for k, joint in enumerate(chain.joints) if joint.rotor is not None}
    for value, hidden, base in zip(p, answer.fit.undetermined, chain.base, strict=True):
        head = chain.standard[base.standard]
        if head.kind not in INERTIAL and not hidden:
            values[head.kind, head.joint] = float(value)
    attributes = _URDF if source.root.tag == "robot" else _MJCF
    units, lacking = {(one.kind, one.joint): one.unit for one in chain.standard}, []
    for (kind, k), value in values.items():
        joint = source.joints[k]
        if kind in attributes and joint is not None:
            element = _child(joint, "dynamics") if attributes is _URDF else joint
            element.set(attributes[kind], repr(value))
        elif value:
            lacking.append(f"{kind}{chain.number(k)} = {with_unit(value, units[kind, k], 4)}")
    lost = [name for name, one in zip(answer.model.p_names, answer.fit.undetermined, strict=True) if one]
    told = {"not determined by the motion, as in that file or near it": lost}
    told |= {"without a place in such a file": lacking}
    notes = [f"{what}: {', '.join(some)}" for what, some in told.items() if some]
    notes += answer.impossible
    lines = [f"Made by `pvid identify` from {made}", *(f"     {one}" for one in notes)]
    comment = re.sub("-(?=-|$)", "- ", "\n".join(map(printable, lines)))  # no comment of XML has two of them
    text = f"{source.head}<!-- {comment} -->\n{ElementTree.tostring(source.root, encoding='unicode')}\n"
    with appearing(out) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="")
        try:
            again = placed(temporary, robot.names[robot.free :], free_base=robot.free > 0)
        except PvidError as error:
            why = str(error).replace(str(temporary), "it")
            raise PvidError(f"{out}: is not written: files that it names are sought beside it, and {why}") from None
        found = np.array([again.inertial(k) for k in range(len(chain.joints))])
        wanted = np.abs(bodies.inertial)
        off = _MOMENT + _READ * (wanted + wanted[:, 4:].max(axis=1, keepdims=True))
        if np.any(np.abs(found - bodies.inertial) > off):
            raise PvidError(
                f"{out}: is not written: MuJoCo would not find these bodies in it: an option of the file's compiler "
                "replaces inertias (inertiafromgeom, settotalmass, balanceinertia)"
            )
    return notes


def _upper(j: Float) -> Float:
    """U of J = U U^T."""
    return np.asarray(np.linalg.cholesky(j[::-1, ::-1])[::-1, ::-1])


def _within(parent: ElementTree.Element, tag: str, *, deep: bool = False) -> Iterator[ElementTree.Element]:
    """Elements of MJCF in the order of MuJoCo's numbers; a frame is none of its bodies."""
    for one in parent:
        if one.tag == tag:
            yield one
        if one.tag == "frame" or (deep and one.tag == "body"):
            yield from _within(one, tag, deep=deep)


def _child(parent: ElementTree.Element, tag: str) -> ElementTree.Element:
    """The one that is there, or a new one in front."""
    found = parent.find(tag)
    if found is None:
        found = ElementTree.Element(tag)
        found.tail = parent.text
        parent.insert(0, found)
    return found


def _put(body: ElementTree.Element | None, j: Float) -> None:
    """Gives a link of URDF or a body of MJCF a pseudo-inertia."""
    assert body is not None
    mass, centre, about = about_centre(j)
    at, moments = " ".join(repr(float(one)) for one in centre), [repr(float(about[one])) for one in _PRODUCTS]
    inertial = _child(body, "inertial")
    if body.tag == "body":
        inertial.attrib = {"pos": at, "mass": repr(mass), "fullinertia": " ".join(moments)}
        return
    _child(inertial, "inertia").attrib = {
        f"i{'xyz'[row]}{'xyz'[column]}": one for (row, column), one in zip(_PRODUCTS, moments, strict=True)
    }
    _child(inertial, "mass").attrib = {"value": repr(mass)}
    _child(inertial, "origin").attrib = {"xyz": at, "rpy": "0 0 0"}
