"""Analysis of a recording by the weak form in float64 (pvid.oracle.weak), of any mechanism with a compiled model."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.identification.answer import Analysis
from pvid.identification.values import values_of_found
from pvid.model.compiled import CompiledModel
from pvid.model.corners import feedthroughs
from pvid.model.normalise import with_own_scales
from pvid.model.together import offsets, shifted_sensors, with_own
from pvid.oracle.weak import work
from pvid.oracle.weak.edges import with_edges
from pvid.oracle.weak.failures import attempted
from pvid.oracle.weak.identify import Identified, identify
from pvid.oracle.weak.weights import Weights
from pvid.rig.run import Recording

_NOTHING = 1e-6  # of its guess: a positive parameter that has shrunk
_OF_SECOND = 1.5  # of a search's allowance of work, for the second one: where it succeeds, 1.0 suffices


@np.errstate(all="ignore")  # what diverges is judged, and told in words
def analysed(
    recording: Recording, model: CompiledModel, weights: Weights = "residuals", own: Collection[str] = ()
) -> Analysis:
    """Parameters of a mechanism from all segments of a recording.

    Raises PvidError when the recording is too short, or holds a signal beyond all reason.

    Parameters
    ----------
    own : unknowns that have a value of their own in each of several recordings
    weights : of the rows, as in pvid.oracle.weak.identify
    """
    model.refuse_robot()
    refuse_constant(recording, model)
    model = with_offsets_of(as_sampled(model, recording.ticks_between), recording)
    model = with_edges(model, recording.run, recording.sample_rate)
    names = [one.name for one in recording.origins]
    whole = with_own(model, own, names)
    found = identify(whole, recording.run, recording.sample_rate, weights=weights)
    if _collapsed(model, found) and (scaled := with_own_scales(model)) is not None:
        other = with_own(scaled, own, names)
        with work.limited(_OF_SECOND * found.allowance):
            again = attempted(lambda: identify(other, recording.run, recording.sample_rate, weights=weights))
        if again is not None and _determined(again) > _determined(found):
            whole, found = other, again
    model = whole if found.drifted is None else replace(whole, drifted=found.drifted)
    notes = *_of_own(model, own), *_of_edges(model), *_of_segments(recording, found)
    noted = replace(recording, notes=(*recording.notes, *notes))
    return Analysis(model, found, values_of_found(model, found), noted, weights)


def _determined(found: Identified) -> int:
    return sum(one.status == "identified" for one in found.judged)


def _collapsed(model: CompiledModel, found: Identified) -> bool:
    """Whether unknowns of a homogeneous row have shrunk to nothing together, or beside one that is not determined.

    A friction of the row that is 0 shrinks alone, and all others are determined.
    """
    rows = [{str(one) for theta in row.theta for one in theta.free_symbols} for row in model.rows if not row.known]
    guesses = {one.name: one.guess for one in model.unknowns if one.positive}
    names = [name if name in guesses else name.partition("[")[0] for name in found.names]  # m of m[A], too
    shrunk = {name for name, p in zip(names, found.p, strict=True) if p < _NOTHING * guesses.get(name, -np.inf)}
    sure = {name for name, one in zip(names, found.judged, strict=True) if one.status == "identified"} - shrunk
    return any(row & shrunk and not (row & sure and sure | shrunk >= {*names}) for row in rows)


def _of_edges(model: CompiledModel) -> Iterator[str]:
    """A note on each sensor that is sampled on one side of the jumps of an input."""
    for sensor, name in feedthroughs(model):
        if (edge := model.signal(sensor).edge) != "between":
            yield f"{sensor} jumps with {name}: its samples are those {edge} the jump"


def own_of(
    model: CompiledModel,
    recording: Recording,
    own: Sequence[str] = (),
    shared: Sequence[str] = (),
    *,
    in_c: bool = False,
) -> tuple[str, ...]:
    """Unknowns that have a value of their own in each of several recordings: these, and offsets of sensors.

    Raises PvidError for a name that is no unknown of the model, and where there is one recording, or the C core.

    Parameters
    ----------
    own, shared : names that were asked for
    in_c : for the C core, which has one value of each
    """
    for option, names in (("own", own), ("shared", shared)):
        for name in names:
            if name not in model.p_names:
                raise PvidError(f"{option} {name}: {model.name} has no such unknown; it has {listed(model.p_names)}")
    if both := [name for name in own if name in shared]:
        raise PvidError(f"{both[0]} is both own and shared")
    if own and not recording.origins:
        raise PvidError(f"own {own[0]}: a parameter has values of its own in several recordings, and there is one")
    if own and in_c:
        raise PvidError(f"own {own[0]}: the C core has one value of each parameter; identify in float64")
    if not recording.origins or in_c:
        return ()
    of_sensors = [name for name in offsets(model) if name not in shared]
    return tuple(name for name in model.p_names if name in own or name in of_sensors)


def _of_own(model: CompiledModel, own: Collection[str]) -> tuple[str, ...]:
    """A note on the parameters that each recording has of its own."""
    if not own:
        return ()
    text = f"each recording has its own {listed(own)}"
    of_sensors = [name for name in offsets(model.alone) if name in own]
    if of_sensors:
        be = "is the offset of a sensor" if len(of_sensors) == 1 else "are offsets of sensors"
        text += f" ({listed(of_sensors)} {be}; --shared {','.join(of_sensors)}: one value in all)"
    return (text,)


def _of_segments(recording: Recording, found: Identified) -> tuple[str, ...]:
    """A note on the segments of a recording that has several."""
    whole = recording.segments
    if len(whole) < 2:
        return ()
    grid, rate = found.fit.rows.record.grid, recording.sample_rate
    first = [int(grid.places[part.start]) for part in grid.parts]
    used = [(part.stop - part.start) / rate for part in whole if any(part.start <= one < part.stop for one in first)]
    left = [(part.stop - part.start) / rate for part in whole]
    for one in used:
        left.remove(one)
    text = f"identified from {len(used)} segments together, of {min(used):.3g} s to {max(used):.3g} s"
    if len(used) == 1:
        text = f"identified from one segment of {used[0]:.3g} s"
    if left:
        text += (
            f"; left out, as too short for a window or behind a lost integral: {len(left)}, {sum(left):.3g} s in all"
        )
    return (text,)


def as_sampled(model: CompiledModel, ticks_between: Mapping[str, float]) -> CompiledModel:
    """The model with white noise of slow sensors that has, at every tick, the density of theirs.

    Parameters
    ----------
    ticks_between : by signal: mean ticks from sample to sample, of those that were interpolated
    """
    if not ticks_between:
        return model
    signals = []
    for one in model.signals:
        between = ticks_between.get(one.name, 1.0)
        rounding = 1 / 12 if one.resolution else 0.0
        signals.append(replace(one, noise=float(np.sqrt(between * (rounding + one.noise**2) - rounding))))
    return replace(model, signals=tuple(signals))


def with_offsets_of(model: CompiledModel, recording: Recording) -> CompiledModel:
    """The model in which an offset of a sensor that never comes near its plausible range may be wherever the samples
    are, and starts at their median; without a drive, where a mechanism comes to rest, if that is beyond the range."""
    at_rest = not any(one.kind == "input" or one.driven for one in model.signals)
    unknowns = list(model.unknowns)
    for k, one in enumerate(unknowns):
        shifted = shifted_sensors(model, one)
        if one.positive or np.isfinite(one.bounds).any() or len(shifted) != 1:  # of two it is the difference
            continue
        [(name, sign)] = shifted
        low, guess, high = np.nanquantile(sign * recording.signals[name], [0.0, 0.5, 1.0]).tolist()
        if not (one.low <= guess <= one.high if at_rest else one.low <= high and low <= one.high):
            sd = max(one.sd, abs(guess - one.guess))
            unknowns[k] = replace(one, guess=guess, sd=sd, low=min(one.low, low), high=max(one.high, high))
    return replace(model, unknowns=tuple(unknowns))


def refuse_constant(recording: Recording, model: CompiledModel) -> None:
    """A sensor that never moves is dead or not connected."""
    for one in model.signals:
        if one.kind == "sensor" and np.nanmax(values := recording.signals[one.name]) == np.nanmin(values):
            raise PvidError(f"{one.name} has the same value in all {len(recording)} samples: is the sensor connected?")
