"""Front end, channels and sums of the fixed-point weak engine: C and twin bit for bit, both near the float64 oracle."""

from __future__ import annotations

import numpy as np
import pytest
from weak_q31 import DESIGNS, Core, Rig, core_in, rig

from pvid.base.errors import PvidError
from pvid.codegen.weak_q31 import JetReaches, fixed_weak
from pvid.design.weak_q31 import Sensing, fixed_design
from pvid.settings.weak import NONE
from pvid.twin.q31 import weak_collect
from pvid.twin.q31.weak_collect import Tick

TICKS = 3000
_TOLERANCE = 2.0**-15  # of the sum of |channel|: the cosine has 16 bits; as much again for the rest


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Core:
    return core_in(tmp_path_factory.getbasetemp() / "weak_q31")


@pytest.fixture(params=DESIGNS)
def one(request: pytest.FixtureRequest) -> Rig:
    return rig(request.param, TICKS)


def test_c_and_twin_have_the_same_sums_after_the_same_ticks(one: Rig, core: Core) -> None:
    found = weak_collect.collect(one.counts, one.design)
    windows, ticks = core.windows(one, one.counts)
    assert len(windows) >= 3
    assert np.array_equal(windows, found.windows)
    assert np.array_equal(ticks, found.ticks)


def test_counts_beyond_full_scale_and_wild_jets_restart_c_and_twin_alike(one: Rig, core: Core) -> None:
    counts = one.counts.copy()
    full = np.array(one.design.full_scale)
    counts[:, 700] = full  # a spike within full scale: derivatives beyond their reach
    counts[0, 1500] = full[0] + 1
    found = weak_collect.collect(counts, one.design)
    windows, ticks = core.windows(one, counts)
    assert ticks[1500] == Tick.REJECTED
    assert np.array_equal(ticks, found.ticks)
    assert np.array_equal(windows, found.windows)


def test_extreme_counts_overflow_nothing(one: Rig, core: Core) -> None:
    """The library traps signed overflow; the twin's int64 does not, and both agree."""
    random = np.random.default_rng(7)
    full = np.array(one.design.full_scale)[:, np.newaxis]
    slow = np.sign(np.sin(np.arange(TICKS) / random.uniform(50, 400, (len(full), 1))))
    for counts in (
        full * slow,
        full * random.choice([-1, 0, 1], (len(full), TICKS)),
        full * np.ones((1, TICKS)),
    ):
        given = counts.astype(np.int64)
        windows, ticks = core.windows(one, given)
        found = weak_collect.collect(given, one.design)
        assert np.array_equal(ticks, found.ticks)
        assert np.array_equal(windows, found.windows)


def test_sums_are_those_of_the_oracle(one: Rig) -> None:
    """Of the same counts: within the rounding of the cosine and of the channels."""
    found = weak_collect.collect(one.counts, one.design).windows
    wanted = one.oracle_sums()
    count = min(len(found), len(next(iter(wanted.values()))))
    for place, channel in enumerate(one.design.model.channel):
        sums = found[:count, place] * one.design.units[place]
        reference, size = wanted[place][:count], one.sizes()[place]
        if channel.gain != NONE and "run_" in one.made.gain_names[channel.gain]:
            # a run begins at the first step here and at the first sample there: a constant
            sums, reference = sums[:, 1:], reference[:, 1:]
        assert np.max(np.abs(sums - reference)) <= _TOLERANCE * size, (place, channel)


def test_a_quantity_that_does_not_fit_is_named() -> None:
    one = rig("kapitza", TICKS)
    with pytest.raises(PvidError, match="has no jet phi_7: its jets are"):
        fixed_weak(one.made, JetReaches(of={"phi_7": 1.0}))
    with pytest.raises(PvidError, match="full scale of sample 0 is 33554432 counts"):
        fixed_design(
            one.design.model,
            one.tables,
            Sensing(one.lsb, (2**25, 9), 1000.0),
            one.fixed.formats,
        )
