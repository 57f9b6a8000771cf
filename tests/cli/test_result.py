"""A result in Python: values, intervals, covariance, residuals, words, tables, files; and the data that Python has."""

import ast
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from own_mechanisms import OWN, own_recording
from test_api import run as run  # the pendulum's

import pvid
from pvid.api.words import in_python
from pvid.base.errors import PvidError
from pvid.models.mechanisms import compiled_of

PLATE = OWN["heated_plate"].path


def plate() -> pvid.Model:
    """The same as in its file."""
    model = pvid.Model("Heated plate")
    P = model.input("P", "W", hold="zoh", reach=50)
    T = model.sensor("T", "K", resolution=0.0625, reach=100)
    C, h = model.unknown("C", "J/K", 100.0), model.unknown("h", "W/K", 0.5)
    model.equation(C * T.d() + h * T - P)
    return model


def data() -> dict[str, Any]:
    recording = own_recording("heated_plate")
    return {"t": recording.t, **recording.signals}


@pytest.fixture(scope="module")
def found() -> pvid.Result:
    return pvid.identify(data(), model=PLATE)


def test_covariance_has_the_squared_standard_errors_and_what_values_have_in_common(run: Path) -> None:
    result = pvid.identify(run)
    se = np.array([one.se for one in result.parameters.values()])
    assert np.diag(result.covariance) == pytest.approx(se**2, rel=1e-9)
    assert np.array_equal(result.covariance, result.covariance.T)
    assert np.linalg.eigvalsh(result.correlation)[0] > -1e-9
    names = list(result.params)
    g, w = names.index("g"), names.index("w")
    assert result.correlation[g, w] == pytest.approx(1.0, abs=1e-6)  # g is l1 w, and l1 is given
    assert np.abs(result.correlation).max() <= 1 + 1e-9


def test_covariance_is_that_of_estimates_from_many_recordings() -> None:
    """Of a line's offset and slope in closed form: y = a + b x, where x is not centred, by the regression's inverse."""
    model = pvid.Model("spring with an offset")
    x, F = model.input("x", "m", hold="sampled", reach=2, gain_sd=0.0), model.sensor("F", "N", noise=0.05, gain_sd=0.0)
    a, b = model.unknown("a", "N", 1.0, positive=False), model.unknown("b", "N/m", 1.0)
    model.equation(F - a - b * x)
    rng = np.random.default_rng(1)
    t = np.arange(2000) / 100
    place = 1.0 + 0.3 * np.sin(t) + 0.2 * np.sin(2.7 * t)
    result = pvid.identify(
        {"t": t, "x": place, "F": 0.5 + 3 * place + 0.05 * rng.normal(size=t.size)},
        model=model,
        settings={"clock_sd": 0.0},
    )
    inverse = np.linalg.inv(np.array([[1.0, place.mean()], [place.mean(), (place**2).mean()]]))
    wanted = inverse[0, 1] / np.sqrt(inverse[0, 0] * inverse[1, 1])
    assert result.correlation[0, 1] == pytest.approx(wanted, abs=0.03) and wanted < -0.9


def test_intervals_are_those_of_the_normal_distribution(found: pvid.Result) -> None:
    for name, (low, high) in found.interval(0.6826895).items():
        one = found[name]
        assert [low, high] == pytest.approx([one.value - one.se, one.value + one.se])
    entry = found.details["parameters"]["C"]
    assert list(found.interval()["C"]) == entry["interval"]
    assert found["C"].interval()[1] == pytest.approx(found["C"].value + 1.959964 * found["C"].se)
    for level in (0.0, 1.0, 95.0, float("nan")):
        with pytest.raises(PvidError, match="a probability between 0 and 1"):
            found.interval(level)


def test_residuals_are_the_noise_and_those_of_validate(found: pvid.Result) -> None:
    left = found.residuals
    assert left["t"].shape == left["T"].shape and len(left["t"]) > 3000
    sd = OWN["heated_plate"].compiled.signal("T").sd
    assert np.std(left["T"]) == pytest.approx(sd, rel=0.2)
    other = found.validate(data())
    assert np.array_equal(other.measured["T"] - other.simulated["T"], left["T"], equal_nan=True)
    assert found.unseen is not None and found.unseen.sensors[0].rms == pytest.approx(sd, rel=0.2)


def test_words_and_tables_have_the_numbers_of_the_result(found: pvid.Result) -> None:
    frame = found.to_frame()
    assert list(frame.index) == ["C", "h"] and frame.loc["C", "value"] == found.params["C"]
    assert list(frame.loc["h", ["low", "high"]]) == list(found.interval()["h"])
    told = found["C"].shown
    assert told is not None and told.unit == "J/K"
    for text in (found.summary(), found._repr_html_(), found._repr_latex_()):
        assert told.value in text and told.low in text and told.high in text
    assert found.summary().startswith("Heated plate: good.") and "predict" in found.summary()
    assert r"\mathrm{J/K}" in found._repr_latex_()


def test_a_result_is_a_mapping_and_a_parameter_a_number(
    found: pvid.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert {**found} == found.parameters and len(found) == 2 and found.get("C") is found["C"] and found.get("x") is None
    assert found != found.parameters and found in {found}
    assert float(found["C"]) == found.params["C"] and f"{found['C']:.3g}" == f"{found.params['C']:.3g}"
    assert f"{found['C']}" == str(found["C"])
    monkeypatch.chdir(tmp_path)
    assert str(found.report()) == "heated_plate.html" and str(found.plot()) == "heated_plate.png"
    own = data()
    for index in (own["t"], pd.to_timedelta(own["t"], unit="s")):  # without a name: the time
        frame = pd.DataFrame({"T": own["T"], "P": own["P"]}, index=index)
        assert pvid.identify(frame, model=PLATE)["C"].value == pytest.approx(found.params["C"], rel=1e-6)


def test_a_result_is_saved_and_loaded(found: pvid.Result, tmp_path: Path) -> None:
    path = found.save(tmp_path / "a.json")
    for model in (PLATE, plate()):
        if not isinstance(model, Path):  # its name is its title's
            with pytest.raises(PvidError, match="a.json: it is of the mechanism heated_plate"):
                other = pvid.Model("another")
                x = other.sensor("x", "m", noise=1.0)
                other.equation(other.unknown("k", "1/s", 1.0) * x + x.d())
                pvid.load(path, model=other)
        again = pvid.load(path, model=model)
        assert again.parameters == found.parameters and np.array_equal(again.covariance, found.covariance)
        assert again.details == found.details and again.notes == found.notes and str(again) == str(found)
        assert again.summary() == found.summary()
        assert again.validate(data()).sensors == found.validate(data()).sensors
    with pytest.raises(PvidError, match="a result from a file has no report: they need the recording"):
        again.report(tmp_path / "a.html")
    with pytest.raises(PvidError, match="heated_plate: load it with model="):  # a file never chooses what runs
        pvid.load(path)
    saved = json.loads(path.read_text())
    assert saved["parameters"]["C"]["value"] == found["C"].value
    saved["saved"]["covariance"] = [[1.0]]
    path.write_text(json.dumps(saved))
    with pytest.raises(PvidError, match="covariance and parameters differ in number"):
        pvid.load(path, model=plate())


def test_other_recordings_have_the_columns_of_the_identification(tmp_path: Path) -> None:
    """By a text and by a mapping; a name may hold what separates the parts of a text."""
    own = data()
    other = {"time, ms": 1e3 * own["t"], "P": own["P"], 'a: "T"': own["T"]}
    columns: dict[str, str | int] = {"t": "time, ms:ms", "T": 'a: "T":K', "P": 2}
    result = pvid.identify(other, model=PLATE, columns=columns)
    assert result["C"].value == pytest.approx(pvid.identify(own, model=PLATE)["C"].value, rel=1e-6)
    found = result.validate(other)
    assert found.sensors == result.validate(own, columns={}).sensors
    assert str(found) == repr(found) == found.text and found.text.startswith("predicts T to ")
    again = pvid.load(result.save(tmp_path / "a.json"), model=PLATE)
    assert again.validate(other).sensors == found.sensors and len(again.predict(other)["T"])
    with pytest.raises(PvidError, match=r"no column 'time, ms' for t .* use columns="):
        result.validate(own)


def test_the_columns_that_a_refusal_proposes_are_python() -> None:
    own = data()
    renamed = {"time, ms": 1e3 * own["t"], "P": own["P"], "T": own["T"]}
    with pytest.raises(PvidError, match="use columns=") as told:
        pvid.identify(renamed, model=PLATE)
    columns = ast.literal_eval(str(told.value).rpartition("use columns=")[2].rstrip("."))
    assert pvid.identify(renamed, model=PLATE, columns=columns).identified


@pytest.mark.parametrize(
    ("typed", "python"),
    [
        ("m: --own m gives each its own", "m: own=['m'] gives each its own"),
        ("offsets; --shared x0,y0: one value in all", "offsets; shared=['x0', 'y0']: one value in all"),
        ("does a parameter differ there (--own)?", "does a parameter differ there (own=...)?"),
        ("weights alone (--weights sensors).", "weights alone."),
        (
            "--set sensor.a.noise=1 --set known.l1=0.3 --set sensor.b.noise=2, or",
            'l1=0.3, settings={"sensor.a.noise": 1, "sensor.b.noise": 2}, or',
        ),
    ],
)
def test_options_are_arguments(typed: str, python: str) -> None:
    assert in_python(typed) == python


def test_a_frame_needs_pandas(found: pvid.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(PvidError, match="to_frame needs pandas"):
        found.to_frame()


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"saved": 3}', '{"saved": {"rig": ""}}'])
def test_what_is_no_saved_result_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(PvidError, match=r"a\.json"):
        pvid.load(tmp_path / "a.json")


def test_a_model_of_the_program_is_that_of_its_file_and_changes_are_seen(found: pvid.Result) -> None:
    model = plate()
    assert pvid.identify(data(), model=model).params == found.params
    before = compiled_of(model)
    assert compiled_of(model) is before
    model.add("a1*abs(T)*T")
    assert "a1" in compiled_of(model).p_names and "a1" not in before.p_names
    with pytest.raises(PvidError, match="needs|no column"):
        pvid.identify({"t": data()["t"], "T": data()["T"]}, model=model)


def test_a_notebook_shows_a_model_with_its_equations() -> None:
    model = pvid.Model("a <b> mass")
    x = model.sensor("phi", "rad", noise=1e-3)
    model.equation(model.unknown("J", "kg*m^2", 1.0) * x.d(2) + model.unknown("c1", "N*m", 1.0) * x)
    assert (
        r"J \ddot{\phi} + \phi c_{1} &= 0" in model._repr_latex_()
        or r"J \ddot{\phi} + c_{1} \phi" in model._repr_latex_()
    )
    assert repr(model).splitlines()[0] == "Model('a <b> mass')" and "J*phi''" in repr(model)
    assert repr(model).splitlines()[2:] == ["    signal: phi [rad]", "    unknown: J [kg*m^2], c1 [N*m]"]
    assert "a &lt;b&gt; mass" in model._repr_html_() and "<td>kg*m^2</td>" in model._repr_html_()


def test_masked_values_switches_and_time_stamps_are_data(found: pvid.Result) -> None:
    whole = data()
    masked = np.ma.masked_array(whole["T"], np.arange(whole["T"].size) % 97 == 50)
    stamps = np.datetime64("2026-11-29T10:00", "ns") + (whole["t"] * 1e9).round().astype("timedelta64[ns]")
    result = pvid.identify({"t": stamps, "T": masked, "P": whole["P"]}, model=PLATE)
    for name in ("C", "h"):
        assert abs(result[name].value - found[name].value) < 2 * found[name].se
    assert any("missing samples of T" in one for one in result.notes)
    on = whole["P"] > np.median(whole["P"])
    high, low = whole["P"][on].mean(), whole["P"][~on].mean()
    switched = pvid.identify({**whole, "P": on}, model=PLATE)
    assert switched.details["samples"] == len(on) and high > low
