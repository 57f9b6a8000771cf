"""The pendulum through the weak engine: what is no answer, and where there is no compiler."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.advised import answered
from pvid.run.engine_identify import identify_by_engine
from pvid.settings.engine_cores import ENGINE_CORES
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors


@cache
def run_of() -> Run:
    return simulate(truth="full", duration=10.0, seed=3).run


def test_without_a_compiler_the_analysis_answers_and_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    found = identify_by_engine(run_of(), RigFile.standard())
    assert found.identified and found.core == "f64" and found.hash is None
    assert "needs a C compiler" in found.remarks[0]
    for name, truth in zip(("w", "d1", "d2"), STANDARD_PENDULUM.linear, strict=True):
        assert abs(found.value[name] - truth) < 3 * found.se[name]


def test_an_offset_between_two_counts_biases_no_core() -> None:
    """A fraction of a count taken off the encoder: in fixed point rounding to counts would move c by ten errors."""
    run = simulate(sensors=standard_sensors(12), truth="linear", duration=20.0, sample_rate=500.0).run
    rig = replace(RigFile.standard(), sample_rate=500.0)
    rig = replace(rig, sensor=replace(rig.sensor, phi_lsb=2 * np.pi / 2**12))
    counts = run.phi / rig.sensor.phi_lsb
    assert abs(counts[0] - round(counts[0])) > 0.1
    one, other = (
        identify_by_engine(run, replace(rig, identifier=replace(rig.identifier, core=engine.name)))
        for engine in ENGINE_CORES.values()
    )
    assert (one.core, other.core) == ("f32", "q31")
    # the finer counts leave less than a thousandth of a count, a fifth of an error here
    assert abs(one.value["c"] - other.value["c"]) < 0.25 * one.se["c"]
    assert not any("disagree on" in text and "core" in text for text in other.doubts or ())


def test_the_other_law_is_refused() -> None:
    rig = RigFile.standard()
    other = replace(rig, identifier=replace(rig.identifier, law="pseudovelocity"))
    with pytest.raises(PvidError, match="stationary law alone"):
        answered(run_of(), other, Native())


def test_a_run_that_no_pendulum_makes_is_no_answer_and_starts_nothing_wild() -> None:
    """White noise for an angle: the fit ends anywhere, and the answer is a start near the guess."""
    noise = np.random.default_rng(1).normal(0.0, 0.05, len(run_of().t))
    rig = replace(RigFile.standard(), identifier=replace(RigFile.standard().identifier, core="f64"))
    found = identify_by_engine(replace(run_of(), phi=noise), rig)
    assert not found.identified and found.trusted_s is None and not found.publications.t.size
    guess = rig.mechanism.mapped([rig.nominal.g, rig.nominal.l2, rig.nominal.rho2])
    assert all(1 / 20 < found.value[name] / one < 20 for name, one in zip(("w", "d1", "d2"), guess, strict=True))
