"""What a refinement is compiled from, and the splines between its samples."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from pvid.codegen.refine import is_driven_by_derivatives, refine_functions_of, without_optional
from pvid.identification.refinement import kernel_text
from pvid.identification.refinement.kernel_text import printed
from pvid.identification.refinement.spline import Spline
from pvid.models.mechanisms import compiled_of, names

MOTOR = compiled_of("dc_motor")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache."""
    monkeypatch.setattr(kernel_text, "cache_folder", lambda: tmp_path)
    return tmp_path / "kernels"


@pytest.mark.by_day(4)
@pytest.mark.parametrize("name", names())
def test_what_was_printed_once_is_read_again(name: str, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the letter, and without a derivation: it costs 0.1 to 0.5 s."""
    model = without_optional(compiled_of(name))
    first = printed(model)
    derived = refine_functions_of(model, None, is_driven_by_derivatives(model))
    bare = {key: replace(one, program=kernel_text._NO_PROGRAM) for key, one in derived.functions.items()}
    monkeypatch.delattr(kernel_text, "refine_functions_of")
    assert printed(model) == first
    assert first[0] == replace(derived, functions=bare)
    assert len(list(cache.iterdir())) == 1


def test_another_model_has_a_text_of_its_own(cache: Path) -> None:
    first, *others = MOTOR.unknowns
    for one in (
        MOTOR,
        replace(MOTOR, equations=(MOTOR.equations[0] + first.symbol, *MOTOR.equations[1:])),
        replace(MOTOR, unknowns=(replace(first, positive=False), *others)),
    ):
        printed(one)
    assert len(list(cache.iterdir())) == 3


@pytest.mark.parametrize("damaged", ["", "[1]", json.dumps({"made": {}, "code": ""}), '{"made": {"inputs": 3}}'])
def test_a_damaged_text_is_printed_again(damaged: str, cache: Path) -> None:
    first = printed(MOTOR)
    (place,) = cache.iterdir()
    whole = place.read_text(encoding="utf-8")
    place.write_text(damaged, encoding="utf-8")
    assert printed(MOTOR) == first
    assert place.read_text(encoding="utf-8") == whole


@pytest.mark.parametrize("n", [6, 7, 121, 122, 4000])
def test_a_spline_is_that_of_scipy(n: int) -> None:
    """Through noise, ends included; of 122 samples and more the inner coefficients are a convolution."""
    x = np.random.default_rng(n).normal(size=n)
    times = 0.01 * np.arange(n)
    at = np.append(np.random.default_rng(1).uniform(0, times[-1], 500), times[[0, -1]])
    expected, found = make_interp_spline(times, x, k=5), Spline(3.7, 0.01, x)
    size = float(np.max(np.abs(expected(at))))
    assert found(3.7 + at) == pytest.approx(expected(at), abs=1e-11 * size)
    assert found(3.7 + at, slope=True) == pytest.approx(expected.derivative()(at), abs=1e-9 * size / 0.01)
