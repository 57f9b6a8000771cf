"""One row of `pvid compare`: a core on this machine against its twin, or on a target against this machine."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Outcome:
    """`hash` is the running one after the last of `ticks`; None: the target never said."""

    target: str
    core: str
    form: str
    law: str
    ticks: int
    hash: int | None
    equal: bool
    verdict: str

    @property
    def cells(self) -> tuple[str, ...]:
        """As text, in the order of the fields."""
        hashed = "-" if self.hash is None else f"{self.hash:08x}"
        return self.target, self.core, self.form, self.law, str(self.ticks), hashed, self.verdict
