"""The table beside the last version: costs of the core that both have, lines, processor time."""

import subprocess
import sys
import tomllib
from pathlib import Path

from conftest import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import trend  # noqa: E402 - of tools

COSTS = {"text": 200, "bss": 10, "stack_bound": 4, "mean": 100, "longest": 300}


def test_a_cost_that_has_grown_is_shown_with_its_share() -> None:
    before = {"targets": {"mps2-an386 weak f32": COSTS, "microbit weak q31": COSTS}}
    now = {"targets": {"mps2-an386 weak f32": COSTS | {"mean": 105}}}
    found = list(trend.rows(before, now))
    assert [one for one in found if one[1] != one[2]] == [("mps2-an386 weak f32: instructions", 100, 105)]
    assert len(found) == len(COSTS)  # of the form that both have
    assert "| mps2-an386 weak f32: instructions | 100 | 105 | +5.0 % |" in trend.table("v1", found)


def test_the_budget_has_the_forms_that_are_shown() -> None:
    budget = tomllib.loads((ROOT / "tests" / "budget.toml").read_text(encoding="utf-8"))
    assert len(list(trend.rows(budget, budget))) == 15 and all(budget["tests"].values())


def test_lines_of_a_commit_are_those_of_its_files(tmp_path: Path) -> None:
    for words in (["init", "-q"], ["config", "user.email", "a@b"], ["config", "user.name", "a"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    (tmp_path / "a.py").write_text("1\n2\n", encoding="utf-8")
    (tmp_path / "a.csv").write_text("1\n", encoding="utf-8")
    subprocess.run(["git", "add", "."], cwd=tmp_path, check=True)
    subprocess.run(["git", "commit", "-qm", "a"], cwd=tmp_path, check=True)
    (tmp_path / "a.py").write_text("1\n2\n3\n", encoding="utf-8")
    code = f"import sys; sys.path.insert(0, {str(ROOT / 'tools')!r}); import trend; from pathlib import Path"
    code += f"; trend._ROOT = Path({str(tmp_path)!r}); print(trend.lines('HEAD'), trend.lines(None))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "2 3\n"
