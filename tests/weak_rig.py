"""The shipped mechanisms on their simulated rigs with the weak identifier: tables, settings, samples, library, twin."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from struct_fields import numbers_of

from pvid.codegen.weak import weak_model_of
from pvid.codegen.weak_library import weak_native
from pvid.configuration.weak_tables import circle_of, config_of, design_tables, for_core
from pvid.core.weak_native import WeakIdentifier, WeakNative
from pvid.models import mechanisms
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.channels import Record as OfRun
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.noise import Gain, NoiseFilters, NoiseModel
from pvid.oracle.weak.rows import WeakRows
from pvid.settings.parts import EstimatorConfig
from pvid.settings.record import Record
from pvid.settings.weak import WeakConfig
from pvid.sim.simulated_run import PERFECT, SOFT, simulation_of
from pvid.twin.printed import PrintedTwin

Float = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

FUNCTIONS = 24  # where the rig's design does not give a number


class _WithoutWalks(NoiseFilters):
    def gains(self, record: OfRun) -> list[dict[str, list[Gain]]]:
        found = super().gains(record)
        return [{name: [one for one in own if one.order >= 0] for name, own in row.items()} for row in found]


def noise_in_c(rows: WeakRows) -> NoiseModel:
    """The identifier's: it has no noise of running integrals."""
    return NoiseModel(_WithoutWalks(rows.compiled.channels), rows.record)


@dataclass(frozen=True)
class WeakRig:
    """A mechanism with its identifier.

    Attributes
    ----------
    config : settings of the float identifier for the rig's own design, from the guesses of the description
    samples : of a simulated run [ticks, samples]
    truth : p of the rig
    rows : of the float64 oracle, of the same run and design
    native : the library
    """

    config: WeakConfig
    samples: Float32
    truth: Float
    rows: WeakRows
    native: WeakNative

    def resized(self, *, functions: int, hop: int, decimation: int) -> WeakConfig:
        """The settings with other sizes than those of the rig's design; the tables of its noise stay."""
        sizes: dict[str, Any] = {"functions": functions, "hop": hop, "decimation": decimation, "circle": circle_of(hop)}
        return replace(self.config, design=replace(self.config.design, **sizes))


@cache
def weak_rig(name: str, seed: int = 0, soft: bool = False) -> WeakRig:
    """A shipped mechanism; soft: its friction, where it has one, has the soft sign in simulation and design."""
    compiled, rig, law = mechanisms.compiled_of(name), simulated_rig(name), SOFT if soft else PERFECT
    given: dict[str, Any] = {"functions": FUNCTIONS, **rig.design}
    if rig.friction_width and soft:
        given |= {"reversals": "soft", "soft": rig.friction_width}
    design = for_core(WeakDesign(rig.sample_rate, rig.window_s, **given))
    simulation, made, model = simulation_of(name), ready(compiled), weak_model_of(compiled)
    run = simulation.run(seed, law)
    rows = WeakRows.of(made, run, design)
    tables = design_tables(model, rows, simulation.truth)
    samples = np.stack([np.asarray(run[one], np.float32) for one in model.sample_names], axis=1)
    config = config_of(tables, rig.sample_rate, made.parameters)
    largest = replace(tables, decimation=max(tables.decimation, 16))  # that `resized` may get
    return WeakRig(config, samples, simulation.truth, rows, weak_native(compiled, largest))


def in_pieces(core: WeakIdentifier | PrintedTwin, samples: Float32, frozen: Mask) -> Record:
    """A run of the core or its twin that is frozen and resumed as `frozen` [ticks] wants it."""
    edges = [0, *(np.flatnonzero(np.diff(frozen)) + 1).tolist(), len(samples)]
    parts = []
    for first, last in zip(edges, edges[1:], strict=False):
        core.freeze(bool(frozen[first]))
        parts.append((core.run if isinstance(core, PrintedTwin) else core.run_samples)(samples[first:last]))
    names = ("p", "sums", "reason", "published", "published_se", "standing", "hash")
    joined = {name: np.concatenate([getattr(one, name) for one in parts]) for name in names}
    return Record(**joined)


def assert_same(core: Record, twin: Record) -> None:
    """Asserts that both have the same bits after every tick."""
    for part in ("reason", "p", "sums", "exponent", "published", "published_se", "standing", "hash"):
        own, other = getattr(core, part), getattr(twin, part)
        assert own.dtype == other.dtype and own.shape == other.shape, part
        if own.tobytes() != other.tobytes():
            of_ticks = (one.reshape(len(one), -1).view(np.uint8) for one in (own, other))
            different = np.flatnonzero((next(of_ticks) != next(of_ticks)).any(axis=1))
            raise AssertionError(f"{part}, first at tick {different[0]}")


def wild(samples: npt.NDArray[Any], most: float) -> npt.NDArray[Any]:
    """No numbers, or counts at the end of their range; a dead sensor, a jump, a value beyond the range."""
    out, n = samples.copy(), len(samples)
    fixed = out.dtype.kind == "i"
    out[n // 8, 0] = 2**31 - 1 if fixed else np.nan
    out[n // 3 : n // 3 + 40] = 0
    out[n // 2 :, -1] += out.dtype.type(most)
    out[3 * n // 4] = -(2**31) if fixed else np.inf
    out[-5, -1] = out.dtype.type(2**30 if fixed else 1e30)
    return out


def assert_equals_the_twin(
    native: WeakNative,
    config: WeakConfig,
    samples: Float32,
    lanes: Sequence[EstimatorConfig] | None = None,
    frozen: Mask | None = None,
) -> list[Record]:
    """Asserts that the library has the twin's bits after every tick: p, sums, reason, published p, running hash; and in
    the end its counters and its estimate. One lane for each of `lanes`, by default the settings' own estimator.

    Returns the records of the core.
    """
    records = []
    for estimator in [config.estimator] if lanes is None else lanes:
        own = replace(config, estimator=estimator)
        core, twin = native.identifier_of(own), PrintedTwin(native.sources, own)
        record = core.run_samples(samples) if frozen is None else in_pieces(core, samples, frozen)
        assert_same(record, twin.run(samples) if frozen is None else in_pieces(twin, samples, frozen))
        assert core.running_hash == twin.running_hash
        assert core.counters == twin.counters and core.is_published == twin.is_published
        for name in numbers_of(core.estimate):
            other = np.array(getattr(twin.estimate, name), np.float32)
            assert core.estimate[name].tobytes() == other.tobytes(), name
        assert np.isfinite(record.p).all() and np.isfinite(record.sums).all()
        records.append(record)
    return records
