"""Bad configurations: every field of every public config, out of range, no number, contradictory.

Each is refused with the status that names the field; and what is accepted, however odd, never becomes infinite or no
number, whatever the samples. tests/unit/test_own_models.c has what takes a model of the user's own.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from configurations import HEADERS, HUGE, IDENTIFIERS, RANGES, SMALLEST, Range, Subject, subjects
from hypothesis import given, settings
from hypothesis import strategies as st
from struct_fields import numbers_of

from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.core.headers import Scalar
from pvid.core.native import Native, Publisher
from pvid.models.mechanisms import compiled_of
from pvid.settings.enums import Law, Status
from pvid.sim.simulated_run import simulation_of

Samples = tuple[npt.NDArray[Any], npt.NDArray[Any]]

TICKS = 5000
NAMES = tuple(RANGES)
LEAST = -(2**31)


@pytest.fixture(scope="module")
def shared(native: Native) -> dict[str, Subject]:
    """With the tables of their designs."""
    return subjects(native)


@pytest.fixture
def empty(native: Native) -> dict[str, Subject]:
    """With long tables of zeros."""
    made = subjects(native)
    for subject in made.values():
        subject.empty_tables()
    return made


@pytest.fixture(scope="module")
def samples() -> dict[str, Samples]:
    """phi and y of the shipped rig by core."""
    weak, run = weak_q31_for_simulated_rig(compiled_of("kapitza")), simulation_of("kapitza").run(1)
    run = {name: run[name][:TICKS] for name in ("phi", "y")}
    y, phi = weak.counts_of(run).T
    return {"f32": (run["phi"], run["y"]), "q31": (phi, y)}


def assert_finite(subject: Subject, phi: npt.NDArray[Any], y: npt.NDArray[Any]) -> None:
    """Steps the accepted configuration through samples and looks at all that it shows."""
    one = subject.identifier
    assert isinstance(one, Publisher)
    record = one.run_samples(np.stack([y, phi], axis=1), hashes=False)  # type: ignore[attr-defined]
    assert np.isfinite(record.p.astype(np.float64)).all()
    assert np.isfinite(record.sums.astype(np.float64)).all()
    lower, upper = (
        np.array([subject.fields[f"estimator.{side}[{i}]"].value for i in range(one.n_p)])
        for side in ("lower", "upper")
    )
    assert (record.p >= lower).all()
    assert (record.p <= upper).all()
    for estimate in (one.assess(), one.estimate):
        for name in numbers_of(estimate):
            assert np.isfinite(np.asarray(estimate[name], np.float64)).all(), name


# ---- one field at a time ----


@pytest.mark.parametrize("name", NAMES)
def test_every_field_is_tested(name: str, shared: dict[str, Subject]) -> None:
    subject = shared[name]
    tried = {field.group for field, _ in subject.ranged()}
    pointers = {field.group for field, _ in subject.pointers()}
    assert tried | pointers == {field.group for field in subject.fields.values() if subject.is_used(field)}


@pytest.mark.parametrize("name", NAMES)
def test_every_field_ends_at_its_bounds_and_a_refused_init_leaves_zeros(name: str, empty: dict[str, Subject]) -> None:
    subject = empty[name]
    for field, value, answers in subject.edges():
        status = subject.status_with({field: value})
        assert status in answers, (field, value)
        assert status is Status.OK or not any(subject.identifier.state_bytes), field
    assert subject.status_with({}) is Status.OK


@pytest.mark.parametrize("name", NAMES)
def test_start_lies_within_its_bounds(name: str, shared: dict[str, Subject]) -> None:
    subject = shared[name]
    is_float = subject.identifier.core == "f32"
    below, above = (float(np.nextafter(np.float32(8), np.float32(way))) if is_float else way for way in (7, 9))
    least = SMALLEST if is_float else 1
    cases = [
        ((8, 8, 9), Status.OK),
        ((8, 7, 8), Status.OK),
        ((least, least, 9), Status.OK),
        ((below, 8, 9), Status.BAD_START),
        ((above, 7, 8), Status.BAD_START),
        ((8, 8, 8), Status.BAD_BOUNDS),
        ((8, 9, 7), Status.BAD_BOUNDS),
    ]
    for i in range(subject.identifier.n_p):
        signed = i >= 3  # the encoder's zero may have any sign
        for negative in ((8, 0, 9), (8, -1, 9)):
            cases.append((negative, Status.OK if signed else Status.BAD_BOUNDS))
        for values, status in cases:
            fields = zip((f"estimator.{key}[{i}]" for key in ("start", "lower", "upper")), values, strict=True)
            assert subject.status_with(dict(fields)) is status, (i, values)
        del cases[-2:]


def values_for(field: Scalar, known: Range) -> st.SearchStrategy[Any]:
    """Anything its type can hold, and its range's edges."""
    limits = None if isinstance(field.value, float) else np.iinfo(HEADERS.dtype(field.kind))
    anything = st.floats(width=32) if limits is None else st.integers(int(limits.min), int(limits.max))
    return anything | st.sampled_from(known.edges(field))


@pytest.mark.parametrize("name", IDENTIFIERS)
@settings(max_examples=400)
@given(data=st.data())
def test_a_field_out_of_its_range_is_refused_by_name(
    name: str, shared: dict[str, Subject], samples: dict[str, Samples], data: Any
) -> None:
    subject = shared[name]
    subject.restore()
    field, known = data.draw(st.sampled_from(list(subject.ranged())), label="field")
    value = data.draw(values_for(field, known), label="value")
    status = subject.status_with({field.name: value})
    assert status in known.answers(value)
    if status is Status.OK:
        assert_finite(subject, *samples[subject.identifier.core])


# ---- fields that depend on each other, and what init makes of them ----


def test_feedback_is_a_rate(shared: dict[str, Subject]) -> None:
    # g = feedback_hz * time between solves, at most 1; 0 asks for Gauss-Newton, and the other law for none
    subject = shared["estimator"]
    for hz, divider, law, gain in (
        (0.5, 1, Law.STATIONARY, 0.125),
        (0.5, 2, Law.STATIONARY, 0.25),
        (100.0, 2, Law.STATIONARY, 1.0),
        (0.0, 2, Law.STATIONARY, 1.0),
        (0.5, 2, Law.PSEUDOVELOCITY, 0.0),
    ):
        given = {"feedback_hz": hz, "divider": divider, "law": int(law), "update_rate_hz": 4.0}
        assert subject.status_with({f"estimator.{name}": value for name, value in given.items()}) is Status.OK
        assert subject.identifier.estimator.settings.gain == gain


@pytest.mark.parametrize(("name", "feedback"), (("weak", {"feedback_hz": 0.01}), ("weak q31", {"gain": 2**30 - 1})))
def test_feedback_takes_one_step_a_window(name: str, feedback: dict[str, Any], shared: dict[str, Subject]) -> None:
    subject = shared[name]
    assert subject.status_with({f"estimator.{key}": value for key, value in feedback.items()}) is Status.OK
    assert subject.identifier.state.iterations == 1


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
def odd_samples(draw: Callable[..., Any], samples: Samples) -> Samples:
    """The rig's samples, or these scaled to any size, or with anything in between."""
    phi, y = (x.astype(np.float64) for x in samples)
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


@pytest.mark.parametrize("name", ("weak",))
@settings(max_examples=150)
@given(data=st.data())
def test_accepted_configurations_stay_finite(
    name: str, shared: dict[str, Subject], samples: dict[str, Samples], data: Any
) -> None:
    subject = shared[name]
    subject.restore()
    status = subject.status_with(data.draw(odd_configs(subject), label="config"))
    contradictions = (Status.OK, Status.BAD_FORGETTING, Status.BAD_UPDATE_RATE, Status.BAD_BOUNDS, Status.BAD_START)
    assert status in contradictions
    if status is Status.OK:
        assert_finite(subject, *data.draw(odd_samples(samples["f32"]), label="samples"))


@pytest.mark.parametrize("name", ("weak q31",))
@settings(max_examples=100)
@given(data=st.data())
def test_fixed_point_core_keeps_its_bounds(
    name: str, shared: dict[str, Subject], samples: dict[str, Samples], data: Any
) -> None:
    subject = shared[name]
    subject.restore()
    many = st.lists(st.sampled_from(list(subject.ranged())), min_size=1, max_size=6)
    values = {field.name: data.draw(values_for(field, known)) for field, known in data.draw(many)}
    if subject.status_with(values) is Status.OK:
        scale = 2.0 ** data.draw(st.integers(-3, 24))
        limits = (LEAST, 2**31 - 1)
        phi, y = samples["q31"]
        assert_finite(subject, np.clip(phi * scale, *limits).astype(np.int64), y)
