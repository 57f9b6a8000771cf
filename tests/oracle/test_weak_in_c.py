"""The weak identifier in C float32 against the float64 oracle with the same design, on rigs without sharp friction."""

import numpy as np
import pytest
from weak_rig import noise_in_c, weak_rig

from pvid.base.errors import PvidError
from pvid.configuration.weak_tables import design_tables
from pvid.oracle.weak import rows
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.rows import EquationError
from pvid.oracle.weak.solve import batch

# In standard errors. The identifier weighs the rows of its first windows at a poor p, the oracle all at the last one.
CLOSE = 0.1


@pytest.mark.parametrize(
    ("name", "soft"),
    [
        ("battery_2rc", False),
        ("cart_pendulum", True),
        ("dc_motor", True),
        ("furuta", False),
        ("kapitza", False),
        ("rigid_body", False),
        ("two_link_arm", True),
        ("two_mass_drive", True),
    ],
)
def test_the_identifier_s_p_is_that_of_the_oracle(name: str, soft: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    # The oracle's ridge takes information away where there are many test functions; the identifier has none.
    monkeypatch.setattr(rows, "_RIDGE", 1e-14)
    rig = weak_rig(name, soft=soft)
    core = rig.native.identifier_of(rig.config)
    record = core.run_samples(rig.samples)
    design = rig.config.design
    used = core.counters["rows"] // (design.functions * design.model.kinds)
    assert used >= len(rig.rows.numbers) - 2  # the last window's work takes half a window
    own = rig.rows.only(slice(0, used))
    own.noise = noise_in_c(own)
    fit = batch(own, rig.config.estimator.start.astype(np.float64), equation_error=False)
    se = uncertainty(fit).predicted
    close = CLOSE * se
    if name == "battery_2rc":
        # The charge before the first step, two samples: the identifier takes the current for that of the first step.
        close[-1] = 2 / rig.config.sample_rate * np.ptp(rig.samples[:3, 1]) * rig.truth[-2]
    assert (np.abs(record.p[-1] - fit.p) < close).all(), (record.p[-1] - fit.p) / se


def test_an_error_of_the_equations_beyond_float32_is_refused_with_its_reason() -> None:
    """At parameters far off it is so large; float32 would make it infinite, and the core call the design bad."""
    rig = weak_rig("kapitza")
    with pytest.raises(PvidError, match=r"variance of the equations' own error of 8e\+44 is beyond float32"):
        design_tables(rig.config.design.model, rig.rows, rig.truth, [EquationError(8e44)] * rig.rows.kinds)


def test_parameters_that_ran_away_are_refused_with_their_reason() -> None:
    """Their noise would have no finite weights, and the core call the design bad."""
    rig = weak_rig("kapitza")
    errors = [EquationError(0.0)] * rig.rows.kinds
    with pytest.raises(PvidError, match="coefficient of .* is beyond float32: the equations do not fit"):
        design_tables(rig.config.design.model, rig.rows, 1e39 * rig.truth, errors)
