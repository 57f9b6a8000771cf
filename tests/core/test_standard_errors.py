"""Standard errors of sums that lost their digits: none is smaller than the sensors allow."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pvid.core.native import Native
from pvid.rig.file import Nominal, RigFile
from pvid.run.identify import identify
from pvid.settings.enums import Core
from pvid.sim.pendulum import Sensors, simulate

BITS = 17


@pytest.mark.parametrize("core", ["f32", "q31"])
def test_a_large_step_leaves_standard_errors(core: Core) -> None:
    """A fine encoder and a guess that is far off: after the first steps nothing is left of the residuals' sum of
    squares in float32. Without a floor under it the core publishes standard errors of exactly 0.

    The float64 oracle keeps the digits; its rows of the far start count more, so that its errors may be smaller.
    """
    sensors = Sensors(phi_lsb=2 * math.pi / 2**BITS, y_lsb=1e-7)
    run = simulate(duration=20.0, sensors=sensors, seed=1).run
    rig = RigFile.standard()
    guess = Nominal(l2=0.5 * rig.nominal.l2, rho2=1.8 * rig.nominal.rho2, g=0.65 * rig.nominal.g)
    fixed = replace(rig.identifier, core=core, survey=False, full_angle=False)
    sensor = replace(rig.sensor, phi_lsb=sensors.phi_lsb, y_lsb=sensors.y_lsb, y_gain_sd=0.0)
    rig = replace(rig, sensor=sensor, l1_sd=0.0, nominal=guess, identifier=fixed)
    found = identify(run, rig, Native())
    known = replace(rig, nominal=RigFile.standard().nominal, identifier=replace(fixed, core="f64", survey=True))
    best = identify(run, known, Native())
    published = found.publications
    assert found.identified and len(published.t) > 0
    assert (published.se > 0).all()
    for name in ("w", "d1", "d2"):
        assert found.se[name] > 0.5 * best.se[name]
