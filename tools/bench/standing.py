"""The standing of published estimates (pvid/standing.h): imperfect motors, accidents and clean runs of mechanisms."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt

from bench.case import Advance, Report, chosen
from pvid.codegen.weak_library import weak_native
from pvid.configuration.weak import config_for_rig_like_the_shipped, samples_of
from pvid.models.mechanisms import compiled_of
from pvid.settings.enums import Reason, Standing
from pvid.settings.record import Record
from pvid.settings.weak import WeakConfig
from pvid.sim.simulated_run import PERFECT, RigSimulation, simulation_of

Float = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Rows = list[tuple[str, ...]]

IMPERFECT = ("imperfection", "results", "wrong", "valid", "valid and wrong", "largest valid, s.e.")
CLEAN = ("mechanism", "publications", "doubted", "changes to doubted", "changes to withdrawn", "valid at the end")
ACCIDENTS = ("mechanism", "runs", "wrong, valid at the end", "not valid within a minute", "wrong, valid meanwhile")
FAR = 5.0  # standard errors
_SUBSTEPS = 20  # of a tick, midpoint rule
_LATER = 8  # ticks behind a window's reason: its standing is known, a stage later, at the slowest pace
_BEFORE_S, _AFTER_S = 20.0, 60.0  # of an accident

# What the motor has and the model has not: of a tick late, V, N*m*s^2, N*m, N*m, a share, a share.
IMPERFECTIONS: Mapping[str, Mapping[str, float]] = {
    "none": {},
    "PWM late by 0.1 tick": {"late": 0.1},
    "PWM late by half a tick": {"late": 0.5},
    "dead time 0.02 V": {"dead": 0.02},
    "dead time 0.1 V": {"dead": 0.1},
    "fan 2e-7 N*m*s^2": {"fan": 2e-7},
    "Stribeck friction 0.005 N*m": {"stribeck": 0.005},
    "load 0.002 N*m, from half of the run": {"load": 0.002},
    "gain of the current 1 % too large": {"gain": 0.01},
    "offset of the voltage 0.05 V": {"offset": 0.05},
}


@dataclass(frozen=True)
class Board:
    """An identifier with the settings of a shipped rig."""

    simulation: RigSimulation
    config: WeakConfig

    def record(self, samples: npt.NDArray[np.float32]) -> Record:
        """From the start, over samples [ticks, samples]."""
        library = weak_native(compiled_of(self.simulation.model.name), self.config.design)
        return library.identifier_of(self.config).run_samples(samples, sums=False, hashes=False)


@cache
def board(name: str) -> Board:
    """Of a shipped mechanism."""
    return Board(simulation_of(name), config_for_rig_like_the_shipped(compiled_of(name)))


def state_of(record: Record) -> npt.NDArray[np.uint32]:
    """Of the published estimate after each tick [ticks]."""
    return np.asarray(record.standing >> 16 & 0xFF)


def errors_of(record: Record, truth: Float, among: list[int]) -> tuple[Float, Bools]:
    """Largest error of the published values [standard errors] after each tick, and whether it is wrong: beyond FAR,
    and by 0.1 % of a value."""
    away = np.abs(record.published[:, among] - truth[among])
    with np.errstate(all="ignore"):
        z = away / record.published_se[:, among]
    wrong = (z > FAR) & (away > 1e-3 * np.abs(truth[among]))
    return np.asarray(z.max(1)), np.asarray(wrong.any(1))


# ---- imperfect motors ----


def motors(seconds: float, runs: int) -> npt.NDArray[np.float32]:
    """Samples V, i, phi [imperfections, runs, ticks, 3] of shipped motors with drives of their own."""
    own = board("dc_motor").simulation
    value, rate = own.rig.truth, own.rig.sample_rate
    ticks, many = round(seconds * rate), len(IMPERFECTIONS)
    flaw = {
        name: np.repeat([one.get(name, 0.0) for one in IMPERFECTIONS.values()], runs)
        for name in ("late", "dead", "fan", "stribeck", "load", "gain", "offset")
    }
    random = np.random.default_rng(1)
    phase = np.tile(random.uniform(0, 60, runs), many)
    steps = np.tile(random.choice([-1.5, 1.5], size=(runs, ticks // 10 + 1)), (many, 1))
    step = 1 / rate / _SUBSTEPS

    def slopes(i: Float, w: Float, v: Float, load: Float) -> tuple[Float, Float]:
        sign = np.clip(w / 0.02, -1, 1)
        dry = value["Tc"] + flaw["stribeck"] * np.exp(-((w / 2) ** 2))
        torque = value["k"] * i - value["b"] * w - dry * sign - flaw["fan"] * w * np.abs(w) - load
        drop = value["R"] * i + value["k"] * w + flaw["dead"] * np.clip(i / 0.005, -1, 1)
        return (v - drop) / value["L"], torque / value["J"]

    i, w, phi, before = (np.zeros(many * runs) for _ in range(4))
    found = np.empty((ticks, 3, many * runs))
    for tick in range(ticks):
        t = phase + tick / rate
        volts = 4.4 * np.sin(4.4 * t) + 2.8 * np.sin(14.5 * t + 1) + steps[:, tick // 10]
        found[tick] = volts + flaw["offset"], i * (1 + flaw["gain"]) + value["i0"], phi
        load = flaw["load"] * (2 * tick >= ticks)
        for part in range(_SUBSTEPS):
            v = np.where((part + 0.5) / _SUBSTEPS < flaw["late"], before, volts)
            of_i, of_w = slopes(i, w, v, load)
            middle = i + step / 2 * of_i, w + step / 2 * of_w
            of_i, of_w = slopes(*middle, v, load)
            i, w, phi = i + step * of_i, w + step * of_w, phi + step * middle[1]
        before = volts
    for place, name in ((1, "i"), (2, "phi")):
        signal = own.model.signal(name)
        noise = signal.noise * np.random.default_rng(place).standard_normal(found[:, place].shape)
        found[:, place] = np.round(found[:, place] / signal.resolution + noise) * signal.resolution
    return found.transpose(2, 0, 1).reshape(many, runs, ticks, 3).astype(np.float32)


def imperfect_rows(runs: int, seconds: float, advance: Advance) -> Rows:
    """A row for each imperfection."""
    own = board("dc_motor")
    truth = own.simulation.truth
    among = [place for place, name in enumerate(own.simulation.model.p_names) if name != "i0"]
    rows: Rows = []
    for label, samples in zip(IMPERFECTIONS, motors(seconds, runs), strict=True):
        results = bad = valid = both = 0
        largest = 0.0
        for run in samples:
            record = own.record(run)
            z, wrong = errors_of(record, truth, among)
            ends = np.flatnonzero(~np.isin(record.reason, (Reason.WARMING_UP, Reason.ACCUMULATED)))
            first = np.flatnonzero(np.isin(record.reason, (Reason.UPDATED, Reason.MISFIT)))
            at = np.minimum(ends[ends >= first[0]] + _LATER, len(run) - 1) if len(first) else ends[:0]
            is_valid = state_of(record)[at] == Standing.VALID
            results, bad = results + len(at), bad + int(wrong[at].sum())
            valid, both = valid + int(is_valid.sum()), both + int((wrong[at] & is_valid).sum())
            largest = max(largest, float(z[at][is_valid].max(initial=0.0)))
        rows.append((label, str(results), str(bad), str(valid), str(both), f"{largest:.1f}"))
        advance()
    return rows


# ---- clean runs and accidents of any mechanism ----


def _lasting(name: str, seconds: float) -> RigSimulation:
    one = board(name).simulation
    return replace(one, rig=replace(one.rig, duration=seconds), _motions={})


def clean_row(name: str, runs: int, seconds: float) -> tuple[str, ...]:
    """Of runs without a fault."""
    own, simulation = board(name), _lasting(name, seconds)
    published = doubted = ends = 0
    changes = {Standing.DOUBTED: 0, Standing.WITHDRAWN: 0}
    for seed in range(runs):
        record = own.record(samples_of(own.config, simulation.run(seed, PERFECT)))
        state = state_of(record)
        new = np.flatnonzero(np.isin(record.reason, (Reason.UPDATED, Reason.MISFIT)))
        at = state[np.minimum(new + _LATER, len(state) - 1)]
        published, doubted = published + len(at), doubted + int((at == Standing.DOUBTED).sum())
        ends += int(state[-1] == Standing.VALID)
        for one in changes:
            changes[one] += int(((state[1:] == one) & (state[:-1] != one)).sum())
    return (name, str(published), str(doubted), *(str(one) for one in changes.values()), f"{ends} of {runs}")


def accidents_of(own: Board, samples: npt.NDArray[np.float32], seed: int, longest_s: float) -> tuple[int, int]:
    """Spoils some signals [ticks, samples] in place for 0.03 s to `longest_s`: 0, the largest, any or the last value.
    Returns the ticks between which."""
    random, rate = np.random.default_rng([seed, 7]), own.simulation.rig.sample_rate
    first = int((_BEFORE_S + random.uniform(0, 5)) * rate)
    last = first + int(np.exp(random.uniform(np.log(0.03), np.log(longest_s))) * rate)
    one, some = int(random.integers(samples.shape[1])), np.asarray(random.random(samples.shape[1]) < 0.5)
    for place in np.flatnonzero(some) if some.any() else [one]:
        top = float(np.abs(samples[:, place]).max())
        values = 0.0, top, random.uniform(-top, top), samples[first, place]
        samples[first:last, place] = values[int(random.integers(4))]
    return first, last


def accident_row(name: str, runs: int, longest_s: float) -> tuple[str, ...]:
    """Of runs with an accident each, a minute longer than it."""
    own, simulation = board(name), _lasting(name, _BEFORE_S + 5 + longest_s + _AFTER_S + 1)
    truth, rate = simulation.truth, simulation.rig.sample_rate
    wrong_end = mute = meanwhile = 0
    for seed in range(runs):
        samples = samples_of(own.config, simulation.run(seed, PERFECT)).copy()
        first, last = accidents_of(own, samples, seed, longest_s)
        record = own.record(samples[: last + int(_AFTER_S * rate)])
        state, wrong = state_of(record), errors_of(record, truth, list(range(len(truth))))[1]
        wrong_and_valid: Bools = np.asarray(wrong & (state == Standing.VALID))
        wrong_end += int(wrong_and_valid[-1])
        mute += int(not (state[last:] == Standing.VALID).any())
        meanwhile += int(wrong_and_valid[first:last].any())
    return name, str(runs), str(wrong_end), str(mute), str(meanwhile)


def _of_each(names: tuple[str, ...], advance: Advance, row: Callable[[str], tuple[str, ...]]) -> Rows:
    rows = []
    for name in names:
        rows.append(row(name))
        advance()
    return rows


def report(mechanism: tuple[str, ...], number: int, seconds: int, longest: int, advance: Advance) -> Report:
    """See bench.case."""
    names = chosen(mechanism, ("dc_motor", "kapitza", "rigid_body", "two_mass_drive"))
    return Report(
        [
            ("standing-imperfections", IMPERFECT, imperfect_rows(number, seconds, advance)),
            ("standing-clean", CLEAN, _of_each(names, advance, lambda one: clean_row(one, number, seconds))),
            ("standing-accidents", ACCIDENTS, _of_each(names, advance, lambda one: accident_row(one, number, longest))),
        ]
    )
