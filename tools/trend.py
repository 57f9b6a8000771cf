"""What code and tests take, beside the last version: the table at the end of `./tools/test`.

Costs of the core are those of tests/budget.toml, here and in the last tag; lines are counted in both; processor time of
the tests is that of the run, beside the time of the last version in tests/budget.toml.
"""

import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).resolve().parents[1]
_BUDGET = "tests/budget.toml"
_SHOWN = ("mps2-an386 weak f32", "mps2-an386 refined f32", "microbit weak q31")
_COSTS = {"text": "code, B", "bss": "RAM, B", "stack_bound": "stack, B", "mean": "instructions", "longest": "longest"}
_CODE = ("*.c", "*.h", "*.cpp", "*.py", "*.sh")
Row = tuple[str, int, int]


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=_ROOT, capture_output=True, text=True, check=True).stdout


def rows(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[Row]:
    """Costs of budgets: what, before, now; of forms that both have."""
    for form in _SHOWN:
        if form in before["targets"] and form in now["targets"]:
            for key, title in _COSTS.items():
                yield f"{form}: {title}", before["targets"][form][key], now["targets"][form][key]


def lines(tag: str | None) -> int:
    """Of C and Python, and of shell programs with that ending, at a tag; None: in the working tree."""
    found = _git("grep", "--count", "", *([tag] if tag else []), "--", *_CODE).splitlines()
    return sum(int(one.rpartition(":")[2]) for one in found)


def table(version: str, compared: list[Row]) -> str:
    """In Markdown."""
    shown = [f"| | {version} | now | change |", "|---|---|---|---|"]
    return "\n".join(shown + [f"| {one} | {a} | {b} | {100 * (b - a) / a:+.1f} % |" for one, a, b in compared])


def main() -> None:
    """Prints it. Argument: processor time of this run of all mandatory layers [s]."""
    try:
        tag = _git("describe", "--tags", "--abbrev=0", "--match", "v[0-9]*").strip()
    except subprocess.CalledProcessError:
        print("No tagged version to compare with: git fetch --tags")
        return
    now = tomllib.loads((_ROOT / _BUDGET).read_text(encoding="utf-8"))
    compared = list(rows(tomllib.loads(_git("show", f"{tag}:{_BUDGET}")), now))
    compared.append(("lines of C and Python", lines(tag), lines(None)))
    if len(sys.argv) > 1 and tag in now["tests"]:
        compared.append(("tests: processor time, s", now["tests"][tag], int(sys.argv[1])))
    print(table(tag, compared))


if __name__ == "__main__":
    main()
