"""Twin of weak/weak_step_f32.c: from the jets of a stretch's steps to its channels, all steps at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.settings.weak import NONE, WeakDesign32
from pvid.twin.f32 import elementary

Float32 = npt.NDArray[np.float32]

_F = np.float32
_LATER = 2  # steps from a step's jets to its channels


@dataclass
class Runs:
    """Integrals since the start of the run, kept over gaps, and what rounding took off [runs].

    lead: from the run's first sample to its first step [s]
    """

    value: npt.NDArray[Any]
    low: npt.NDArray[Any]
    lead: np.float32
    ran: bool = False

    @classmethod
    def of(cls, design: WeakDesign32, lead: np.float32) -> Runs:
        """At the start of a run."""
        nothing = np.zeros(design.model.runs, np.float32)
        return cls(nothing, nothing, lead)

    def at_steps(self, rates: Float32, dt: np.float32, before: Float32, plain: Float32) -> Float32:
        """Their values at the steps of a stretch [runs, steps] from their derivatives [runs, steps].

        Parameters
        ----------
        before : their derivatives at the outputs before the first step [runs, outputs]
        plain : at the first step without derivatives of signals [runs, 1]; where it differs from `rates`, that of the
            first step counts since the first sample
        """
        out = np.empty_like(rates)
        half_dt = _F(0.5) * dt
        for step in range(rates.shape[1]):
            if step:
                rise = half_dt * (rates[:, step - 1] + rates[:, step]) + self.low
                moved = self.value + rise
                self.low = rise - (moved - self.value)
                self.value = moved
            elif not self.ran:
                whole = np.zeros_like(self.value)
                for place in range(before.shape[1]):
                    whole = whole + dt * before[:, place] if place else half_dt * before[:, place]
                known = (self.lead > 0) & (plain[:, 0] == rates[:, 0])
                self.value = np.where(known, whole + half_dt * rates[:, 0], self.lead * rates[:, 0])
                self.ran = True
            out[:, step] = self.value
        return out


@dataclass(frozen=True)
class Values:
    """Of one stretch.

    Attributes
    ----------
    channels : that are summed [steps, channels]
    edges : I^1 and I^2 of the integrands at the end of every half window, from its start [halves, 2, integrands]
    """

    channels: Float32
    edges: Float32


def mean_signs(v: Float32) -> Float32:
    """Means of sgn over the steps but the last one [signs, steps - 1] of arguments [signs, steps]."""
    slope = np.empty_like(v[:, 1:])
    slope[:, :1] = v[:, 1:2] - v[:, :1]
    slope[:, 1:] = _F(0.5) * (v[:, 2:] - v[:, :-2])
    twice = _F(2) * v[:, :-1]
    size = elementary.magnitude(slope)
    inside = np.where(size > 0, twice / size, _F(0))
    return np.where(twice > size, _F(1), np.where(twice < -size, _F(-1), inside)).astype(np.float32, copy=False)


def _integrals(f: Float32, hop: int, dt: np.float32) -> tuple[Float32, Float32]:
    """I^1 and I^2 from the start of each half [halves, hop + 1, integrands]; the last place is the half's end.

    f: integrands at the steps [steps, integrands]; halves that are not whole are garbage where there is no step.
    """
    steps = len(f)
    part, half, bend = dt / _F(24), _F(0.5) * dt, (dt * dt) / _F(60)
    # rises from the step before to each step; the first and the last one have none
    rise, outside = np.zeros_like(f), np.zeros_like(f)
    if steps > 2:
        last, now, behind = f[:-2], f[1:-1], f[2:]
        before = np.concatenate([_F(2) * last[:1] - now[:1], last[:-1]])
        rise[1:-1] = part * (((-before + _F(13) * last) + _F(13) * now) - behind)
        outside[1:-1] = bend * ((behind - before) - _F(8) * (now - last))
    halves = -(-steps // hop)
    places = np.minimum(hop * np.arange(halves)[:, None] + np.arange(hop + 1), steps - 1)
    own = rise[places]
    own[:, 0] = 0
    once = np.add.accumulate(own, axis=1, dtype=np.float32)
    more = np.zeros_like(once)
    more[:, 1:] = half * (once[:, :-1] + once[:, 1:]) + outside[places][:, 1:]
    return once, np.add.accumulate(more, axis=1, dtype=np.float32)


def _leads(jets: Float32, design: WeakDesign32, early: Float32) -> tuple[Float32, Float32]:
    """Derivatives of the runs before the first step [runs, outputs], and at it without those of signals [runs, 1]."""
    model = design.model
    if not model.runs or model.prepare is None:
        return np.zeros((0, 0), np.float32), np.zeros((0, 1), np.float32)
    orders = np.array([one.order for one in model.jet])
    plain = np.where(orders[:, None] == 0, jets[:, :1], _F(0))
    return model.prepare(early)[: model.runs], model.prepare(plain)[: model.runs]


def values(jets: Float32, design: WeakDesign32, runs: Runs, dt: np.float32, early: Float32) -> Values:
    """Channels of a stretch from its jets [jets, steps] and those before the first step [jets, outputs]; moves the
    runs."""
    model, hop = design.model, design.hop
    steps = jets.shape[1]
    summed = [one for one in model.channel if one.gain != NONE]
    nothing = Values(np.zeros((0, len(summed)), np.float32), np.zeros((0, 2, model.integrands), np.float32))
    with np.errstate(all="ignore"):
        arguments = np.zeros((0, steps), np.float32) if model.prepare is None else model.prepare(jets)
        of_runs = runs.at_steps(arguments[: model.runs], dt, *_leads(jets, design, early))
        if steps <= _LATER:
            return nothing
        v = arguments[model.runs :]
        width = np.asarray(design.sign_width, np.float32)[:, None]
        signs = np.where(width > 0, elementary.tanh(v[:, :-1] / width), mean_signs(v))
        found = model.values(np.concatenate([jets[:, :-1], of_runs[:, :-1], signs.astype(np.float32, copy=False)]))
        gains, integrands = found[: model.gains], found[model.gains :].T
        once, twice = _integrals(integrands, hop, dt)
        known = steps - _LATER
        index = np.arange(known) % hop
        t = dt * index.astype(np.float32)
        of_steps = [one[:, :hop].reshape(len(one) * hop, model.integrands) for one in (once, twice)]
        channels = np.empty((known, len(summed)), np.float32)
        for place, one in enumerate(summed):
            gain = gains[one.gain, :known]
            if one.fold and one.integrand == NONE:
                gain = gain * (t if one.fold == 1 else _F(0.5) * (t * t))
            elif one.fold:
                gain = gain * of_steps[one.fold - 1][:known, one.integrand]
            channels[:, place] = gain
    return Values(channels, np.stack([once[:, hop], twice[:, hop]], axis=1))
