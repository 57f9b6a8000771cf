"""Figure files: the format by the file's suffix, and one sentence if the file cannot be written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pvid.base.atomic_write import appearing
from pvid.base.errors import PvidError
from pvid.base.replacing import CREATOR
from pvid.base.wording import printable, reason

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")


def format_of(path: Path) -> str:
    """The format by the suffix of a figure's name; png without suffix. Raises PvidError when it is another one."""
    found = path.suffix[1:].lower() or FORMATS[0]
    if found not in FORMATS:
        raise PvidError(f"the figure {path} has no name of one: it must end in .{', .'.join(FORMATS)}")
    return found


def save(figure: Figure, path: Path, dpi: int) -> None:
    """Writes a figure, whole or not at all. Raises PvidError when it cannot be written."""
    kind = format_of(path)
    key = "Software" if kind == "png" else "Creator"
    try:
        with appearing(path) as temporary:
            figure.savefig(temporary, dpi=dpi, format=kind, metadata={key: CREATOR})
    except (OSError, ValueError) as error:
        raise PvidError(f"cannot write the figure {path}: {reason(error)}") from error


def drawable(name: str) -> str:
    """A file's name in letters that the figures' font has; others become question marks."""
    from matplotlib.font_manager import FontProperties, findfont, get_font

    letters = get_font(findfont(FontProperties())).get_charmap()
    return "".join(c if ord(c) in letters else "?" for c in printable(name))
