"""What a tick costs, held against its budget and against plain recursive least squares."""

from __future__ import annotations

import platform
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT

from bench.cost import build, stage_costs, state_bytes
from pvid.base.errors import PvidError

ALLOWANCE = 1.02

Budget = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def budget() -> Budget:
    return tomllib.loads((ROOT / "tests" / "budget.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def costs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, int]:
    binary = build(tmp_path_factory.mktemp("cost"))
    return {cost.stage: cost.instructions for cost in stage_costs(binary)}


def gcc_major() -> str:
    done = subprocess.run(["gcc", "-dumpversion"], capture_output=True, text=True, check=True)
    return done.stdout.split(".")[0].strip()


def test_a_tick_of_the_strong_form_is_cheaper_than_a_row_of_recursive_least_squares(costs: dict[str, int]) -> None:
    """Exact projection at every row is cheaper on a Cortex-M4F only, which has twice the registers."""
    assert costs["staged"] < costs["tick"] < min(costs["rls"], costs["ud"])


def test_no_stage_exceeds_its_budget(costs: dict[str, int], budget: Budget) -> None:
    allowed = dict(budget["instructions"])
    compiler = allowed.pop("compiler")
    if platform.machine() != "x86_64" or compiler != f"gcc {gcc_major()}":
        allowed = {}  # instructions of another compiler are no regression of ours
    over = {stage: (costs[stage], limit) for stage, limit in allowed.items() if costs[stage] > ALLOWANCE * limit}
    assert not over


def test_no_state_exceeds_its_budget(tmp_path: Path, budget: Budget) -> None:
    sizes = {name.split(" ")[0].rstrip(","): size for name, size in state_bytes(tmp_path).items()}
    assert set(budget["state_bytes"]) < set(sizes)
    over = {name: sizes[name] for name, limit in budget["state_bytes"].items() if sizes[name] > ALLOWANCE * limit}
    assert not over


def test_the_readme_shows_what_is_measured(costs: dict[str, int], budget: Budget) -> None:
    if budget["instructions"]["compiler"] != f"gcc {gcc_major()}":
        return
    page = (ROOT / "host" / "docs" / "benchmarks" / "cost.md").read_text(encoding="utf-8")
    for stage, instructions in costs.items():
        line = next(line for line in page.splitlines() if line.startswith(f"| {stage} |"))
        shown = int(line.split("|")[2])
        assert shown == pytest.approx(instructions, rel=0.02), stage


def test_a_missing_compiler_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(PvidError, match="no-such-compiler"):
        build(tmp_path, compiler="no-such-compiler")
