"""The table of `bench peers`: recordings of every mechanism, each tool on them in a process of its environment.

The tools of others are installed into build/peers, an environment of their own, in the versions that their files name;
one that cannot be had, or has no answer in time, has a row with the reason.
"""

from __future__ import annotations

import ast
import inspect
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from bench.case import Advance, Report, chosen, columns
from bench.peers.arm import Arm, write_arm
from bench.peers.rigs import CLEAN, LACKING, OFF, RIGS, Rig
from pvid.core.sources import ROOT

HEADER = columns(
    "mechanism | recording | tool | answered | median % | median %, start 50 % off | worst % | median s.e. | worst s.e."
    " | in 2 s.e. % | warned | CPU s a run | statements"
)
TOOLS = {
    "pvid_itself": "pvid",
    "pvid_refined": "pvid --refine",
    "scipy_simulation": "SciPy, simulation",
    "casadi_shooting": "CasADi, multiple shooting",
    "textbook": "textbook, derivatives",
    "sindy": "pysindy, weak form",
    "pybop_cell": "PyBOP",
    "mujoco_sysid": "MuJoCo sysid",
    "pinocchio_torque": "Pinocchio, torque regressor",
}
_ENVIRONMENT = ROOT / "build" / "peers"
_LARGEST = 1000.0  # per cent, standard errors
_PATIENCE = 120  # seconds of the processor that a tool has for a recording, beside those for all


def tool_of(name: str) -> ModuleType:
    """Its file."""
    return import_module(f"bench.peers.{name}")


@cache
def interpreter(package: str) -> tuple[str, str]:
    """A Python that has a package, or "" and why there is none; "": the product's own."""
    if not package:
        return sys.executable, ""
    python = _ENVIRONMENT / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", _ENVIRONMENT], check=True)
    told = subprocess.run(
        [python, "-m", "pip", "install", "--quiet", "--only-binary", ":all:", *package.split()],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if told.returncode:
        return "", (told.stderr.strip().splitlines() or ["pip failed"])[-1]
    (place,) = _ENVIRONMENT.glob("lib/python*/site-packages")
    (place / "bench.pth").write_text(f"{ROOT / 'tools'}\n", encoding="utf-8")  # behind its packages
    return str(python), ""


def fitted(name: str, rig: str, folder: Path, seconds: float) -> tuple[list[dict[str, Any]], str]:
    """What a tool makes of the recordings of a folder, and why it does not."""
    python, why = interpreter(tool_of(name).PACKAGE)
    if why:
        return [], why
    most = int(seconds) + _PATIENCE
    command = [python, "-P", "-m", "bench.peers.worker", name, rig, str(folder), str(seconds), str(most)]
    one_thread = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    told = subprocess.run(command, capture_output=True, text=True, check=False, env=one_thread)
    found = [json.loads(line) for line in told.stdout.splitlines() if line.startswith("{")]
    if told.returncode == -signal.SIGXCPU:
        return found, "" if found else f"no answer within {most} s of the processor"
    return found, "" if found else (told.stderr.strip().splitlines() or ["no answer"])[-1]


def statements(name: str, rig: Rig | Arm) -> int:
    """Statements that a user writes: those of the tool's file without other mechanisms', and the rates it is given."""
    source = inspect.getsource(tool_of("pvid_itself" if name == "pvid_refined" else name))
    others = tuple(one for one in (*RIGS, "arm3") if one != rig.name)
    made = [
        one for one in ast.parse(source).body if isinstance(one, ast.FunctionDef) and not one.name.startswith(others)
    ]
    if "rig.rates" in source and isinstance(rig, Rig):
        made.append(ast.parse(inspect.getsource(rig.rates)).body[0])  # type: ignore[arg-type]
    return sum(
        isinstance(part, ast.stmt) and not (isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant))
        for one in made
        for part in ast.walk(one)
    )


def _cell(numbers: Sequence[float]) -> str:
    worst = max(numbers, default=float("nan"))
    return "-" if np.isnan(worst) else f"> {_LARGEST:.0f}" if worst > _LARGEST else f"{worst:.2g}"


def row(rig: Rig | Arm, case: str, name: str, answers: Sequence[dict[str, Any]], why: str) -> tuple[str, ...]:
    """As in HEADER."""
    head = (rig.name, case if case == CLEAN else rig.effect[0], TOOLS[name])
    if not answers:
        return (*head, f"not available: {why}", *["-"] * (len(HEADER) - 4))
    good = [one for one in answers if one["values"] and np.isfinite([*one["values"].values()]).all()]
    off: list[list[float]] = [[], []]
    scores = []
    for one in good:
        for parameter, truth in rig.truth.items():
            error = abs(one["values"][parameter] - truth)
            off[one["seed"] % 2].append(100 * error / rig.size(parameter))
            scores.append(error / one["errors"][parameter] if one["errors"][parameter] else float("nan"))
    known = [one for one in scores if np.isfinite(one)]
    middle = [[statistics.median(some)] if some else [] for some in (off[0] + off[1], off[1], known)]
    return (
        *head,
        f"{len(good)} of {len(answers)}",
        _cell(middle[0]),
        _cell(middle[1]),
        _cell(off[0] + off[1]),
        _cell(middle[2]),
        _cell(known),
        f"{100 * np.mean(np.array(known) < 2):.0f}" if known else "-",
        f"{sum(bool(one['said']) for one in answers)}",
        f"{statistics.median(one['s'] for one in answers):.2g}",
        f"{statements(name, rig)}",
    )


def rows(
    names: Sequence[str], seeds: int, seconds: float, tools: Sequence[str], advance: Advance
) -> Iterator[tuple[str, ...]]:
    """Of mechanisms and tools."""
    with tempfile.TemporaryDirectory() as folder:
        rigs: dict[str, Rig | Arm] = {one: RIGS[one] for one in names if one in RIGS}
        for name in names:
            for case in (CLEAN, LACKING):
                place = Path(folder) / name / case.replace(" ", "-")
                place.mkdir(parents=True)
                rig = rigs[name] if name in rigs else write_arm(place)
                for seed in range(seeds):
                    np.savez(place / f"{seed}.npz", **rig.recording(seed, case))  # type: ignore[arg-type]
                for tool in tools:
                    if name in tool_of(tool).RIGS:
                        yield row(rig, case, tool, *fitted(tool, name, place, seconds))
                        advance()


def report(seeds: int, seconds: int, tool: Sequence[str], mechanism: Sequence[str], advance: Advance) -> Report:
    """As the command prints it."""
    tools, names = chosen(tool, what="tool", among=[*TOOLS]), chosen(mechanism, among=[*RIGS, "arm3"])
    found = [*rows(names, seeds, seconds, tools, advance)]
    said = f"Starts: {OFF[0]:.0%} off in even runs, {OFF[1]:.0%} in odd ones."
    return Report([("peers", HEADER, found)], said=[said])
