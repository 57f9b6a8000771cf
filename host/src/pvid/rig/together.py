"""Several recordings of one mechanism as one: each is a segment, or several, that no window leaves.

They have one sample rate. A clock that is off by up to 5 % is not another rate: such a recording is interpolated at the
times of the first one's.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.rig.clock import RATE_LIMIT, RATE_TOLERANCE, interpolated
from pvid.rig.columns import Columns
from pvid.rig.gaps import longest_bridged
from pvid.rig.run import Origin, Recording
from pvid.rig.table import Table, row_place

# Ticks between two recordings, at least: nothing is interpolated over so many, by the C core neither.
_APART = 64


def names_of(paths: Sequence[Path]) -> tuple[str, ...]:
    """A short name for each file: its stem, with the folder in front where two have the same one.

    Raises PvidError where a file is given twice.
    """
    twice = [one for one, times in Counter(path.resolve() for path in paths).items() if times > 1]
    if twice:
        raise PvidError(f"{twice[0].name} is given twice: its samples count once")
    stems = [path.name.removesuffix(".gz").rsplit(".", 1)[0] or path.name for path in paths]
    alike = {one for one, times in Counter(stems).items() if times > 1}
    long = [f"{path.resolve().parent.name}/{stem}" for path, stem in zip(paths, stems, strict=True)]
    names = [full if stem in alike else stem for stem, full in zip(stems, long, strict=True)]
    if len(set(names)) < len(names):
        names = [f"{stem}_{number}" for number, stem in enumerate(stems, 1)]
    return tuple(names)


def joined(recordings: Sequence[Recording], names: Sequence[str], columns: Columns) -> Recording:
    """Recordings one behind the other, with missing ticks between them; a single one as it is.

    The times of the second and the others follow those before them.

    Raises PvidError where a sample rate is another one than that of the first.

    Parameters
    ----------
    names : of each, in notes and answers
    columns : which signals are held
    """
    first, *others = recordings
    if not others:
        return first
    rate = first.sample_rate
    parts = [
        first,
        *(_at_rate(one, rate, name, names[0], columns) for one, name in zip(others, names[1:], strict=True)),
    ]
    apart = max(_APART, longest_bridged(rate) + 2)
    gap = {name: np.full(apart, np.nan) for name in first.signals}
    times, signals = [first.t], {name: [one] for name, one in first.signals.items()}
    origins = [Origin(names[0], 0, len(first))]
    for part, name in zip(parts[1:], names[1:], strict=True):
        end = times[-1][-1]
        times += [end + np.arange(1, apart + 1) / rate, end + (apart + 1) / rate + (part.t - part.t[0])]
        for key, own in signals.items():
            own += [gap[key], part.signals[key]]
        begin = origins[-1].end + apart
        origins.append(Origin(name, begin, begin + len(part)))
    t = np.concatenate(times)
    begins = listed(f"{one.name} from {t[one.first]:.6g} s" for one in origins)
    notes = [f"{name}: {note}" for part, name in zip(parts, names, strict=True) for note in part.notes]
    return Recording(
        t,
        {name: np.concatenate(own) for name, own in signals.items()},
        rate,
        (*notes, f"{len(parts)} recordings are identified together; their times follow each other: {begins}"),
        _ticks_between(parts),
        tuple(origins),
    )


def _at_rate(one: Recording, rate: float, name: str, name_of_first: str, columns: Columns) -> Recording:
    """A recording at the first one's sample rate [Hz]."""
    off = one.sample_rate / rate - 1
    if abs(off) <= RATE_TOLERANCE:
        return one
    if abs(off) > RATE_LIMIT:
        raise PvidError(
            f"{name} is sampled at {one.sample_rate:.6g} Hz and {name_of_first} at {rate:.6g} Hz: recordings that are "
            "identified together have one sample rate; resample one of them, or identify each by itself"
        )
    table = Table(Path(name), one.t, one.signals, columns, row_place)
    t, signals = interpolated(table, rate, 1 / one.sample_rate)
    note = f"its clock is {100 * off:+.2g} % off that of {name_of_first}: it is interpolated at {rate:g} Hz"
    return replace(one, t=t, signals=signals, sample_rate=rate, notes=(*one.notes, note))


def _ticks_between(parts: Sequence[Recording]) -> dict[str, float]:
    """Of each sensor that is slower in some of the recordings, the mean over all samples."""
    slow = {name for part in parts for name in part.ticks_between}
    samples = np.array([len(part) for part in parts], np.float64)
    return {
        name: float(np.average([part.ticks_between.get(name, 1.0) for part in parts], weights=samples)) for name in slow
    }
