"""RC models on a cell that is no RC circuit: PyBaMM's single-particle model with electrolyte (SPMe).

A model is identified on random steps of the current and predicts the voltage under another load, that of a vehicle. The
records of tests/data/cell were written by `./tools/pvid bench cell --write tests/data/cell`. PyBaMM is needed for that
alone; nothing else of the project imports it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bench.case import Advance, Report
from bench.replay import Replay
from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.base.replacing import replacing
from pvid.models.mechanisms import compiled_of
from pvid.models.registry import asked_for
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.rows import Compiled, WeakRows
from pvid.oracle.weak.solve import batch
from pvid.rig.columns import Channel, Columns
from pvid.rig.run import Recording, read_recording, write_recording

Float = npt.NDArray[np.float64]

DATA = Path(__file__).resolve().parents[2] / "tests" / "data" / "cell"
STEP = 1.0  # s between samples
DURATION = 7200  # samples
PARAMETERS = "Chen2020"  # PyBaMM's set for the LG M50, a 21700 cell of 5 A h
CURRENT_STEP = 1e-3  # A, of the recorded current
VOLTAGE_STEP = 1e-4  # V, of the recorded voltage
CHANNELS = (Channel("i", "A"), Channel("v", "V"))  # the current is positive in discharge


@dataclass(frozen=True)
class Load:
    """A load profile.

    Attributes
    ----------
    name : of the file
    driving : phases of a vehicle (acceleration, cruise, braking, stand); else random steps of 15 s and 240 s
    seed : of its random numbers
    rms : of the current about its mean [A]
    mean : of the current [A]; positive in discharge
    charge : state of charge at the start, 0 to 1
    """

    name: str
    driving: bool
    seed: int
    rms: float
    mean: float
    charge: float = 0.6

    def current(self) -> Float:
        """At each sample [A], shape (DURATION,); the load goes straight from one to the next."""
        rng = np.random.default_rng(self.seed)
        shape = _driving(rng) if self.driving else 0.4 * _steps(rng, 15) + 0.6 * _steps(rng, 240)
        about = shape - shape.mean()
        return np.asarray(np.round(self.rms * about / about.std() + self.mean, 3))


# Each pair: identified on the steps, predicted on the drive. C/5 and C/2.
LOADS = (
    Load("steps-mild", driving=False, seed=1, rms=1.0, mean=0.0),
    Load("drive-mild", driving=True, seed=3, rms=1.0, mean=0.25),
    Load("steps", driving=False, seed=1, rms=2.5, mean=0.0),
    Load("drive", driving=True, seed=3, rms=2.5, mean=0.25),
)


def _steps(rng: np.random.Generator, length: int) -> Float:
    """Random levels, each held for `length` samples; shape (DURATION,)."""
    return np.repeat(rng.normal(0.0, 1.0, DURATION // length + 1), length)[:DURATION]


def _driving(rng: np.random.Generator) -> Float:
    """Acceleration, cruise, braking (charges) and stand, until DURATION samples are full."""
    parts: list[Float] = []
    while sum(part.size for part in parts) < DURATION:
        levels = (rng.uniform(0.5, 1.5), rng.uniform(0.1, 0.4), -rng.uniform(0.3, 0.9), 0.0)
        lengths = (rng.integers(5, 15), rng.integers(20, 90), rng.integers(3, 10), rng.integers(5, 40))
        parts += [np.full(length, level) for level, length in zip(levels, lengths, strict=True)]
    return np.concatenate(parts)[:DURATION]


def voltage(load: Load) -> Float:
    """Of the SPMe at each sample [V], shape (DURATION,).

    Raises
    ------
    PvidError
        When PyBaMM is not installed.
    """
    try:
        import pybamm
    except ImportError as error:
        raise PvidError("bench cell --write needs PyBaMM: build/venv/bin/python -m pip install pybamm") from error
    t = STEP * np.arange(DURATION)
    parameters = pybamm.ParameterValues(PARAMETERS)
    parameters["Current function [A]"] = pybamm.Interpolant(t, load.current(), pybamm.t)
    solver = pybamm.IDAKLUSolver(rtol=1e-7, atol=1e-8)
    simulation = pybamm.Simulation(pybamm.lithium_ion.SPMe(), parameter_values=parameters, solver=solver)
    solution = simulation.solve(t_eval=t, t_interp=t, initial_soc=load.charge)
    return np.asarray(solution["Voltage [V]"](t), dtype=np.float64)


def record(load: Load) -> Recording:
    """Current and voltage as a tester with 1 mA and 0.1 mV resolution records them."""
    signals = {
        "i": _rounded(load.current(), CURRENT_STEP),
        "v": _rounded(voltage(load), VOLTAGE_STEP),
    }
    return Recording(np.arange(DURATION) * np.float64(STEP), signals, 1.0 / STEP)


def _rounded(values: Float, step: float) -> Float:
    """To the nearest decimal number of a resolution."""
    return np.asarray(np.round(values, round(-np.log10(step))))


def written(folder: Path) -> list[Path]:
    """Writes the records and their PROVENANCE; gives the files."""
    paths = [folder / f"{load.name}.csv.gz" for load in LOADS]
    for load, path in zip(LOADS, paths, strict=True):
        with replacing():  # a record of any version
            write_recording(path, record(load), CHANNELS)
    note = folder / "PROVENANCE.md"
    write_whole(note, provenance().encode(), freely=True)
    return [*paths, note]


def provenance() -> str:
    """What the records are."""
    import pybamm

    rows = [
        f"| {load.name}.csv.gz | {'driving' if load.driving else 'random steps of 15 s and 240 s'} | {load.seed} | "
        f"{load.rms:g} | {load.mean:g} | {load.charge:g} |"
        for load in LOADS
    ]
    return "\n".join(
        [
            "# Cell that is no RC circuit",
            "",
            "Simulated, not recorded. `./tools/pvid bench cell --write tests/data/cell` wrote these files with PyBaMM",
            f"{pybamm.__version__} (BSD 3-Clause): model SPMe, parameter set {PARAMETERS} (LG M50, 5 A h), constant",
            f"temperature, one sample every {STEP:g} s, {DURATION} samples. Columns: t [s], i [A] (positive in",
            f"discharge, straight between samples, resolution {CURRENT_STEP:g} A), v [V] (resolution",
            f"{VOLTAGE_STEP:g} V). The loads are those of `tools/bench/cell.py`.",
            "",
            "| file | load | seed | RMS about the mean [A] | mean [A] | state of charge at the start |",
            "|---|---|---|---|---|---|",
            *rows,
            "",
        ]
    )


# ---- RC models on the records

# Ten minutes, up to a period of 100 s.
DESIGN = WeakDesign(1.0 / STEP, window_s=600.0, functions=12)
MODELS = (("2 RC pairs", "battery_2rc"), ("2 RC pairs, reaction", str(DATA / "cell_2rc_reaction.py")))
HEADER = ("model", "identified on", "mV RMS there", "predicted", "mV RMS there", "R0 mohm", "T1 s", "T2 s")


@dataclass(frozen=True)
class Outcome:
    """A model identified on one load and tried on another.

    Attributes
    ----------
    model, own, other : names
    own_rms, other_rms : of the simulated voltage's error [V]
    values : by parameter, with its standard error
    """

    model: str
    own: str
    other: str
    own_rms: float
    other_rms: float
    values: dict[str, tuple[float, float]]

    def cells(self) -> tuple[str, ...]:
        """As a row of the table."""
        shown = [f"{scale * v:.3g} +- {scale * e:.1g}" for scale, (v, e) in self._shown()]
        return (self.model, self.own, f"{1e3 * self.own_rms:.1f}", self.other, f"{1e3 * self.other_rms:.1f}", *shown)

    def _shown(self) -> list[tuple[float, tuple[float, float]]]:
        return [(scale, self.values[name]) for scale, name in ((1e3, "R0"), (1.0, "T1"), (1.0, "T2"))]


def recorded(name: str) -> Recording:
    """A record of tests/data/cell."""
    return read_recording(DATA / f"{name}.csv.gz", None, Columns(CHANNELS))


def outcome(title: str, model_name: str, own: str, other: str) -> Outcome:
    """Identifies a model on one record and simulates both.

    Rows have the weights of the sensors' noise alone: what the model lacks is an error of the voltage, not of the
    equation that is left when the hidden voltages are eliminated.
    """
    model = compiled_of(asked_for(model_name))
    run = recorded(own)
    fit = batch(WeakRows.of(Compiled(model), run.signals, DESIGN), equation_error=False)
    se = uncertainty(fit).se
    values = {name: (float(p), float(e)) for name, p, e in zip(model.p_names, fit.p, se, strict=True)}
    rms = [Replay(model, one).matches(fit.p)["v"].rms for one in (run, recorded(other))]
    return Outcome(title, own, other, rms[0], rms[1], values)


def outcomes() -> Iterator[Outcome]:
    """Every model on every pair of loads."""
    for first, second in zip(LOADS[::2], LOADS[1::2], strict=True):
        for title, name in MODELS:
            yield outcome(title, name, first.name, second.name)


def report(write: Path | None, advance: Advance) -> Report:
    """See bench.case; with a folder, its records are written there instead."""
    if write is not None:
        return Report(said=[f"{path} written" for path in written(write)])
    return Report([("cell", HEADER, [one.cells() for one in outcomes()])])
