"""What is missing, in the answer for programs: terms with their errors, the parameters with them, the model's part."""

import json
from functools import cache

import numpy as np
import pytest
from lag_plant import DRAG, RATE, K, T, lag, signals

from pvid.api.result import result_of
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.rig.run import Recording


@cache
def answer(drag: float) -> Analysis:
    samples = signals(drag)
    return analysed(Recording(np.arange(len(samples["u"])) / RATE, samples, RATE), lag(2))


def test_term_and_the_parameters_with_it_are_in_the_json() -> None:
    found = json.loads(json.dumps(answer(DRAG).as_json(), allow_nan=False))
    missing = found["missing"]
    (term,) = missing["terms"]
    assert missing["explained"] and missing["share"] > 0.95
    assert (term["where"], term["law"], term["unit"]) == ("equation 1", "abs(y)*y", None)
    assert term["size"] == pytest.approx(2 * DRAG, rel=0.02)
    assert abs(term["size"] - 2 * DRAG) < 4 * term["se"] + 0.01 * 2 * DRAG  # the column has the noise of y
    for name, truth in (("T", T), ("K", K)):
        with_it, without = missing["parameters"][name], found["parameters"][name]
        assert abs(without["value"] - truth) > 0.02 * truth
        assert with_it["value"] == pytest.approx(truth, rel=5e-3)
        assert without["se"] >= without["se_model"] > 0.02 * truth


def test_output_has_the_model_part_of_what_it_is_made_of() -> None:
    values = answer(DRAG).values
    time, pole = values["T"], values["pole"]
    assert time.value and time.se_model and pole.value and pole.se_model
    assert pole.se_model / pole.value == pytest.approx(time.se_model / time.value, rel=1e-6)


def test_result_in_python_has_what_is_missing() -> None:
    result = result_of(answer(DRAG))
    assert result.missing is not None and result.missing["terms"][0]["law"] == "abs(y)*y"


def test_answer_that_lacks_nothing_has_no_model_part() -> None:
    found = answer(0.0).as_json()
    assert found["status"] == "good" and found["missing"] is None
    assert all(one["se_model"] < 0.3 * one["se"] for one in found["parameters"].values())
    assert result_of(answer(0.0)).missing is None
