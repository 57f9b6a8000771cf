"""A quick identification of a pendulum's run, to see whether a suspected mistake in it explains the run better.

The rows of the weak form in float64, with windows of a few lengths about a period of the motion and two filters: some
tenths of a second. `identify` tries more designs and judges the answer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pvid.base.errors import PvidError
from pvid.models.model import Model
from pvid.oracle.weak.choice import Scored, lengths, made, power_of, score_of
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.rows import Compiled, WeakRows
from pvid.oracle.weak.starts import starts_about
from pvid.rig.described import described
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.rig.sensor_steps import resolved
from pvid.run.mechanism import model_of

_LENGTHS = 3  # of windows
_PERIODS = 1.0  # of the dominant motion, in the middle one
_FILTERS = ((101, 6), (41, 4))  # samples and degree of the derivatives' polynomials
_FEWEST = 8  # windows
_MISFIT = 4.0  # chi^2 above which the answer is doubted


@dataclass(frozen=True)
class Trial:
    """What a quick identification found.

    Attributes
    ----------
    model : of the mechanism
    value : mapped parameters, the offset, and inside the physical region the physical ones
    chi2 : variance of the residuals over what the sensors' noise explains
    identified : every parameter has a value that means something
    """

    model: Model
    value: dict[str, float]
    chi2: float
    identified: bool

    @property
    def warning(self) -> str | None:
        """Why the answer is doubted; None: it is not."""
        return "the residuals exceed the sensors' noise" if self.chi2 > _MISFIT else None


def trial_of(run: Run, rig: RigFile) -> Trial | None:
    """The best of a few designs; None where none fits the run.

    Gaps in the run are left out as `identify` does.
    """
    try:
        run = run.whole()
        rig = resolved(rig, run)
        found = _best(ready(model_of(described(rig))), run)
    except PvidError:
        return None
    if found is None:
        return None
    mechanism = rig.mechanism
    model = mechanism.model
    value = dict(zip((*model.mapped_names, model.offset_name), map(float, found.p), strict=True))
    physical = mechanism.physical(found.p)
    if np.isfinite(physical).all():
        value.update(zip(model.physical_names, map(float, physical), strict=True))
    return Trial(model, value, found.chi2, found.known and model.is_plausible(found.p))


def rows_near(run: Run, rig: RigFile, p: Float) -> WeakRows | None:
    """Rows of the design that suits parameters p [n_p] best; None where none fits the run."""
    rig = resolved(rig, run)
    model = ready(model_of(described(rig)))
    found = [*_scored(model, _signals(run), _designs(model, run), p)]
    if not found:
        return None
    best = min(found, key=lambda one: (not one.known, one.score))
    return WeakRows.of(model, _signals(run), best.design)


def _signals(run: Run) -> dict[str, Float]:
    return {"phi": run.phi, "y": run.y}


def _designs(model: Compiled, run: Run) -> list[WeakDesign]:
    """Windows of about a period of the motion; in a long run the longest ones would not see it."""
    wanted = np.log(_PERIODS / dominant_hz(run))
    possible = lengths(len(run.t), run.sample_rate)
    near = sorted(sorted(possible, key=lambda one: abs(np.log(one) - wanted))[:_LENGTHS], reverse=True)
    basis = WeakDesign(run.sample_rate, 64 / run.sample_rate, 12, power_of(model), rate_taps=21, rate_degree=3)
    return [
        made(basis, window_s=length, rate_taps=taps, rate_degree=degree) for taps, degree in _FILTERS for length in near
    ]


@np.errstate(all="ignore")  # what diverges from a start is judged and left out
def _best(model: Compiled, run: Run) -> Scored | None:
    signals, designs = _signals(run), _designs(model, run)
    found = [one for one in _scored(model, signals, designs, None) if one.known]
    if not found:  # from other starts than the guess
        starts = starts_about(model.parameters, model.parameters.checked(None))
        found = [one for start in starts for one in _scored(model, signals, designs[:1], start) if one.known]
    return min(found, key=lambda one: (one.chi2 > _MISFIT, one.score), default=None)


def _scored(
    model: Compiled, signals: dict[str, Float], designs: list[WeakDesign], start: Float | None
) -> Iterator[Scored]:
    for design in designs:
        one = score_of(model, signals, design, start, False, _FEWEST)
        if one is not None:
            yield one


def dominant_hz(run: Run) -> float:
    """Frequency of the largest value of phi's spectrum [Hz]; at least two periods per run."""
    phi = np.where(np.isfinite(run.phi), run.phi, np.nanmedian(run.phi))
    power = np.abs(np.fft.rfft((phi - phi.mean()) * np.hanning(len(phi)))) ** 2
    return float(max(2, int(np.argmax(power[2:])) + 2)) * run.sample_rate / len(phi)
