"""Bad configurations: every field of every public config, out of range, no number, contradictory.

Each is refused with the status that names the field; and what is accepted, however odd, never becomes infinite or no
number, whatever the samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pvid.core.headers import Headers, Scalar, default_library
from pvid.core.native import Identifier, Native
from pvid.rig.file import RigFile
from pvid.settings.enums import Status
from pvid.settings.f32 import EstimatorConfig
from pvid.setup.f32 import strong_config, weak_config
from pvid.setup.q31 import strong_config_q31, weak_config_q31
from pvid.sim.pendulum import simulate, standard_sensors
from pvid.twin import fnv
from pvid.twin.strong import StrongTwin
from pvid.twin.weak import WeakTwin

Samples = npt.NDArray[Any]

RIG = RigFile.standard()
TICKS = 5000
HEADERS = Headers.of(default_library())
HUGE = float(np.finfo(np.float32).max)


def rig_with(**settings: Any) -> RigFile:
    return replace(RIG, identifier=replace(RIG.identifier, **settings))


@dataclass(repr=False)
class Subject:
    """An identifier whose configuration may be spoilt, and comes back as it was."""

    name: str
    identifier: Identifier
    phi: Samples
    y: Samples

    def __post_init__(self) -> None:
        headers, config = self.identifier.native.headers, self.identifier.config_struct
        self.fields = {field.name: field for field in headers.scalars(config)}
        structs = [config, *([config.design[0]] if "design.taps" in self.fields else [])]
        self._memory = [headers.ffi.buffer(headers.ffi.addressof(struct)) for struct in structs]
        self._good = [bytes(memory) for memory in self._memory]

    def restore(self) -> None:
        """The good configuration again."""
        for memory, good in zip(self._memory, self._good, strict=True):
            memory[:] = good

    def status_with(self, values: dict[str, Any]) -> Status:
        """What init says of the good configuration with other values."""
        self.restore()
        for name, value in values.items():
            self.fields[name].set(value)
        return self.identifier.initialise()

    def assert_finite(self, phi: Samples, y: Samples) -> None:
        """Steps the accepted configuration through samples and looks at all that it shows."""
        one = self.identifier
        record = one.run(phi, y, hashes=False)
        assert np.isfinite(record.p.astype(np.float64)).all()
        assert np.isfinite(record.sums.astype(np.float64)).all()
        lower, upper = (
            np.array([self.fields[f"estimator.{side}[{i}]"].value for i in range(one.n_p)])
            for side in ("lower", "upper")
        )
        assert (record.p >= lower).all()
        assert (record.p <= upper).all()
        shown = [one.assess()] + ([one.estimate] if one.publishes else [])
        for estimate in shown:
            for name in estimate.dtype.names or ():
                assert np.isfinite(np.asarray(estimate[name], np.float64)).all(), name


@pytest.fixture(scope="module")
def subjects(native: Native) -> dict[str, Subject]:
    """One of each form and core."""
    run = simulate(sensors=standard_sensors(14), truth="linear", duration=TICKS / 1000, seed=1).run
    counts = [
        np.rint(x / lsb).astype(np.int64) for x, lsb in ((run.phi, RIG.sensor.phi_lsb), (run.y, RIG.sensor.y_lsb))
    ]
    with_friction = rig_with(full_angle=True, damping=True)
    strong = native.identifier(strong_config(rig_with(form="strong"), 1000.0))
    weak, corrected = (native.identifier(weak_config(rig, 1000.0)) for rig in (RIG, with_friction))
    weak_q31 = native.identifier(weak_config_q31(RIG, 1000.0))
    strong_q31 = native.identifier(strong_config_q31(rig_with(form="strong"), 1000.0))
    made = (
        Subject("strong", strong, run.phi, run.y),
        Subject("weak", weak, run.phi, run.y),
        Subject("corrected", corrected, run.phi, run.y),
        Subject("weak q31", weak_q31, *counts),
        Subject("strong q31", strong_q31, *counts),
    )
    return {subject.name: subject for subject in made}


# ---- one field at a time ----


@dataclass(frozen=True)
class Range:
    """What a field may hold; outside of it init answers `status`, inside it may contradict others: `also`."""

    low: float
    high: float
    status: Status
    also: tuple[Status, ...] = ()
    besides: tuple[float, ...] = ()  # allowed values outside low..high

    def holds(self, value: float) -> bool:
        """Whether it may be `value`, as C compares them."""
        if not isinstance(value, int):
            single = np.float32(value)
            return value in self.besides or bool(np.float32(self.low) <= single <= np.float32(self.high))
        return value in self.besides or self.low <= value <= self.high


BOUNDS = Range(-HUGE, HUGE, Status.BAD_BOUNDS, (Status.BAD_BOUNDS, Status.BAD_START))
ESTIMATOR = {
    "estimator.start": Range(-HUGE, HUGE, Status.BAD_START, (Status.BAD_START,)),
    "estimator.start_sd": Range(1e-12, 1e12, Status.BAD_START_SD),
    "estimator.lower": BOUNDS,
    "estimator.upper": BOUNDS,
    "estimator.row_sd": Range(1e-12, 1e12, Status.BAD_ROW_SD),
    "estimator.forgetting_s": Range(0.0, 1e12, Status.BAD_FORGETTING, (Status.BAD_FORGETTING,)),
    "estimator.feedback_hz": Range(0.0, 1e12, Status.BAD_FEEDBACK),
    "estimator.step_limit": Range(1e-6, 0.9, Status.BAD_STEP_LIMIT),
    "estimator.kappa_min": Range(0.0, 0.999, Status.BAD_KAPPA_MIN),
    "estimator.noise_margin": Range(0.0, 1e6, Status.BAD_NOISE_MARGIN),
    "estimator.dead_zone": Range(0.0, 100.0, Status.BAD_DEAD_ZONE),
    "estimator.law": Range(0, 1, Status.BAD_LAW),
    "estimator.divider": Range(1, 65535, Status.BAD_DIVIDER),
}
RIG_FIELDS = {
    "sample_rate_hz": Range(1e-3, 1e6, Status.BAD_SAMPLE_RATE, (Status.BAD_FORGETTING, Status.BAD_UPDATE_RATE)),
    "l1": Range(1e-6, 1e6, Status.BAD_LENGTH),
    "drive_min": Range(0.0, 1e9, Status.BAD_DRIVE_MIN),
    "gate.sigmas": Range(2.0, 1e3, Status.BAD_GATE_SIGMAS, besides=(0.0,)),
    "gate.patience_s": Range(0.0, 1e12, Status.BAD_GATE_PATIENCE),
}
STRONG = {
    **RIG_FIELDS,
    **ESTIMATOR,
    "estimator.correlation": Range(1.0, 1e6, Status.BAD_CORRELATION),
    "estimator.row_weight": Range(1.0, 1.0, Status.BAD_ROW_WEIGHT),
}
WEAK = {
    **RIG_FIELDS,
    **ESTIMATOR,
    "pivot_noise": Range(0.0, 1e9, Status.BAD_PIVOT_NOISE),
    "angle_limit": Range(0.0, 1e9, Status.BAD_ANGLE_LIMIT),
    "iterations": Range(1, 10, Status.BAD_ITERATIONS, (Status.BAD_ITERATIONS,)),
    "design.overlap": Range(1.0, 1e6, Status.BAD_OVERLAP),
    "trust.kappa_min": Range(0.0, 0.999, Status.BAD_PUBLISH_KAPPA),
    "trust.se_max": Range(1e-9, 1e9, Status.BAD_SE_MAX),
    "trust.misfit_max": Range(1.0, 1e6, Status.BAD_MISFIT_MAX, besides=(0.0,)),
    "trust.renewal": Range(0.01, 1e3, Status.BAD_RENEWAL, besides=(0.0,)),
    "trust.groups_min": Range(0, 65535, Status.OK),
    "trust.revert_after": Range(0, 65535, Status.OK),
}
LEAST = -(2**31)
FORMAT = Range(-64, 64, Status.BAD_FORMAT)
ESTIMATOR_Q31 = {
    "estimator.start": Range(LEAST, 2**31 - 1, Status.BAD_START, (Status.BAD_START,)),
    "estimator.start_sd": Range(1, 2**31 - 1, Status.BAD_START_SD),
    "estimator.lower": Range(LEAST + 1, 2**31 - 1, Status.BAD_BOUNDS, (Status.BAD_BOUNDS, Status.BAD_START)),
    "estimator.upper": Range(LEAST + 1, 2**31 - 1, Status.BAD_BOUNDS, (Status.BAD_BOUNDS, Status.BAD_START)),
    "estimator.p_bits": FORMAT,
    "estimator.n_bits": FORMAT,
    "estimator.y_bits": FORMAT,
    "estimator.row_sd": Range(1, 2**31 - 1, Status.BAD_ROW_SD),
    "estimator.forgetting_groups": Range(4, 2**24, Status.BAD_FORGETTING, besides=(0,)),
    "estimator.gain": Range(0, 2**30, Status.BAD_FEEDBACK),
    "estimator.correlation": Range(2**16, 2**31, Status.BAD_CORRELATION),
    "estimator.row_weight": Range(1, 2**16, Status.BAD_ROW_WEIGHT),
    "estimator.step_limit": Range(1, 58982, Status.BAD_STEP_LIMIT),
    "estimator.kappa_min": Range(0, 2**30 - 2**30 // 1000, Status.BAD_KAPPA_MIN),
    "estimator.noise_margin": Range(0, 2**30, Status.BAD_NOISE_MARGIN),
    "estimator.dead_zone": Range(0, 100 << 16, Status.BAD_DEAD_ZONE),
    "gate.sigmas": Range(2 << 16, 1000 << 16, Status.BAD_GATE_SIGMAS, besides=(0,)),
    "gate.patience_groups": Range(0, 2**30, Status.BAD_GATE_PATIENCE),
    "estimator.divider": Range(1, 65535, Status.BAD_DIVIDER),
}
WEAK_Q31 = {
    **ESTIMATOR_Q31,
    "drive_min": Range(0, 2**18, Status.BAD_DRIVE_MIN),
    "phi_offset": Range(LEAST, 2**31 - 1, Status.OK),
    "y_offset": Range(LEAST, 2**31 - 1, Status.OK),
    "iterations": Range(1, 10, Status.BAD_ITERATIONS, (Status.BAD_ITERATIONS,)),
    "pivot_noise.m": Range(0, 2**30, Status.BAD_PIVOT_NOISE),
    "pivot_noise.e": Range(-200, 200, Status.BAD_PIVOT_NOISE),
    "trust.kappa_min": Range(0, 2**30 - 2**30 // 1000, Status.BAD_PUBLISH_KAPPA),
    "trust.se_max": Range(1, 2**31 - 1, Status.BAD_SE_MAX),
    "trust.misfit_max": Range(2**16, 2**32 - 1, Status.BAD_MISFIT_MAX, besides=(0,)),
    "trust.renewal": Range(655, 1000 << 16, Status.BAD_RENEWAL, besides=(0,)),
    "trust.groups_min": Range(0, 65535, Status.OK),
    "trust.revert_after": Range(0, 65535, Status.OK),
}
SHIFT = Range(0, 62, Status.BAD_SHIFT)
STRONG_Q31 = {
    **ESTIMATOR_Q31,
    **{f"row.{name}": SHIFT for name in ("n_a", "n_e", "n_phi2", "n_phi0", "part", "y")},
    "u_multiplier": Range(1, 2**31 - 1, Status.BAD_U_MULTIPLIER),
    "u_shift": SHIFT,
    "phi_offset": Range(LEAST, 2**31 - 1, Status.OK),
    "y_offset": Range(LEAST, 2**31 - 1, Status.OK),
    "drive_min": Range(0, 2**30, Status.BAD_DRIVE_MIN),
    "drive_ticks": Range(1, 2**30, Status.BAD_DRIVE_TICKS),
    # what counts within full scale could overflow is refused, too
    "bank.phi_max": Range(1, 2**24, Status.BAD_FULL_SCALE, (Status.BAD_FULL_SCALE, Status.BAD_SHIFT)),
    "bank.y_max": Range(1, 2**24, Status.BAD_FULL_SCALE, (Status.BAD_FULL_SCALE, Status.BAD_SHIFT)),
    "bank.centre": Range(1, 2**30, Status.BAD_CENTRE, (Status.BAD_SHIFT,)),
    "bank.phi_shift": Range(0, 62, Status.BAD_SHIFT, (Status.BAD_SHIFT,)),
    "bank.y_shift": Range(0, 62, Status.BAD_SHIFT, (Status.BAD_SHIFT,)),
}
RANGES = {
    "strong": STRONG,
    "weak": WEAK,
    "corrected": {**WEAK, "passes": Range(1, 8, Status.BAD_ANGLE, (Status.BAD_ITERATIONS,))},
    "weak q31": WEAK_Q31,
    "strong q31": STRONG_Q31,
}
# Filled in by init, or a flag that another subject has set, or the sizes and tables below.
NOT_HERE = {"estimator.model", "estimator.update_rate_hz", "full_angle", "friction", "zero_unknown", "angle", "passes"}
NOT_WEAK = {"estimator.correlation", "estimator.row_weight"}  # of the design

# What a design and a bank refuse besides; sizes beyond those of the tables must not be accepted by chance.
NAMED = {  # the others by their own names
    "bank.weights": Status.BAD_BANK,
    "angle": Status.BAD_ANGLE,
    **{f"design.{table}": Status.BAD_DESIGN for table in ("smooth", "second", "chi", "gram", "multiplier")},
    **{f"design.{name}": Status.BAD_FULL_SCALE for name in ("phi_max", "y_max", "u_max")},
}
REFUSED = {
    "strong": {"bank.half": (0, 1, 65535), "bank.stride": (0, 65535), "bank.weights": (HEADERS.ffi.NULL,)},
    "weak": {
        "design.taps": (0, 1, 3, 6, 65535),
        "design.decimation": (0, 65, 65535),
        "design.window": (0, 7, 156, 65535),
        "design.functions": (0, 3, 255),
        "design.lag": (0,),
        **{f"design.{table}": (HEADERS.ffi.NULL,) for table in ("smooth", "second", "chi", "gram")},
    },
    "weak q31": {
        "design.taps": (0, 1, 3, 6, 65535),
        "design.decimation": (0, 65, 65535),
        "design.window": (0, 7, 156, 65535),
        "design.functions": (0, 3, 255),
        "design.smooth_bits": (32, 255),
        "design.lag": (0,),
        **{f"design.{shift}": (63, 255) for shift in ("phi_shift", "u_shift", "uf_shift")},
        **{f"design.{full_scale}": (0, -1, LEAST, 2**31 - 1) for full_scale in ("phi_max", "y_max", "u_max")},
        "design.sum_shift": (0, 31, 255),
        "design.integral_shift[1]": (63, 255),
        "design.high_shift[1]": (62, 255),
        "design.product_shift[4]": (63, 255),
        "design.shift[3]": (63, 255),
        **{f"design.{table}": (HEADERS.ffi.NULL,) for table in ("smooth", "second", "chi", "gram", "multiplier")},
    },
}
REFUSED["strong q31"] = REFUSED["strong"]
REFUSED["corrected"] = {**REFUSED["weak"], "angle": (HEADERS.ffi.NULL,)}
NAMES = tuple(RANGES)


def is_used(field: Scalar, n_p: int, n_theta: int) -> bool:
    """Whether the model has such an entry."""
    name = field.group.removeprefix("estimator.")
    if name in ("start", "start_sd", "lower", "upper", "p_bits"):
        return field.place < n_p
    return name != "n_bits" or field.place < n_theta


def ranged(subject: Subject) -> Iterator[tuple[Scalar, Range]]:
    """Every field that is to be used, with what it may hold."""
    for field in subject.fields.values():
        known = RANGES[subject.name].get(field.group)
        if known is not None and is_used(field, subject.identifier.n_p, 11 if subject.name.startswith("strong") else 8):
            yield field, known


def integers_of(field: Scalar) -> tuple[int, int]:
    """Least and largest of its C type."""
    limits = np.iinfo(HEADERS.dtype(field.kind))
    return int(limits.min), int(limits.max)


def values_for(field: Scalar, known: Range) -> st.SearchStrategy[Any]:
    """Anything its type can hold, and its range's edges."""
    if isinstance(field.value, float):
        with np.errstate(over="ignore"):
            edges = [
                float(np.nextafter(np.float32(edge), np.float32(way)))
                for edge in (known.low, known.high)
                for way in (-np.inf, np.inf)
            ]
        return st.floats(width=32) | st.sampled_from([*edges, known.low, known.high, math.nan, math.inf, -math.inf])
    low, high = integers_of(field)
    near = [int(edge) + step for edge in (known.low, known.high) for step in (-1, 0, 1)]
    return st.integers(low, high) | st.sampled_from([value for value in (low, high, 0, *near) if low <= value <= high])


@pytest.mark.parametrize("name", NAMES)
def test_every_field_is_tested(name: str, subjects: dict[str, Subject]) -> None:
    known = {field.group for field, _ in ranged(subjects[name])}
    refused = {entry.partition("[")[0] for entry in REFUSED[name]}
    leave = NOT_HERE | (NOT_WEAK if name in ("weak", "corrected") else set()) | {"design.gram_bits"}
    assert {field.group for field in subjects[name].fields.values()} - leave == (known | refused) - leave


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=400, deadline=None)
@given(data=st.data())
def test_a_field_out_of_its_range_is_refused_by_name(name: str, subjects: dict[str, Subject], data: Any) -> None:
    subject = subjects[name]
    choices = list(ranged(subject))
    field, known = data.draw(st.sampled_from(choices), label="field")
    subject.restore()
    value = data.draw(values_for(field, known), label="value")
    field.set(value)
    status = subject.identifier.initialise()
    if known.holds(value):
        assert status in (Status.OK, *known.also)
    else:
        assert status is known.status
    if status is Status.OK:
        subject.assert_finite(subject.phi, subject.y)


@pytest.mark.parametrize("name", NAMES)
def test_not_a_number_is_always_refused(name: str, subjects: dict[str, Subject]) -> None:
    for field, known in ranged(subjects[name]):
        if isinstance(field.value, float):
            for value in (math.nan, math.inf, -math.inf):
                assert subjects[name].status_with({field.name: value}) is known.status, (field.name, value)


@pytest.mark.parametrize("name", NAMES)
def test_sizes_formats_and_missing_tables_are_refused(name: str, subjects: dict[str, Subject]) -> None:
    for field, values in REFUSED[name].items():
        own = field.rpartition(".")[2].partition("[")[0]
        shift = Status.BAD_SHIFT if own.endswith(("shift", "_bits")) else None
        named = NAMED.get(field) or shift or Status[f"BAD_{own.upper()}"]
        for value in values:
            assert subjects[name].status_with({field: value}) is named, (field, value)
    subjects[name].restore()
    assert subjects[name].identifier.initialise() is Status.OK


def test_an_estimator_of_its_own_needs_a_model_and_a_rate(native: Native) -> None:
    config = strong_config(rig_with(form="strong"), 1000.0).estimator
    estimator = native.estimator(config, 1000.0)
    struct = estimator.config_struct
    for rate in (0.0, -1.0, 9e-7, 1.1e6, math.nan, math.inf):
        struct.update_rate_hz = rate
        assert estimator.initialise() is Status.BAD_UPDATE_RATE
    struct.update_rate_hz = 1000.0
    struct.model = native.headers.ffi.NULL
    assert estimator.initialise() is Status.BAD_MODEL


def test_friction_with_a_known_zero_is_a_contradiction(subjects: dict[str, Subject]) -> None:
    assert subjects["corrected"].status_with({"zero_unknown": False}) is Status.BAD_ANGLE


# ---- many at once: what is accepted stays finite ----


def magnitudes(low: float, high: float) -> st.SearchStrategy[float]:
    """float32 numbers of every size between two powers of ten."""
    return st.floats(low, high).map(lambda exponent: float(np.float32(min(10.0**exponent, HUGE))))


ODD_FLOATS: dict[str, st.SearchStrategy[float]] = {
    "estimator.row_sd": magnitudes(-12, 12),
    "estimator.forgetting_s": st.just(0.0) | magnitudes(-3, 12),
    "estimator.feedback_hz": st.just(0.0) | magnitudes(-10, 12),
    "estimator.step_limit": magnitudes(-6, -0.05),
    "estimator.kappa_min": st.just(0.0) | magnitudes(-9, -0.001),
    "estimator.noise_margin": st.just(0.0) | magnitudes(-6, 6),
    "estimator.dead_zone": st.just(0.0) | magnitudes(-12, 2),
    "sample_rate_hz": magnitudes(-3, 6),
    "l1": magnitudes(-6, 6),
    "pivot_noise": st.just(0.0) | magnitudes(-12, 9),
    "trust.kappa_min": st.just(0.0) | magnitudes(-9, -0.001),
    "trust.se_max": magnitudes(-9, 9),
    "gate.sigmas": st.just(0.0) | magnitudes(0.31, 3),
    "gate.patience_s": st.just(0.0) | magnitudes(-12, 12),
}


@st.composite
def odd_configs(draw: Callable[..., Any], subject: Subject) -> dict[str, float]:
    """Values that init is likely to accept, of any size."""
    names = [name for name in ODD_FLOATS if name in subject.fields]
    values = {name: draw(ODD_FLOATS[name]) for name in draw(st.sets(st.sampled_from(names)))}
    for i in draw(st.sets(st.integers(0, 2))):
        lower, start, upper = sorted(draw(st.tuples(*[magnitudes(-44, 38.5)] * 3)))
        values |= {f"estimator.{key}[{i}]": x for key, x in (("lower", lower), ("start", start), ("upper", upper))}
    for i in draw(st.sets(st.integers(0, subject.identifier.n_p - 1))):
        values[f"estimator.start_sd[{i}]"] = draw(magnitudes(-12, 12))
    values["estimator.law"] = draw(st.integers(0, 1))
    values["estimator.divider"] = draw(st.integers(1, 9))
    return values


@st.composite
def odd_samples(draw: Callable[..., Any], subject: Subject) -> tuple[Samples, Samples]:
    """The rig's samples, or these scaled to any size, or with anything in between."""
    phi, y = subject.phi.astype(np.float64), subject.y.astype(np.float64)
    kind = draw(st.sampled_from(("plain", "phi scaled", "y scaled", "spoilt")))
    with np.errstate(over="ignore"):
        if kind == "phi scaled":
            phi = phi * draw(magnitudes(-38, 38))
        elif kind == "y scaled":
            y = y * draw(magnitudes(-38, 38))
        elif kind == "spoilt":
            strange = np.array([1e30, -1e38, np.nan, 0, 1e10, -np.inf, 1e-40, HUGE, -HUGE])
            rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
            for x in (phi, y):
                every = draw(st.integers(1, 500))
                x[::every] = rng.choice(strange[draw(st.integers(0, 7)) :], len(x[::every]))
    return phi, y


@pytest.mark.parametrize("name", ("strong", "weak", "corrected"))
@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_accepted_configurations_stay_finite(name: str, subjects: dict[str, Subject], data: Any) -> None:
    subject = subjects[name]
    subject.restore()
    status = subject.status_with(data.draw(odd_configs(subject), label="config"))
    contradictions = (Status.OK, Status.BAD_FORGETTING, Status.BAD_UPDATE_RATE, Status.BAD_BOUNDS, Status.BAD_START)
    assert status in contradictions
    if status is Status.OK:
        subject.assert_finite(*data.draw(odd_samples(subject), label="samples"))


@pytest.mark.parametrize("name", ("weak q31", "strong q31"))
@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_fixed_point_core_keeps_its_bounds(name: str, subjects: dict[str, Subject], data: Any) -> None:
    subject = subjects[name]
    subject.restore()
    many = st.lists(st.sampled_from(list(ranged(subject))), min_size=1, max_size=6)
    values = {field.name: data.draw(values_for(field, known)) for field, known in data.draw(many)}
    if subject.status_with(values) is Status.OK:
        scale = 2.0 ** data.draw(st.integers(-3, 24))
        limits = (LEAST, 2**31 - 1)
        subject.assert_finite(np.clip(subject.phi * scale, *limits).astype(np.int64), subject.y)


# ---- what was found ----


def test_an_infinite_mean_of_finite_samples_places_no_zero(native: Native) -> None:
    # the zero goes to the mean of the first window's angles: here inf - inf
    config = weak_config(RIG, 1000.0)
    run = simulate(sensors=standard_sensors(14), truth="linear", duration=8.0, seed=1).run
    phi = run.phi.copy()
    phi[:3000:3], phi[1:3000:3] = HUGE, -HUGE
    core = native.identifier(config)
    record = core.run(phi, run.y)
    twin = WeakTwin(config).run(phi, run.y)
    assert np.isfinite(record.p).all()
    assert record.p[-1, 3] == pytest.approx(0.0, abs=1e-3)
    assert core.running_hash == fnv.running_hashes(twin.lane())[-1]


def test_residuals_beyond_float32_have_a_finite_variance(native: Native) -> None:
    config = strong_config(rig_with(form="strong"), 1000.0)
    far = np.array([32.0, 5.0, 1e20], np.float32)
    estimator: EstimatorConfig = replace(config.estimator, start=far, upper=np.float32(10.0) * far)
    config = replace(config, estimator=estimator)
    run = simulate(sensors=standard_sensors(20), truth="linear", duration=2.0, seed=1).run
    core, twin = native.identifier(config), StrongTwin(config)
    core.run(run.phi, run.y)
    twin.run(run.phi, run.y)
    assert core.assess()["residual_sd"] > 0
    assert np.isfinite(core.assess()["residual_sd"])
    assert core.assess().tobytes() == twin.estimator.assess()[0].tobytes()
