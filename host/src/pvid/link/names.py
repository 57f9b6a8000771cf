"""What a board says about its mechanism (frames.Names): a text of few lines.

    dc_motor
    sample V V
    sample phi rad
    p R ohm
    p d1
    r R ohm
    r friction N*m*s
    count V 0.000366

The mechanism's name, then its samples and its parameters in order, each with its name and, except for a pure number,
its unit; of a board with a second stage also the refined parameters (frames.RefinedEstimate), of one that sends counts
the value of a count of each sample. A board is not trusted: names are those of a program's variables, units are few
printable characters, and nothing is read of a text that breaks a rule.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pvid.base.errors import PvidError
from pvid.base.wording import shown
from pvid.link.frames import MAX_SAMPLES, PLACES, WIDE

_NAME = "[A-Za-z_][A-Za-z0-9_]{0,31}"
_COUNT = re.compile(rf"count ({_NAME}) ([0-9.e+-]{{1,24}})")
_LINE = re.compile(rf"(sample|p|r) ({_NAME})(?: ([A-Za-z0-9/*^()%.+-]{{1,24}}))?")
MOST = 1200  # characters of a text


def shown_of_refined(parameters: int, widths: int, in_p: Sequence[int]) -> tuple[int, ...]:
    """Entries of the refinement's r that RefinedEstimate has: without the widths, which are first and differ from block
    to block, and without those in p where the others fill its places."""
    found = tuple(range(widths, parameters))
    places = PLACES if len(in_p) <= PLACES else WIDE
    return found if len(found) <= places else tuple(one for one in found if one not in in_p)


class Quantity(NamedTuple):
    """A number with a name, and its unit in SI, in ASCII as in "m/s^2"; "" for a pure number."""

    name: str
    unit: str

    @property
    def shown_unit(self) -> str:
        """For pages and terminals, as in "m/s²"."""
        return self.unit.replace("^2", "²")

    @property
    def label(self) -> str:
        """As in "w [1/s²]"."""
        return f"{self.name} [{self.shown_unit}]" if self.unit else self.name


@dataclass(frozen=True)
class BoardNames:
    """A mechanism by its samples and parameters.

    counts : value of a count of each sample, if the board sends counts
    refined : entries of the refinement's r that it sends; () without a second stage
    """

    mechanism: str
    samples: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    counts: tuple[float, ...] = ()
    refined: tuple[Quantity, ...] = ()

    @property
    def text(self) -> str:
        """As in a frame."""
        named = (("sample", self.samples), ("p", self.parameters), ("r", self.refined))
        lines = [(what, *one) for what, quantities in named for one in quantities]
        lines += [("count", name, repr(float(x))) for (name, _), x in zip(self.samples, self.counts, strict=False)]
        return "\n".join([self.mechanism, *(" ".join(line).rstrip() for line in lines)])

    @classmethod
    def parse(cls, text: bytes) -> BoardNames:
        """From what a board sent.

        Raises PvidError where it is not of this form, names something twice, or names too much or nothing.
        """
        if len(text) > MOST:
            raise PvidError(f"names of {len(text)} characters, and {MOST} are the most")
        mechanism, *lines = text.decode("ascii", "replace").split("\n")
        if not re.fullmatch(_NAME, mechanism):
            raise PvidError(f"{shown(mechanism, 40)} is no name of a mechanism")
        found: dict[str, list[Quantity]] = {"sample": [], "p": [], "r": []}
        counts: dict[str, float] = {}
        for line in lines:
            if (of_count := _COUNT.fullmatch(line)) is not None:
                counts[of_count[1]] = _number(of_count[2])
                continue
            match = _LINE.fullmatch(line)
            if match is None:
                raise PvidError(f"{shown(line, 60)} names no sample and no parameter")
            found[match[1]].append(Quantity(match[2], match[3] or ""))
        for what, least, most in (("sample", 1, MAX_SAMPLES), ("p", 1, WIDE), ("r", 0, WIDE)):
            named = [name for name, _ in found[what]]
            if not least <= len(named) <= most or len(set(named)) < len(named):
                raise PvidError(
                    f"{mechanism}: {len(named)} names of {what}, where {least} to {most} different ones belong"
                )
        if counts and list(counts) != [name for name, _ in found["sample"]]:
            raise PvidError(f"{mechanism}: the counts of {len(counts)} samples, and not of all in their order")
        samples, parameters, refined = (tuple(found[what]) for what in ("sample", "p", "r"))
        return cls(mechanism, samples, parameters, tuple(counts.values()), refined)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise PvidError(f"{shown(text, 30)} is no value of a count")
    return value
