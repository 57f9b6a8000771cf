"""Real hardware, recorded by other laboratories: where the recordings are, and how a short piece of each is cut.

The recordings of SOURCES are not in this repository; `./tools/pvid bench recordings FOLDER --cut CHECKOUTS` cuts two
pieces of each from checkouts CHECKOUTS/OWNER/NAME of the public repositories: one to identify from, one to predict.
Pieces from packages are kept here, see bench.kept_recordings. The mechanisms are those of tests/data/recordings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.base.replacing import replacing
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.rig.columns import Channel, Columns
from pvid.rig.run import Recording, read_recording, write_recording

Float = npt.NDArray[np.float64]

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
class Repository:
    """A public repository, whose recordings are not copied into this one.

    Attributes
    ----------
    name : owner/name
    commit : that the figures of the docs are from
    """

    name: str
    commit: str

    @property
    def folder(self) -> str:
        """Of its checkout."""
        return self.name

    @property
    def request(self) -> str:
        """What a user must do to have it there."""
        return f"check out {self.name} at {self.commit} there"

    def __str__(self) -> str:
        """For a table of origins."""
        return f"{self.name}, commit {self.commit}"


@dataclass(frozen=True)
class Package:
    """The source archive of a Python package: what is cut from its recordings is kept in tests/data/recordings.

    Attributes
    ----------
    name, version : as the package registry has them
    licence : path of its text
    """

    name: str
    version: str
    licence: str

    @property
    def folder(self) -> str:
        """Of the unpacked archive."""
        return f"{self.name}-{self.version}"

    @property
    def request(self) -> str:
        """What a user must do to have it there."""
        return f"unpack the source archive of the Python package {self.name} {self.version} there"

    def __str__(self) -> str:
        """For a table of origins."""
        return f"Python package {self.name} {self.version}, source archive"


@dataclass(frozen=True)
class Source:
    """Two recorded runs of one rig, and what its owners published about it.

    Attributes
    ----------
    name : of the rig
    file : of the mechanism
    origin : where the recordings are
    licence : of the origin, with its copyright line
    read : a file and a part of it -> t [s] and signals of the mechanism in SI, by name
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
    origin: Repository | Package
    licence: str
    read: Callable[[Path, int], Mapping[str, Float]]
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
        table = dict(self.read(path, piece.part))
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
    if isinstance(source.origin, Package):
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
    rate = "the recording's own" if source.rate is None else f"{source.rate:g} Hz"
    return "\n".join(
        [
            f"# {source.name}",
            "",
            f"Recorded by others: {source.origin}.",
            f"Licence: {source.licence}. {_where_licence(source.origin)}",
            "",
            f"Columns: t [s], {columns}. Interpolated onto an even clock, rate: {rate}; rounded below the",
            f"resolution of the sensors. Cut by `{_command(source.origin)}`.",
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


def _where_licence(origin: Repository | Package) -> str:
    if isinstance(origin, Package):
        return "Its text is the file LICENSE.txt beside this one."
    return "Its text is the file LICENSE of that repository."


def _command(origin: Repository | Package) -> str:
    if isinstance(origin, Package):
        return "./tools/pvid bench kept-recordings --cut ARCHIVES"
    return "./tools/pvid bench recordings FOLDER --cut CHECKOUTS"


# ---- formats


def _columns(path: Path, names: Mapping[str, str]) -> dict[str, Float]:
    """Columns of a text table with a header line, under new names."""
    with path.open(encoding="utf-8") as file:
        header = file.readline().strip().split(",")
        table = np.loadtxt(file, delimiter=",", ndmin=2)
    return {name: np.asarray(table[:, header.index(column)]) for name, column in names.items()}


def _two_links(path: Path, part: int) -> dict[str, Float]:
    del part
    names = {"q1": "pos_meas1", "q2": "pos_meas2", "t1": "tau_meas1", "t2": "tau_meas2"}
    return _columns(path, {"t": "time", **names})


def _one_link(path: Path, part: int) -> dict[str, Float]:
    del part
    return _columns(path, {"t": "time", "q": "position", "tau": "torque"})


def _free_swing(names: tuple[str, ...]) -> Callable[[Path, int], dict[str, Float]]:
    """A file with pieces of one run: part 0 those of Y_id, part 1 those of Y_vad; angles, then velocities."""

    def read(path: Path, part: int) -> dict[str, Float]:
        from scipy.io import loadmat

        content = loadmat(path, squeeze_me=True)
        key = ("id", "vad")[part]
        t = np.concatenate(list(content[f"Time_{key}"]))
        motion = np.concatenate([np.asarray(one).T for one in content[f"Y_{key}"]])
        return {"t": t, **{name: np.ascontiguousarray(motion[:, k]) for k, name in enumerate(names)}}

    return read


def _random_discharge(path: Path, part: int) -> dict[str, Float]:
    """The discharge number `part` of random steps of the current; charge counted from its start [A s]."""
    from scipy.io import loadmat

    run = loadmat(path, squeeze_me=True)["rw_data"][part]
    t, i, v = (np.asarray(run[name], dtype=np.float64) for name in ("t", "I", "V"))
    charge = np.append(0.0, np.cumsum((i[1:] + i[:-1]) / 2 * np.diff(t)))
    return {"t": t, "i": i, "q": charge, "v": v}


# ---- sources

_ANGLES = ("q1", "q2")
_DFKI = "BSD 3-Clause, Copyright (c) {year}, DFKI RIC Underactuated Robotics Lab"
_DOUBLE = Repository("dfki-ric-underactuated-lab/double_pendulum", "1e8544e67f3da72a51ee52fbbb278e131ce2a43f")
_SWINGS = Repository("dynamicslab/MultiArm-Pendulum", "e99a7e13fe2adc8fc647321a156b6cb59a48a698")
_SINGLE = Repository(
    "dfki-ric-underactuated-lab/torque_limited_simple_pendulum", "ed17ea2d32a35ad944944ca03ef57693e2986732"
)
_CELL = Repository(
    "Silencefrog9305/Digital-Twins-for-Battery-Using-CTA-MTL", "ec0fe7c0e6ceb8576086d3adc8232b7d14616deb"
)
_TWO_LINK_CHANNELS = (
    Measured("q1", "rad", meaning="angle of the upper link"),
    Measured("q2", "rad", meaning="angle of the lower link to the upper"),
    Measured("t1", "N*m", meaning="torque of the upper motor"),
    Measured("t2", "N*m", meaning="torque of the lower motor"),
)
_ONE_LINK_CHANNELS = (Measured("q", "rad", meaning="angle"), Measured("tau", "N*m", meaning="torque"))
_CELL_CHANNELS = (
    Measured("i", "A", meaning="current"),
    Measured("q", "A*s", meaning="charge drawn"),
    Measured("v", "V", meaning="voltage"),
)


def _links(
    m1: float, r1: float, i1: float, m2: float, r2: float, i2: float, l1: float, rotor: float
) -> dict[str, float]:
    """Parameters of the mechanism of masses, distances, inertias about the joints and a rotor geared 6 : 1."""
    return {
        "J1": i1 + m2 * l1**2 + 36 * rotor,
        "J2": i2,
        "Jm": 36 * rotor,
        "h1": m1 * r1 + m2 * l1,
        "h2": m2 * r2,
    }


def _double(
    name: str, design: str, day: str, runs: tuple[int, int], l1: float, published: dict[str, float], at: str
) -> Source:
    folder = f"data/experiment_records/{design}/{day}/sys_id"
    return Source(
        name=name,
        file="double_pendulum.py",
        origin=_DOUBLE,
        licence=_DFKI.format(year=2022),
        read=_two_links,
        identify=Piece(f"{folder}/trajectory_{runs[0]:02d}.csv"),
        predict=Piece(f"{folder}/trajectory_{runs[1]:02d}.csv"),
        channels=_TWO_LINK_CHANNELS,
        rate=500.0,
        decimals={"t1": 4, "t2": 4},
        published=published,
        published_at=f"data/system_identification/identified_parameters/{design}/{at}/model_parameters.yml",
        knowns={"l1": l1},
    )


SOURCES = (
    _double(
        "double_pendulum_a",
        "design_A.0",
        "20220815",
        (5, 1),
        0.3,
        _links(0.55938, 0.3, 0.0534708, 0.6043459, 0.1837769, 0.0239237, 0.3, 7.6593e-5)
        | {"b1": 0.001, "c1": 0.093, "b2": 0.001, "c2": 0.078},
        "model_2.0",
    ),
    _double(
        "double_pendulum_c",
        "design_C.0",
        "20220914",
        (2, 1),
        0.2,
        _links(0.6416938, 0.2, 0.0267108, 0.5639360, 0.3212670, 0.0538781, 0.2, 9.9373e-5)
        | {"b1": 0.001, "c1": 0.093, "b2": 0.001, "c2": 0.078},
        "model_3.0",
    ),
    Source(
        name="simple_pendulum",
        file="simple_pendulum.py",
        origin=_SINGLE,
        licence=_DFKI.format(year=2021),
        read=_one_link,
        identify=Piece("results/control_method_direct_collocation/data_measured.csv"),
        predict=Piece("results/control_method_ddp/data_measured.csv"),
        channels=_ONE_LINK_CHANNELS,
        decimals={"tau": 4},
        published={"J": 0.139625, "G": 0.6755 * 0.5 * 9.81, "b": 0.1},
        published_at="data/parameters/sp_parameters_sac.yaml",
        traps={
            # a swing-up by small pushes: most of the motion is not the torque's work
            "attenuation": Piece("results/control_method_energy_shaping/data_measured.csv"),
            # the torque is that which holds the weight
            "feedback": Piece("results/control_method_gravity_compensation/data_measured.csv", end=15.0),
        },
    ),
    Source(
        name="free_pendulum",
        file="free_pendulum.py",
        origin=_SWINGS,
        licence="MIT, Copyright (c) 2022 dynamicslab",
        read=_free_swing(("q",)),
        identify=Piece("ParameterEstimation/SinglePendulum/SinglePendulumDataForParameterEstimation.mat", part=0),
        predict=Piece("ParameterEstimation/SinglePendulum/SinglePendulumDataForParameterEstimation.mat", part=1),
        channels=(Measured("q", "rad", meaning="angle from upright"),),
        # m a g/(m a^2 + I) and k/(m a^2 + I) of the five numbers of the file
        published={"w2": 64.221, "k": 0.06723, "c": 0.0, "o": 0.0},
        published_at="ParameterEstimation/SinglePendulum/EstimatedParameters_SinglePendulum.mat",
    ),
    Source(
        name="free_double_pendulum",
        file="free_double_pendulum.py",
        origin=_SWINGS,
        licence="MIT, Copyright (c) 2022 dynamicslab",
        read=_free_swing(_ANGLES),
        identify=Piece(
            "ParameterEstimation/DoublePendulum/DoublePendulumDataForParameterEstimation.mat", end=16.0, part=0
        ),
        predict=Piece(
            "ParameterEstimation/DoublePendulum/DoublePendulumDataForParameterEstimation.mat", 16.0, 26.0, part=0
        ),
        channels=tuple(Measured(name, "rad", meaning="angle from upright") for name in _ANGLES),
        # of the ten numbers of the file, over m2 a2 L1
        published={"A": 2.035, "B": 1.134, "G1": 120.0, "G2": 56.8, "k1": 0.0854, "k2": 0.0036},
        published_at="ParameterEstimation/DoublePendulum/EstimatedParameters_DoublePendulum.mat",
    ),
    Source(
        name="cell_dmegc",
        file="cell_dmegc.py",
        origin=_CELL,
        licence="MIT, Copyright (c) 2025 Silencefrog9305",
        read=_random_discharge,
        # both to 1.9 A h: a polynomial of the charge must not be extrapolated
        identify=Piece("Exp25_R1.mat", end=3500.0, part=25),
        predict=Piece("Exp25_R1.mat", end=2800.0, part=26),
        channels=_CELL_CHANNELS,
        rate=0.1,
        decimals={"i": 4, "q": 3, "v": 4},
    ),
)
