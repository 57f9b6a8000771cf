"""Rigs with the imperfections that the refinement fits: dry friction, a play of the encoder, both at once."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from campaign_rigs import MOTION, RELEASE, RIG

from bench.campaign.judge import identify_rig
from bench.campaign.motion import accelerations, integrate, step_of
from bench.campaign.population import RandomRig
from bench.campaign.truth import SimulatedRig, measure, rig_file
from pvid.core.native import Native
from pvid.identification.answer import Analysis
from pvid.rig.run import Run

_PENDULUM = RIG.pendulum
_DRY = 1e-3 * _PENDULUM.g * _PENDULUM.l2  # of pivot and joint [m^2/s^2]
_SLIP = 5e-3  # rad/s: the friction is full from here on


def recorded(native: Native, rig: RandomRig) -> SimulatedRig:
    """The standard rig's run with the imperfections of `rig`."""
    steps, step_s = step_of(_PENDULUM, rig.modes_hz[1], MOTION, rig.dry, _SLIP, rig.duration + 1 / rig.sample_rate)
    acceleration = accelerations(MOTION, steps, step_s)
    state = integrate(native, _PENDULUM, [*RELEASE, 0.0, 0.0], acceleration, step_s, dry=rig.dry, slip=_SLIP)
    assert state is not None
    phi, y = measure(rig, state, step_s)
    t = np.arange(len(phi)) / rig.sample_rate
    run = Run(t=t, phi=rig.phi_lsb * phi.astype(float), y=rig.y_lsb * y.astype(float), sample_rate=rig.sample_rate)
    largest = float(np.abs(state[:, 1] - state[:, 0]).max())
    return SimulatedRig(rig, run, rig_file(rig), _PENDULUM.linear, np.full(3, 1e-4), largest)


@pytest.mark.parametrize(
    ("imperfections", "found"),
    [
        pytest.param(
            {"dry": (_DRY, _DRY)},
            {"f1": _DRY / _PENDULUM.l1**2, "f2": _DRY / _PENDULUM.l1**2},
            marks=pytest.mark.long,
        ),
        pytest.param({"backlash": 4e-3}, {"play": 2e-3}, marks=pytest.mark.long),
        ({"dry": (_DRY, _DRY), "backlash": 4e-3}, {"f2": _DRY / _PENDULUM.l1**2, "play": 2e-3}),
    ],
    ids=["dry friction", "a play", "both"],
)
def test_an_imperfection_is_fitted_and_the_answer_is_right(
    native: Native, imperfections: dict[str, object], found: dict[str, float]
) -> None:
    """Without its equation each is refused, or moves w, d1 and d2 by many standard errors."""
    record, answer = identify_rig(recorded(native, replace(RIG, **imperfections)))  # type: ignore[arg-type]
    assert record["published"] and record["answered"] and not record["silently_wrong"]
    assert isinstance(answer, Analysis) and answer.refinement is not None and answer.refinement.adopted
    assert isinstance(record["worst_error"], float) and record["worst_error"] < 0.005
    extras = answer.refinement.as_json()["parameters"]
    for name, truth in found.items():
        value, se = extras[name]["value"], extras[name]["se"]
        assert math.isclose(value, truth, rel_tol=0.1) or abs(value - truth) < 4 * se, name
