"""The report of a recording, and the residuals in it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import field_board
import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

from pvid.base.errors import PvidError
from pvid.cli.main import commands
from pvid.core.native import Native
from pvid.link import frames as link
from pvid.log.file import LogWriter
from pvid.log.reader import LogReader
from pvid.log.values import Values
from pvid.models.kapitza.modes import modes_hz
from pvid.rig.file import Nominal, RigFile
from pvid.rig.run import Run, write_run
from pvid.run.advised import answered
from pvid.run.residuals import Residuals, residuals_of, residuals_of_fit
from pvid.show import report
from pvid.show.report import recording_of, write_report
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors
from pvid.sim.simulated_angle import simulated_angle

TICKS = 30_000
# designed for the truth: what a wrong guess costs is not asked here
STANDARD = replace(RigFile.standard(), nominal=Nominal(g=9.5, l2=0.12, rho2=0.08))
P = np.array([*STANDARD_PENDULUM.linear, 0.0])
SENSORS = replace(standard_sensors(14), random_offset=False)  # so that P is the truth with its zero


@pytest.fixture(scope="module")
def log(native: Native, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a run of TICKS with ten estimates a second, its rig file in it."""
    path = tmp_path_factory.mktemp("report") / "field.pvlog"
    writer = LogWriter(path, rig=field_board.text())
    writer.begin("a port", None)
    field = field_board.Field(TICKS, estimate_every=100)
    writer.take(b"".join(field_board.frames(field_board.messages(field))))
    writer.end("the end")
    writer.close()
    return path


# ---- residuals


def test_residuals_at_the_truth_are_the_encoders_noise_and_white() -> None:
    sensors = replace(SENSORS, y_lsb=0.0, y_noise_lsb=0.0)
    run = simulate(sensors=sensors, truth="linear", duration=40, seed=3).run
    residuals = residuals_of(run, STANDARD, P)
    assert residuals.expected
    # 44 windows of 12 degrees of freedom, half of whose noise they share: the mean square's standard deviation is 7 %
    assert float(np.mean(residuals.rms**2)) == pytest.approx(1, abs=0.2)
    correlation = residuals.autocorrelation(20)
    assert correlation[0] == 1
    assert np.mean(np.abs(correlation[2:]) < residuals.chance) > 0.8
    assert residuals.t[-1] <= run.t[-1] and residuals.t[0] > 1


def test_residuals_at_wrong_parameters_or_of_another_mechanism_are_larger() -> None:
    run = simulate(sensors=SENSORS, truth="linear", duration=40, seed=3).run
    right = residuals_of(run, STANDARD, P)
    for i in range(3):
        wrong = residuals_of(run, STANDARD, P * (1 + 0.02 * (np.arange(4) == i)))
        assert float(np.mean(wrong.rms**2)) > 2 * float(np.mean(right.rms**2))
    full = simulate(sensors=SENSORS, truth="full", duration=40, seed=3).run
    # the weak form's equations are linear: what they neglect at 0.107 rad is above the noise of 14 bits
    assert float(np.mean(residuals_of(full, STANDARD, P).rms ** 2)) > 2 * float(np.mean(right.rms**2))


def test_residuals_equal_those_of_the_board(log: Path) -> None:
    recording = recording_of(log, None)
    residuals = residuals_of(recording.run, recording.rig, recording.p)
    values, told = Values(STANDARD.mechanism), 0.0
    for record in LogReader(log):
        for rows in values.rows(record):
            if rows.table == "estimates":
                told = float(rows.columns["residual"][0])
    # the board's rows were whitened at the estimates of their time, the first of them far off
    assert float(np.sqrt(np.mean(residuals.rms**2))) == pytest.approx(told, rel=0.05)


def test_autocorrelation_in_closed_form() -> None:
    signs = (-1.0) ** np.arange(50)
    residuals = Residuals(np.arange(50.0), signs[:, np.newaxis] * np.ones(3), 3, 1.0, True, 1)
    assert residuals.autocorrelation(3) == pytest.approx([1, -49 / 50, 48 / 50, -47 / 50])
    assert residuals.rms == pytest.approx(np.ones(50))
    assert residuals.chance == pytest.approx(2 / np.sqrt(150))
    assert len(replace(residuals, e=residuals.e[:2]).autocorrelation(24)) == 2


def test_residuals_of_the_strong_form() -> None:
    run = simulate(sensors=standard_sensors(20), truth="linear", duration=20, seed=1).run
    standard = RigFile.standard()
    rig = replace(standard, identifier=replace(standard.identifier, form="strong"))
    residuals = residuals_of(run, rig, P)
    assert float(residuals.e.std()) == pytest.approx(1) and not residuals.expected
    still = Run(t=run.t, phi=run.phi, y=0 * run.y, sample_rate=run.sample_rate)
    with pytest.raises(PvidError, match="the pivot rests"):
        residuals_of(still, rig, P)


def test_modes_of_the_standard_rig() -> None:
    assert modes_hz(P) == pytest.approx((0.742, 2.56), rel=2e-3)  # theory.md 6


def test_parameters_outside_the_physical_region_have_no_modes_hz() -> None:
    assert modes_hz(np.array([11.56, 0.25, 0.2])) == modes_hz(np.array([-1.0, 9.0, 5.0])) == ()


# ---- the report


def shown(svg: Path) -> str:
    """The texts of a figure: matplotlib draws them as curves and keeps them in comments."""
    return svg.read_text(encoding="utf-8")


def test_report_labels_contain_units(log: Path, tmp_path: Path) -> None:
    write_report(recording_of(log, None), tmp_path / "a.svg")
    text = shown(tmp_path / "a.svg")
    for words in (
        "field.pvlog: board field, weak form, 1000 samples per second",
        "estimate: g = 9.",
        "Measured against simulated angle: R² = 0.998",  # linear motion, drawn beside full equations
        "simulated with the estimate",
        "angle phi [rad]",
        f"{TICKS} samples in 1 segment; lost 0 frames",
        "Convergence",
        "gravity in the plane g* [m/s²]",
        "joint to centre of mass l2 [m]",
        "radius of gyration rho2 [m]",
        "±2 standard errors",
        "nothing is published below",
        "time since the first sample [s]",
        "Residuals of the rows at the last estimate",
        "Autocorrelation of the residuals",
        "acceleration [m/s²/√Hz]",
        "mode at 0.7",
        "mode at 2.5",
        "frequency [Hz]",
        "Phase plot",
        "rate of phi [rad/s]",
    ):
        assert words in text, words


@pytest.mark.parametrize(("suffix", "begins"), [("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_plot_format_follows_the_file_suffix(log: Path, tmp_path: Path, suffix: str, begins: bytes) -> None:
    out = tmp_path / f"out.{suffix}"
    done = CliRunner().invoke(commands, ["plot", str(log), "-o", str(out)], standalone_mode=False)
    assert done.return_value == 0 and done.output == f"{out}\n"
    assert out.read_bytes().startswith(begins)


def test_plot_of_a_run_identifies_it_first(tmp_path: Path) -> None:
    run = simulate(sensors=standard_sensors(14), release=(0.02, 0.05), truth="full", duration=10, seed=3).run
    write_run(tmp_path / "run.csv", run)
    RigFile.standard().write(tmp_path / "run.toml")
    arguments = ["plot", str(tmp_path / "run.csv"), "--rig", str(tmp_path / "run.toml"), "-o", str(tmp_path / "a.svg")]
    assert CliRunner().invoke(commands, arguments, standalone_mode=False).return_value == 0
    text = shown(tmp_path / "a.svg")
    assert "run.csv: refinement in float64 after the weak form, stationary law, core f32" in text
    # the numbers are those of the refinement, and so are the curves and the residuals
    assert "answer ±2 s.e." in text and "Residuals of the angle, simulated with the estimate" in text
    (of_g,) = re.findall(r"estimate: g = (\S+ ± \S+) m/s²", text)
    assert f"<!-- {of_g} -->" in text
    assert "10000 samples" in text
    assert CliRunner().invoke(commands, arguments[:2], standalone_mode=False).return_value == 0  # run.toml is there
    assert (tmp_path / "run.png").is_file()
    (tmp_path / "run.toml").unlink()
    with pytest.raises(
        PvidError, match="no rig file: of the pendulum l1, .* is all that is needed: use --set l1=0.25 with"
    ):
        CliRunner().invoke(commands, arguments[:2], standalone_mode=False, catch_exceptions=False)


def test_plot_of_a_log_without_estimates_identifies_it_first(native: Native, tmp_path: Path) -> None:
    writer = LogWriter(tmp_path / "raw.pvlog", rig=field_board.text())
    writer.begin("a port", None)
    field = field_board.Field(15_000, estimate_every=0)
    writer.take(b"".join(field_board.frames(field_board.messages(field))))
    writer.close()
    recording = recording_of(tmp_path / "raw.pvlog", None)
    assert "weak form, stationary law, core f32" in recording.title
    assert recording.physical[-1] == pytest.approx([9.5, 0.12, 0.08], rel=0.02)


def test_a_report_of_an_estimate_outside_the_physical_region(log: Path, tmp_path: Path) -> None:
    recording = recording_of(log, None)
    nowhere = np.full_like(recording.physical, np.nan)
    p = np.array([11.56, 0.25, 0.2, 0.0])
    estimate = {name: (float(value), 0.01) for name, value in zip(("w", "d1", "d2"), p, strict=False)}
    wild = replace(recording, physical=nowhere, physical_se=nowhere, p=p, estimate=estimate)
    write_report(wild, tmp_path / "wild.svg")
    text = shown(tmp_path / "wild.svg")
    assert (
        "estimate: outside the physical region: w = 11.560 ± 0.010 1/s², d1 = 0.250 ± 0.010, d2 = 0.200 ± 0.010" in text
    )
    assert "no mechanism has these parameters" in text
    assert "mode at" not in text and "nan" not in text


def test_report_of_a_held_run_states_the_reason(tmp_path: Path) -> None:
    run = simulate(sensors=standard_sensors(14), truth="full", duration=10, seed=3).run
    turned = replace(run, y=-run.y)
    write_run(tmp_path / "run.csv", turned)
    recording = recording_of(tmp_path / "run.csv", RigFile.standard())
    assert recording.estimate == {}
    write_report(recording, tmp_path / "held.svg")
    text = shown(tmp_path / "held.svg")
    assert "nothing identified: held not explained" in text
    assert "advice: y is counted downwards" in text and "columns y=y:" in text  # XML comments hold no two dashes
    assert "Measured angle (no estimate to simulate with)" in text
    for false in ("outside the physical region", "too little", "R²", "simulated with", "last estimate"):
        assert false not in text, false


def test_a_report_and_identify_give_the_same_estimate(native: Native, tmp_path: Path) -> None:
    run = simulate(sensors=standard_sensors(14), truth="full", duration=15, seed=3).run
    write_run(tmp_path / "run.csv", run)
    recording, result = (
        recording_of(tmp_path / "run.csv", RigFile.standard()),
        answered(run, RigFile.standard(), native),
    )
    assert recording.estimate == {name: (result.value[name], result.se[name]) for name in result.value}
    assert recording.fit is not None
    white = residuals_of_fit(recording.fit, 0.0)
    assert float(np.mean(white.rms**2)) == pytest.approx(1, abs=0.4)  # 12 windows of 16 means: its s.d. is 10 %


# ---- measured against simulated


def test_a_simulation_with_the_truth_leaves_the_encoders_noise() -> None:
    sensors = replace(standard_sensors(14), random_offset=False)
    for release in ((0.06, 0.14), (0.12, 0.28)):  # 0.1 and 0.22 rad
        run = simulate(sensors=sensors, truth="full", duration=15, release=release, seed=1).run
        seen = simulated_angle(run, P, 0.3)
        assert seen is not None
        # rounding and half an LSB of noise: 0.58 LSB, less what the starts take in
        assert 0.4 < seen.rms / sensors.phi_lsb < 0.62
        assert seen.unexplained == pytest.approx(seen.rms**2 / float(np.var(run.phi)), rel=0.1)


def test_a_simulation_with_wrong_parameters_does_not_fit() -> None:
    run = simulate(sensors=SENSORS, truth="full", duration=15, seed=1).run
    right = simulated_angle(run, P, 0.3)
    assert right is not None and right.r2_words.startswith("0.9999")
    for i in range(3):
        wrong = simulated_angle(run, P * (1 + 0.02 * (np.arange(4) == i)), 0.3)
        assert wrong is not None and wrong.unexplained > 5 * right.unexplained


def test_a_simulation_takes_friction_and_an_offset_in() -> None:
    body = replace(STANDARD_PENDULUM, damping1=4e-4, damping2=2e-4)
    run = simulate(body, sensors=replace(SENSORS, phi_zero=0.5), truth="full", duration=15, seed=1).run
    p = P + [0, 0, 0, 0.5]
    with_it, without = simulated_angle(run, p, 0.3, (4e-4, 2e-4)), simulated_angle(run, p, 0.3)
    assert with_it is not None and without is not None
    assert with_it.rms < 0.65 * SENSORS.phi_lsb < without.rms / 2


def test_a_simulation_at_100_samples_a_second_and_through_missing_ones() -> None:
    run = simulate(sensors=SENSORS, truth="full", duration=15, sample_rate=100.0, seed=1).run
    phi, y = run.phi.copy(), run.y.copy()
    phi[500:510], y[700] = np.nan, np.nan
    seen = simulated_angle(replace(run, phi=phi, y=y), P, 0.3)
    assert seen is not None and seen.unexplained < 1e-3


def test_impossible_simulation_is_refused() -> None:
    run = simulate(sensors=SENSORS, truth="full", duration=2, seed=1).run
    assert simulated_angle(run, np.array([11.56, 0.25, 0.2, 0.0]), 0.3) is None
    assert simulated_angle(run, P, 0.3) is None  # less than a block of two slow periods


def test_restarted_board_is_marked(native: Native, tmp_path: Path) -> None:
    writer = LogWriter(tmp_path / "two.pvlog", rig=field_board.text())
    writer.begin("a port", None)
    sent = b"".join(field_board.frames(field_board.messages(field_board.Field(6000, estimate_every=100))))
    writer.take(sent + sent)
    writer.close()
    recording = recording_of(tmp_path / "two.pvlog", None)
    assert len(recording.breaks) == 1 and (np.diff(recording.t) >= 0).all()
    write_report(recording, tmp_path / "two.svg")
    assert "the board began anew" in shown(tmp_path / "two.svg")


def test_undrawable_input_is_refused_in_a_sentence(log: Path, native: Native, tmp_path: Path) -> None:
    recording = recording_of(log, None)
    with pytest.raises(PvidError, match="out.xyz .*must end in .png, .svg, .pdf"):
        write_report(recording, tmp_path / "out.xyz")
    with pytest.raises(PvidError, match="cannot write the figure"):
        write_report(recording, tmp_path / "no" / "folder.png")
    (tmp_path / "taken.png").mkdir()
    with pytest.raises(PvidError, match="cannot write the figure .*taken.png: Is a directory"):
        write_report(recording, tmp_path / "taken.png")
    assert [path.name for path in tmp_path.iterdir()] == ["taken.png"]  # nothing half written is left
    writer = LogWriter(tmp_path / "short.pvlog", rig=field_board.text())
    writer.begin("a port", None)
    sent = field_board.messages(field_board.Field(320, estimate_every=100))
    writer.take(b"".join(field_board.frames(sent)))
    writer.close()
    with pytest.raises(PvidError, match="record longer"):
        write_report(recording_of(tmp_path / "short.pvlog", None), tmp_path / "short.png")
    writer = LogWriter(tmp_path / "bare.pvlog")
    writer.begin("a port", None)
    writer.take(link.encode(link.Hash(1, 2), 0))
    writer.close()
    with pytest.raises(PvidError, match="no rig file"):
        recording_of(tmp_path / "bare.pvlog", None)


def test_the_phase_plot_takes_a_run_that_ends_with_missing_samples() -> None:
    """A board that sends no numbers at the end of a log took the report down."""
    run = simulate(sensors=standard_sensors(14), truth="linear", duration=6.0, seed=2).run
    phi = run.phi.copy()
    phi[:3] = phi[-5:] = np.nan
    axis = Figure().add_subplot()
    report._phase(replace(run, phi=phi), axis)
    whole, _ = axis.lines
    assert np.isfinite(np.asarray(whole.get_ydata())).mean() > 0.9
