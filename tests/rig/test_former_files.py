"""Rig files and settings of the pendulum's former dialect, and mechanisms that nobody names."""

from pathlib import Path

import numpy as np
import pytest

from pvid.base.errors import PvidError
from pvid.log.rig_choice import rig_of
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.rig.mechanism_file import MechanismRig, channels_of
from pvid.rig.run import Recording, write_recording
from pvid.sim.simulated_run import RigSimulation

FORMER = """\
l1 = 0.25  # m
sample_rate = 500.0  # Hz
l1_sd = 0.002  # relative

[sensor]
phi_lsb = 0.0015  # rad
y_lsb = 2e-05  # m
phi_zero = 3.1
y_delay = 0.002
y_gain_sd = 0.004
phi_range = 0.0
y_range = 0.03

[nominal]
l2 = 0.08
rho2 = 0.09
g = 9.8

[identifier]
form = "weak"
core = "q31"
law = "stationary"
degree = 12
forgetting_s = 20.0
test_functions = 7

[refine]
dry_friction = true

[model]
name = "kapitza"
"""


def test_every_former_key_is_one_of_today(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(FORMER)
    rig = rig_of(None, path)
    assert rig == MechanismRig(
        "kapitza",
        500.0,
        known={"l1": 0.25},
        sensor={
            "phi": {"resolution": 0.0015},
            "y": {"resolution": 2e-5, "reach": 0.03, "delay": 0.002, "gain_sd": 0.004},
        },
        nominal={"l2": 0.08, "rho2": 0.09, "g": 9.8, "c": 3.1},
        known_sd={"l1": 0.0005},
        identifier={"forgetting_s": 20.0},
        refine={"dry_friction": True},
    )
    model = rig.applied(compiled_of("kapitza"))
    guess = {one.name: one.guess for one in model.unknowns}
    ratio = (0.08 / 0.09) ** 2
    assert guess["w"] == pytest.approx(9.8 / 0.25)
    assert guess["d1"] == pytest.approx(1 + ratio * (1 + 0.25 / 0.08), rel=1e-6)
    assert guess["d2"] == pytest.approx(0.25 / 0.08 * ratio, rel=1e-6)
    assert guess["c"] == 3.1 and guess["w"] == pytest.approx(39.2, rel=1e-12)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('form = "strong"', "--form strong"),
        ('law = "pseudovelocity"', "--law pseudovelocity"),
        ("divider = 4", "identifier.divider = '4' is of the strong form"),
    ],
)
def test_a_key_without_a_place_is_refused_with_what_to_do(tmp_path: Path, line: str, said: str) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(f"l1 = 0.25\n[identifier]\n{line}\n")
    with pytest.raises(PvidError) as caught:
        rig_of(None, path)
    assert said in str(caught.value)


def test_the_name_of_a_constant_is_a_setting_of_any_mechanism() -> None:
    assert rig_of(None, None, ["l1=0.2"]).known == {"l1": 0.2}
    assert rig_of(None, None, ["g=9.7"], "cart_pendulum").known == {"g": 9.7}


def test_a_length_that_differs_from_rig_to_rig_must_be_given() -> None:
    with pytest.raises(PvidError, match=r"l1 \[m\] of the rig is missing: use --set known.l1=0.3"):
        rig_of(None, None, [], "kapitza")


@pytest.mark.parametrize("name", ["dc_motor", "two_link_arm", "battery_2rc"])
def test_a_recording_is_of_the_mechanism_that_has_its_signals(tmp_path: Path, name: str) -> None:
    simulation = RigSimulation.of(compiled_of(name), simulated_rig(name))
    run = simulation.run()
    few = {one: values[:200] for one, values in run.items()}
    path = tmp_path / "run.csv"
    write_recording(path, Recording(np.arange(200) / 1000.0, few, 1000.0), channels_of(compiled_of(name)))
    assert rig_of(path).model == name


def test_columns_of_no_shipped_mechanism_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = "\n".join(f"{k / 100},{k % 7},{k % 5}" for k in range(100))
    path.write_text(f"t,humidity,pressure\n{rows}\n")
    with pytest.raises(PvidError) as caught:
        rig_of(path)
    assert "no shipped mechanism has the names of its columns t, humidity, pressure" in str(caught.value)


def test_a_file_without_rows_is_refused_for_that(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("")
    with pytest.raises(PvidError) as caught:
        rig_of(path)
    assert "can be of" not in str(caught.value) and "run.csv" in str(caught.value)
