"""The refinement as the second stage of the weak identifier: bits of its twin, gaps, freezes, snapshots, refusals."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from struct_fields import numbers_of
from weak_rig import WeakRig, weak_rig

from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.board.refined_image import published_run
from pvid.codegen.refine import RefineFunctions, refine_functions
from pvid.codegen.weak import weak_model_of
from pvid.codegen.weak_library import weak_native, weak_sources
from pvid.configuration.refine import refine_settings
from pvid.core.weak_native import RefinedIdentifier, RefinedRecord, WeakNative
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.settings.enums import Reason, SnapshotStatus
from pvid.settings.parts import TrustConfig
from pvid.settings.refine import RefineConfig
from pvid.twin.printed import PrintedTwin

NAME = "rigid_body"  # of order 1, three outputs


@dataclass(frozen=True)
class Refined:
    """A mechanism with both stages."""

    rig: WeakRig
    library: WeakNative
    made: RefineFunctions
    settings: RefineConfig

    def identifier(self, **changes: object) -> RefinedIdentifier:
        """A new one."""
        trust = TrustConfig(se_max=10.0, groups_min=1)
        return self.library.refined_of(replace(self.rig.config, trust=trust), replace(self.settings, **changes))  # type: ignore[arg-type]


@cache
def refined(name: str = NAME) -> Refined:
    rig, made, simulated = weak_rig(name), refine_functions(compiled_of(name)), simulated_rig(name)
    names = made.model
    run = {one: rig.samples[:, k] for k, one in enumerate(_samples(name))}
    settings = refine_settings(made, run, simulated.sample_rate, rig.truth, 2 * simulated.window_s)
    return Refined(rig, weak_native(names, rig.config.design, made), made, settings)


def _samples(name: str) -> tuple[str, ...]:
    return weak_model_of(compiled_of(name)).sample_names


def kept(one: RefinedIdentifier) -> bytes:
    """The refinement's memory without its configuration."""
    ffi = one.native.headers.ffi
    return bytes(ffi.buffer(one.refinement))[ffi.offsetof("pvid_refine_f32", "h") :]


def assert_same(record: RefinedRecord, twin: PrintedTwin, samples: npt.NDArray[np.float32]) -> None:
    """The record of both stages is that of their twin, tick by tick."""
    found = twin.run(samples)
    assert twin.second is not None
    np.testing.assert_array_equal(record.hash, found.hash)
    np.testing.assert_array_equal(record.told, twin.second.told)
    np.testing.assert_array_equal(record.r, twin.second.r)
    np.testing.assert_array_equal(record.se, twin.second.se)


@pytest.mark.parametrize(
    ("options", "ticks"), [(("dry_friction", "slant"), 7600), pytest.param(("slant",), 10_000, marks=pytest.mark.long)]
)
def test_the_twin_has_the_bits_of_the_pendulum_with_options(options: tuple[str, ...], ticks: int) -> None:
    """Dry friction of hidden angles, a skew and derived inputs, with steps of Runge-Kutta."""
    run = published_run("kapitza", ticks, BOARDS["mps2-an386"], options)
    core = run.native()
    sources = weak_sources(run.weak.compiled, run.weak.config.design, run.made)
    record = core.run_both(run.weak.samples)
    assert_same(record, PrintedTwin(sources, run.weak.config, run.settings), run.weak.samples)
    assert Reason.UPDATED in record.told


@pytest.mark.parametrize("name", [NAME, "dc_motor"])
def test_the_twin_has_the_bits_of_both_stages_over_missing_and_wild_samples(name: str) -> None:
    given = refined(name)
    core, samples = given.identifier(), given.rig.samples[:5000].copy()
    samples[2500, 0] = np.nan
    samples[[900, 1401], -1] += np.float32(20) * samples[:, -1].std()
    record = core.run_both(samples)
    assert_same(record, PrintedTwin(given.library.sources, core.config, given.settings), samples)
    assert Reason.UPDATED in record.told


def test_the_twin_of_both_stages_publishes_what_the_core_does() -> None:
    """Wrong inputs for more than two blocks: the track is lost, the estimate withdrawn, and one published again."""
    given, samples = refined(), refined().rig.samples[:15500].copy()
    samples[5000:9200, :3] *= 1.3
    core = given.identifier(distance=0.1)
    twin = PrintedTwin(given.library.sources, core.config, replace(given.settings, distance=0.1))
    stages = []
    for k in range(31):
        part = samples[500 * k : 500 * (k + 1)]
        assert_same(core.run_both(part), twin, part)
        (own_stage, own), (stage, estimate) = core.best, twin.best
        assert own_stage == stage, k
        stages.append(stage)
        for name in numbers_of(own):
            assert own[name].tobytes() == np.array(getattr(estimate, name), np.float32).tobytes(), name
    assert len(np.flatnonzero(np.diff(stages))) >= 3


def test_the_refined_estimate_is_sharper_than_the_weak_one_and_right() -> None:
    given = refined()
    core = given.identifier()
    record = core.run_both(given.rig.samples)
    names = [one.name for one in given.made.parameters]
    truth = np.array([simulated_rig(NAME).truth[name] for name in names])
    assert np.all(np.abs(record.r[-1] - truth) < 3.5 * record.se[-1])
    ratio = record.se[-1] / core.estimate["se"][: len(names)]
    assert np.prod(ratio) <= 1.0 and np.all(ratio < 1.2)


def test_a_gap_and_a_freeze_reach_both_stages() -> None:
    given = refined()
    one, samples = given.identifier(distance=0.1), given.rig.samples
    one.run_both(samples[:3000])
    before = bytes(kept(one))
    one.gap()
    assert one.refinement.front.next == 0 and kept(one) != before
    one.freeze(True)
    linear = list(one.refinement.linear)
    one.run_both(samples[3000:6000])
    assert one.refinement.frozen and list(one.refinement.linear) == linear
    one.freeze(False)
    assert Reason.UPDATED in one.run_both(samples[6000:12000]).told


def test_a_snapshot_keeps_both_stages_and_refuses_other_settings() -> None:
    given = refined()
    one, other = given.identifier(distance=0.05), given.identifier(distance=0.05)
    ffi, library = one.native.headers.ffi, one.native.library
    one.run_both(given.rig.samples[:4321])
    image = ffi.new("uint8_t[]", 200_000)
    n = library.pvid_snapshot_save_refine_f32(one.state, one.config_pointer, 1, image, len(image))
    assert n > ffi.sizeof("pvid_weak_f32") + ffi.sizeof("pvid_refine_f32") - 300

    def restored(into: RefinedIdentifier) -> SnapshotStatus:
        return SnapshotStatus(library.pvid_snapshot_restore_refine_f32(into.state, into.config_pointer, image, n))

    assert restored(other) is SnapshotStatus.RESTORED
    assert kept(other) == kept(one)
    rest = given.rig.samples[4321:9000]
    a, b = one.run_both(rest), other.run_both(rest)
    np.testing.assert_array_equal(a.r, b.r)
    assert kept(other) == kept(one) and np.any(a.r > 0)
    for changes in ({"gate": 7.0}, {"first_block": 12}, {"prior_sd": 2 * given.settings.prior_sd}, {"distance": 0.1}):
        assert restored(given.identifier(**({"distance": 0.05} | changes))) is SnapshotStatus.OTHER_CONFIG
    weak = given.library.identifier_of(given.rig.config)
    assert library.pvid_snapshot_save_refine_f32(weak.state, weak.config_pointer, 1, image, len(image)) == 0
    status = library.pvid_snapshot_restore_weak_f32(weak.state, weak.config_pointer, image, n)
    assert SnapshotStatus(status) is SnapshotStatus.OTHER_KIND


def test_what_the_second_stage_refuses_is_refused_by_init() -> None:
    with pytest.raises(PvidError, match="refused the configuration"):
        refined().identifier(passes=0)


def test_without_a_second_stage_the_weak_form_has_the_same_bits() -> None:
    given = refined()
    both, alone = given.identifier(), given.library.identifier_of(given.identifier().config)
    record = alone.run_samples(given.rig.samples[:3000], hashes=False)
    both.run_both(given.rig.samples[:3000])
    np.testing.assert_array_equal(list(both.estimator.p), list(alone.estimator.p))
    assert len(record.reason) == 3000


def test_a_running_integral_is_an_input() -> None:
    made, rig = refine_functions(compiled_of("battery_2rc")), weak_rig("battery_2rc")
    run = {one: rig.samples[:, k] for k, one in enumerate(_samples("battery_2rc"))}
    settings = refine_settings(made, run, 1.0, rig.truth, 2400.0)
    assert [str(one) for one in made.inputs] == ["i", "z"]
    assert [one.order for one in settings.signal] == [0, -1, 0]
    assert settings.signal[1].range >= 1.4 * np.abs(np.cumsum(run["i"])).max()
