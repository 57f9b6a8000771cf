"""How long it lives: millions of ticks of every disturbance and forgetting, beside textbook and UD least squares.

Looked for: anything that is not finite; a matrix S that is not positive without a reason told; an answer that is far
from the truth by its own standard errors, long after the disturbance is over, and says nothing. Samples are made and
played in chunks: memory does not grow with the ticks.
"""

from __future__ import annotations

import ctypes
import subprocess
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.longevity_signals import CHUNK, L1, RATE_HZ, Disturbance, Sensing, Signals
from pvid.base.errors import PvidError
from pvid.codegen.refine import refine_functions
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.codegen.weak_q31 import FixedEngine
from pvid.configuration.weak import config_for_simulated_rig
from pvid.configuration.weak_q31 import engine_for_simulated_rig
from pvid.core.headers import Filled, Headers, default_library
from pvid.core.native import Identifier, Native, Publisher
from pvid.core.sources import PUBLIC_FOLDERS, ROOT
from pvid.core.weak_native import RefinedIdentifier, WeakIdentifier, WeakNative
from pvid.core.weak_native_q31 import WeakIdentifierQ31, WeakNativeQ31
from pvid.design.refine import refine_config
from pvid.models.kapitza.refinement import refine_rig, sample_sd
from pvid.models.mechanisms import compiled_of
from pvid.rig.file import RigFile
from pvid.settings.bounds import SIZES
from pvid.settings.enums import Reason
from pvid.settings.f32 import GateConfig
from pvid.settings.q31 import StrongConfigQ31
from pvid.settings.weak import WeakConfig
from pvid.setup.f32 import strong_config
from pvid.setup.q31 import counts_of_samples, p_of, se_of, strong_config_q31
from pvid.sim.pendulum import STANDARD_DRIVE, STANDARD_PENDULUM, Tone

Float = npt.NDArray[np.float64]

LIBRARY = "liblongevity.so"
STRIDE = 8  # ticks between the points of the strong form's Savitzky-Golay filters
STRONG_FORGETTING_S = (0.1, 1.0, 10.0, 100.0, 0.0)
WEAK_FORGETTING_S = (10.0, 100.0, 0.0)  # a group is a window: below four of them init refuses
REFINED_FORGETTING_S = (10.0, 0.0)
PEERS = ("RLS", "UD RLS")
ENCODER = Sensing()
EXACT = Sensing(phi_lsb=0.0, y_lsb=0.0, zero=0.0)
FINE = Sensing(phi_lsb=2 * np.pi / 2**22, y_lsb=2e-8, zero=0.0)  # integers have to count in something
JUDGED = (
    Reason.UPDATED,
    Reason.MISFIT,
    Reason.HELD_NOT_EXCITED,
    Reason.HELD_SINGULAR,
    Reason.HELD_UNCERTAIN,
    Reason.HELD_OUT_OF_RANGE,
    Reason.REJECTED_OUTLIER,
)
BACK = 3.0  # standard errors
PATIENCE = 1.0  # of the gate, in times of forgetting, as a rig file has it that does not say
# What the filters make of the standard rig, relative, of w, d1, d2, and of which the standard errors know nothing: see
# `filter_bias`; of the weak form with exact samples 0.9e-6, 0.8e-6 and 1.3e-6.
FILTER_BIAS = {"weak": (1.4e-6, 1.2e-6, 2.0e-6), "strong": (0.0015, 0.0015, 0.0035), "refined": (0.0, 0.0, 0.0)}
FAR = 6.0  # standard errors


@dataclass(frozen=True)
class Lane:
    """One estimator: `kind` weak, refined (both stages), strong, RLS or UD RLS; forgetting_s 0: none.

    Of ours in float32 or fixed point, with the outlier gate as a rig file has it that does not say, or without; the
    strong form with exact sensors or with FINE ones, as in fixed point always.
    """

    kind: str
    forgetting_s: float
    gated: bool = True
    core: str = "f32"
    fine: bool = False

    @property
    def label(self) -> str:
        """As the tables name it."""
        time = f"{self.forgetting_s:g} s" if self.forgetting_s else "none"
        more = ("" if self.gated else ", no gate") + (", 22 bits" if self.fine else "")
        return f"{self.kind}{' q31' * (self.core == 'q31')}, {time}{more}"

    @property
    def full(self) -> bool:
        """The refinement has the full equations, and sees those of small angles as another mechanism."""
        return self.kind == "refined"

    @property
    def sensing(self) -> Sensing:
        """The weak form takes a 14-bit encoder, the others an exact or a fine one: they need it."""
        if self.kind in ("weak", "refined"):
            return ENCODER
        return FINE if self.fine or self.core == "q31" else EXACT


WEAK_LANES = (
    *(Lane("weak", tau) for tau in WEAK_FORGETTING_S),
    *(Lane("weak", tau, gated=False) for tau in (10.0, 0.0)),
)
REFINED_LANES = tuple(Lane("refined", tau) for tau in REFINED_FORGETTING_S)
STRONG_LANES = (
    *(Lane("strong", tau) for tau in STRONG_FORGETTING_S),
    *(Lane("strong", tau, gated=False) for tau in (10.0, 0.0)),
)
WEAK_Q31_LANES = tuple(Lane("weak", tau, core="q31") for tau in WEAK_FORGETTING_S)
STRONG_Q31_LANES = tuple(Lane("strong", tau, core="q31") for tau in (10.0, 0.0))
FINE_LANES = tuple(Lane("strong", tau, fine=True) for tau in (10.0, 0.0))
PEER_LANES = tuple(Lane(kind, tau) for kind in PEERS for tau in STRONG_FORGETTING_S)
# What is measured together, by the name of its columns.
COLUMNS = {
    "weak": WEAK_LANES,
    "refined": REFINED_LANES,
    "strong": STRONG_LANES,
    "weak-q31": WEAK_Q31_LANES,
    "strong-q31": STRONG_Q31_LANES,
    "strong-fine": FINE_LANES,
    "peers": PEER_LANES,
}
OURS = tuple(name for name in COLUMNS if name != "peers")


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
    published : estimates of the refinement
    far : those whose w, d1 or d2 was off by more than FAR of its standard errors at that time
    """

    ticks: int = 0
    not_finite: int = 0
    singular: int = 0
    error_before: float = float("nan")
    error_after: float = float("nan")
    errors: float = float("nan")
    told: str = ""
    disturbed: dict[str, int] = field(default_factory=dict)
    published: int = 0
    far: int = 0

    @property
    def silent(self) -> bool:
        """Far from the truth, and nothing told."""
        return self.told == Reason.UPDATED.text and not self.errors <= BACK


def rig_of(lane: Lane) -> RigFile:
    """The standard rig with the settings of a lane of the strong form; its filter is cheap enough for 10^7 ticks."""
    rig = RigFile.standard()
    settings = replace(
        rig.identifier,
        forgetting_s=lane.forgetting_s,
        outlier_gate=None if lane.gated else 0.0,
        core=lane.core,  # type: ignore[arg-type]
    )
    sensor = replace(rig.sensor, phi_lsb=lane.sensing.phi_lsb, y_lsb=lane.sensing.y_lsb)
    return replace(rig, identifier=replace(settings, form="strong", stride=STRIDE), sensor=sensor)


@cache
def config_q31_of(lane: Lane) -> StrongConfigQ31:
    """Settings of a lane of the strong form in fixed point, of which the design takes a second."""
    return strong_config_q31(rig_of(lane), RATE_HZ)


class _Ours(ABC):
    """A lane of the shipped core."""

    identifier: Publisher

    def __init__(self, lane: Lane) -> None:
        self.bias = FILTER_BIAS[lane.kind]
        self.outcome = Outcome()
        self._lately: list[int] = []

    @abstractmethod
    def _play(self, phi: Float, y: Float) -> tuple[npt.NDArray[np.uint8], int]:
        """Reasons, and ticks at which p was not finite."""

    @abstractmethod
    def look(self) -> tuple[Float, Float]:
        """(w, d1, d2) and their standard errors, as a user sees them."""

    def run(self, phi: Float, y: Float, disturbed: bool, w: Float) -> None:
        """One chunk, and a look; `w`: the truth at its ticks."""
        del w
        told, not_finite = self._play(phi, y)
        outcome = self.outcome
        outcome.ticks += len(phi)
        outcome.not_finite += not_finite + sum(not np.isfinite(seen).all() for seen in self.look())
        if disturbed:
            counts = Counter(outcome.disturbed) + Counter(Reason(r).text for r in told[told != Reason.ACCUMULATED])
            outcome.disturbed = dict(counts)
        judged = told[np.isin(told, JUDGED)]
        self._lately = [*self._lately, *judged[-8:].tolist()][-8:]
        last = Reason(self._lately[-1]) if self._lately else Reason.WARMING_UP
        if last is Reason.UPDATED and not (self.identifier.assess()["se"][: self.identifier.n_p] > 0).all():
            outcome.singular += 1

    def compare(self, w: float, at_end: bool) -> None:
        """Notes the error against the truth."""
        p, se = self.look()
        truth = np.array([w, *STANDARD_PENDULUM.linear[1:3]])
        error = 100 * (float(p[0]) / w - 1)
        if not at_end:
            self.outcome.error_before = error
            return
        self.outcome.error_after = error
        beyond = np.maximum(np.abs(p - truth) - np.array(self.bias) * truth, 0.0)
        self.outcome.errors = float(np.max(beyond / se))
        alarms = [r for r in self._lately if r == Reason.MISFIT]
        self.outcome.told = Reason(alarms[-1] if alarms else (self._lately or [Reason.WARMING_UP])[-1]).text


class _StrongInFloat(_Ours):
    """The strong form in float32."""

    identifier: Identifier

    def __init__(self, native: Native, lane: Lane) -> None:
        super().__init__(lane)
        self.identifier = native.identifier(strong_config(rig_of(lane), RATE_HZ))

    def _play(self, phi: Float, y: Float) -> tuple[npt.NDArray[np.uint8], int]:
        record = self.identifier.run(phi, y, sums=False, hashes=False)
        return record.reason, int((~np.isfinite(record.p).all(axis=1)).sum())

    def look(self) -> tuple[Float, Float]:
        one = self.identifier
        seen = one.estimate if one.publishes else one.assess()
        return seen["p"][:3].astype(np.float64), seen["se"][:3].astype(np.float64)


_START = (0.8, 1.2, 0.8, 1.0)  # over the guess


def _start_of(start: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A start that is up to 20 % off."""
    return np.asarray(start * np.array(_START), start.dtype)


@cache
def weak_of(lane: Lane) -> tuple[WeakNative, WeakConfig]:
    """The compiled pendulum and the settings of a lane, with the design of its shipped rig."""
    compiled = compiled_of("kapitza")
    config = config_for_simulated_rig(compiled)
    gate = config.gate if lane.gated else GateConfig()
    start = _start_of(config.estimator.start)
    estimator = replace(config.estimator, start=start, forgetting_s=lane.forgetting_s)
    if lane.forgetting_s and lane.gated:
        gate = replace(gate, patience_s=PATIENCE * lane.forgetting_s)
    return weak_native(compiled, config.design), replace(config, estimator=estimator, gate=gate)


class _WeakInFloat(_Ours):
    """The weak form with the compiled pendulum, in float32."""

    identifier: WeakIdentifier

    def __init__(self, lane: Lane) -> None:
        super().__init__(lane)
        native, config = weak_of(lane)
        self.identifier = native.identifier_of(config)

    def _play(self, phi: Float, y: Float) -> tuple[npt.NDArray[np.uint8], int]:
        record = self.identifier.run_samples(np.stack([y, phi], axis=1), sums=False, hashes=False)
        return record.reason, int((~np.isfinite(record.p).all(axis=1)).sum())

    def look(self) -> tuple[Float, Float]:
        seen = self.identifier.estimate
        return seen["p"][:3].astype(np.float64), seen["se"][:3].astype(np.float64)


class _Refined(_Ours):
    """Both stages with the compiled pendulum, in float32."""

    identifier: RefinedIdentifier

    def __init__(self, lane: Lane) -> None:
        super().__init__(lane)
        compiled = compiled_of("kapitza")
        _, config = weak_of(replace(lane, kind="weak"))
        about = refine_rig(RATE_HZ, L1, STANDARD_PENDULUM.linear[:3], sample_sd(14), 0.0, samples=("y", "phi"))
        library = weak_native(compiled, config.design, refine_functions(compiled))
        self.identifier = library.refined_of(config, refine_config(about, lane.forgetting_s))
        self._last = np.zeros(3, np.float32)

    def _play(self, phi: Float, y: Float) -> tuple[npt.NDArray[np.uint8], int]:
        raise NotImplementedError

    def run(self, phi: Float, y: Float, disturbed: bool, w: Float) -> None:
        """One chunk: each estimate against the truth of its tick."""
        record = self.identifier.run_both(np.stack([y, phi], axis=1))
        outcome, r = self.outcome, record.r[:, :3]
        outcome.ticks += len(phi)
        finite = np.isfinite(record.r).all(axis=1) & np.isfinite(record.se).all(axis=1)
        outcome.not_finite += int((~finite).sum()) + sum(not np.isfinite(seen).all() for seen in self.look())
        new = np.any(np.diff(r, axis=0, prepend=self._last[None]) != 0, axis=1) & (r[:, 0] > 0)
        self._last = r[-1].copy()
        truth = np.stack([w[new], *(np.full(new.sum(), one) for one in STANDARD_PENDULUM.linear[1:3])], axis=1)
        far = np.any(np.abs(r[new] - truth) > FAR * record.se[new, :3], axis=1)
        outcome.published += len(far)
        outcome.far += int(far.sum())
        if disturbed:
            told = Counter(Reason(one).text for one in [self.told])
            outcome.disturbed = dict(Counter(outcome.disturbed) + told)
        self._lately = [int(self.told)]

    @property
    def told(self) -> Reason:
        """Of the last block."""
        return Reason(self.identifier.refinement.told)

    def look(self) -> tuple[Float, Float]:
        _, seen = self.identifier.best
        return seen["p"][:3].astype(np.float64), seen["se"][:3].astype(np.float64)


@cache
def weak_q31_of() -> tuple[FixedEngine, WeakNativeQ31]:
    """The compiled pendulum in fixed point, with the design of its shipped rig."""
    engine = engine_for_simulated_rig(compiled_of("kapitza"))
    return engine, weak_native_q31(engine.made, engine.parameters, engine.config)


class _ChangedQ31(WeakIdentifierQ31):
    """The identifier with the settings of a lane: a copy of those that its library has."""

    def __init__(self, native: WeakNativeQ31, lane: Lane, hop_s: float) -> None:
        self._lane, self._hop_s = lane, hop_s
        super().__init__(native)

    def _filled_with(self, native: Native, kind: str, config: object) -> Filled:
        struct = native.headers.ffi.new(f"{kind} *", self._config)[0]
        estimator, groups = struct.estimator, round(self._lane.forgetting_s / self._hop_s)
        given = np.array(list(estimator.start)[: len(_START)], np.int64)
        for i, start in enumerate(_start_of(given)):
            estimator.start[i] = int(start)
        estimator.forgetting_groups = groups
        if groups:
            struct.gate.patience_groups = round(PATIENCE * groups)
        return Filled(struct, {}, {}, [])


class _WeakInFixedPoint(_Ours):
    """The weak form in integers, which are always finite."""

    identifier: WeakIdentifierQ31

    def __init__(self, lane: Lane) -> None:
        super().__init__(lane)
        self._engine, native = weak_q31_of()
        self.identifier = _ChangedQ31(native, lane, self._engine.hop_s)

    def _play(self, phi: Float, y: Float) -> tuple[npt.NDArray[np.uint8], int]:
        lsb = dict(zip(self._engine.sample_names, self._engine.lsb, strict=True))
        counts = [counts_of_samples(x, lsb[name]) for name, x in (("y", y), ("phi", phi))]
        record = self.identifier.run_samples(np.stack(counts, axis=1), sums=False, hashes=False)
        return record.reason, 0

    def look(self) -> tuple[Float, Float]:
        seen = self.identifier.estimate
        p, se = (self._engine.values(seen[name][: self.identifier.n_p]) for name in ("p", "se"))
        return p[:3], se[:3]


class _StrongInFixedPoint(_Ours):
    """The strong form in integers, which are always finite."""

    identifier: Identifier

    def __init__(self, native: Native, lane: Lane) -> None:
        super().__init__(lane)
        self._sensing = lane.sensing
        self._config = config_q31_of(lane)
        self.identifier = native.identifier(self._config)

    def _play(self, phi: Float, y: Float) -> tuple[npt.NDArray[np.uint8], int]:
        sensing = self._sensing
        record = self.identifier.run(
            counts_of_samples(phi, sensing.phi_lsb), counts_of_samples(y, sensing.y_lsb), sums=False, hashes=False
        )
        return record.reason, 0

    def look(self) -> tuple[Float, Float]:
        one = self.identifier
        seen = one.estimate if one.publishes else one.assess()
        n_p = one.n_p
        return p_of(self._config, seen["p"][:n_p])[:3], se_of(self._config, seen["se"][:n_p])[:3]


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
        headers = Headers.of(default_library())
        self._config = headers.filled("pvid_strong_config_f32", strong_config(rig_of(Lane("strong", 0.0)), RATE_HZ))
        bank = headers.ffi.addressof(self._config.struct, "bank")
        made = library.longevity_peer_init(
            self._state,
            ctypes.c_bool(lane.kind == "UD RLS"),
            ctypes.c_float(lam),
            ctypes.c_void_p(int(headers.ffi.cast("uintptr_t", bank))),
            ctypes.c_float(RATE_HZ),
            ctypes.c_float(L1),
            (ctypes.c_float * 11)(*theta),
            ctypes.c_float(2e5),
        )
        if not made:
            raise PvidError("the baseline's differentiator was refused")

    def run(self, phi: Float, y: Float, disturbed: bool, w: Float) -> None:
        """One chunk, up to where it is no number any more."""
        del disturbed, w
        if not self.alive:
            return
        samples = [np.ascontiguousarray(x, np.float32) for x in (phi, y)]
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in samples]
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
    """The motion and the baselines of tests/longevity, built with the core's options into `folder`.

    What they take of the core comes from the library that is measured.
    """
    here, cost = (ROOT / name for name in ("tests/longevity", "tests/cost"))
    sources = [*sorted(here.glob("*.c")), cost / "rls_f32.c"]
    library, core = folder / LIBRARY, default_library().resolve()
    folder.mkdir(parents=True, exist_ok=True)
    command = ["gcc", "-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=default"]
    command += SIZES
    command += [f"-I{path}" for path in (*PUBLIC_FOLDERS, here, cost)]
    linked = [str(core), f"-Wl,-rpath,{core.parent}", "-lm"]
    try:
        done = subprocess.run(
            [*command, *map(str, sources), *linked, "-o", str(library)], capture_output=True, text=True, check=False
        )
    except OSError as error:
        raise PvidError(f"cannot run gcc: {error.strerror}") from error
    if done.returncode != 0:
        raise PvidError(f"gcc refused the baselines: {done.stderr.strip()[:200]}")
    return ctypes.CDLL(str(library))


def _player(native: Native, library: ctypes.CDLL, lane: Lane) -> _Ours | _Peer:
    if lane.kind in PEERS:
        return _Peer(library, lane)
    if lane.kind == "refined":
        return _Refined(lane)
    if lane.kind == "weak":
        return _WeakInFixedPoint(lane) if lane.core == "q31" else _WeakInFloat(lane)
    return _StrongInFixedPoint(native, lane) if lane.core == "q31" else _StrongInFloat(native, lane)


def measure(
    native: Native,
    library: ctypes.CDLL,
    disturbance: Disturbance,
    lanes: Sequence[Lane],
    ticks: int,
) -> dict[str, Outcome]:
    """Outcomes of the lanes by label."""
    outcomes = {}
    for sensing, full in dict.fromkeys((lane.sensing, lane.full) for lane in lanes):
        mine = [lane for lane in lanes if (lane.sensing, lane.full) == (sensing, full)]
        players = [_player(native, library, lane) for lane in mine]
        signals = Signals(library, disturbance, ticks, sensing, full)
        compared = False
        tick = 0
        for phi, y in signals.chunks():
            if not compared and tick >= signals.first:
                for one in players:
                    one.compare(signals.w(signals.first - 1), at_end=False)
                compared = True
            for one in players:
                disturbed = signals.first < tick + len(phi) and tick < signals.last
                one.run(phi, y, disturbed, signals.w_at(tick + np.arange(len(phi))))
            tick += len(phi)
        for lane, one in zip(mine, players, strict=True):
            one.compare(signals.w(ticks), at_end=True)
            outcomes[lane.label] = one.outcome
    return outcomes


def weak_bias(library: ctypes.CDLL) -> Float:
    """Errors of w, d1, d2, relative, of the weak form after 100 s of exact samples of the standard rig."""
    player = _WeakInFloat(Lane("weak", 0.0))
    for phi, y in Signals(library, Disturbance("perfect", ""), 5 * CHUNK, EXACT).chunks():
        player.run(phi, y, False, np.zeros(0))
    return np.asarray(np.abs(player.look()[0] / np.array(STANDARD_PENDULUM.linear[:3]) - 1))


def filter_bias(native: Native, library: ctypes.CDLL, change: float, drive: tuple[Tone, ...] = STANDARD_DRIVE) -> Float:
    """Errors of w, d1, d2, relative, of the strong form without forgetting after 80 s of exact samples of a rig whose w
    is changed by this factor: what FILTER_BIAS is to cover."""
    lane = Lane("strong", 0.0)
    signals = Signals(library, Disturbance("step", "", change=change, drive=drive), 5 * CHUNK, lane.sensing)
    player = _StrongInFloat(native, lane)
    for phi, y in list(signals.chunks())[1:]:
        player.run(phi, y, False, np.zeros(0))
    truth = np.array([signals.w(signals.ticks), *STANDARD_PENDULUM.linear[1:3]])
    return np.asarray(np.abs(player.look()[0] / truth - 1))
