"""The dead zone: p rests while the data ask for less than noise explains; its rule in the weak form."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from weak_rig import weak_rig

from pvid.codegen.weak_library import weak_native_q31
from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.models.mechanisms import compiled_of

Float = npt.NDArray[np.float64]
Played = tuple[Float, Float, dict[str, int]]


def in_float(dead_zone: float) -> Played:
    """The end p of the pendulum's shipped rig in the weak form, its published standard errors, the counters."""
    rig = weak_rig("kapitza")
    estimator = replace(rig.config.estimator, dead_zone=dead_zone)
    core = rig.native.identifier_of(replace(rig.config, estimator=estimator))
    record = core.run_samples(rig.samples, hashes=False)
    return np.array(record.p[-1], np.float64), np.array(core.estimate["se"][:4], np.float64), core.counters


def in_fixed_point(dead_zone: float) -> Played:
    """The same in fixed point."""
    weak, rig = weak_q31_for_simulated_rig(compiled_of("kapitza")), weak_rig("kapitza")
    estimator = replace(weak.config.estimator, dead_zone=round(dead_zone * 2**16))
    config = replace(weak.config, estimator=estimator)
    core = weak_native_q31(weak.made, weak.parameters, config).identifier()
    samples = dict(zip(weak.sample_names, rig.samples.T, strict=True))
    record = core.run_samples(weak.counts_of(samples), hashes=False)
    return weak.values(record.p[-1]), weak.values(core.estimate["se"][:4]), core.counters


@pytest.mark.parametrize("played", [in_float, in_fixed_point])
def test_p_stays_within_the_zone_of_the_solution(played: Callable[[float], Played]) -> None:
    """As far as the zone says from the answer without one, hardly moved, and the published errors are no smaller."""
    (end, error, counters), (rested, as_before, at_rest) = played(0.0), played(1.0)
    # each parameter within one standard error: the zone bounds the largest of all combinations
    assert (np.abs(rested - end) <= 1.02 * error).all()
    # not smaller; the scores of windows scatter more where p is off by up to a standard error
    assert (as_before >= 0.98 * error).all() and (as_before <= 1.1 * error).all()
    assert counters["in_dead_zone"] == 0
    assert at_rest["updates"] + at_rest["in_dead_zone"] == counters["updates"]  # the same solves
    assert at_rest["in_dead_zone"] > 0.5 * counters["updates"]  # and most of them needed no step
