"""The rig file of any mechanism: values reach the model, and every mistake is a sentence that names it."""

import math
from dataclasses import replace
from typing import Any

import pytest
import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Extra, Following, Known, Refinement, Signal, Unknown
from pvid.model.signals import Jet
from pvid.rig.mechanism_file import MechanismRig, with_settings

TEXT = """
sample_rate = 500
[model]
name = "dc_motor"
[known]
g = 9.7
[sensor.phi]
resolution = 1e-3
[sensor.V]
gain_sd = 0.005
[nominal]
R = 2
[identifier]
forgetting_s = 20
outlier_patience_s = 5
[refine]
stiction = true
"""


def model() -> CompiledModel:
    R, i0, g = sp.symbols("R i0 g", real=True)
    return CompiledModel(
        name="dc_motor",
        title="",
        signals=(Signal(Jet("V"), "V", "input"), Signal(Jet("phi"), "rad", "sensor", resolution=2e-3, noise=0.7)),
        unknowns=(
            Unknown(R, "ohm", 1.0, True, 0.0, math.inf, 2.0),
            Unknown(i0, "A", 0.0, False, -math.inf, math.inf, 0.1),
        ),
        knowns=(Known(g, "m/s^2", 9.81),),
        outputs=(),
        rows=(),
        refinement=Refinement(extras=(Extra(sp.Symbol("s"), "N*m", 0.1, "stiction"),)),
    )


def test_values_of_the_file_replace_those_of_the_model() -> None:
    rig = MechanismRig.parse(TEXT)
    assert rig.sample_rate == 500.0 and rig.model == "dc_motor"
    changed = rig.applied(model())
    assert changed.knowns[0].value == 9.7
    assert (changed.signal("phi").resolution, changed.signal("phi").noise) == (1e-3, 0.7)
    assert (changed.signal("V").gain_sd, changed.signal("phi").gain_sd) == (0.005, 0.0)
    assert (changed.unknowns[0].guess, changed.unknowns[0].sd) == (2.0, 4.0)
    assert changed.unknowns[1].sd == 0.1
    assert changed.following == Following(forgetting_s=20.0, outlier_patience_s=5.0)
    assert model().options == ("stiction",) and changed.options == ()
    assert replace(rig, refine={"stiction": False}).applied(model()).options == ("stiction",)


def test_text_gives_the_same_rig_back() -> None:
    rig = MechanismRig.parse(TEXT)
    assert MechanismRig.parse(rig.text()) == rig


def test_settings_come_before_the_file() -> None:
    document = {"model": {"name": "dc_motor"}, "known": {"g": 9.7}}
    changed = with_settings(document, ["known.g=9.6", "sensor.phi.resolution=0.5", "model.name=furuta"])
    rig = MechanismRig.of_document(changed)
    assert (rig.model, rig.known["g"], rig.sensor["phi"]["resolution"]) == ("furuta", 9.6, 0.5)
    assert document["known"] == {"g": 9.7}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("l1 = 0.3\n[model]\nname='x'", "'l1' is not a key of the rig file of a mechanism"),
        ("sample_rate = 5", "the mechanism is missing"),
        ("[model]\nname='x'\n[known]\ng='9'", "known.g must be a number, not '9'"),
        ("[model]\nname='x'\n[known]\ng=nan", "known.g must be a number, not 'nan'"),
        ("[model]\nname='x'\n[sensor]\nphi=3", "sensor.phi must be a table, [sensor.phi], not '3'"),
        ("sensor = 3\n[model]\nname='x'", "sensor must be a table, [sensor], not '3'"),
        ("sensor = []\n[model]\nname='x'", "sensor must be a table, [sensor], not '[]'"),
        (
            "[model]\nname='x'\n[sensor.phi]\nbits=3",
            "'bits' is not a key: resolution, noise, gain_sd, delay_sd, offset_sd, neglected, delay and reach are",
        ),
        ("[model]\nname='x'\n[sensor.phi]\nnoise=-3", "sensor.phi.noise must not be negative"),
        (
            "[model]\nname='x'\n[identifier]\ndivider=3",
            "identifier: 'divider' is not a key: forgetting_s, outlier_gate",
        ),
        ("[model]\nname='x'\n[identifier]\nforgetting_s=-3", "identifier.forgetting_s must not be negative"),
        ("[model]\nname='x'\n[refine]\nslant=1", "refine.slant must be true or false, not '1'"),
        ("model = 3", "model must be a table"),
        ("[model", "is not TOML"),
    ],
)
def test_a_mistake_is_named(text: str, sentence: str) -> None:
    with pytest.raises(PvidError, match=".") as caught:
        MechanismRig.parse(text)
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"known": {"h": 1.0}}, "known.h: the model has no 'h'; it has g"),
        ({"sensor": {"U": {"noise": 1.0}}}, "sensor.U: the model has no 'U'; it has V and phi"),
        (
            {"sensor": {"V": {"noise": 1.0}}},
            "sensor.V: an input of the model has gain_sd, delay_sd, offset_sd and reach alone",
        ),
        ({"nominal": {"L": 1.0}}, "nominal.L: the model has no 'L'; it has R and i0"),
        ({"nominal": {"R": -1.0}}, "nominal.R must be positive, not -1"),
        ({"refine": {"slant": True}}, "refine.slant: the model has no 'slant'; it has stiction"),
    ],
)
def test_what_the_model_does_not_have_is_named(table: dict[str, dict[str, Any]], sentence: str) -> None:
    rig = MechanismRig.of_document({"model": {"name": "dc_motor"}, **table})
    with pytest.raises(PvidError) as caught:
        rig.applied(model())
    assert str(caught.value) == sentence


@pytest.mark.parametrize(("setting", "sentence"), [("g", "is not KEY=VALUE"), ("sample_rate.x=3", "is a number")])
def test_a_setting_that_is_none_is_refused(setting: str, sentence: str) -> None:
    with pytest.raises(PvidError, match=sentence):
        with_settings({"sample_rate": 5}, [setting])


def test_a_setting_of_a_hundred_thousand_parts_is_one_sentence() -> None:
    with pytest.raises(PvidError, match="has too many parts: it is KEY=VALUE, as in --set known.g=9.81") as refused:
        with_settings({}, ["known." + "a." * 100_000 + "b=1"])
    assert len(str(refused.value)) < 200


def test_limits_of_a_commissioning_are_read_and_written() -> None:
    text = '[model]\nname = "dc_motor"\n[excitation]\nburst_s = 2.0\n[excitation.V]\nlimit = 12\n'
    rig = MechanismRig.parse(text)
    assert rig.excitation == {"": {"burst_s": 2.0}, "V": {"limit": 12.0}}
    assert MechanismRig.parse(rig.text()) == rig
    with pytest.raises(PvidError, match=r"excitation\.V\.limit must be a number"):
        MechanismRig.parse(text.replace("12", '"12 V"'))
