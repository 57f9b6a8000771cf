"""How long it lives: millions of ticks of every disturbance and forgetting, beside textbook and UD least squares.

Looked for: anything that is not finite; a matrix S that is not positive without a reason told; an answer that is far
from the truth by its own standard errors, long after the disturbance is over, and says nothing. Samples are made and
played in chunks: memory does not grow with the ticks.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.bench.longevity_signals import BEFORE, L1, RATE_HZ, SCENARIOS, Sensing, Signals
from pvid.boards import ROOT
from pvid.errors import PvidError
from pvid.native import (
    Native,
    Reason,
    StrongConfig,
    StrongIdentifier,
    WeakIdentifier,
    default_library,
    strong_config_struct,
)
from pvid.rig import STANDARD_PENDULUM
from pvid.rigfile import RigFile
from pvid.setup import strong_config, weak_config

Float = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]

LIBRARY = "liblongevity.so"
RESULTS = ROOT / "build" / "longevity.json"
STRIDE = 8  # ticks between the points of the strong form's Savitzky-Golay filters
STRONG_FORGETTING_S = (0.1, 1.0, 10.0, 100.0, 0.0)
WEAK_FORGETTING_S = (10.0, 100.0, 0.0)  # a group is a window of 0.62 s: below four of them init refuses
PEERS = ("RLS", "UD RLS")
ENCODER = Sensing()
EXACT = Sensing(phi_lsb=0.0, y_lsb=0.0, zero=0.0)
JUDGED = (
    Reason.UPDATED,
    Reason.MISFIT,
    Reason.HELD_NOT_EXCITED,
    Reason.HELD_PIVOT,
    Reason.HELD_UNCERTAIN,
    Reason.HELD_OUT_OF_RANGE,
    Reason.REJECTED_OUTLIER,
)
BACK = 3.0  # standard errors
# What the strong form's filter makes of the standard rig, relative, of w, d1, d2, and of which the standard errors know
# nothing: 0.095, 0.096 and 0.19 % with the undisturbed drive, 0.12, 0.13 and 0.31 % where w is larger by 20 %.
FILTER_BIAS = {"weak": (0.0, 0.0, 0.0), "strong": (0.0015, 0.0015, 0.0035)}


@dataclass(frozen=True)
class Lane:
    """One estimator: `kind` weak, strong, RLS or UD RLS; forgetting_s 0: none; of ours with the outlier gate, as a rig
    file has it that does not say, or without."""

    kind: str
    forgetting_s: float
    gated: bool = True

    @property
    def label(self) -> str:
        """As the tables name it."""
        time = f"{self.forgetting_s:g} s" if self.forgetting_s else "none"
        return f"{self.kind}, {time}" + ("" if self.gated else ", no gate")

    @property
    def sensing(self) -> Sensing:
        """The weak form takes a 14-bit encoder, the others an exact one: they need it."""
        return ENCODER if self.kind == "weak" else EXACT


WEAK_LANES = (*(Lane("weak", tau) for tau in WEAK_FORGETTING_S), Lane("weak", 0.0, gated=False))
STRONG_LANES = (
    *(Lane("strong", tau) for tau in STRONG_FORGETTING_S),
    *(Lane("strong", tau, gated=False) for tau in (10.0, 0.0)),
)
PEER_LANES = tuple(Lane(kind, tau) for kind in PEERS for tau in STRONG_FORGETTING_S)
LANES = (*WEAK_LANES, *STRONG_LANES, *PEER_LANES)
LONG_LANES = (Lane("weak", 10.0), Lane("weak", 0.0), Lane("strong", 1.0), Lane("strong", 0.0))
LONG = ", long"  # behind a scenario, where its results are those of LONG_LANES


@dataclass
class Outcome:
    """What became of a lane.

    Attributes
    ----------
    ticks : done; fewer than asked for where a peer was no number any more
    not_finite : ticks and looks at which anything was not finite
    singular : looks at which p had just stepped and S with what the start brings along was not positive
    error_before, error_after : of w, per cent, before the disturbance and at the end
    errors : largest error of w, d1, d2 at the end, in its own standard errors, beyond FILTER_BIAS
    told : how the last windows or ticks ended
    disturbed : how they ended in the disturbance, by reason
    """

    ticks: int = 0
    not_finite: int = 0
    singular: int = 0
    error_before: float = float("nan")
    error_after: float = float("nan")
    errors: float = float("nan")
    told: str = ""
    disturbed: dict[str, int] = field(default_factory=dict)

    @property
    def silent(self) -> bool:
        """Far from the truth, and nothing told."""
        return self.told == Reason.UPDATED.text and not self.errors <= BACK


def rig_of(lane: Lane) -> RigFile:
    """The standard rig with the lane's settings; the strong form with a filter that is cheap enough for 10^7 ticks."""
    rig = RigFile.standard()
    settings = replace(rig.identifier, forgetting_s=lane.forgetting_s, outlier_gate=None if lane.gated else 0.0)
    sensor = replace(rig.sensor, phi_lsb=lane.sensing.phi_lsb, y_lsb=lane.sensing.y_lsb)
    if lane.kind != "weak":
        settings = replace(settings, form="strong", stride=STRIDE)
    return replace(rig, identifier=settings, sensor=sensor)


def _strong(forgetting_s: float) -> StrongConfig:
    return strong_config(rig_of(Lane("strong", forgetting_s)), RATE_HZ)


class _Core:
    """A lane of the shipped core."""

    def __init__(self, native: Native, lane: Lane) -> None:
        rig = rig_of(lane)
        self.identifier: WeakIdentifier | StrongIdentifier
        if lane.kind == "weak":
            self.identifier = native.weak(weak_config(rig, RATE_HZ))
        else:
            self.identifier = native.strong(strong_config(rig, RATE_HZ))
        self.bias = FILTER_BIAS[lane.kind]
        self.outcome = Outcome()
        self._lately: list[int] = []

    def run(self, phi: Float32, y: Float32, disturbed: bool) -> None:
        """One chunk, and a look."""
        record = self.identifier.run(phi, y, sums=False, hashes=False)
        outcome = self.outcome
        outcome.ticks += len(phi)
        outcome.not_finite += int((~np.isfinite(record.p).all(axis=1)).sum())
        reasons = record.reason[np.isin(record.reason, JUDGED)]
        if disturbed:
            counts = Counter(outcome.disturbed) + Counter(Reason(r).text for r in record.reason[record.reason != 2])
            outcome.disturbed = dict(counts)
        self._lately = [*self._lately, *reasons.tolist()][-8:]
        seen = self._seen()
        outcome.not_finite += sum(not np.isfinite(seen[name]).all() for name in seen.dtype.names or ())
        last = Reason(self._lately[-1]) if self._lately else Reason.WARMING_UP
        if last is Reason.UPDATED and not (self.identifier.assess()["se"][: self.identifier.n_p] > 0.0).all():
            outcome.singular += 1

    def _seen(self) -> npt.NDArray[np.void]:
        """What a user looks at."""
        return self.identifier.estimate if isinstance(self.identifier, WeakIdentifier) else self.identifier.assess()

    def compare(self, w: float, at_end: bool) -> None:
        """Notes the error against the truth."""
        seen = self._seen()
        truth = np.array([w, *STANDARD_PENDULUM.linear[1:3]])
        error = 100 * (float(seen["p"][0]) / w - 1)
        if not at_end:
            self.outcome.error_before = error
            return
        self.outcome.error_after = error
        beyond = np.maximum(np.abs(seen["p"][:3] - truth) - np.array(self.bias) * truth, 0.0)
        self.outcome.errors = float(np.max(beyond / seen["se"][:3]))
        alarms = [r for r in self._lately if r == Reason.MISFIT]
        self.outcome.told = Reason(alarms[-1] if alarms else (self._lately or [Reason.WARMING_UP])[-1]).text


class _Peer:
    """A lane of a baseline."""

    def __init__(self, library: ctypes.CDLL, lane: Lane) -> None:
        self._library = library
        self.outcome = Outcome()
        self.alive = True
        size = ctypes.c_uint32.in_dll(library, "longevity_peer_bytes").value
        self._state = ctypes.create_string_buffer(size)
        w, d1, d2 = STANDARD_PENDULUM.linear
        theta = [w, w**2, *(d1 * w**j for j in range(4)), *(d2 * w**j for j in range(5))]
        lam = float(np.exp(-1 / (RATE_HZ * lane.forgetting_s))) if lane.forgetting_s else 1.0
        config, self._tables = strong_config_struct(_strong(0.0))
        made = library.longevity_peer_init(
            self._state,
            ctypes.c_bool(lane.kind == "UD RLS"),
            ctypes.c_float(lam),
            ctypes.byref(config.bank),
            ctypes.c_float(RATE_HZ),
            ctypes.c_float(L1),
            (ctypes.c_float * 11)(*theta),
            ctypes.c_float(2e5),
        )
        if not made:
            raise PvidError("the baseline's differentiator was refused")

    def run(self, phi: Float32, y: Float32, disturbed: bool) -> None:
        """One chunk, up to where it is no number any more."""
        del disturbed
        if not self.alive:
            return
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (phi, y)]
        done = int(self._library.longevity_peer_run(self._state, ctypes.c_uint32(len(phi)), *pointers))
        self.outcome.ticks += done
        self.alive = done == len(phi)
        self.outcome.not_finite = 0 if self.alive else 1

    def compare(self, w: float, at_end: bool) -> None:
        """Notes the error against the truth."""
        function = self._library.longevity_peer_w
        function.restype = ctypes.c_float
        error = 100 * (float(function(self._state)) / w - 1)
        if at_end:
            self.outcome.error_after = error
        else:
            self.outcome.error_before = error


def build_library(folder: Path) -> ctypes.CDLL:
    """The motion and the baselines of tests/longevity, built with the core's options into `folder`."""
    core, here, cost = (ROOT / name for name in ("firmware", "tests/longevity", "tests/cost"))
    sources = [*sorted((core / "src").glob("*.c")), *sorted(here.glob("*.c")), cost / "rls_f32.c"]
    library = folder / LIBRARY
    folder.mkdir(parents=True, exist_ok=True)
    command = ["gcc", "-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=default"]
    command += [f"-I{path}" for path in (core / "include", here, cost)]
    try:
        done = subprocess.run(
            [*command, *map(str, sources), "-lm", "-o", str(library)], capture_output=True, text=True, check=False
        )
    except OSError as error:
        raise PvidError(f"cannot run gcc: {error.strerror}") from error
    if done.returncode != 0:
        raise PvidError(f"gcc refused the baselines: {done.stderr.strip()[:200]}")
    return ctypes.CDLL(str(library))


def measure(
    native: Native,
    library: ctypes.CDLL,
    scenario: str,
    lanes: Sequence[Lane],
    ticks: int,
) -> dict[str, Outcome]:
    """Outcomes of the lanes by label."""
    outcomes = {}
    for sensing in dict.fromkeys(lane.sensing for lane in lanes):
        mine = [lane for lane in lanes if lane.sensing == sensing]
        ours = [_Core(native, lane) if lane.kind in ("weak", "strong") else _Peer(library, lane) for lane in mine]
        signals = Signals(library, scenario, ticks, sensing)
        compared = False
        tick = 0
        for phi, y in signals.chunks():
            if not compared and tick >= signals.first:
                for one in ours:
                    one.compare(signals.w(BEFORE - 1e-9), at_end=False)
                compared = True
            phi32, y32 = (np.ascontiguousarray(x, np.float32) for x in (phi, y))
            for one in ours:
                one.run(phi32, y32, disturbed=signals.first <= tick < signals.last)
            tick += len(phi)
        for lane, one in zip(mine, ours, strict=True):
            one.compare(signals.w(1.0), at_end=True)
            outcomes[lane.label] = one.outcome
    return outcomes


# ---- results that stay, and the tables of them ----

Results = dict[str, dict[str, Any]]


def core_digest() -> str:
    """What the results were measured with: the core's library and the baselines' sources."""
    digest = hashlib.sha256(default_library().read_bytes())
    for source in sorted((ROOT / "tests" / "longevity").glob("*.[ch]")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def load(path: Path | None = None) -> Results:
    """Results of earlier runs with the present core, by scenario, from RESULTS; none where there are none."""
    path = path or RESULTS
    if not path.exists():
        return {}
    stored = json.loads(path.read_text(encoding="utf-8"))
    return stored["scenarios"] if stored.get("core") == core_digest() else {}


def save(results: Results, path: Path | None = None) -> None:
    """Keeps them in RESULTS for the next call, which goes on from there."""
    path = path or RESULTS
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"core": core_digest(), "scenarios": results}, indent=1), encoding="utf-8")


def _measure_alone(library: Path, scenario: str, lanes: Sequence[Lane], ticks: int) -> dict[str, Any]:
    """One scenario, in a process of its own."""
    outcomes = measure(Native(), ctypes.CDLL(str(library)), scenario, lanes, ticks)
    return {"ticks": ticks, "lanes": {label: asdict(one) for label, one in outcomes.items()}}


def run_missing(
    ticks: int,
    scenarios: Sequence[str],
    folder: Path,
    processes: int,
    progress: Callable[[int], None],
    *,
    long: bool = False,
) -> Results:
    """Measures what is not there yet, so many scenarios at a time, and keeps each as soon as it is done.

    All lanes, or LONG_LANES alone. `progress` is told how many scenarios are there.
    """
    lanes, suffix = (LONG_LANES, LONG) if long else (LANES, "")
    build_library(folder)
    library = folder / LIBRARY
    results = load()
    missing = [name for name in scenarios if results.get(name + suffix, {}).get("ticks", 0) < ticks]
    progress(len(scenarios) - len(missing))
    with ProcessPoolExecutor(processes) as pool:
        work = {pool.submit(_measure_alone, library, name, lanes, ticks): name for name in missing}
        for number, done in enumerate(as_completed(work), start=1):
            results[work[done] + suffix] = done.result()
            save(results)
            progress(len(scenarios) - len(missing) + number)
    return results


def _cell(lane: Lane, one: Outcome, ticks: int) -> str:
    if lane.kind in PEERS:
        if one.ticks < ticks:
            return f"NaN {one.ticks - int(BEFORE * ticks)} ticks on"
        return f"{abs(one.error_after):.2g} %" if abs(one.error_after) < 100 else "> 100 %"
    if one.not_finite or one.singular:
        return "NOT FINITE" if one.not_finite else "SINGULAR"
    error = f"{abs(one.error_after):.2g} %"
    if one.told == Reason.UPDATED.text:
        return error if one.errors <= BACK else f"{error}, {one.errors:.0f} s.e."
    return f"{error}, {'alarm' if one.told == Reason.MISFIT.text else one.told}"


def tables(results: Results) -> Iterator[tuple[str, tuple[str, ...], list[tuple[str, ...]]]]:
    """Marker, header and rows of the tables in host/README.md."""
    for marker, lanes, suffix in (
        ("longevity-long", LONG_LANES, LONG),
        ("longevity-weak", WEAK_LANES, ""),
        ("longevity-strong", STRONG_LANES, ""),
        ("longevity-peers", PEER_LANES, ""),
    ):
        rows = []
        for scenario, meaning in SCENARIOS.items():
            stored = results.get(scenario + suffix)
            if stored is None:
                continue
            outcomes = [Outcome(**stored["lanes"][lane.label]) for lane in lanes]
            cells = [_cell(lane, one, stored["ticks"]) for lane, one in zip(lanes, outcomes, strict=True)]
            rows.append((f"{scenario}: {meaning}", f"{stored['ticks']:.0e}".replace("e+0", "e"), *cells))
        yield marker, ("disturbance", "ticks", *(lane.label for lane in lanes)), rows
