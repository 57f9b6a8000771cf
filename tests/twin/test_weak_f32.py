"""Bit equality of the weak identifier of any mechanism in C and its numpy twin, after every tick."""

from dataclasses import replace

import numpy as np
import pytest
from weak_rig import Float32, WeakRig, assert_equals_the_twin, weak_rig

from bench.kinds import KINDS
from pvid.settings.enums import Law, Reason
from pvid.settings.parts import EstimatorConfig, GateConfig, TrustConfig
from pvid.settings.weak import WeakConfig

NO_GATE = GateConfig()


def with_gaps(samples: Float32) -> Float32:
    """Without single samples and a stretch, before the first window, in a window, and while a window is processed."""
    out = samples.copy()
    out[[50, 3001], 0] = np.nan
    out[4500:4503, -1] = np.inf
    return out


def updates(reason: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> int:
    return int(np.isin(reason, (Reason.UPDATED, Reason.MISFIT)).sum())


@pytest.mark.parametrize("name", KINDS)
def test_every_mechanism_has_the_bits_of_its_twin(name: str) -> None:
    """Gaps, a frozen stretch, errors of the equations, compensation; conditions that publish early."""
    rig = weak_rig(name)
    samples = with_gaps(rig.samples[:9000])
    variance = np.full(rig.config.design.model.kinds, 1e-9, np.float32)
    trust = TrustConfig(se_max=10.0, groups_min=1, kappa_min=0.0)
    config = replace(rig.config, design=replace(rig.config.design, error_variance=variance), trust=trust)
    frozen = np.zeros(len(samples), np.bool_)
    frozen[7000:8200] = True
    record = assert_equals_the_twin(rig.native, config, samples, frozen=frozen)[0]
    assert (record.reason == Reason.REJECTED_NOT_FINITE).sum() == 5
    assert (record.p[-1] != record.p[0]).all()
    assert updates(record.reason) > 0


@pytest.mark.parametrize("name", ["dc_motor", "furuta", "battery_2rc"])
def test_the_rig_s_own_settings_have_the_bits_of_the_twin(name: str) -> None:
    rig = weak_rig(name)
    record = assert_equals_the_twin(rig.native, rig.config, rig.samples[:12000])[0]
    assert (record.published[-1] != record.published[0]).any()


def starts(rig: WeakRig) -> list[EstimatorConfig]:
    """Four starts with four times of forgetting, without and with short ones."""
    own = rig.config.estimator
    lanes = []
    for seed, forgetting in enumerate((0.0, 5.0, 20.0, 400.0)):
        factor = np.random.default_rng(seed).uniform(0.8, 1.25, len(own.start)).astype(np.float32)
        lanes.append(replace(own, start=own.start * factor, forgetting_s=forgetting))
    return lanes


@pytest.mark.parametrize(("name", "compensation"), [("kapitza", False), ("rigid_body", True)])
def test_lanes_with_other_starts_and_forgetting_equal_the_twin(name: str, compensation: bool) -> None:
    rig = weak_rig(name)
    config = replace(rig.config, gate=NO_GATE, compensation=compensation)
    records = assert_equals_the_twin(rig.native, config, rig.samples[:9000], starts(rig))
    assert len({record.p[-1].tobytes() for record in records}) == 4


@pytest.mark.parametrize(
    ("law", "feedback_hz", "divider"),
    [(Law.PSEUDOVELOCITY, 0.0, 1), (Law.STATIONARY, 0.5, 1), (Law.STATIONARY, 0.0, 3)],
)
def test_laws_and_divider_equal_the_twin(law: Law, feedback_hz: float, divider: int) -> None:
    rig = weak_rig("cart_pendulum")
    estimator = replace(rig.config.estimator, law=law, feedback_hz=feedback_hz, divider=divider)
    record = assert_equals_the_twin(rig.native, replace(rig.config, estimator=estimator), rig.samples[:7000])[0]
    assert (record.p[-1] != record.p[0]).any()


@pytest.mark.parametrize(
    ("name", "functions", "hop", "decimation"),
    [
        ("cart_pendulum", 4, 56, 1),
        ("cart_pendulum", 7, 120, 2),
        ("cart_pendulum", 11, 40, 8),
        ("kapitza", 5, 16, 16),
        ("kapitza", 6, 80, 5),
        ("kapitza", 9, 40, 16),
        ("battery_2rc", 13, 24, 1),
        ("dc_motor", 39, 104, 2),
        ("dc_motor", 6, 40, 8),
        ("two_mass_drive", 8, 24, 16),
    ],
)
def test_every_size_equals_the_twin(name: str, functions: int, hop: int, decimation: int) -> None:
    rig = weak_rig(name)
    config = rig.resized(functions=functions, hop=hop, decimation=decimation)
    record = assert_equals_the_twin(rig.native, config, rig.samples[:6000])[0]
    moved = bool((record.p[-1] != record.p[0]).any())
    # 0.12 s of the pendulum and 48 s of the battery contain little but noise
    assert moved != ((name, functions) in {("kapitza", 4), ("battery_2rc", 13)})
    assert moved or (record.reason == Reason.HELD_NOT_EXCITED).any()


def noise_of(rig: WeakRig) -> Float32:
    """The rig at rest: its first sample with the noise of the run."""
    curved = np.diff(rig.samples[:4000], n=4, axis=0)
    sd = curved.std(axis=0) / np.sqrt(70)  # white noise of variance 1 has 70 in its fourth difference
    random = np.random.default_rng(1)
    return np.asarray(rig.samples[0] + sd * random.standard_normal((7000, len(sd))), np.float32)


@pytest.mark.parametrize(("name", "compensation"), [("furuta", True), ("dc_motor", False)])
def test_noise_alone_is_no_excitation(name: str, compensation: bool) -> None:
    """S exceeds a millionth of its diagonal there, and p moved before: the information is that of the noise."""
    rig = weak_rig(name)
    config = replace(rig.config, compensation=compensation)
    record = assert_equals_the_twin(rig.native, config, noise_of(rig))[0]
    held = record.reason == Reason.HELD_NOT_EXCITED
    assert held.sum() >= 5 and updates(record.reason) == 0
    assert (record.p[-1] == record.p[0]).all()
    unchecked = replace(config, estimator=replace(config.estimator, noise_margin=0.0))
    record = assert_equals_the_twin(rig.native, unchecked, noise_of(rig))[0]
    assert (record.p[-1] != record.p[0]).any()


def hostile(samples: Float32) -> Float32:
    """Huge values, denormals, steps that overflow, a dead sensor, all sensors at rest."""
    random = np.random.default_rng(7)
    out = samples[:9000].copy()
    out[2000:2100] = 1e30 * random.standard_normal((100, out.shape[1]))
    out[3500:3510] = 3e38 * np.sign(random.standard_normal((10, out.shape[1])))
    out[4000:4600] = 1e-40 * random.standard_normal((600, out.shape[1]))
    out[5200:, 0] = 0.0
    out[7000:] = 0.0
    return out.astype(np.float32)


@pytest.mark.by_day(2)
@pytest.mark.parametrize("name", ["kapitza", "dc_motor", "cart_pendulum", "battery_2rc"])
def test_hostile_samples_equal_the_twin_and_leave_finite_numbers(name: str) -> None:
    rig = weak_rig(name)
    record = assert_equals_the_twin(rig.native, rig.config, hostile(rig.samples))[0]
    assert np.isin(record.reason, (Reason.REJECTED_NOT_FINITE, Reason.REJECTED_SATURATED)).any()


def limited(rig: WeakRig) -> WeakConfig:
    """Ranges that the first sample exceeds now and then; the last one must move."""
    samples = rig.samples
    ranges = 2 * np.abs(samples).max(axis=0)
    ranges[0] = np.quantile(np.abs(samples[:, 0]), 0.9999)
    least = np.zeros(samples.shape[1], np.float32)
    least[-1] = 0.1 * samples[:, -1].std()
    return replace(rig.config, range=ranges.astype(np.float32), drive_min=least)


@pytest.mark.parametrize("name", ["cart_pendulum", "dc_motor"])
def test_windows_beyond_the_range_or_without_a_drive_equal_the_twin(name: str) -> None:
    rig = weak_rig(name)
    samples = rig.samples.copy()
    samples[6000:9000, -1] = samples[6000, -1]
    record = assert_equals_the_twin(rig.native, limited(rig), samples)[0]
    reasons = set(record.reason.tolist())
    assert {Reason.HELD_OUT_OF_RANGE, Reason.HELD_NOT_EXCITED} <= reasons


def test_the_gate_rejects_a_jolt_in_both() -> None:
    rig = weak_rig("furuta")
    samples = rig.samples.copy()
    samples[18000:18040, 0] += np.float32(3.0)
    record = assert_equals_the_twin(rig.native, rig.config, samples)[0]
    assert (record.reason == Reason.REJECTED_OUTLIER).any()


def test_a_soft_sign_equals_the_twin() -> None:
    rig = weak_rig("two_link_arm", soft=True)
    assert (rig.config.design.sign_width > 0).all()
    assert_equals_the_twin(rig.native, rig.config, rig.samples[:6000])


def test_a_run_in_two_pieces_has_the_bits_of_one() -> None:
    rig = weak_rig("cart_pendulum")
    whole, pieces = rig.native.identifier_of(rig.config), rig.native.identifier_of(rig.config)
    whole.run_samples(rig.samples[:6000])
    for part in (slice(0, 1), slice(1, 2345), slice(2345, 2346), slice(2346, 6000)):
        pieces.run_samples(rig.samples[part])
    assert pieces.running_hash == whole.running_hash


def test_a_gap_is_a_missing_sample_without_a_tick() -> None:
    rig = weak_rig("kapitza")
    told, seen = rig.native.identifier_of(rig.config), rig.native.identifier_of(rig.config)
    for core in (told, seen):
        core.run_samples(rig.samples[:5000])
    told.gap()
    of_told = told.run_samples(rig.samples[4000:7000])
    missing = np.full((1, rig.samples.shape[1]), np.nan, np.float32)
    of_seen = seen.run_samples(np.concatenate([missing, rig.samples[4000:7000]]))
    assert np.array_equal(of_told.sums, of_seen.sums[1:])
    assert np.array_equal(of_told.reason, of_seen.reason[1:])


def test_the_sums_of_a_run_outlive_a_gap() -> None:
    """The battery's charge is an integral since the start: the twin's goes on where the core's does."""
    rig = weak_rig("battery_2rc")
    assert rig.config.design.model.runs == 1
    samples = rig.samples[:9000].copy()
    samples[4000:4040] = np.nan
    record = assert_equals_the_twin(rig.native, rig.config, samples)[0]
    assert updates(record.reason) + (record.reason == Reason.HELD_UNCERTAIN).sum() > 0


def random_case(seed: int) -> tuple[WeakRig, WeakConfig, Float32]:
    """A mechanism with random sizes, settings and limits, and a piece of its run with random faults."""
    random = np.random.default_rng(seed)
    rig = weak_rig(str(random.choice(KINDS)))
    design, kinds = rig.config.design, rig.config.design.model.kinds
    functions = int(random.integers(4, design.functions + 1))
    hop = 8 * int(random.integers((functions + design.power) // 8 + 2, 20))
    config = rig.resized(functions=functions, hop=hop, decimation=int(random.integers(1, design.decimation + 1)))
    variance = np.where(random.random(kinds) < 0.5, 0.0, 10.0 ** random.uniform(-12, 3, kinds)).astype(np.float32)
    orders = random.integers(0, 3, kinds).astype(np.uint8)
    signs = config.design.model.signs
    doubt = (10.0 ** random.uniform(-3, 1, signs)).astype(np.float32) if random.random() < 0.7 else None
    config = replace(
        config,
        design=replace(config.design, error_variance=variance, error_order=orders, sign_doubt=doubt),
        iterations=int(random.integers(1, 6)),
        compensation=bool(random.integers(2)),
        gate=GateConfig(float(random.choice([0.0, 3.0])), float(random.choice([0.0, 1.0]))),
        trust=TrustConfig(se_max=10.0, groups_min=int(random.integers(3)), renewal=float(random.choice([0.0, 0.2]))),
        range=(np.abs(rig.samples).max(axis=0) * random.uniform(0.8, 3.0) + 1e-6).astype(np.float32),
        drive_min=(rig.samples.std(axis=0) * random.uniform(0.0, 0.5)).astype(np.float32),
    )
    first = int(random.integers(5000))
    samples = rig.samples[first : first + 3000].copy()
    for fault in (np.nan, 1e30, 1e-42, 0.0, 3e38):
        start = int(random.integers(len(samples)))
        samples[start : start + int(random.integers(60)), int(random.integers(samples.shape[1]))] = fault
    return rig, config, samples


@pytest.mark.by_day(4)
@pytest.mark.parametrize("seed", range(8))
def test_random_settings_and_faults_equal_the_twin(seed: int) -> None:
    rig, config, samples = random_case(seed)
    record = assert_equals_the_twin(rig.native, config, samples)[0]
    assert (record.reason == Reason.REJECTED_NOT_FINITE).any() or np.isfinite(samples).all()


def test_an_equation_s_own_error_that_comes_and_goes_has_the_bits_of_the_twin() -> None:
    """White noise of a motor's recorded voltage, in the first half of the run: the variance of the error rises, older
    rows count no more; then it falls."""
    rig = weak_rig("dc_motor")
    samples = rig.samples[:12000].copy()
    place = rig.config.design.model.sample_names.index("V")
    samples[:6000, place] += np.random.default_rng(2).standard_normal(6000).astype(np.float32)
    core, largest = rig.native.identifier_of(rig.config), []
    for part in (samples[:6000], samples[6000:]):
        core.run_samples(part)
        largest.append(max(one.variance for one in core.state.finish.error))
    assert largest[0] > 10 * largest[1]
    record = assert_equals_the_twin(rig.native, rig.config, samples)[0]
    assert updates(record.reason) > 0
