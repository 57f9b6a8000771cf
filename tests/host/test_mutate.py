"""tools/mutate.py changes what it says and nothing else."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]

CODE = """/* a < b + 1 */
#define N 4
static int f(int a, int b)
{
    if ((a < b) && (a != 7)) {
        return -a; // 3
    }
    return p->x + 2u;
}
"""


@pytest.fixture(scope="module")
def mutate() -> ModuleType:
    spec = importlib.util.spec_from_file_location("mutate", ROOT / "tools" / "mutate.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["mutate"] = module  # where dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_operators_signs_and_constants_of_the_code_alone(
    mutate: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "f.c"
    path.write_text(CODE, encoding="utf-8")
    monkeypatch.setattr(mutate, "SOURCES", tmp_path)
    found = {(m.line()[0], m.old.strip(), m.new.strip()) for m in mutate.mutants_of(path)}
    assert found == {
        (5, "<", "<="),
        (5, "&&", "||"),
        (5, "!=", "=="),
        (5, "7", "8"),
        (6, "-", ""),
        (8, "+", "-"),
        (8, "2u", "3u"),
    }
    for mutant in mutate.mutants_of(path):
        text = mutant.text()
        differs = [a != b for a, b in zip(text.splitlines(), CODE.splitlines(), strict=True)]
        assert differs.count(True) == 1 and differs.index(True) == mutant.line()[0] - 1


def test_a_sample_is_the_same_again(mutate: ModuleType) -> None:
    assert mutate.drawn(20, seed=1) == mutate.drawn(20, seed=1)
    assert mutate.drawn(20, seed=1) != mutate.drawn(20, seed=2)
