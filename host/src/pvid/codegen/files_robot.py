"""The float32 files of a robot for pvid/robot.h: its columns, the tables of a rig, a target of CMake, the twin."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from pvid.base.errors import PvidError
from pvid.codegen.c_functions import float_function
from pvid.codegen.c_text import UNCONTRACTED, array, c_comment, for_cpp, guarded, initialised, number
from pvid.codegen.cmake import target
from pvid.codegen.describe import table
from pvid.codegen.functions import identifiers
from pvid.core.sources import PUBLIC_FOLDERS, SRC, source
from pvid.model.chain import Chain
from pvid.model.compiled import CompiledModel
from pvid.model.operations import Argument, Literal, Program
from pvid.settings.robot_core import RobotCoreDesign
from pvid.twin.printer.program import text_of

MOST_P = 64  # PVID_ROBOT_P
_LONGEST = 61  # taps of a design at most
_WIDTH = 8  # numbers a line
CORE = ("elementary_f32", "finite_f32", "fnv", "publication", "robot_f32")
_VERBS = ("init", "step", "gap", "read", "covariance", "hash")


def refuse_in_c(model: CompiledModel) -> None:
    """PvidError for a robot on a free base, or with more base parameters than the C core takes."""
    if model.chain is not None and model.chain.free:
        raise PvidError(f"{model.name} has a free base: the C core takes robots on a fixed one; `pvid identify` both")
    if len(model.unknowns) > MOST_P:
        raise PvidError(
            f"{model.name} has {len(model.unknowns)} base parameters and the C core takes at most {MOST_P}: hold "
            "joints by `pvid model from --joints`; `pvid identify` in float64 takes all"
        )


def board_report(model: CompiledModel) -> str:
    """What it costs on a board, for `pvid model check`."""
    assert model.chain is not None
    if model.chain.free:
        return "On a board: not in C, which has robots on a fixed base."
    if len(model.unknowns) > MOST_P:
        return f"On a board: not in C, which takes at most {MOST_P} base parameters."
    files = RobotFiles(model, "")
    rows = sum(len(one) * (len(one) + 1) // 2 for one in files.columns)
    return (
        f"On a board: {files.memory(_LONGEST) * 4 / 1000:.3g} kB of memory at most; a step, one of several samples, is "
        f"twice {files.program.cost} and {8 * len(files.slots)} multiplications; a row of all joints {rows}. `pvid "
        "model build --run` writes the C for pvid/robot.h."
    )


@dataclass(frozen=True, eq=False)
class RobotFiles:
    """A robot's columns by joints, as C has them.

    Attributes
    ----------
    compiled : the robot
    command : that generates, for the banners
    design : for a rig; None: no NAME_design_f32.h
    """

    compiled: CompiledModel
    command: str
    design: RobotCoreDesign | None = None

    @cached_property
    def name(self) -> str:
        """Prefix of all names in C."""
        return identifiers([self.compiled.name])[0]

    @property
    def chain(self) -> Chain:
        """Of the robot."""
        assert self.compiled.chain is not None
        return self.compiled.chain

    @cached_property
    def _entries(self) -> tuple[Program, list[tuple[int, int, int]]]:
        """The program with friction, forces first, and (order, joint, parameter) of each result.

        Arguments are q, v, and the mean signs of v over a step.
        """
        n, columns = len(self.chain.joints), [one.standard for one in self.chain.base]
        program, entries = self.chain.program(columns)
        values, entries, results = list(program.values), list(entries), list(program.results)
        first = {"Fv": n, "Fc": 2 * n}
        for place, column in enumerate(columns):
            one = self.chain.standard[column]
            if one.kind in first or one.kind == "Offset":
                value = Argument(first[one.kind] + one.joint) if one.kind in first else Literal(Fraction(1))
                if value not in values:
                    values.append(value)
                results.append(values.index(value))
                entries.append((0, one.joint, place))
        order = sorted(range(len(entries)), key=lambda k: entries[k][0])
        names = (*program.arguments, *(f"sign{k + 1}" for k in range(n)))
        made = Program(names, tuple(values), tuple(results[k] for k in order))
        return made, [entries[k] for k in order]

    @property
    def program(self) -> Program:
        """Of the values of a step."""
        return self._entries[0]

    @cached_property
    def columns(self) -> list[list[int]]:
        """Parameters of each joint, ascending."""
        found: list[set[int]] = [set() for _ in self.chain.joints]
        for _, joint, place in self._entries[1]:
            found[joint].add(place)
        return [sorted(one) for one in found]

    @cached_property
    def slots(self) -> list[int]:
        """Of each result."""
        places = [(joint, one) for joint, own in enumerate(self.columns) for one in own]
        where = {one: k for k, one in enumerate(places)}
        return [where[joint, place] for _, joint, place in self._entries[1]]

    @property
    def forces(self) -> int:
        """Results that are no momenta."""
        return sum(order == 0 for order, _, _ in self._entries[1])

    def memory(self, taps: int) -> int:
        """Floats, as pvid_robot_memory_f32."""
        n, p, slots = len(self.chain.joints), len(self.compiled.unknowns), sum(map(len, self.columns))
        triangles = sum(len(one) * (len(one) + 1) // 2 for one in self.columns)
        fixed = 4 * n * taps + 2 * len(self.slots) + 6 * n + 7 * (2 * slots + n)
        return fixed + 2 * triangles + slots + p * (p + 1) + 10 * p

    def banner(self) -> list[str]:
        """Two lines for the head of a file."""
        made_from = repr(
            (self.compiled.name, self.compiled.title, self.compiled.signals, self.compiled.unknowns, self._entries)
        )
        return [
            f"Generated by `{self.command}`: do not edit.",
            f"Input {hashlib.sha256(made_from.encode()).hexdigest()[:8]}.",
        ]

    def files(self) -> dict[str, str]:
        """Name -> text of each."""
        texts = {f"{self.name}_robot.h": self._header(), f"{self.name}_robot_f32.c": self._source()}
        cmake = target(self.name, self.banner(), [f"{self.name}_robot_f32.c"])
        texts |= {"CMakeLists.txt": cmake, f"{self.name}_twin.py": self._twin(texts)}
        return texts if self.design is None else texts | {f"{self.name}_design_f32.h": self._design_header()}

    def _header(self) -> str:
        n, upper = len(self.chain.joints), self.name.upper()
        signals = {one.name: one for one in self.compiled.signals}
        held = {"zoh": 'hold="zoh": from this sample to the next'}
        rows = [(f"sample[{k}]", one, f"[{signals[one].unit}]", held.get(signals[one].hold, ""))
                for k, one in enumerate(self.samples)]  # fmt: skip
        parameters = [
            (f"p[{k}]", self.chain.name_of(one), f"[{unknown.unit}]", self.chain.closed_form(one))
            for k, (one, unknown) in enumerate(zip(self.chain.base, self.compiled.unknowns, strict=True))
        ]
        about = [
            f"{self.name}_robot.h - {self.compiled.title}: a robot of {n} joints for pvid/robot.h, float32.",
            "", *self.banner(), "",
            f'  #include "{self.name}_design_f32.h"',
            f"  static pvid_robot_f32 identifier; static float memory[{upper}_MEMORY];",
            f"  if (pvid_robot_init_f32(&identifier, &{self.name}_config_f32, memory, {upper}_MEMORY) != PVID_OK) ...",
            "  each tick: reason = pvid_robot_step_f32(&identifier, sample);",
            "", "Samples of a tick:", *table(rows), "", "Base parameters:", *table(parameters),
        ]  # fmt: skip
        body = [
            '#include "pvid/robot.h"', "",
            f"#define {upper}_JOINTS {n}", f"#define {upper}_P {len(self.compiled.unknowns)}", "",
            *for_cpp([
                f"/* Columns of the torques: {self.program.cost} a step. */",
                f"extern const pvid_robot_model_f32 {self.name}_robot_f32;", "",
            ]),
        ]  # fmt: skip
        return guarded(f"{self.name}_robot", about, body)

    @cached_property
    def samples(self) -> list[str]:
        """Names of the signals of a tick."""
        n, names = len(self.chain.joints), {one.name for one in self.compiled.signals}
        torques = [f"tau{k}" if f"tau{k}" in names else f"i{k}" for k in range(1, n + 1)]
        return [*(f"q{k}" for k in range(1, n + 1)), *torques]

    def _source(self) -> str:
        n = len(self.chain.joints)
        constants = {one.name: one.value for one in self.compiled.knowns}
        ends = np.cumsum([len(one) for one in self.columns]).tolist()
        held = ["true" if self.compiled.signal(one).hold == "zoh" else "false" for one in self.samples[n:]]
        gains = [number(constants.get(f"kt{k}", 1.0)) for k in range(1, n + 1)]
        fields: dict[str, object] = {
            "joints": n,
            "p": len(self.compiled.unknowns),
            "forces": self.forces,
            "entries": len(self.slots),
        }
        fields |= {one: one for one in ("end", "column", "slot", "gain", "share", "held", "values")}
        shares = [number(0.5 if self.chain.standard[one.standard].kind == "Fc" else 1.0) for one in self.chain.base]
        parts = [
            c_comment(self.banner()),
            UNCONTRACTED,
            f'#include "{self.name}_robot.h"\n\n#include "pvid/elementary.h"',
            float_function("static void values(const float in[], float out[])", self.program),
            array("uint16_t", "end", ends, _WIDTH),
            array("uint8_t", "column", [one for own in self.columns for one in own], _WIDTH),
            array("uint16_t", "slot", self.slots, _WIDTH),
            array("float", "gain", gains, _WIDTH),
            array("float", "share", shares, _WIDTH),
            array("bool", "held", held, _WIDTH),
            initialised(f"const pvid_robot_model_f32 {self.name}_robot_f32", fields),
        ]
        return "\n\n".join(parts) + "\n"

    def _design_header(self) -> str:
        d, upper, name = self.design, self.name.upper(), self.name
        assert d is not None
        about = [
            f"{name}_design_f32.h - {self.compiled.title}: pvid/robot.h at {d.sample_rate:g} samples a second.",
            "", *self.banner(), "",
            f"A step of {d.decimation} samples, a row of each joint every {1e3 * d.knots_s:.3g} ms, an estimate every "
            f"{d.group * d.knots_s:.3g} s.",
        ]  # fmt: skip
        tables = ("position", "rate", "spline", "slope", "torque", "noise", "noise_sd")
        white = ", ".join(map(number, d.white))
        body = [
            f'#include "{name}_robot.h"', "",
            f"#define {upper}_MEMORY {self.memory(d.taps)}u /* floats */", "",
            *(array("float", f"{name}_{one}", map(number, getattr(d, one)), _WIDTH)
              for one in (*tables, "start", "start_sd")), "",
            initialised(f"static const pvid_robot_design_f32 {name}_design_f32", {
                "taps": d.taps, "decimation": d.decimation, "interval": d.interval,
                **{one: f"{name}_{one}" for one in tables}, "white": f"{{{white}}}",
            }), "",
            initialised(f"static const pvid_robot_config_f32 {name}_config_f32", {
                "model": f"&{name}_robot_f32", "design": f"&{name}_design_f32",
                "start": f"{name}_start", "start_sd": f"{name}_start_sd",
                "group": d.group, "memory": f"{d.memory}u",
            }),
        ]  # fmt: skip
        return guarded(f"{name}_design_f32", about, body)

    def _twin(self, texts: dict[str, str]) -> str:
        about = [f"{self.compiled.title}: its identifier in numpy, printed from its C.", "", *self.banner(), ""]
        sources = [source(f"{one}.c") for one in CORE]
        return text_of(sources, [*PUBLIC_FOLDERS, SRC], {}, self.roots, texts, about="\n".join(about))

    @property
    def roots(self) -> list[str]:
        """What the twin has: the functions of pvid/robot.h and the robot."""
        return [*(f"pvid_robot_{verb}_f32" for verb in _VERBS), f"{self.name}_robot_f32"]
