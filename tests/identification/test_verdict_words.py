"""One word for an answer and for each parameter: what each reason leaves of which value, the same for all printers."""

import io
from dataclasses import replace
from functools import cache
from typing import get_args

import numpy as np
import pytest
import sympy as sp
from conftest import ROOT
from lag_plant import DRAG, RATE, K, T, lag, signals
from rich.console import Console

from pvid.api.result import result_of
from pvid.base.rounding import percent
from pvid.cli.identify_run import table_of
from pvid.cli.page_table import table_in
from pvid.cli.verdict_table import ROWS, verdict_table
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.identification.judge import PREDICTED
from pvid.identification.road import identified
from pvid.identification.values import values_of
from pvid.model import Model
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.parameters import UNKNOWN
from pvid.oracle.weak.verdict import Judged, Reason, Verdict, of_width
from pvid.oracle.weak.words import WIDE, Word
from pvid.rig.run import Recording


@cache
def answer(drag: float = 0.0, noise: float = 1e-3, hand: float = 0.0, judged: bool = False) -> Analysis:
    """T y' + y + drag |y| y = K u + a random push, in 20 steps a sample."""
    samples, model = signals(drag, noise, hand), lag()
    noisy = tuple(replace(one, noise=noise) if one.name == "y" else one for one in model.signals)
    recording = Recording(np.arange(len(samples["u"])) / RATE, samples, RATE)
    model = replace(model, signals=noisy)
    return identified(recording, model, refine=False) if judged else analysed(recording, model)


def test_table_of_the_page_is_made_from_the_code() -> None:
    assert table_in(ROOT / "host" / "docs" / "reasons.md", "verdict") == verdict_table()
    assert tuple(ROWS) == get_args(Word)
    assert percent(WIDE) in ROWS["good"][1] and percent(WIDE) in ROWS["usable"][1]
    assert percent(UNKNOWN) in ROWS["not_identified"][1] and f"{PREDICTED:g}" in ROWS["not_explained"][1]


@pytest.mark.parametrize(
    ("reasons", "word", "of_a", "of_b"),
    [
        ((), "good", "good", "good"),
        ((Reason("chi2", "", alarm=False),), "good", "good", "good"),
        ((Reason("wide", "", alarm=False, of=("a",)),), "usable", "usable", "good"),
        ((Reason("halves", ""),), "usable", "usable", "usable"),
        ((Reason("undetermined", "", of=("a",)),), "usable", "not_identified", "good"),
        ((Reason("unexplained", "", of=("a",)), Reason("halves", "", of=("b",))), "usable", "not_explained", "usable"),
        ((Reason("unpredicted", ""), Reason("halves", "")), "not_explained", "not_explained", "not_explained"),
        ((Reason("not_identified", ""), Reason("unpredicted", "")), *["not_identified"] * 3),
    ],
)
def test_reason_leaves_a_word_to_the_parameters_that_it_concerns(
    reasons: tuple[Reason, ...], word: Word, of_a: Word, of_b: Word
) -> None:
    verdict = Verdict(reasons)
    assert (verdict.word, verdict.of("a"), verdict.of("b")) == (word, of_a, of_b)
    assert (verdict.warning is None) or verdict.word != "good"


def test_every_printer_has_the_word_of_the_answer_and_of_each_parameter() -> None:
    for found, words in ((answer(), ("good", "good")), (answer(DRAG), ("usable", "usable"))):
        shown, result = found.as_json(), result_of(found)
        assert shown["verdict"] == result.verdict == words[0]
        assert {one["verdict"] for one in shown["parameters"].values()} == {words[1]}
        assert result["T"].verdict == found.values["pole"].word == words[1]
        console = Console(file=(text := io.StringIO()), width=120)
        console.print(table_of(found.values, "", {}))
        assert ("usable" in text.getvalue()) == (words[1] == "usable")


def test_large_errors_alone_are_usable_without_a_warning() -> None:
    """Noise of half the motion: T has an error between the two limits, and its value is right within it."""
    found = answer(noise=0.85)
    one = found.values["T"]
    assert one.value and one.se and WIDE < one.se / one.value < UNKNOWN
    assert (one.word, found.found.verdict.word, found.found.verdict.warning) == ("usable", "usable", None)
    assert abs(one.value - T) < 4 * one.se


@pytest.mark.parametrize(
    ("se", "by_model", "word"),
    [
        (0.9 * WIDE, 0.0, "good"),
        (1.1 * WIDE, 0.0, "usable"),
        (0.9 * UNKNOWN, 0.9 * UNKNOWN, "usable"),
        (1.2 * UNKNOWN, 1.1 * UNKNOWN, "not_explained"),
    ],
)
def test_limits_of_an_error_are_parts_of_the_value(se: float, by_model: float, word: Word) -> None:
    found = answer().found
    of_k = np.array([0.0, found.p[1]])
    reasons = of_width(lag(), found.fit, se * of_k, by_model * of_k, [Judged(), Judged()])
    assert (Verdict(tuple(reasons)).of("T"), Verdict(tuple(reasons)).of("K")) == ("good", word)


def test_what_no_term_explains_is_usable_only_where_the_run_is_predicted() -> None:
    """A hand pushes at random. Without a prediction nothing tells whether the values move the mechanism."""
    alone, judged = (answer(hand=0.2, judged=one) for one in (False, True))
    assert alone.found.verdict.word == "not_explained"
    assert min(one.r2 for one in judged.prediction) > PREDICTED and judged.found.verdict.word == "usable"
    for name, truth in (("T", T), ("K", K)):
        one = judged.values[name]
        assert one.value and one.se and abs(one.value - truth) < 4 * one.se


@pytest.mark.parametrize(("share", "se", "known"), [(0.0, 0.08, False), (0.0, 0.002, True), (-1.0, 0.08, True)])
def test_an_output_depends_on_what_is_lost_beyond_its_slope(share: float, se: float, known: bool) -> None:
    """r = sqrt(cx^2 + cy^2) has the slope 0 in cx at cx = 0; cx + cy is known where their errors cancel."""
    model = Model("whirl")
    x, y = (model.sensor(name, "m", resolution=1e-6) for name in "xy")
    cx, cy = (model.unknown(name, "1/s^2", 0.1, positive=False, sd=1.0) for name in ("cx", "cy"))
    model.equation(x.d(2) + cx * y)
    model.equation(y.d(2) + cy * x)
    model.output("r", "1/s^2", cx + cy if share else sp.sqrt(cx**2 + cy**2))
    lost = Judged("not_identified", "cx is lost", has_error=True)
    own = np.array([[se**2, share * se**2], [share * se**2, se**2 if share else 1e-6]]) + 1e-12 * np.eye(2)
    compiled, p = model.compiled("whirl"), np.array([1e-4, 0.05])
    values = values_of(compiled, p, own, np.zeros((0, 2)), [lost, Judged()], Verdict(), of_known=False)
    assert (values["r"].value is not None) is known


def test_an_output_whose_formula_has_no_value_is_not_identified_and_no_nan() -> None:
    """rho2 of the pendulum is a root, of a negative number where d1 < 1 + d2."""
    model = compiled_of("kapitza")
    p, judged = np.array([30.0, 5.0, 5.6, 0.0]), [Judged()] * 4
    values = values_of(model, p, 1e-6 * np.eye(4), np.zeros((0, 4)), judged, Verdict(), of_known=False)
    assert values["rho2"].value is None and values["rho2"].status == "not_identified"
    assert values["rho2"].reason == "its formula has no real value at these parameters"
    assert values["g"].value == pytest.approx(9.0) and values["l2"].value is not None
