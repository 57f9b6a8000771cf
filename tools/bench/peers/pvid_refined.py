"""pvid, with the refinement: `identify --refine`."""

from __future__ import annotations

from bench.peers import pvid_itself
from bench.peers.rigs import Fit, Rig, Run, Values

PACKAGE = ""
RIGS = pvid_itself.RIGS[:-1]


def fit(rig: Rig, run: Run, guess: Values) -> Fit:
    return pvid_itself.fit(rig, run, guess, refine=True)
