#!/usr/bin/env python3
"""Builds the documentation of host/docs and the reference of the C headers into build/site; exits 1 at any warning.

    build/venv/bin/python tools/docs.py             checks the generated parts and all links, builds the site
    build/venv/bin/python tools/docs.py --update    writes the generated parts first

mkdocs checks links and anchors between the pages of the site; this program those of the README files and of .github,
which GitHub shows. Nothing is loaded from the network. Needs mkdocs-material and doxygen.
"""

import argparse
import inspect
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import cast

import pvid
from pvid.cli.page_table import put_table, with_table
from pvid.cli.verdict_table import verdict_table
from pvid.codegen import files_strong
from pvid.codegen.strong import renamed, strong_functions_of
from pvid.core.sources import FOLDERS, SRC
from pvid.link import frames
from pvid.model.strong import strong_form
from pvid.models.mechanisms import compiled_of
from pvid.oracle import paper
from pvid.twin.printer import program

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "host" / "docs"
SITE = ROOT / "build" / "site"
# Pages outside the site, whose links are checked here.
OUTSIDE = ("README.md", "firmware/README.md", "host/README.md", ".github/*.md")

# ---- generated parts


def schema_block() -> str:
    """The schema of link-and-log.md."""
    return f"```\n{frames.SCHEMA_TEXT}\n```"


def documented(thing: object) -> str:
    """A docstring of numpydoc as Markdown: sections are headings, descriptions of names are a list."""
    lines = (inspect.getdoc(thing) or "").splitlines()
    out: list[str] = []
    section = ""
    for at, line in enumerate(lines):
        if line and set(line) == {"-"}:
            continue
        if at + 1 < len(lines) and lines[at + 1] and set(lines[at + 1]) == {"-"}:
            section = line
            out += [f"*{line}*", ""]
        elif section == "Examples" and line:
            out.append(f"    {line.removesuffix('  # doctest: +SKIP')}")
        elif section not in ("", "Returns") and line and not line.startswith(" "):
            name, colon, rest = line.partition(" : ")
            out.append(f"- `{name}`{': ' if colon else ''}{rest}")
        else:
            out.append(line)
    return "\n".join(out).strip()


def signature_of(name: str, thing: Callable[..., object]) -> str:
    """A call with its arguments, one a line if there are many."""
    parameters = [
        str(one).replace(repr(one.annotation), str(one.annotation), 1)
        for one in inspect.signature(thing).parameters.values()
        if one.name != "self"
    ]
    inner = ", ".join(parameters)
    return f"{name}({inner})" if len(inner) < 80 else f"{name}(\n    " + ",\n    ".join(parameters) + ",\n)"


def own_members(owner: type) -> Iterator[tuple[str, object]]:
    """Public methods and properties of a class that have a docstring, in the order of the source."""
    for name, member in vars(owner).items():
        if not name.startswith("_") and inspect.getdoc(member) and (callable(member) or isinstance(member, property)):
            yield name, member


def python_reference() -> str:
    """The reference of `import pvid`, from its docstrings."""
    lines = []
    for name in sorted(set(pvid.__all__) - {"__version__"}, key=str.lower):
        thing = getattr(pvid, name)
        lines += [f"## pvid.{name}", ""]
        if not (isinstance(thing, type) and issubclass(thing, Exception)):
            lines += ["```text", signature_of(f"pvid.{name}", thing), "```", ""]
        lines += [documented(thing), ""]
        if not isinstance(thing, type) or issubclass(thing, Exception):
            continue
        for member, of_class in own_members(thing):
            lines += [f"### {name}.{member}", ""]
            if not isinstance(of_class, property):
                lines += ["```text", signature_of(member, cast("Callable[..., object]", of_class)), "```", ""]
            lines += [documented(of_class), ""]
    return "\n".join(lines).strip()


def paper_block() -> str:
    """The identifier of the paper, for paper.md."""
    return f"```python\n{inspect.getsource(paper)}```"


def printed_block() -> str:
    """The row and the solve of the pendulum's printed strong form, for paper.md."""
    source = files_strong.source(renamed(strong_functions_of(strong_form(compiled_of("kapitza")))), "pvid model build")
    parts = [
        one
        for name in ("atoms_of", "innovate", "force_of", "solved")
        for one in source.split("\n\n")
        if f" {name}(const" in one
    ]
    return "```c\n" + "\n\n".join(parts) + "\n```"


def twin_block() -> str:
    """A module of the core and what is printed of it, for twin.md."""
    text = program.text_of([SRC / "judge" / "gate_f32.c"], FOLDERS, {})
    printed = text.partition("# ---- judge/gate_f32.c")[2].strip()
    c = (SRC / "judge" / "gate_f32.c").read_text(encoding="utf-8").strip()
    return f"## C\n\n```c\n{c}\n```\n\n## Printed\n\n```python\n{printed}\n```"


GENERATED = (  # page, marker, text
    ("paper.md", "paper", paper_block),
    ("paper.md", "printed", printed_block),
    ("twin.md", "twin", twin_block),
    ("link-and-log.md", "schema", schema_block),
    ("api-python.md", "api", python_reference),
    ("reasons.md", "verdict", verdict_table),
)


def generated_parts(update: bool) -> Iterator[str]:
    """Writes the generated parts, or names those that differ."""
    for name, marker, text_of in GENERATED:
        page = DOCS / name
        if update:
            put_table(page, marker, text_of())
        elif with_table(page, marker, text_of()) != page.read_text(encoding="utf-8"):
            yield f"host/docs/{name}: {marker} is out of date: tools/docs.py --update"


# ---- links that mkdocs does not check


def anchors(page: Path) -> set[str]:
    """Anchors of the headings of a page, as GitHub makes them."""
    headings = re.findall(r"(?m)^#+ (.*)$", re.sub(r"(?ms)^```.*?^```", "", page.read_text(encoding="utf-8")))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def broken_links(page: Path) -> Iterator[str]:
    """Links of a page that lead nowhere."""
    text = re.sub(r"(?ms)^```.*?^```", "", page.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'src="([^"]+)"', text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        to = (page.parent / path).resolve() if path else page
        if not to.exists():
            yield f"{page.relative_to(ROOT)}: no {target}"
        elif anchor and anchor not in anchors(to):
            yield f"{page.relative_to(ROOT)}: {target} has no such heading"


# ---- the site


def build_site(settings: Path = ROOT / "host" / "mkdocs.yml", site: Path = SITE) -> list[str]:
    """Builds the pages into a folder; returns the warnings. (With --quiet, mkdocs would count none.)"""
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "true"}
    command = [sys.executable, "-P", "-m", "mkdocs", "build", "--strict", "--clean", "--site-dir", str(site)]
    done = subprocess.run([*command, "--config-file", str(settings)], env=environment, capture_output=True, text=True)
    if not done.returncode:
        return []
    return [line for line in done.stderr.splitlines() if not line.startswith("INFO")] or ["mkdocs failed"]


def build_reference() -> list[str]:
    """Builds the reference of the C headers into build/site/api; returns the warnings."""
    settings = (ROOT / "host" / "Doxyfile").read_text(encoding="utf-8")
    settings += f'OUTPUT_DIRECTORY = "{SITE}"\nINPUT_FILTER = "\\"{sys.executable}\\" -P tools/doxygen_filter.py"\n'
    done = subprocess.run(["doxygen", "-"], cwd=ROOT, input=settings, capture_output=True, text=True)
    if not done.returncode and (SITE / "api" / "index.html").exists():
        return []
    return done.stderr.splitlines() or ["doxygen failed"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--update", action="store_true", help="write the generated parts")
    update = parser.parse_args().update
    faults = list(generated_parts(update))
    for pattern in OUTSIDE:
        for page in sorted(ROOT.glob(pattern)):
            faults += broken_links(page)
    faults += build_site() or build_reference()
    print("\n".join(faults) or "All checks passed! build/site/index.html, build/site/api/index.html")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
