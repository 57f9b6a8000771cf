#!/usr/bin/env python3
"""The blocks of README.md and host/docs: which are executed, how, and what they print.

    build/venv/bin/python tools/pages.py             lists the blocks that are not executed, with the reason of each
    build/venv/bin/python tools/pages.py --update    writes what commands print into the pages that show it

A block is a fence, or lines indented by four spaces behind an empty line. A block of commands is executed line by
line in a folder with recordings, rig files and a model (`prepared`). A fence `text` behind commands shows what they
print. tests/tools/test_pages.py executes all of it.
"""

import argparse
import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from click.testing import CliRunner

from pvid.core.host_compiler import compiled_once
from pvid.model.chain import Chain
from pvid.models.mechanisms import compiled_of

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "host" / "docs"

COMMAND = re.compile(r"(?:\./tools/|build/venv/|cmake |cd |cc |pip |head |python3? )")

# ---- commands that are not executed, only parsed: pattern, reason
NOT_EXECUTED = (
    (r"^\./tools/pvid bench\b", "takes minutes to hours; tests/bench executes its short form"),
    (r"^\./tools/pvid log /dev/ttyACM0 \w+\.csv", "needs a board; tests/log/test_text_table.py has one that prints"),
    (r"^\./tools/pvid demo", "tests/cli/test_cli.py and test_demo_run.py execute it"),
    (r"^\./tools/pvid watch", "runs until Ctrl-C; tests/fleet/test_batch.py"),
    (r"^\./tools/pvid sizes", "builds every image; tests/board/test_targets.py measures some of them"),
    (r"^\./tools/(test|release)\b", "executes the tests themselves; tests/tools/test_release.py executes parts of it"),
    (r"^build/venv/bin/python tools/prove\.py", "takes minutes; tests/tools/test_proofs.py executes parts of it"),
    (r"^python3 -m venv|pip install", "tests/tools/test_wheel.py installs the package into a bare environment"),
)
# An emulated board, but for what is measured on it.
ON_THIS_COMPUTER = (r"^(?!.*pvid design )(.*?)\b(mps2-an386|microbit)\b", r"\1stream-host")
# ---- short forms: pattern, replacement, reason
SHORT = (
    (*ON_THIS_COMPUTER, "tests/board has the emulators; they compute the same bits"),
    (r"--on all\b", "--on stream-host", "the same"),
    (r"/dev/ttyACM0 run", "stream-host board", "a board behind a pseudo-terminal of this machine; run.pvlog exists"),
    (r"(model predict \S+)(?: --duration \d+)?", r"\1 --drive steps --duration 4", "one short drive is enough"),
    (r"(pvid simulate \S+)", r"\1 --duration 8", "a shorter run"),
    (r"(model simulate \S+ \S+)", r"\1 --duration 5", "a shorter run"),
    (r"(pvid log .*)", r"\1 --paced --samples 3000 --quiet", "a shorter log"),
    (r"(pvid batch .* -o \S+)(?: --workers 4)?", r"\1 --workers 1", "tests/fleet has a batch by two processes"),
    (r"MODEL --for \S+ --run RUN.csv -o DIR", "dc_motor --for arduino --run motor.csv -o made", "a form, filled in"),
)
# ---- blocks that are neither commands nor programs: page, pattern of the first line, what they are and their test
SHOWN = (
    ("batch.md", r"changed: ", "what it prints; tests/fleet/test_changes.py"),
    ("theory.md", "", "equations; tests/oracle"),
    ("robots.md", r" +instructions a tick", "figures; tests/board/test_robot_board.py"),
    ("compiler.md", r"sum_j", "an equation"),
    ("compiler.md", r"cart\.py|I1, h1", "sentences; tests/model"),
    ("compiler.md", r"model\.mechanics", "a form to fill in; tests/model/test_mechanics.py"),
    ("link-and-log.md", r"COBS", "the layout of a frame; tests/link"),
    ("link-and-log.md", r"pvid 1", "the schema; tools/docs.py"),
    ("models.md", r"t,V,i,phi", "a recording"),
    ("python.md", r"@misc", "BibTeX, as .github/CITATION.cff"),
    ("README.md", r"Simulated: ", "tools/pvid bench demo"),
    ("models.md", r"add_subdirectory", "CMake; tests/tools/test_consumer.py"),
    ("porting.md", r"set\(", "CMake; tests/board/test_port.py"),
    ("mechanisms/*.md", r"\w+: ", "tests/tools/test_mechanism_pages.py"),
    ("api-python.md", "", "written by tools/docs.py"),
)


@dataclass(frozen=True)
class Block:
    """A block of a page.

    Attributes
    ----------
    page : below the repository
    line : number of its first line
    language : of a fence; "" of an indented block
    text : without indentation
    """

    page: Path
    line: int
    language: str
    text: str

    @property
    def kind(self) -> str:
        """commands, output, python, c, toml, or shown: a block that SHOWN lists; else unknown."""
        if self.language in ("python", "c", "toml"):
            return self.language
        if COMMAND.match(self.text):
            return "commands"
        for page, first, _ in SHOWN:
            if self.page.match(page) and re.match(first, self.text):
                return "shown"
        return "output" if self.language == "text" else "unknown"

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def pages() -> list[Path]:
    """README.md and the pages of the site, below the repository."""
    some = [ROOT / "README.md", ROOT / "firmware" / "examples" / "README.md", ROOT / ".github" / "CONTRIBUTING.md"]
    return [path.relative_to(ROOT) for path in (*some, *sorted(DOCS.rglob("*.md")))]


def blocks_of(page: Path) -> list[Block]:
    """All blocks of a page, in order."""
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    found, at, before = [], 0, ""
    while at < len(lines):
        fence = re.match(r"( *)```(\w*)$", lines[at])
        if fence:
            end = lines.index(f"{fence[1]}```", at + 1)
            inner = [line.removeprefix(fence[1]) for line in lines[at + 1 : end]]
            found.append(Block(page, at + 1, fence[2] or "text", "\n".join(inner)))
            at = end
        elif lines[at].startswith("    ") and not before.strip():
            end = at
            while end < len(lines) and (lines[end].startswith("    ") or not lines[end].strip()):
                end += 1
            inner = [line.strip() if "set(" in line else line[4:] for line in lines[at:end]]
            found.append(Block(page, at + 1, "", "\n".join(inner).strip()))
            at = end - 1
        before = lines[at]
        at += 1
    return found


def commands_of(block: Block) -> list[str]:
    """The command lines of a block, without comments; `a && b` is two lines, unless a changes the folder."""
    joined = re.sub(r"\\\n *", "", block.text)
    lines = [re.sub(r"(^|\s+)#.*$", "", line).strip() for line in joined.splitlines()]
    return [one.strip() for line in lines if line for one in ([line] if line[:3] == "cd " else line.split("&&"))]


def reason_not_to_execute(line: str) -> str | None:
    """Why a command is only parsed; None: it is executed."""
    return next((why for pattern, why in NOT_EXECUTED if re.search(pattern, line)), None)


def short_form(line: str) -> str:
    """A command of pvid with the short forms in place."""
    for pattern, replacement, _ in SHORT:
        line = re.sub(pattern, replacement, line, count=1)
    return line


# ---- execution


@dataclass
class Printed:
    """Exit code, and standard output with standard error."""

    code: int
    text: str


def pvid(words: list[str]) -> Printed:
    """`./tools/pvid WORDS` in this process and folder; `> FILE` at the end takes what is printed."""
    from pvid.base.console import BAD_INPUT
    from pvid.base.errors import PvidError
    from pvid.base.replacing import replacing
    from pvid.cli.main import commands

    words, target = _redirected(words)
    with replacing():  # the files at hand are those of the page's reader
        done = CliRunner().invoke(commands, words, standalone_mode=False)
    if target is not None:
        target.write_text(done.stdout, encoding="utf-8")
    if isinstance(done.exception, PvidError | click.ClickException):
        return Printed(BAD_INPUT, f"{done.output}pvid: {done.exception}")
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return Printed(done.return_value if isinstance(done.return_value, int) else 0, done.output)


def _redirected(words: list[str]) -> tuple[list[str], Path | None]:
    """The words of a command, and the file that takes its output."""
    return (words[:-2], Path(words[-1])) if words[-2:-1] == [">"] else (words, None)


def parse(line: str) -> None:
    """Raises click.ClickException where the arguments of `./tools/pvid ...` are not accepted."""
    from pvid.cli.main import commands

    words, _ = _redirected(shlex.split(line)[1:])
    command: click.Command = commands
    context = click.Context(command)
    while isinstance(command, click.Group):
        name, found, words = command.resolve_command(context, words)
        assert found is not None and name is not None
        context = click.Context(found, info_name=name, parent=context)
        command = found
    command.make_context(context.info_name, words)


def prepared(folder: Path) -> None:
    """Writes the files that the pages' commands name: simulated runs, logs, rig files, the model file of models.md.

    Runs have further columns, so that `--columns` finds the names and units of the pages.
    """
    with contextlib.chdir(folder):
        for words in (
            "simulate run.csv --duration 8 --seed 1",
            "model simulate dc_motor motor.csv --duration 5",
            "log stream-host run.pvlog --rig run.toml --paced --samples 8000 --quiet",
        ):
            done = pvid(words.split())
            assert done.code == 0, f"{words}: {done.text}"
        shutil.copy("run.toml", "rig.toml")
        Path("tests").symlink_to(ROOT / "tests")  # with recordings that others made
        shutil.copytree(ROOT / "firmware", "firmware", ignore=shutil.ignore_patterns("build"))
        for page, name in (("models", "motor.py"), ("robots", "robot.py")):
            model = next(one for one in blocks_of(Path(f"host/docs/{page}.md")) if one.kind == "python")
            Path(name).write_text(model.text, encoding="utf-8")
        shutil.copy(ROOT / "tests/data/robot/arm.urdf", "arm.urdf")
        assert pvid("model from arm.urdf -o arm.py".split()).code == 0
        sys.path.insert(0, str(ROOT / "tests"))
        from robot_arms import log_of

        for seed, name in enumerate(("arm.csv", "other.csv")):
            log = log_of(chain_of(Path("arm.py")), seed, seconds=10.0, rate=200.0)
            np.savetxt(name, np.array(list(log.values())).T, delimiter=",", header=",".join(log), comments="")
        scales = {
            "time_ms": ("t", 1e3),
            "ms": ("t", 1e3),
            "angle_deg": ("phi", 180 / np.pi),
            "deg": ("phi", 180 / np.pi),
        }
        with_columns(Path("run.csv"), Path("run.csv"), {**scales, "h": ("y", 1e3)})
        others = {"time": ("t", 1e3), "current_mA": ("i", 1e3), "angle": ("phi", 180 / np.pi), "u": ("V", 1.0)}
        with_columns(Path("motor.csv"), Path("recorded.csv"), others)
        of_a_sketch = {"t": ("t", 1e3), "duty": ("V", 255 / 12), "current": ("i", 1023 / 5)}
        turned = {"counts": ("phi", 2400 / (2 * np.pi))}
        with_columns(Path("motor.csv"), Path("sketch.csv"), of_a_sketch | turned, keep=False)
        for day in ("monday", "tuesday", "wednesday"):
            shutil.copy("motor.csv", f"{day}.csv")
        for place, name in (("fleet/a", "run.pvlog"), ("runs", "run.csv"), ("motors/a", "motor.csv")):
            Path(place).mkdir(parents=True)
            shutil.copy(name, place)


def chain_of(path: Path) -> Chain:
    """Of a robot's model file."""
    chain = compiled_of(path).chain
    assert chain is not None
    return chain


def with_columns(source: Path, target: Path, scales: dict[str, tuple[str, float]], *, keep: bool = True) -> None:
    """A run with further columns, or with these alone: name -> the column and its factor."""
    header, *rows = source.read_text(encoding="utf-8").splitlines()
    names = header.split(",")
    data = np.array([row.split(",") for row in rows], dtype=float)
    more = [data[:, names.index(column)] * factor for column, factor in scales.values()]
    table = np.column_stack([data, *more] if keep else more)
    named = ",".join([*names, *scales] if keep else scales)
    np.savetxt(target, table, fmt="%.9g", delimiter=",", header=named, comments="")


def executed(line: str, folder: Path, full: bool) -> Printed:
    """A command line in a folder; in its short form unless its output is shown."""
    if line.startswith("./tools/pvid "):
        line = line if full else short_form(line)
        with contextlib.chdir(folder):
            return pvid(shlex.split(re.sub(*ON_THIS_COMPUTER, line))[1:])
    # Three pages build the same package, each in a folder of its own; without optimisation, which changes no bit.
    once = {**compiled_once(), "CCACHE_BASEDIR": str(folder), "CMAKE_BUILD_TYPE": "None"}
    if shutil.which("ccache") and "--preset" not in line:  # a board's objects are those of one page alone
        once["CMAKE_C_COMPILER_LAUNCHER"] = "ccache"
    pipe = subprocess.PIPE
    done = subprocess.run(
        line, shell=True, cwd=folder, env=once, stdout=pipe, stderr=subprocess.STDOUT, text=True, check=False
    )
    return Printed(done.returncode, done.stdout)


def executed_python(block: Block, folder: Path, names: dict[str, object]) -> Printed:
    """A block of Python in a folder, with the names of the blocks before it; `# NAME.py` above it writes that file."""
    printed = io.StringIO()
    name = re.match(r"# (\w+\.py)\n", block.text)
    if name:
        (folder / name[1]).write_text(block.text, encoding="utf-8")
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
        exec(compile(block.text, str(block), "exec"), names)
    return Printed(0, printed.getvalue())


def shown_lines(printed: str) -> list[str]:
    """Lines as a page shows them."""
    return [line.rstrip() for line in printed.replace("stream-host", "mps2-an386").splitlines() if line.strip()]


def differences(shown: str, printed: str) -> Iterator[str]:
    """Yields the lines that a page shows and the command did not print, in order. `...` matches any lines.

    Figures may differ by 5 %: another machine's linear algebra rounds otherwise, and standard errors have two digits.
    """
    lines = iter(shown_lines(printed))
    for line in shown_lines(shown):
        if line.strip() != "..." and not any(
            alike(line.removesuffix(" ..."), one, line.endswith(" ...")) for one in lines
        ):
            yield line


_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def _words(line: str) -> str:
    """A line without its figures and its hash."""
    return " ".join(_NUMBER.sub("0", re.sub(r"hash \w+", "hash", line)).split())


def alike(a: str, b: str, begins: bool = False) -> bool:
    """Whether two lines have the same words and nearly the same figures.

    `begins`: b may go on. A hash may differ: it depends on the design, which the host computes in float64.
    """
    if begins:
        b = " ".join(b.split()[: len(a.split())])
    if a == b:
        return True
    if _words(a) != _words(b):
        return False
    a, b = (re.sub(r"hash \w+", "hash", one) for one in (a, b))
    pairs = zip(map(float, _NUMBER.findall(a)), map(float, _NUMBER.findall(b)), strict=True)
    return all(abs(x - y) <= 0.05 * max(abs(x), abs(y)) or max(abs(x), abs(y)) < 1e-4 for x, y in pairs)


# ---- the command


def report() -> Iterator[str]:
    """The blocks and commands that are not executed, with the reason of each."""
    for page in pages():
        for block in blocks_of(page):
            if block.kind == "commands":
                for line in commands_of(block):
                    why = reason_not_to_execute(line)
                    if why:
                        yield f"{block}: {line}: {why}"
            elif block.kind in ("shown", "unknown"):
                yield f"{block}: {block.kind}: {block.text.splitlines()[0][:60]}"


def updated(page: Path, folder: Path) -> str:
    """The text of a page with what its commands print now."""
    text = (ROOT / page).read_text(encoding="utf-8")
    names: dict[str, object] = {}
    printed = ""
    blocks = blocks_of(page)
    for place, block in enumerate(blocks):
        shows = place + 1 < len(blocks) and blocks[place + 1].kind == "output"
        if block.kind == "python" and not mechanism_page(page):
            printed = executed_python(block, folder, names).text
        elif block.kind == "commands":
            printed = "\n".join(
                executed(line, folder, shows).text for line in commands_of(block) if not reason_not_to_execute(line)
            )
        elif block.kind == "output" and "..." not in block.text:
            text = text.replace(block.text, renewed(block.text, printed), 1)
    return text


def renewed(shown: str, printed: str) -> str:
    """What a page shows with the figures of what is printed; all that is printed if a line has other words."""
    lines = shown_lines(printed)
    found = []
    rest = iter(lines)
    for line in shown_lines(shown):
        match = next((one for one in rest if _words(one) == _words(line)), None)
        if match is None:
            return "\n".join(lines)
        found.append(match)
    return "\n".join(found)


def mechanism_page(page: Path) -> bool:
    """Whether it is written by `pvid bench pages`, and its Python is a shipped mechanism."""
    return page.parent.name == "mechanisms"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--update", action="store_true", help="write what commands print into the pages")
    parser.add_argument("pages", nargs="*", help="only these, as in host/docs/tutorial.md")
    given = parser.parse_args()
    if not given.update:
        print("\n".join(report()))
        return 0
    sys.path.insert(0, str(ROOT / "tools"))
    os.environ["COLUMNS"] = "100"
    for page in [Path(one) for one in given.pages] or pages():
        if any(block.kind == "output" for block in blocks_of(page)):
            with tempfile.TemporaryDirectory() as name:
                prepared(Path(name))
                (ROOT / page).write_text(updated(page, Path(name)), encoding="utf-8")
            print(page)
    return 0


if __name__ == "__main__":
    sys.exit(main())
