"""tools/analyse.py sees what it is there for: faults planted in a copy of the core are found, by the tool meant."""

import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT

PLANTED = """
#include <stdint.h>
#include <stdlib.h>

int32_t pvid_planted(int32_t kind, const int32_t *values);

int32_t pvid_planted(int32_t kind, const int32_t *values)
{
    int32_t *copy = malloc(8);
    if (values == NULL) {
        kind = *values;
    }
    switch (kind) {
    case 1:
        kind = 2;
    case 2:
        kind = 3;
        break;
    }
    if (copy != NULL) {
        free(copy);
        free(copy);
    }
    return kind >> 40;
}
"""


FAULTY = ("firmware/src/weak/planted.c", "firmware/ports/host/planted.c")
# A line that chooses by a macro of the compiler.
CHOICE = re.compile(r"^#\s*(?:el)?if.*\b__(?!cplusplus)\w+", re.MULTILINE)
STALE = """
[[deviation]]
tool = "misra"
rule = "8.14"
files = ["firmware/src/weak/planted.c"]
line = "restrict"
reason = "There is none."
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A repository with the tool, the firmware and two more of its files that are full of faults."""
    top = tmp_path_factory.mktemp("analysis")
    for name in ("tools/analyse.py", "tools/kept.py", "tools/units.py", ".clang-tidy"):
        (top / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, top / name)
    for folder in ("firmware", "tests/analysis"):
        shutil.copytree(ROOT / folder, top / folder)
    for name in FAULTY:
        (top / name).write_text(PLANTED, encoding="utf-8")
    with (top / "firmware" / "analysis.toml").open("a", encoding="utf-8") as file:
        file.write(STALE)
    return top


def run(copy: Path, *files: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(copy / "tools" / "analyse.py"), *files]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_planted_faults_are_found(copy: Path) -> None:
    done = run(copy, *FAULTY)
    assert done.returncode == 1, done.stderr
    for name in FAULTY:
        for expected in (
            "22: gcc -Wanalyzer-double-free",
            "11: clang-tidy clang-analyzer-core.NullDereference",
            "24: cppcheck shiftTooManyBits",
            "16: misra 16.3",  # a case without a break
            "13: misra 16.4",  # a switch without a default
            "21: misra 21.3",  # free
        ):
            assert f"{name}:{expected}" in done.stdout
    # Nor may a deviation outlive its cause.
    assert "analysis.toml: misra 8.14 firmware/src/weak/planted.c `restrict` covers nothing" in done.stdout


def test_required_rule_is_not_deviated_from_more_often_than_written(copy: Path) -> None:
    deviations = copy / "firmware" / "analysis.toml"
    text = deviations.read_text(encoding="utf-8")
    text, changes = re.subn(r'(rule = "10\.3"\nmost =) \d+', r"\1 0", text)
    assert changes == 1
    deviations.write_text(text, encoding="utf-8")
    done = run(copy, "firmware/src/number/fnv.c")
    assert "1 findings, analysis.toml says 0" in done.stdout


def test_of_one_source_the_findings_in_new_lines_are_named(copy: Path) -> None:
    """How many a rule has in all, one source does not tell."""
    git = ["git", "-C", str(copy), "-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (["init", "-q"], ["add", "firmware"], ["commit", "-qm", "before"]):
        subprocess.run([*git, *command], check=True)
    source = copy / "firmware" / "src" / "number" / "layout.c"
    before = source.read_text(encoding="utf-8")
    assert "not committed" not in run(copy, "firmware/src/number/layout.c").stdout
    wider = "uint32_t pvid_wider(uint16_t a, uint16_t b)\n{\n    const uint32_t both = a + b;\n    return both;\n}\n"
    source.write_text(f"{before}\nuint32_t pvid_wider(uint16_t a, uint16_t b);\n{wider}", encoding="utf-8")
    done = run(copy, "firmware/src/number/layout.c")
    assert done.returncode == 1 and "misra 10.6" in done.stdout
    assert re.search(r"\d in lines that are not committed.*\n  firmware/src/number/layout.c:\d+: misra", done.stdout)


def test_every_header_that_chooses_by_a_macro_is_read_with_it() -> None:
    tools = {**runpy.run_path(str(ROOT / "tools" / "units.py")), **runpy.run_path(str(ROOT / "tools" / "analyse.py"))}
    read, choosing = set(), set()
    for unit in tools["core"]("host"):
        done = subprocess.run(
            ["gcc", "-MM", *unit.common, str(unit.source)], cwd=ROOT, capture_output=True, text=True, check=True
        )
        headers = {Path(one).resolve() for one in done.stdout.replace("\\\n", " ").split()[1:] if one.endswith(".h")}
        choosing |= {one for one in headers if CHOICE.search(one.read_text(encoding="utf-8"))}
        if unit.source.name in tools["WHOLE"]:
            read |= headers
    assert choosing - read == set()
    assert {one.name for one in choosing} >= {"config.h", "layout.h", "unroll.h"}
