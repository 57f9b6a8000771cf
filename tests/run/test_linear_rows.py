"""Large angles: what linear rows lack is solved for in every window, and its error is in the fixed-point answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pvid.core.native import Native
from pvid.oracle.weak import remainder
from pvid.rig.file import Core, Nominal, RigFile
from pvid.run.identify import identify
from pvid.run.linear_rows import linear_error
from pvid.run.rows import RunRows
from pvid.run.survey import fitted
from pvid.setup.f32 import weak_design_of
from pvid.sim.pendulum import Pendulum, Simulation, Tone, simulate, standard_sensors

STANDARD = RigFile.standard()
# The first link swings some 8 times as far as the joint: passes around the circle of motion and lack run away.
FAR = Pendulum(l1=0.3, l2=0.33, rho2=0.12, g=9.8)
DRIVE = (Tone(0.02, 1.3), Tone(0.006, 3.1, 1.0))


def far_run(rate: float = 0.05) -> Simulation:
    """0.06 rad at the joint, with `rate` 0 0.11 rad, and eight times that at the pivot."""
    return simulate(
        FAR,
        drive=DRIVE,
        sensors=standard_sensors(16),
        sample_rate=500.0,
        duration=30.0,
        release=(0.1, rate),
        truth="full",
        seed=1,
    )


def rig_of(core: Core) -> RigFile:
    return replace(
        STANDARD,
        sample_rate=None,
        l1_sd=0.0,
        sensor=replace(STANDARD.sensor, y_gain_sd=0.0),
        nominal=Nominal(g=FAR.g, l2=FAR.l2, rho2=FAR.rho2),
        identifier=replace(STANDARD.identifier, core=core),
    )


def test_the_error_of_linear_rows_is_what_they_are_off() -> None:
    far = far_run()
    rig = fitted(rig_of("q31"), far.run)
    at = np.append(far.p, 0.0)
    linear = RunRows.of(rig, far.run, weak_design_of(rig, far.run.sample_rate)).fitted(at)
    off = linear.p[:3] / far.p - 1
    assert np.abs(off).max() > 0.02
    found = linear_error(rig, far.run, at)
    assert found is not None
    assert np.abs(found - off).max() < 0.1 * np.abs(off).max()


def test_fixed_point_covers_its_linear_rows_and_float32_corrects_them(native: Native) -> None:
    far = far_run()
    fixed, float32 = (identify(far.run, rig_of(core), native) for core in ("q31", "f32"))
    assert fixed.identified and fixed.warning is None and float32.identified
    for at, name in enumerate(("w", "d1", "d2")):
        assert abs(fixed.value[name] - far.p[at]) < 2 * fixed.se[name]
        assert fixed.se[name] > 0.01 * far.p[at]
        assert abs(float32.value[name] - far.p[at]) < max(0.003 * far.p[at], 2 * float32.se[name])
    published = fixed.publications
    assert len(published.t) > 20
    assert (np.abs(published.p - far.p) < 3 * published.se).all()


def test_uncorrectable_angles_give_no_fixed_point_answer(native: Native) -> None:
    run = simulate(
        FAR, DRIVE, standard_sensors(16), sample_rate=500.0, duration=30.0, release=(0.2, 0.05), truth="full", seed=1
    ).run
    result = identify(run, rig_of("q31"), native)
    assert not result.identified and result.status == "held out of range"


def test_a_window_is_solved_for_where_passes_run_away() -> None:
    far = far_run(0.0)
    rig = fitted(rig_of("f32"), far.run)
    design = weak_design_of(rig, far.run.sample_rate)
    rows = RunRows.of(rig, far.run, design).thinned(60)
    at, none = np.append(far.p, 0.0), np.zeros(2)
    passes = [
        [remainder(at, none, *one, design, count).y for count in (2, 3)]
        for one in zip(rows.columns, rows.phi, rows.u, strict=True)
    ]
    moved = [np.linalg.norm(b - a) / np.linalg.norm(b) for a, b in passes]
    assert np.max(moved) > 0.1
    corrected = rows.corrected(at)
    assert corrected.sound is not None and corrected.sound.all()
    # what is left is noise: the rows as they are leave twenty times as much and more
    assert corrected.judged(at).chi2 < 0.05 * rows.judged(at).chi2
