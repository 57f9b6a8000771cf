#!/usr/bin/env python3
"""Prints a C header with its comments marked for doxygen: INPUT_FILTER of host/Doxyfile.

    tools/doxygen_filter.py HEADER

The headers are written to be read as they are. A comment in front of a declaration becomes its description, one behind
it on the same line belongs to what stands before it, the first of the file describes the file. The text is kept as it
is, line by line.
"""

import re
import sys
from pathlib import Path

COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)


def plain(comment: str) -> str:
    """The text of a comment, without its frame."""
    lines = comment[2:-2].strip().split("\n")
    return "\n".join([lines[0], *(re.sub(r"^\s*\* ?", "", line).rstrip() for line in lines[1:])])


def marked(comment: str, first: bool, behind: bool) -> str:
    """A comment as doxygen reads it, with as many lines."""
    text = plain(comment)
    if text.startswith(("@", "#")):  # a contract for Frama-C
        return comment
    escaped = re.sub(r"([\\@<>&#%$\"])", r"\\\1", text).replace("--", "-\\-")
    if first:
        return f"/** @file\n@verbatim\n{text}\n@endverbatim */"
    if behind:
        return f"/**< {escaped} */"
    brief = re.match(r".*?\.(?=\s)", escaped, re.DOTALL)
    return f"/** @brief {brief.group()} @details{escaped[brief.end() :]} */" if brief else f"/** {escaped} */"


def main() -> None:
    source = Path(sys.argv[1]).read_text(encoding="utf-8")
    out, at = [], 0
    for number, found in enumerate(COMMENT.finditer(source)):
        before = source[source.rfind("\n", 0, found.start()) + 1 : found.start()].strip()
        out += [source[at : found.start()], marked(found.group(), number == 0, bool(before))]
        at = found.end()
    print("".join([*out, source[at:]]), end="")


main()
