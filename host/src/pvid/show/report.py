"""A recording on one page: measured against simulated angle, convergence, residuals, excitation, motion."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from scipy.signal import savgol_filter, welch

from pvid.base.figure_file import drawable, save
from pvid.base.rounding import with_error
from pvid.core.native import Native
from pvid.link.frames import Hello
from pvid.log.reader import LogReader
from pvid.log.rig import run_of_log
from pvid.log.rig_settings import rig_for
from pvid.log.values import Rows, Values, extras_of
from pvid.log.words import KAPPA_MIN, reason_words, stage_words
from pvid.models.model import Model, Quantity
from pvid.rig.columns import Columns
from pvid.rig.file import RigFile
from pvid.rig.run import Run, is_run, read_run
from pvid.rig.sensor_steps import resolution_note, resolved
from pvid.run.advised import identified
from pvid.run.refined_pendulum import RefinedPendulum
from pvid.run.residuals import Residuals, residuals_of, residuals_of_fit
from pvid.settings.enums import Reason, Stage
from pvid.show.axis_limits import draw_answer, interesting, plain_ticks
from pvid.sim.simulated_angle import simulated_angle

Float = npt.NDArray[np.float64]

_RIGHT = 4  # pictures beside those of convergence
_LAGS = 24
_RESOLUTION_HZ = 0.05  # of the spectra, where the run is long enough
_LEAST_SHOWN_HZ = 10.0
_SMOOTHING_S = 0.071  # of the angle's rate, as in the weak form's front end
_MOST_DOTS = 20_000
_LAST_S = 5.0  # of the motion, drawn dark
_SHOWN_S = 12.0  # of measured and simulated angle
_LINE = 150  # characters of the title
_PUBLISHED = (Reason.UPDATED.text, Reason.MISFIT.text)


@dataclass(frozen=True)
class Refined:
    """Estimates of the second stage, NaN while none stands.

    t : [n, s];  physical, physical_se : [n, n_physical];  words : whose estimate is published at the end, and why
    extras : parameters in `newest` that the weak form does not have
    newest : of the published estimate: value and standard error by name; empty while the weak form's is published
    """

    t: Float
    physical: Float
    physical_se: Float
    words: str
    extras: tuple[Quantity, ...]
    newest: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Recording:
    """What is drawn.

    t : of the estimates, `clock` is their origin [n, s];  physical, physical_se : [n, n_physical];  kappa [n]
    p : the last estimate, as residuals_of takes it, or the start;  estimate : value and standard error by name; empty
        where nothing is identified
    reasons : how many estimates came with each;  state : the last, with what it means
    remarks : sentences on the answer
    breaks : when the board began anew or the link came up again [s];  account : what was recorded and lost
    run : the longest stretch of samples without a gap;  refined : None without a second stage
    """

    title: str
    clock: str
    rig: RigFile
    run: Run
    t: Float
    physical: Float
    physical_se: Float
    kappa: Float
    p: Float
    estimate: dict[str, tuple[float, float]]
    reasons: dict[str, int]
    state: str
    remarks: tuple[str, ...]
    breaks: tuple[float, ...]
    account: str
    refined: Refined | None = None
    fit: RefinedPendulum | None = None


def recording_of(path: Path, rig: RigFile | None, columns: Columns | None = None) -> Recording:
    """What a log holds, or what a run or a log without estimates gives when it is identified here.

    Parameters
    ----------
    rig
        None: the one in the log, or beside the run.
    columns
        Which columns of a run are t, phi and y.

    Raises
    ------
    PvidError
        When the file cannot be read, has too few samples, or there is no rig file.
    """
    if rig is None:
        rig = rig_for(path, None)
    if is_run(path):
        return _of_run(path, read_run(path, rig.sample_rate, columns), rig)
    return _of_log(path, rig) or _of_run(path, run_of_log(path), rig)


def _of_log(path: Path, rig: RigFile) -> Recording | None:
    """What the board said; None when that was no estimate."""
    reader, values, model = LogReader(path), Values(rig.mechanism), rig.mechanism.model
    columns: dict[str, list[Any]] = {name: [] for name in ("log_time", "run", "kappa", "reason")}
    columns |= {name: [] for one in model.answers for name in (one.name, f"{one.name}_se")}
    refined: list[Rows] = []
    hello, began = None, None
    for record in reader:
        if isinstance(record.item, Hello):
            hello = record.item
        for rows in values.rows(record):
            if rows.table == "samples" and began is None:
                began = int(rows.columns["log_time"][0])
            if rows.table == "estimates":
                for name, column in columns.items():
                    column.append(rows.columns[name][0])
            elif rows.table == "refined":
                refined.append(rows)
    if not columns["run"]:
        return None
    series = {name: np.array(column) for name, column in columns.items()}
    began = int(series["log_time"][0]) if began is None else began
    t = (series["log_time"] - began) / 1e9
    of_refined = _refined(refined, began, values, model) if refined else None
    newest = {} if of_refined is None else of_refined.newest
    counts = zip(*np.unique(series["reason"], return_counts=True), strict=True)
    if hello is None:
        title = path.name
    else:
        form = hello.form_name
        rig = replace(rig, identifier=replace(rig.identifier, form=form))
        title = f"{path.name}: board {hello.board}, {form} form, {hello.sample_rate:g} samples per second"
    return Recording(
        title=title,
        clock="since the first sample",
        rig=rig,
        run=run_of_log(path),
        t=t,
        physical=np.stack([series[name] for name in model.physical_names], axis=1),
        physical_se=np.stack([series[f"{name}_se"] for name in model.physical_names], axis=1),
        kappa=series["kappa"],
        p=np.array([newest.get(name, (series[name][-1],))[0] for name in model.p_names[: rig.n_core]]),
        estimate={
            name: (float(series[name][-1]), float(series[f"{name}_se"][-1]))
            for name in (*model.physical_names, *model.mapped_names)
            if np.isin(series["reason"], _PUBLISHED).any() and np.isfinite(series[name][-1])
        }
        | newest,
        reasons={str(reason): int(count) for reason, count in counts},
        state=("" if of_refined is None else "weak form: ") + _with_words(str(series["reason"][-1])),
        remarks=() if of_refined is None else (f"published: {of_refined.words}",),
        breaks=tuple(t[1:][np.diff(series["run"]) > 0]),
        account=reader.account.text,
        refined=of_refined,
    )


def _refined(rows: Sequence[Rows], began: int, values: Values, model: Model) -> Refined:
    """Of the rows of the table `refined`, in order; the origin of their times is `began` [ns]."""

    def column(name: str) -> Float:
        return np.array([one.columns[name][0] for one in rows], np.float64)

    last = {name: x[0] for name, x in rows[-1].columns.items()}
    stands = last["stage"] == Stage.REFINED.text
    extras = extras_of(model, values.refined) if stands else ()
    answers = [one.name for one in (*model.answers, *extras)]
    return Refined(
        t=(np.array([one.columns["log_time"][0] for one in rows]) - began) / 1e9,
        physical=np.stack([column(name) for name in model.physical_names], axis=1),
        physical_se=np.stack([column(f"{name}_se") for name in model.physical_names], axis=1),
        words=stage_words(str(last["stage"]), str(last["reason"])),
        extras=extras,
        newest={
            name: (float(last[name]), float(last[f"{name}_se"]))
            for name in answers
            if stands and np.isfinite(last[name])
        },
    )


def _of_run(path: Path, run: Run, rig: RigFile) -> Recording:
    run.refuse_damaged()
    native = Native()
    run = replace(run, notes=(*run.notes, *resolution_note(rig, resolved(rig, run))))
    whole = run.whole()  # residuals and spectra have no place for a missing sample
    given = run if rig.identifier.core_traits.takes_gaps else whole
    result = identified(given, rig, native)
    names = [name for name in result.model.p_names if name in result.value]
    advices = tuple(f"advice: {sentence}" for sentence in result.advice)
    refined = result.refinement is not None and result.refinement.adopted
    return Recording(
        fit=result.refinement.outcome if refined else None,
        title=f"{path.name}: {result.method}, {run.sample_rate:g} samples per second",
        clock="of the run",
        rig=resolved(rig, given),  # as it was identified
        run=whole,
        t=result.trajectory.t,
        physical=result.trajectory.physical,
        physical_se=result.trajectory.physical_se,
        kappa=result.trajectory.kappa,
        p=np.array([result.value[name] for name in names]),
        estimate={name: (result.value[name], result.se[name]) for name in result.value if result.identified},
        reasons={},
        state=_with_words(result.status) if result.identified else result.verdict,
        remarks=advices if result.warning is None else (f"warning: {result.warning}", *advices),
        breaks=(),
        account=f"{result.ticks} samples, {result.updates} updates, {result.lost} samples rejected",
    )


def _with_words(reason: str) -> str:
    words = reason_words(reason)
    return f"{reason}: {words}" if words else reason


def write_report(recording: Recording, path: Path) -> None:
    """Draws it; the format follows the suffix of `path` (png, svg, pdf).

    Raises
    ------
    PvidError
        When the run is too short for the residuals, or the file cannot be written.
    """
    if recording.fit is None:
        residuals = residuals_of(recording.run, recording.rig, recording.p)
    else:
        residuals = residuals_of_fit(recording.fit, float(recording.run.t[0]))
    figure = plt.figure(figsize=(15, 17), layout="constrained")
    try:
        rows: list[Any] = [["angle", "angle"], ["difference", "difference"]]
        count = {"left": len(recording.rig.mechanism.model.physical) + 1, "right": _RIGHT}
        names = {side: [f"{side}{k}" for k in range(n)] for side, n in count.items()}
        rows += [list(pair) for pair in zip_longest(*names.values(), fillvalue=".")]
        axes = figure.subplot_mosaic(
            rows,
            height_ratios=[1.0, 0.45, *[1.0] * max(count.values())],
        )
        left, right = (np.array([axes[name] for name in side]) for side in names.values())
        _overlay(recording, axes["angle"], axes["difference"])
        _converge(recording, left)
        _residuals(recording, residuals, right[0])
        _autocorrelation(residuals, right[1])
        _spectra(recording, right[2])
        _phase(recording.run, right[3])
        figure.align_ylabels([axes["angle"], axes["difference"], *left])
        figure.align_ylabels(right)
        lines = [recording.title, *_last(recording), recording.account]
        folded = [part for line in lines for part in textwrap.wrap(drawable(line), _LINE) or [""]]
        figure.suptitle("\n".join(folded), fontsize=12, parse_math=False)
        save(figure, path, dpi=110)
    finally:
        plt.close(figure)


def _last(recording: Recording) -> list[str]:
    """The last estimate in words, why it is the last, and what is to be said of it."""
    known = recording.estimate
    if not known:
        headline = f"nothing identified: {recording.state}"
    else:
        model = recording.rig.mechanism.model
        physical = all(name in known for name in model.physical_names)
        parts = []
        shown: Sequence[Quantity] = model.physical if physical else model.parameters[: model.n_mapped]
        extras = () if recording.refined is None else recording.refined.extras
        for one in (*shown, *extras):
            value, error = with_error(*known[one.name])
            parts.append(f"{one.name} = {value} ± {error} {one.shown_unit}".rstrip())
        where = "" if physical else "outside the physical region: "
        headline = f"estimate: {where}{', '.join(parts)}  (± standard error)"
    reasons = ", ".join(f"{count} {reason}" for reason, count in recording.reasons.items())
    return [
        headline,
        *([recording.state] if known else []),
        *([f"estimates: {reasons}"] if reasons else []),
        *recording.remarks,
    ]


def _overlay(recording: Recording, angle: Axes, difference: Axes) -> None:
    """Measured against simulated angle, and their difference, over the last seconds of the run."""
    run = recording.run
    simulated = simulated_angle(run, recording.p, recording.rig.l1) if recording.estimate else None
    end = run.t[-1] if simulated is None else simulated.t[-1]
    shown = (run.t >= end - _SHOWN_S) & (run.t <= end)
    angle.plot(run.t[shown], run.phi[shown], color="0.6", linewidth=2.5, label="measured")
    angle.set_ylabel("angle phi [rad]")
    difference.set_ylabel("difference\n[mrad]")
    (angle if simulated is None else difference).set_xlabel(_clock(recording))
    if simulated is None:
        why = "no mechanism has these parameters" if recording.estimate else "no estimate to simulate with"
        angle.set_title(f"Measured angle ({why})")
        difference.set_visible(False)
    else:
        late = simulated.t >= end - _SHOWN_S
        t, fit = simulated.t[late], simulated.simulated[late]
        angle.plot(t, fit, color="C1", linewidth=1.2, label="simulated with the estimate")
        difference.plot(t, 1e3 * (simulated.measured[late] - fit), color="C0", linewidth=0.9)
        angle.set_title(
            f"Measured against simulated angle: R² = {simulated.r2_words}, rms difference {1e3 * simulated.rms:.2g} "
            f"mrad over the run (full equations, a start fitted every {simulated.block_s:.2g} s)"
        )
    for axis in (angle, difference):
        axis.set_xlim(max(float(run.t[0]), float(end) - _SHOWN_S), float(end))
        axis.grid(alpha=0.3)
    low, high = angle.get_ylim()
    angle.set_ylim(low, high + 0.25 * (high - low))  # room for the legend
    angle.legend(loc="upper right", fontsize=9, ncols=2)
    angle.tick_params(labelbottom=simulated is None)


def _clock(recording: Recording) -> str:
    """Of the samples, as a label."""
    return "time on the board [s]" if recording.reasons else "time of the run [s]"


def _converge(recording: Recording, axes: npt.NDArray[Any]) -> None:
    t = recording.t
    shown = recording.rig.mechanism.model.physical
    for column, (one, axis) in enumerate(zip(shown, axes[:-1], strict=True)):
        of_weak = "estimate" if recording.estimate else "not published"
        of_weak = "weak form" if recording.fit is not None else of_weak
        curves = [(t, recording.physical, recording.physical_se, of_weak)]
        if (refined := recording.refined) is not None:
            curves[0] = (*curves[0][:3], "weak form")
            curves.append((refined.t, refined.physical, refined.physical_se, "refined, published where drawn"))
        limits = []
        for k, (at, values, errors, name) in enumerate(curves):
            value, band = values[:, column], 2 * errors[:, column]
            axis.fill_between(at, value - band, value + band, alpha=0.25, color=f"C{k}", label="±2 standard errors")
            axis.plot(at, value, color=f"C{k}", linewidth=1.2, label=name)
            low, high = interesting(value, band)
            limits += [(low, high)] if math.isfinite(low) and low < high else []
        if recording.fit is not None and one.name in recording.estimate:
            draw_answer(axis, *recording.estimate[one.name])
        if limits:
            axis.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
        axis.set_ylabel(one.label)
        plain_ticks(axis)
    axes[0].set_title("Convergence")
    kappa = axes[len(shown)]
    kappa.semilogy(t, np.where(recording.kappa > 0, recording.kappa, np.nan), color="C2", label="kappa")
    if recording.rig.identifier.form_traits.publishes:
        kappa.axhline(KAPPA_MIN, color="C3", linestyle="--", label="nothing is published below")
    kappa.set_ylabel("kappa: identifiability\nof w [1]")
    kappa.set_xlabel(f"time {recording.clock} [s]")
    for axis in axes:
        for i, when in enumerate(recording.breaks):
            axis.axvline(when, color="0.5", linestyle=":", label="the board began anew" if i == 0 else None)
        axis.set_xlim(min(0.0, float(t[0])), max(float(t[-1]), 1e-9))
        axis.grid(alpha=0.3)
        axis.legend(loc="best", fontsize=9)


def _residuals(recording: Recording, residuals: Residuals, axis: Axes) -> None:
    run = recording.run
    t, e = np.repeat(residuals.t, residuals.e.shape[1]), residuals.e.ravel()
    every = max(1, len(e) // _MOST_DOTS)
    axis.plot(t[::every], e[::every], ".", markersize=3, color="0.6", label="one row")
    if residuals.expected:
        axis.plot(residuals.t, residuals.rms, color="C1", linewidth=1.2, label="rms of a window")
        axis.axhline(1.0, color="C3", linestyle="--", label="rms of the encoder's noise")
        unit = "the encoder's noise"
    else:
        unit = "its standard deviation"
    reach = 1.15 * max(float(np.quantile(np.abs(e), 0.999)), 1.0)
    axis.set_ylim(-reach, 1.45 * reach)  # room for the legend
    if recording.fit is not None:
        mean_ms = 1e3 * residuals.step_s / residuals.e.shape[1]
        axis.set_title(f"Residuals of the angle, simulated with the estimate (means over {mean_ms:.2g} ms)")
    else:
        axis.set_title(f"Residuals of the rows at the {'last estimate' if recording.estimate else 'guess'}")
    axis.set_ylabel(f"residual [1 = {unit}]")
    axis.set_xlabel(_clock(recording))
    axis.set_xlim(run.t[0], run.t[-1])
    axis.grid(alpha=0.3)
    axis.legend(loc="upper right", fontsize=9, ncols=3)


def _autocorrelation(residuals: Residuals, axis: Axes) -> None:
    """Of the windows' rows; in the strong form of the samples' over twice the differentiator's reach."""
    every = max(1, 2 * residuals.shared // _LAGS)
    found = residuals.autocorrelation(_LAGS * every)[::every]
    lag = every * residuals.step_s * np.arange(len(found))
    axis.bar(lag[1:], found[1:], width=0.6 * every * residuals.step_s, color="C0", label="autocorrelation")
    axis.axhspan(-residuals.chance, residuals.chance, color="C3", alpha=0.2, label="chance (±2 s.d.)")
    shared = residuals.shared * residuals.step_s
    axis.axvspan(0, shared * 1.2, color="0.85", zorder=0, label="share samples")
    reach = max(0.3, 1.3 * float(np.abs(found[1:]).max(initial=0.0)))
    axis.set_ylim(-reach, 1.6 * reach)
    axis.set_xlim(0, max(float(lag[-1]), residuals.step_s) * 1.02)
    axis.set_title("Autocorrelation of the residuals")
    axis.set_ylabel("correlation [1]")
    axis.set_xlabel("lag [s]")
    axis.grid(alpha=0.3)
    axis.legend(loc="upper right", fontsize=9, ncols=3)


def _spectra(recording: Recording, axis: Axes) -> None:
    """Amplitude spectral densities of the pivot's acceleration and of the angle, beside the modes."""
    run = recording.run
    length = min(len(run.t), round(run.sample_rate / _RESOLUTION_HZ))
    frequency, height = welch(run.y - run.y.mean(), run.sample_rate, "hann", length)
    _, angle = welch(run.phi - run.phi.mean(), run.sample_rate, "hann", length)
    found = recording.rig.mechanism.model.modes_hz(recording.p)
    shown = (frequency > 0) & (frequency <= max((_LEAST_SHOWN_HZ, *(4 * one for one in found))))
    acceleration = np.sqrt(height) * (2 * np.pi * frequency) ** 2
    drive = _amplitude(axis, frequency[shown], acceleration[shown], color="C0", label="pivot's acceleration")
    axis.set_ylabel("acceleration [m/s²/√Hz]", color="C0")
    other = axis.twinx()
    motion = _amplitude(other, frequency[shown], np.sqrt(angle)[shown], color="C1", label="angle phi")
    other.set_ylabel("angle [rad/√Hz]", color="C1")
    lines = [*drive, *motion]
    for one in found:
        lines += [axis.axvline(one, color="C3", linestyle="--", label=f"mode at {one:.3g} Hz")]
    axis.set_xlim(0, float(frequency[shown][-1]))
    axis.set_title(f"Excitation and answer against the modes of the {'estimate' if recording.estimate else 'guess'}")
    axis.set_xlabel("frequency [Hz]")
    axis.grid(alpha=0.3)
    axis.legend(handles=lines, loc="upper right", fontsize=9, ncols=2)


def _amplitude(axis: Axes, frequency: Float, x: Float, color: str, label: str) -> list[Line2D]:
    """Over a logarithmic scale with room for the legend; of a signal that stands still there is none."""
    lines = axis.semilogy(frequency, np.where(x > 0, x, np.nan), color=color, label=label)
    low, high = axis.get_ylim()
    axis.set_ylim(low, high * (high / low) ** 0.35)
    return lines


def _phase(run: Run, axis: Axes) -> None:
    points = max(7, round(_SMOOTHING_S * run.sample_rate)) | 1
    angle = savgol_filter(run.phi, points, 4, mode="nearest")  # a fit at the ends would refuse a missing sample
    rate = savgol_filter(run.phi, points, 4, deriv=1, delta=1 / run.sample_rate, mode="nearest")
    every = max(1, len(angle) // _MOST_DOTS)
    last = run.t > run.t[-1] - _LAST_S
    axis.plot(angle[::every], rate[::every], color="C0", linewidth=0.6, alpha=0.3, label="whole run")
    axis.plot(
        angle[last], rate[last], color="C0", linewidth=1.2, label=f"last {min(_LAST_S, run.t[-1] - run.t[0]):g} s"
    )
    axis.set_title("Phase plot")
    axis.set_xlabel("angle phi [rad]")
    axis.set_ylabel("rate of phi [rad/s]")
    axis.grid(alpha=0.3)
    axis.legend(loc="upper right", fontsize=9)
