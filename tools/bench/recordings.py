"""Real hardware, recorded by other laboratories: where the recordings are, and how a short piece of each is cut.

The rigs are those of tests/data/recordings/sources.toml, with their mechanisms. The recordings of SOURCES are not in
this repository; `./tools/pvid bench recordings FOLDER --cut CHECKOUTS` cuts two pieces of each from checkouts
CHECKOUTS/OWNER/NAME of the public repositories: one to identify from, one to predict. Pieces of KEPT are here;
`./tools/pvid bench kept-recordings --cut ARCHIVES` cuts them anew from the unpacked archives ARCHIVES/NAME-VERSION.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.io import loadmat

from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.base.replacing import replacing
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.rig.columns import Channel, Columns
from pvid.rig.run import Recording, read_recording, write_recording

Float = npt.NDArray[np.float64]
Names = Sequence[str]

MECHANISMS = Path(__file__).resolve().parents[2] / "tests" / "data" / "recordings"
PIECES = ("identify", "predict")

_SLACK = 1e-3  # of a sample: the last one counts, whatever its last bits are


@dataclass(frozen=True)
class Piece:
    """Part of a recorded run.

    Attributes
    ----------
    path : in the repository
    start, end : [s] of the run's own clock
    part : which of the file's runs, where it has several
    """

    path: str
    start: float = 0.0
    end: float = float("inf")
    part: int = 0


@dataclass(frozen=True)
class Measured(Channel):
    """A channel, and what it is in words."""

    meaning: str = ""


@dataclass(frozen=True)
class Origin:
    """A public repository, whose recordings are not copied into this one, or the source archive of a Python package, of
    whose recordings pieces are kept in tests/data/recordings.

    Attributes
    ----------
    name : owner/name of the repository; of the package, as its registry has it
    commit : of the repository, that the figures of the docs are from
    version, licence : of the package, and the path of its licence's text
    """

    name: str
    commit: str = ""
    version: str = ""
    licence: str = ""

    @property
    def folder(self) -> str:
        """Of its checkout, or of the unpacked archive."""
        return f"{self.name}-{self.version}" if self.version else self.name

    @property
    def request(self) -> str:
        """What a user must do to have it there."""
        if self.version:
            return f"unpack the source archive of the Python package {self.name} {self.version} there"
        return f"check out {self.name} at {self.commit} there"

    def __str__(self) -> str:
        """For a table of origins."""
        if self.version:
            return f"Python package {self.name} {self.version}, source archive"
        return f"{self.name}, commit {self.commit}"


@dataclass(frozen=True)
class Source:
    """Two recorded runs of one rig, and what its owners published about it.

    Attributes
    ----------
    name : of the rig
    file : of the mechanism
    origin : where the recordings are
    licence : of the origin, with its copyright line
    read : its format, one of _READERS
    identify, predict : the two pieces
    rate : samples a second of the pieces [Hz]; the recording's own rate unless given
    decimals : digits kept behind the point, by signal; beyond what the sensor resolves
    published : parameters of the mechanism that follow from the owners' own
    published_at : where these stand
    knowns : constants of the mechanism that this rig has, where they differ from those of its file
    traps : further runs of the rig, by the alarm that they must raise: the mechanism cannot be identified from them
    note : what a reader of the pieces must know, for PROVENANCE.md
    """

    name: str
    file: str
    origin: Origin
    licence: str
    read: str
    identify: Piece
    predict: Piece
    channels: tuple[Measured, ...]
    rate: float | None = None
    decimals: Mapping[str, int] = field(default_factory=dict)
    published: Mapping[str, float] = field(default_factory=dict)
    published_at: str = ""
    knowns: Mapping[str, float] = field(default_factory=dict)
    traps: Mapping[str, Piece] = field(default_factory=dict)
    note: str = ""

    def model(self) -> CompiledModel:
        """The compiled mechanism, with this rig's constants."""
        model = compiled_of(MECHANISMS / self.file)
        knowns = tuple(replace(one, value=self.knowns.get(one.name, one.value)) for one in model.knowns)
        return replace(model, knowns=knowns)

    @property
    def pieces(self) -> dict[str, Piece]:
        """By the name of the file that they are cut into."""
        return dict(zip(PIECES, (self.identify, self.predict), strict=True)) | dict(self.traps)

    def cut(self, checkouts: Path, piece: Piece) -> Recording:
        """The piece, from a checkout of the repository at CHECKOUTS/OWNER/NAME or an archive at CHECKOUTS/NAME-VERSION.

        Raises
        ------
        PvidError
            When there is no such file.
        """
        path = checkouts / self.origin.folder / piece.path
        if not path.is_file():
            raise PvidError(f"{path} does not exist: {self.origin.request}")
        table = dict(_READERS[self.read](path, piece.part, [one.name for one in self.channels]))
        t = table.pop("t")
        later = np.append(True, np.diff(t) > 0)
        used = later & (t >= piece.start) & (t < piece.end)
        t, signals = t[used], {name: one[used] for name, one in table.items()}
        rate = self.rate or 1.0 / float(np.median(np.diff(t)))
        clock = np.arange(int((t[-1] - t[0]) * rate + _SLACK) + 1) / rate
        even = {
            name: np.round(np.interp(t[0] + clock, t, one), self.decimals.get(name, 6)) for name, one in signals.items()
        }
        return Recording(clock, even, rate)

    def load(self, folder: Path, piece: str) -> Recording:
        """A piece that was cut before, in FOLDER/NAME: "identify", "predict" or the name of a trap."""
        return read_recording(folder / self.name / f"{piece}.csv.gz", None, Columns(self.channels))


def write_source(source: Source, checkouts: Path, folder: Path) -> list[Path]:
    """Cuts the pieces of a source and writes where they are from; gives the files."""
    place = folder / source.name
    place.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, piece in source.pieces.items():
        paths.append(place / f"{name}.csv.gz")
        with replacing():  # a piece of any version
            write_recording(paths[-1], source.cut(checkouts, piece), source.channels)
    paths.append(place / "PROVENANCE.md")
    write_whole(paths[-1], provenance(source).encode(), freely=True)
    if source.origin.version:
        paths.append(place / "LICENSE.txt")
        write_whole(paths[-1], (checkouts / source.origin.folder / source.origin.licence).read_bytes(), freely=True)
    return paths


def provenance(source: Source) -> str:
    """Where the pieces are from, and what they hold."""
    columns = ", ".join(f"{one.name} [{one.unit}] {one.meaning}" for one in source.channels)
    pieces = [
        f"| {name}.csv.gz | {piece.path} | {piece.part} | {piece.start:g} to {piece.end:g} |"
        for name, piece in source.pieces.items()
    ]
    published = ", ".join(f"{name} = {value:.6g}" for name, value in source.published.items())
    command, licence = "recordings FOLDER --cut CHECKOUTS", "LICENSE of that repository"
    if source.origin.version:
        command, licence = "kept-recordings --cut ARCHIVES", "LICENSE.txt beside this one"
    rate = "the recording's own" if source.rate is None else f"{source.rate:g} Hz"
    return "\n".join(
        [
            f"# {source.name}",
            "",
            f"Recorded by others: {source.origin}.",
            f"Licence: {source.licence}. Its text is the file {licence}.",
            "",
            f"Columns: t [s], {columns}. Interpolated onto an even clock, rate: {rate}; rounded below the",
            f"resolution of the sensors. Cut by `./tools/pvid bench {command}`.",
            "",
            "| file | of | part | s |",
            "|---|---|---|---|",
            *pieces,
            "",
            f"Published there ({source.published_at}): {published}." if published else "No parameters are published.",
            *(("", source.note) if source.note else ()),
            "",
        ]
    )


# ---- formats: a file, a part of it and the names of the signals -> t [s] and signals in SI, by name

_CLOCK = 1000.0  # samples in the unit of time of the motor's model: the clock is not published
_REST = 4000  # samples before the motor is first switched on
_SCALE = 1000.0  # of the generator's numbers
_SWITCHED = 5.0  # the input while the motor is on
_SWING_MIDDLE = 1.356  # [V] about which the fork's gyroscope swings
_MEAN = 5  # samples of the lift


def _columns(path: Path, names: Mapping[str, str]) -> dict[str, Float]:
    """Columns of a text table with a header line, under new names."""
    with path.open(encoding="utf-8") as file:
        header = file.readline().strip().split(",")
        table = np.loadtxt(file, delimiter=",", ndmin=2)
    return {name: np.asarray(table[:, header.index(column)]) for name, column in names.items()}


def _two_links(path: Path, _: int, __: Names) -> dict[str, Float]:
    names = {"q1": "pos_meas1", "q2": "pos_meas2", "t1": "tau_meas1", "t2": "tau_meas2"}
    return _columns(path, {"t": "time", **names})


def _one_link(path: Path, _: int, __: Names) -> dict[str, Float]:
    return _columns(path, {"t": "time", "q": "position", "tau": "torque"})


def _free_swing(path: Path, part: int, names: Names) -> dict[str, Float]:
    """A file with pieces of one run: part 0 those of Y_id, part 1 those of Y_vad; angles, then velocities."""
    content, key = loadmat(path, squeeze_me=True), ("id", "vad")[part]
    motion = np.concatenate([np.asarray(one).T for one in content[f"Y_{key}"]])
    t = np.concatenate(list(content[f"Time_{key}"]))
    return {"t": t, **{name: np.ascontiguousarray(motion[:, k]) for k, name in enumerate(names)}}


def _random_discharge(path: Path, part: int, _: Names) -> dict[str, Float]:
    """The discharge number `part` of random steps of the current; charge counted from its start [A s]."""
    run = loadmat(path, squeeze_me=True)["rw_data"][part]
    t, i, v = (np.asarray(run[name], dtype=np.float64) for name in ("t", "I", "V"))
    charge = np.append(0.0, np.cumsum((i[1:] + i[:-1]) / 2 * np.diff(t)))
    return {"t": t, "i": i, "q": charge, "v": v}


def _switched_motor(path: Path, _: int, __: Names) -> dict[str, Float]:
    """The generator's numbers of PATH less their value at rest; the input beside it."""
    y, u = (np.loadtxt(one, ndmin=1) for one in (path, path.with_name("x_cc.csv")))
    return {"t": np.arange(len(y)) / _CLOCK, "u": u / _SWITCHED, "y": (y - y[:_REST].mean()) / _SCALE}


def _gyroscope(path: Path, _: int, __: Names) -> dict[str, Float]:
    content = loadmat(path, squeeze_me=True)
    v = np.asarray(content["data"], dtype=np.float64)
    return {"t": np.arange(len(v)) / float(content["ActualRate"]), "v": v - _SWING_MIDDLE}


def _lift(path: Path, _: int, __: Names) -> dict[str, Float]:
    """Means of five samples of the first joint; the file of the efforts is beside that of the positions."""
    files = (path, path.with_name("tiago_effort.csv"))
    positions, efforts = (np.loadtxt(one, delimiter=",", skiprows=1) for one in files)
    whole = len(positions) // _MEAN * _MEAN
    columns = {"t": positions[:whole, 0], "q": positions[:whole, 1], "i": efforts[:whole, 1]}
    return {name: one.reshape(-1, _MEAN).mean(axis=1) for name, one in columns.items()}


_READERS: Mapping[str, Callable[[Path, int, Names], dict[str, Float]]] = {
    one.__name__[1:]: one
    for one in (_two_links, _one_link, _free_swing, _random_discharge, _switched_motor, _gyroscope, _lift)
}


def _source(given: Mapping[str, Any]) -> Source:
    """Of an entry of sources.toml."""
    made: dict[str, Any] = {**given}
    made |= {key: Piece(**made[key]) for key in PIECES}
    made["traps"] = {name: Piece(**piece) for name, piece in made.get("traps", {}).items()}
    made |= {"origin": Origin(**made["origin"]), "channels": tuple(Measured(**one) for one in made["channels"])}
    return Source(**made)


_ALL = [_source(one) for one in tomllib.loads((MECHANISMS / "sources.toml").read_text(encoding="utf-8"))["rig"]]
SOURCES = tuple(one for one in _ALL if not one.origin.version)
KEPT = tuple(one for one in _ALL if one.origin.version)  # pieces are in tests/data/recordings
