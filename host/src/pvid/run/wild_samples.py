"""Wild samples of a recording: single ones far from the smooth signal about them, as interference makes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pvid.model.compiled import CompiledModel
from pvid.model.signals import jets
from pvid.rig.breaks import breaks
from pvid.rig.gaps import bridge, stretches
from pvid.rig.run import Recording

_SPAN = 0.5  # [s] over which a signal may change its character
_SHORTEST = 50  # samples of it
_LONGEST = 5  # samples that one wild sample makes suspect
_MOST = 1e-3  # of the samples: where more are, they belong to the signal


def without_wild_samples(recording: Recording, model: CompiledModel) -> Recording:
    """The recording with the wild samples of its coordinates interpolated, and a note for each changed signal.

    A coordinate is a sensor whose acceleration is in the equations: unlike a current, it cannot jump for one sample. A
    sample is wild if its neighbours lie on a smooth curve within their noise and it is off this curve. Jumps and
    corners are kept, and so is a signal of which more than 0.1 % of the samples look wild.
    """
    changed = dict(recording.signals)
    notes = list(recording.notes)
    span = max(_SHORTEST, round(_SPAN * recording.sample_rate))
    moving = {jet.of for equation in model.equations for jet in jets(equation) if jet.order >= 2}
    for one in model.signals:
        if one.kind != "sensor" or one.name not in moving:
            continue
        x = recording.signals[one.name]
        found = breaks(x, span, one.sd)
        for first, end in zip(*stretches(found), strict=True):
            if end - first > _LONGEST:
                found[first:end] = False
        bridged = np.where(found, np.nan, x)
        bridge(bridged, recording.sample_rate)
        replaced = found & np.isfinite(bridged)
        firsts, _ = stretches(replaced)
        if 0 < len(firsts) <= _MOST * len(x):
            changed[one.name] = np.where(replaced, bridged, x)
            many = f"{len(firsts)} wild samples of {one.name}" if len(firsts) > 1 else f"a wild sample of {one.name}"
            notes.append(f"{many} (at {recording.t[firsts[0]] + 2 / recording.sample_rate:.6g} s): interpolated")
    return replace(recording, signals=changed, notes=tuple(notes))
