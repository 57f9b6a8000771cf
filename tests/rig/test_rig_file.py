"""Rig files: defaults, round trips, and one sentence that names the key for everything that is wrong."""

import json
from dataclasses import fields, replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvid.base.errors import PvidError
from pvid.rig.file import Identifier, Nominal, Refine, RigFile, Sensor, load
from pvid.setup.f32 import strong_config


def test_only_l1_is_required() -> None:
    rig = RigFile.parse("l1 = 0.6")
    assert rig.l1 == 0.6
    assert rig.sample_rate is None
    assert rig.sensor == Sensor()
    assert rig.identifier == Identifier()
    assert rig.nominal == Nominal(l2=0.6 / 3, rho2=0.6 / 3, g=9.8)


def test_the_example_of_the_design_is_the_standard_rig() -> None:
    rig = RigFile.parse(
        """
        l1 = 0.30                 # m
        sample_rate = 1000        # Hz; must agree with t
        l1_sd = 0.0
        [sensor]
        y_gain_sd = 0.0
        phi_lsb = 3.834951969714103e-4
        y_lsb = 5e-6
        [nominal]
        g = 9.8
        l2 = 0.1
        rho2 = 0.1
        [identifier]
        """
    )
    assert rig == RigFile.standard()
    assert type(rig.sample_rate) is float


def test_the_window_is_the_forms_own_unless_given() -> None:
    assert Identifier(form="strong").strong_window_s == 0.241
    assert Identifier(form="strong", window_s=0.2).strong_window_s == 0.2


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "l1 is missing"),
        ("[sensor]\nphi_lsb = 1e-4", "l1 is missing"),
        ("l1 = ", "^is not TOML: Invalid value"),
        ("l1 = 0.3\nl1 = 0.4", "^is not TOML: Cannot overwrite a value"),
        ('l1 = "0.3"', "^l1 must be a number, not '0.3'"),
        ("l1 = true", "^l1 must be a number, not true"),
        ("l1 = 0", "^l1 must be from 1e-06 to 1e\\+06 m, not 0"),
        ("l1 = -0.3", "^l1 must be from .* not -0.3"),
        ("l1 = nan", "^l1 must be from .* not nan"),
        ("l1 = inf", "^l1 must be from .* not inf"),
        ("l1 = [0.3]", "^l1 must be a number, not \\[0.3\\]"),
        (f"l1 = {10**400}", "^l1 must be from .* not 1000000000"),
        ("l1 = 0.3\nl3 = 1", "^'l3' is not a key of a rig file; known keys: l1"),
        ("l1 = 0.3\n[sensors]", "^'sensors' is not a key"),
        ("l1 = 0.3\nsensor = 3", "^sensor must be a table, \\[sensor\\], not 3"),
        ("l1 = 0.3\nsample_rate = 0", "^sample_rate must be from 0.001 to 1e\\+06 Hz, not 0"),
        ("l1 = 0.3\nsample_rate = '1 kHz'", "^sample_rate must be a number"),
        ("l1 = 0.3\n[sensor]\nphi_lsb = -1e-4", "^\\[sensor\\] phi_lsb must be from 0 to 1 rad, not -0.0001"),
        ("l1 = 0.3\n[nominal]\nl2 = 0", "^\\[nominal\\] l2 must be"),
        ("l1 = 0.3\n[nominal]\nw = 30", "^\\[nominal\\] 'w' is not a key .* l2, rho2, g"),
        (
            "l1 = 0.3\n[identifier]\nlaw = 'paper'",
            '^\\[identifier\\] law must be "stationary" or "pseudovelocity"',
        ),
        ("l1 = 0.3\n[identifier]\nlaw = 5", "^\\[identifier\\] law must be .* not 5"),
        ("l1 = 0.3\n[identifier]\nlaw = []", "^\\[identifier\\] law must be .* not \\[\\]"),
        ("l1 = 0.3\n[identifier]\ndegree = 6.0", "^\\[identifier\\] degree must be a whole number, not 6.0"),
        ("l1 = 0.3\n[identifier]\ndegree = 13", "^\\[identifier\\] degree must be from 4 to 12, not 13"),
        ("l1 = 0.3\n[identifier]\ndivider = 0", "^\\[identifier\\] divider must be from 1"),
        (
            "l1 = 0.3\n[identifier]\nkappa_min = 1",
            "^\\[identifier\\] kappa_min must be from 0 to 0.999, not 1",
        ),
        ("l1 = 0.3\n[identifier]\nforgetting_s = -1", "^\\[identifier\\] forgetting_s must be from 0"),
        ("l1 = 0.3\n[refine]\nslant = 0.01", "^\\[refine\\] slant must be true or false, not 0.01"),
        ("l1 = 0.3\n[refine]\nfriction = true", "^\\[refine\\] 'friction' is not a key .* dry_friction, slant"),
        ("a." * 3000 + "b = 1", "rig file|TOML"),
    ],
)
def test_wrong_key_is_named(text: str, sentence: str) -> None:
    with pytest.raises(PvidError, match=sentence) as caught:
        RigFile.parse(text)
    assert "\n" not in str(caught.value)


def test_settings_changed_in_code_are_checked_too() -> None:
    with pytest.raises(PvidError, match="core must be"):
        replace(Identifier(), core="f16")  # type: ignore[arg-type]
    with pytest.raises(PvidError, match="^l1 must be"):
        replace(RigFile.standard(), l1=float("nan"))


def zero_to(high: float) -> st.SearchStrategy[float]:
    """What a key takes whose range begins with 0."""
    return st.just(0.0) | st.floats(1e-12, high)


@given(
    l1=st.floats(1e-6, 1e6),
    rate=st.none() | st.floats(1e-3, 1e6),
    sensor=st.builds(Sensor, phi_lsb=zero_to(1), y_lsb=zero_to(1)),
    nominal=st.builds(Nominal, l2=st.floats(1e-6, 1e6), rho2=st.floats(1e-6, 1e6), g=st.floats(1e-3, 1e3)),
    identifier=st.builds(
        Identifier,
        form=st.sampled_from(["weak", "strong"]),
        law=st.sampled_from(["stationary", "pseudovelocity"]),
        core=st.sampled_from(["f32", "q31", "f64"]),
        window_s=zero_to(1e6),
        differentiator=st.sampled_from(["savitzky-golay", "finite-difference"]),
        degree=st.integers(4, 12),
        stride=st.integers(1, 65535),
        forgetting_s=zero_to(1e12),
        divider=st.integers(1, 65535),
        kappa_min=zero_to(0.999),
        outlier_gate=st.none() | zero_to(1e3),
        outlier_patience_s=st.none() | zero_to(1e12),
        dead_zone=zero_to(100),
    ),
    refine=st.builds(Refine, dry_friction=st.booleans(), slant=st.booleans()),
)
def test_text_gives_the_same_rig_back(
    l1: float, rate: float | None, sensor: Sensor, nominal: Nominal, identifier: Identifier, refine: Refine
) -> None:
    rig = RigFile(l1=l1, nominal=nominal, sensor=sensor, identifier=identifier, sample_rate=rate, refine=refine)
    assert RigFile.parse(rig.text()) == rig


def test_a_written_file_holds_every_key_and_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    RigFile.standard().write(path)
    text = path.read_text()
    for table in (RigFile, Sensor, Nominal, Identifier, Refine):
        for key in fields(table):
            assert key.name in text
    assert load(path) == RigFile.standard()


def test_non_log_files_are_refused(tmp_path: Path) -> None:
    absent = tmp_path / "absent.toml"
    with pytest.raises(PvidError, match=f"^{absent}: cannot be read: No such file"):
        load(absent)
    with pytest.raises(PvidError, match="cannot be read: Is a directory"):
        load(tmp_path)
    with pytest.raises(PvidError, match="cannot be written"):
        RigFile.standard().write(tmp_path / "no" / "rig.toml")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(bytes(range(128, 256)))
    with pytest.raises(PvidError, match=f"^{binary}: is not UTF-8 text"):
        load(binary)
    wrong = tmp_path / "wrong.toml"
    wrong.write_text("l1 = 0.3\nl2 = 0.1\n")
    with pytest.raises(PvidError, match=f"^{wrong}: 'l2' is not a key"):
        load(wrong)


@given(st.text(max_size=200) | st.builds(lambda s: f"l1 = 0.3\n[identifier]\n{s}", st.text(max_size=60)))
def test_any_text_gives_a_rig_or_a_sentence(text: str) -> None:
    try:
        rig = RigFile.parse(text)
    except PvidError as error:
        assert len(str(error)) < 500
    else:
        assert rig.l1 > 0.0


KEYS = [key.name for table in (RigFile, Sensor, Nominal, Identifier) for key in fields(table)]
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.lists(st.integers(), max_size=2),
)


@given(
    table=st.sampled_from(["", "[sensor]", "[nominal]", "[identifier]"]),
    key=st.sampled_from(KEYS),
    value=VALUES,
)
def test_any_value_of_any_key_gives_a_rig_or_a_sentence(table: str, key: str, value: object) -> None:
    shown = {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)
    line = f"{key} = {shown}"
    text = f"{table}\n{line}" if table else line
    prefix = "" if (not table and key == "l1") else "l1 = 0.3\n"
    try:
        RigFile.parse(prefix + text)
    except PvidError as error:
        assert str(error)


def test_the_published_defaults() -> None:
    assert Identifier() == Identifier(
        form="weak",
        law="stationary",
        core="f32",
        window_s=0.0,
        differentiator="savitzky-golay",
        degree=12,
        stride=1,
        forgetting_s=0.0,
        feedback_hz=10.0,
        divider=1,
        kappa_min=1e-5,
        outlier_gate=None,
        outlier_patience_s=None,
        dead_zone=0.0,
    )


@pytest.mark.parametrize("key", ["full_angle = false", "test_functions = 9", "zero = true"])
def test_a_key_of_the_form_before_says_what_does_it_now(key: str) -> None:
    with pytest.raises(PvidError, match=f"{key.split()[0]} is no key any more: .*leave it out"):
        RigFile.parse(f"l1 = 0.3\n[identifier]\n{key}\n")


def test_the_gate_where_the_file_does_not_say() -> None:
    assert Identifier(form="weak").gate == 4.0
    assert Identifier(form="strong").gate == 6.0
    assert Identifier(law="pseudovelocity").gate == 0.0, "the paper has none"
    assert Identifier(core="q31").gate == 4.0, "both cores alike"
    assert Identifier(outlier_gate=0.0).gate == 0.0
    assert Identifier(law="pseudovelocity", outlier_gate=5.0).gate == 5.0
    assert Identifier().patience_s is None, "of some windows"
    assert Identifier(forgetting_s=10.0).patience_s == 5.0
    assert Identifier(form="strong").patience_s == 0.0
    assert Identifier(form="strong", forgetting_s=10.0).patience_s == 60.0
    assert Identifier(forgetting_s=1e12).patience_s == 5e11
    assert Identifier(core="q31", forgetting_s=10.0).patience_s == 5.0
    assert Identifier(forgetting_s=10.0, outlier_patience_s=0.0).patience_s == 0.0


@pytest.mark.parametrize(("key", "value"), [("stride", 0), ("stride", -1)])
def test_whole_numbers_have_a_least_value(key: str, value: int) -> None:
    with pytest.raises(PvidError, match=f"{key} must be from"):
        RigFile.parse(f"l1 = 0.3\n[identifier]\n{key} = {value}")


def test_byte_order_mark_is_accepted(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_bytes(b"\xef\xbb\xbfl1 = 0.3\n")
    assert load(path).l1 == 0.3


@pytest.mark.parametrize(
    "text",
    [
        "l1 = " + "[" * 3000 + "]" * 3000,
        "l1 = " + "1" * 5000,
        "l1 = 0x" + "f" * 5000,
        "l1." + "a." * 3000 + "b = 1",
    ],
)
def test_oversized_files_are_refused_in_one_sentence(text: str) -> None:
    with pytest.raises(PvidError) as caught:
        RigFile.parse(text)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize("line", ["core = 0", "law = 5"])
def test_a_value_is_shown_as_it_was_written(line: str) -> None:
    with pytest.raises(PvidError, match=f"not {line[-1]}$"):
        RigFile.parse(f"l1 = 0.3\n[identifier]\n{line}")


def test_a_file_without_a_model_is_the_pendulum_and_one_may_name_it() -> None:
    assert RigFile.parse("l1 = 0.3") == RigFile.parse('l1 = 0.3\n[model]\nname = "kapitza"')
    assert RigFile.parse("l1 = 0.3").mechanism.model.name == "kapitza"


def test_an_unknown_model_is_refused_with_those_that_are_known() -> None:
    for wrong in ("furuta", 3, "", True):
        with pytest.raises(PvidError) as told:
            RigFile.parse(f"l1 = 0.3\n[model]\nname = {json.dumps(wrong)}")
        assert str(told.value).startswith('[model] name must be "kapitza", not ')
    with pytest.raises(PvidError, match=r"\[model\] 'kind' is not a key of a rig file"):
        RigFile.parse('l1 = 0.3\n[model]\nkind = "kapitza"')


def test_a_block_makes_points_of_means_in_the_strong_form() -> None:
    rig = replace(RigFile.standard(), identifier=Identifier(form="strong", window_s=0.315, block=9))
    config = strong_config(rig, 1000.0)
    assert (config.half, config.stride, config.block, config.window) == (17, 1, 9, 315)
    plain = strong_config(replace(rig, identifier=replace(rig.identifier, block=1)), 1000.0)
    assert (config.estimator.correlation, plain.estimator.correlation) == (17, 157)  # half a window of rows
    for wrong, sentence in (({"block": 8}, "must be odd"), ({"differentiator": "finite-difference"}, "omit it")):
        with pytest.raises(PvidError, match=sentence):
            strong_config(replace(rig, identifier=replace(rig.identifier, **wrong)), 1000.0)
