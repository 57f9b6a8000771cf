"""Tables that a command prints, or writes into the place for them on a page."""

from __future__ import annotations

from pathlib import Path

import click

from pvid.base.atomic_write import write_whole
from pvid.base.console import write_stderr
from pvid.base.errors import PvidError


def table_in(page: Path, marker: str) -> str | None:
    """What stands between <!-- marker --> and <!-- /marker -->; None: the page has no such lines."""
    _, opening, rest = page.read_text(encoding="utf-8").partition(f"<!-- {marker} -->\n")
    return rest.partition(f"\n<!-- /{marker} -->")[0] if opening else None


def with_table(page: Path, marker: str, text: str) -> str:
    """The page with this text between <!-- marker --> and <!-- /marker -->.

    Raises PvidError when the page has no such lines.
    """
    old = page.read_text(encoding="utf-8")
    opening, closing = f"<!-- {marker} -->", f"<!-- /{marker} -->"
    if opening not in old or closing not in old:
        raise PvidError(f"{page} does not contain the marker lines {opening} and {closing}")
    head, rest = old.split(opening, 1)
    tail = rest.split(closing, 1)[1]
    return f"{head}{opening}\n{text}\n{closing}{tail}"


def put_table(page: Path | None, marker: str, text: str) -> None:
    """Writes the text into the page, between its marker lines; prints it when no page is given."""
    if page is None:
        click.echo(text)
        return
    write_whole(page, with_table(page, marker, text), freely=True)
    write_stderr(f"{page}: table {marker} written")


UPDATE = click.option(
    "--update",
    type=click.Path(path_type=Path, exists=True),
    help="Replace the table in this file, between its two marker lines.",
)


def markdown(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])
