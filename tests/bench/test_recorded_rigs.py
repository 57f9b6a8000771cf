"""What `bench recordings` does with a rig's two runs, on simulated ones: the real ones are not in this repository."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from bench import recorded_rigs
from bench.recordings import KEPT, SOURCES
from pvid.models.drive import Sines
from pvid.models.simulated_rig import SimulatedRig
from pvid.rig.run import Recording, write_recording
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import RigSimulation

SINGLE = next(source for source in SOURCES if source.name == "simple_pendulum")
TRUTH = {"J": 0.18, "G": 3.6, "b": 0.05, "c": 0.1, "o": 0.02}
DESIGN = recorded_rigs.Design(window_s=1.0, functions=9)


def simulated(tones: tuple[tuple[float, float, float], ...], seed: int) -> Recording:
    rig = SimulatedRig(
        model="simple_pendulum",
        truth=TRUTH,
        drive={"tau": Sines(tones)},
        sample_rate=250.0,
        duration=10.0,
        substeps=4,
        friction_width=0.3,
    )
    run = RigSimulation.of(SINGLE.model(), rig).run(seed, Imperfections(friction="sharp"))
    t = run.pop("t")
    return Recording(t, run, rig.sample_rate)


@lru_cache
def rig() -> recorded_rigs.Rig:
    runs = (simulated(((1.2, 0.5, 0.0), (0.9, 0.8, 1.0)), 0), simulated(((1.5, 0.6, 0.5), (0.6, 1.1, 0.0)), 1))
    return recorded_rigs.rig_of(SINGLE, runs, DESIGN)


def test_both_runs_give_the_truth_and_agree() -> None:
    truth = np.array([TRUTH[name] for name in rig().model.p_names])
    for one in rig().estimates:
        np.testing.assert_allclose(one.p[:2], truth[:2], rtol=0.01)
        assert (np.abs(one.p - truth) < 4 * one.se).all()
    assert (rig().clash() < recorded_rigs.CLASH).all()


def test_second_run_is_predicted_better_than_by_the_published_values() -> None:
    (row,) = recorded_rigs.prediction_rows(rig())
    assert row[:2] == ("simple_pendulum", "q")
    own, published = float(row[2]), float(row[4])
    assert own > 0.999
    assert published < own  # they are those of another rig


def test_tables_name_every_parameter_with_its_unit() -> None:
    rows = recorded_rigs.value_rows(rig())
    assert [row[1] for row in rows] == ["J kg*m^2", "G N*m", "b N*m*s/rad", "c N*m", "o N*m"]
    assert [row[4] for row in rows] == ["0.1396", "3.313", "0.1", "-", "-"]
    assert all(len(row) == len(recorded_rigs.HEADER) for row in rows)
    assert recorded_rigs.verdict_rows(rig())[0][0] == "simple_pendulum"


def test_bars_are_met_by_a_rig_that_is_its_model_and_missed_by_another() -> None:
    assert recorded_rigs.missed(rig()) == []
    first, second = rig().estimates
    wrong = replace(first, p=1.5 * first.p)
    sentences = recorded_rigs.missed(replace(rig(), estimates=(wrong, second)))
    assert len(sentences) == 2 and "R^2" in sentences[0] and "disagree on J, G" in sentences[-1]


def test_torque_that_is_a_law_of_the_angle_is_taken_for_feedback(tmp_path: Path) -> None:
    """Held weight: the torque is that of gravity at the measured angle, and the angle is moved by hand."""
    t = np.arange(3750) / 250.0
    q = 1.2 * np.sin(2 * np.pi * 0.3 * t) + 0.4 * np.sin(2 * np.pi * 0.7 * t)
    noisy = q + np.random.default_rng(1).normal(0.0, 2e-4, q.size)
    held = Recording(t, {"q": noisy, "tau": 3.3 * np.sin(noisy)}, 250.0)
    for trap in SINGLE.traps:
        path = tmp_path / SINGLE.name / f"{trap}.csv.gz"
        path.parent.mkdir(exist_ok=True)
        write_recording(path, held, SINGLE.channels)
    for row in recorded_rigs.trap_rows(SINGLE, tmp_path):
        assert "feedback" in row[2].split(", ")


def test_every_source_has_a_design() -> None:
    assert set(recorded_rigs.DESIGNS) == {source.name for source in (*SOURCES, *KEPT)}
