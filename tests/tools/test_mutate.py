"""tools/mutate.py changes what it says and nothing else."""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import playback_weak
import pytest
from conftest import ROOT

from pvid.codegen import files_refine
from pvid.codegen.refine import refine_functions
from pvid.models.mechanisms import compiled_of

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
    monkeypatch.setattr(mutate, "files_of_core", lambda: [path])
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


def test_a_draw_is_the_same_again_and_an_edit_elsewhere_leaves_it(
    mutate: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "f.c").write_text(CODE, encoding="utf-8")
    monkeypatch.setattr(mutate, "files_of_core", lambda: [tmp_path / "f.c"])
    mutate.source_text.cache_clear()
    before = [(m.old, m.new, m.line()[1]) for m in mutate.ranked(1)["f.c"]]
    assert before == [(m.old, m.new, m.line()[1]) for m in mutate.ranked(1)["f.c"]]
    assert before != [(m.old, m.new, m.line()[1]) for m in mutate.ranked(2)["f.c"]]
    (tmp_path / "f.c").write_text("static int g;\n\n" + CODE, encoding="utf-8")
    mutate.source_text.cache_clear()
    assert before == [(m.old, m.new, m.line()[1]) for m in mutate.ranked(1)["f.c"]]


def test_every_file_has_its_share(mutate: ModuleType) -> None:
    assert mutate.shares({"large": 90, "small": 9, "tiny": 1}, 20) == {"large": 18, "small": 1, "tiny": 1}
    assert mutate.shares({"large": 3, "small": 1}, 20) == {"large": 3, "small": 1}


def test_reasons_speak_of_lines_that_stand_there(mutate: ModuleType) -> None:
    known = [mutant for mutants in mutate.ranked(1).values() for mutant in mutants]
    for reason in mutate.reasons():
        assert len(reason.why) >= 20
        assert any(reason.is_of(mutant) for mutant in known), f"{reason.file}: {reason.line}"


def test_what_is_played_has_both_kinds_of_steps_and_all_that_a_mechanism_may_have() -> None:
    """What a shape leaves out is not compiled: a change there would be no mutant."""
    shapes = [files_refine.shape(refine_functions(compiled_of(name)), "a test") for name in playback_weak.BOTH_STAGES]
    numbers = [dict(re.findall(r"^#define PVID_REFINE_(\w+) +(\d+)", shape, re.MULTILINE)) for shape in shapes]
    for name in ("RUNGE_KUTTA", "HIDDEN", "INTEGRALS", "TURNING", "SIGNS", "WIDTHS"):
        assert {int(one[name]) > 0 for one in numbers} == {False, True}, name
    assert {one["OUTPUT_LINEAR"] for one in numbers} == {"0", "1"}
    assert max(int(one["SIGNS"]) for one in numbers) > 1


@pytest.mark.long
def test_of_ten_mutants_the_quick_tests_kill_eight(
    mutate: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The whole campaign asks for 95 %: less than eight of ten are then killed in one draw of a hundred."""
    monkeypatch.setattr(mutate, "BUILD", tmp_path)
    results = mutate.campaign(10, seed=1, sanitizers=())
    assert len(results) == 10
    assert sum(by is not None for _, by in results) >= 8, results
