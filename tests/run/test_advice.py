"""Advice: each usual mistake gets its own sentence with what to type, and no other; a healthy run gets none."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from pvid.base.errors import PvidError
from pvid.cli.main import commands
from pvid.core.native import Native
from pvid.rig.file import Nominal, RigFile
from pvid.rig.run import Run, write_run
from pvid.rig.sensor_steps import resolved
from pvid.run.advice import advice, advice_on_refusal, suspected_unit
from pvid.run.advised import answered, identified
from pvid.run.excitation import excitation_of
from pvid.run.identify import Identification
from pvid.run.skew import aligned
from pvid.settings.enums import Reason
from pvid.sim.pendulum import STANDARD_DRIVE, Pendulum, Tone, simulate, standard_sensors

LSB = 2 * np.pi / 2**12
RIG = RigFile.parse(f"l1 = 0.25\n[sensor]\nphi_lsb = {LSB!r}\n")


@cache
def run_of(
    drive: float = 1.0, friction: float = 0.0, release: float = 1.0, truth: str = "full", duration: float = 10.0
) -> Run:
    """12 bits at 500 Hz: a rig that a student might have, of parts of the standard drive and release."""
    return simulate(
        Pendulum(l1=0.25, l2=0.09, rho2=0.06, g=9.81, damping1=friction, damping2=friction),
        drive=tuple(Tone(drive * one.amplitude_m, one.frequency_hz, one.phase_rad) for one in STANDARD_DRIVE),
        sensors=replace(standard_sensors(12), phi_zero=0.01),
        sample_rate=500.0,
        duration=duration,
        release=(0.06 * release, 0.14 * release),
        truth=truth,  # type: ignore[arg-type]
        seed=3,
    ).run


def with_identifier(**changed: object) -> RigFile:
    return replace(RIG, identifier=replace(RIG.identifier, **changed))  # type: ignore[arg-type]


Advised = tuple[Identification | None, tuple[str, ...]]
_ADVISED: dict[tuple[object, ...], Advised] = {}  # many cures end in the same run


def advised(run: Run, rig: RigFile, native: Native) -> Advised:
    """What `identify` gives and the advice on it, as the command has it."""
    key = (run.t.tobytes(), run.phi.tobytes(), run.y.tobytes(), run.sample_rate, run.notes, repr(rig))
    if key not in _ADVISED:
        try:
            result = answered(run, rig, native, refine=False)
        except PvidError:
            _ADVISED[key] = None, advice_on_refusal(run, rig)
        else:
            _ADVISED[key] = result, advice(run, rig, result)
    return _ADVISED[key]


@dataclass(frozen=True)
class Mistake:
    """How a run and its rig file are spoilt, what is said and typed, and how the cure does it."""

    spoilt: Callable[[], tuple[Run, RigFile]]
    said: str
    typed: str
    cured: Callable[[Run, RigFile], tuple[Run, RigFile]]


MISTAKES = {
    "y in mm": Mistake(
        lambda: (replace(run_of(), y=1e3 * run_of().y), RIG),
        r"y looks like millimetres (largest |y| is 14.6, l1 is 0.25 m)",
        "--columns y=y:mm",
        lambda run, rig: (replace(run, y=run.y / 1e3), rig),
    ),
    "y in cm": Mistake(
        lambda: (replace(run_of(), y=1e2 * run_of().y), RIG),
        "y looks like centimetres",
        "--columns y=y:cm",
        lambda run, rig: (replace(run, y=run.y / 1e2), rig),
    ),
    "y's sign turned": Mistake(
        lambda: (replace(run_of(), y=-run_of().y), RIG),
        "y is counted downwards",
        "--columns y=y:-m",
        lambda run, rig: (replace(run, y=-run.y), rig),
    ),
    "phi in degrees": Mistake(
        lambda: (replace(run_of(), phi=np.degrees(run_of().phi)), RIG),
        "phi looks like degrees",
        "--columns phi=phi:deg",
        lambda run, rig: (replace(run, phi=np.radians(run.phi)), rig),
    ),
    "phi in degrees, a small swing": Mistake(
        lambda: (
            replace(run_of(release=0.3, duration=15.0), phi=np.degrees(run_of(release=0.3, duration=15.0).phi)),
            RIG,
        ),
        "phi looks like degrees",
        "--columns phi=phi:deg",
        lambda run, rig: (replace(run, phi=np.radians(run.phi)), rig),
    ),
    "phi in counts": Mistake(
        lambda: (replace(run_of(), phi=np.rint(run_of().phi / LSB)), RIG),
        "phi looks like counts of the encoder",
        "--columns phi=phi:rev/N",
        lambda run, rig: (replace(run, phi=LSB * run.phi), rig),
    ),
    "l1 in cm": Mistake(
        lambda: (run_of(), replace(RIG, l1=25.0, nominal=Nominal(25 / 3, 25 / 3))),
        "l1 = 25 m looks like centimetres",
        "--set l1=0.25",
        lambda run, rig: (run, RIG),
    ),
    "l1 in mm": Mistake(
        lambda: (run_of(), replace(RIG, l1=250.0, nominal=Nominal(250 / 3, 250 / 3))),
        "l1 = 250 m looks like millimetres",
        "--set l1=0.25",
        lambda run, rig: (run, RIG),
    ),
    "t in ms": Mistake(
        lambda: (replace(run_of(), t=1e3 * run_of().t, sample_rate=0.5), RIG),
        "t looks like milliseconds",
        "--columns t=t:ms",
        lambda run, rig: (run_of(), rig),
    ),
    "a clock ten times too slow": Mistake(  # which explains the run as well, with another gravity
        lambda: (replace(run_of(), t=run_of().t * 10, sample_rate=50.0), RIG),
        "unless the plane is tilted by 89 degrees, t is 10 times too large",
        "--columns t=t:0.1",
        lambda run, rig: (run_of(), rig),
    ),
    "a clock four times too slow": Mistake(
        lambda: (replace(run_of(), t=run_of().t * 4, sample_rate=125.0), RIG),
        "unless the plane is tilted by 86 degrees, t is 4 times too large",
        "--columns t=t:0.25",
        lambda run, rig: (run_of(), rig),
    ),
    "a clock twice too fast": Mistake(
        lambda: (replace(run_of(), t=run_of().t / 2, sample_rate=1000.0), RIG),
        "m/s^2 is 4 times gravity: t is 2 times too small",
        "--columns t=t:2",
        lambda run, rig: (run_of(), rig),
    ),
    "a wrong phi_lsb": Mistake(
        lambda: (run_of(), replace(RIG, sensor=replace(RIG.sensor, phi_lsb=LSB / 4))),
        "phi moves in steps of 0.001534 rad, and phi_lsb is 0.0003835",
        "--set sensor.phi_lsb=0.001534",
        lambda run, rig: (run, RIG),
    ),
    "a phi_lsb that is too coarse": Mistake(
        lambda: (run_of(), replace(RIG, sensor=replace(RIG.sensor, phi_lsb=LSB * 4))),
        "phi moves in steps of 0.001534 rad",
        "--set sensor.phi_lsb=0.001534",
        lambda run, rig: (run, RIG),
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_its_sentence_and_no_other(native: Native, name: str) -> None:
    mistake = MISTAKES[name]
    _, said = advised(*mistake.spoilt(), native)
    assert len(said) == 1, said
    assert mistake.said in said[0] and mistake.typed in said[0]


@pytest.mark.parametrize("name", MISTAKES)
def test_suggested_option_cures_the_finding(native: Native, name: str) -> None:
    mistake = MISTAKES[name]
    result, said = advised(*mistake.cured(*mistake.spoilt()), native)
    assert result is not None and result.identified
    assert said == ()
    # 10 s of a 12-bit encoder: some 0.5 % of noise; friction and the correction's remainder leave more
    assert result.value["g"] == pytest.approx(9.81, rel=0.03)


def without_a_rig_file(run: Run) -> RigFile:
    """As with --set l1=0.25 alone: the encoder's resolution, 12 bits, is not given."""
    return resolved(RigFile.parse("l1 = 0.25"), run)


@pytest.mark.parametrize("name", ["y in mm", "y's sign turned", "phi in degrees"])
def test_a_mistake_gets_its_sentence_without_a_rig_file_too(native: Native, name: str) -> None:
    run, _ = MISTAKES[name].spoilt()
    _, said = advised(run, without_a_rig_file(run), native)
    assert len(said) == 1, said
    assert MISTAKES[name].said in said[0]


@pytest.mark.parametrize(
    ("run", "said"),
    [
        (lambda: run_of(), ()),
        (lambda: run_of(release=3.0), ("angles reach 0.25 rad",)),
        (lambda: run_of(friction=2e-3, duration=15.0), ("the swing decays",)),
    ],
)
def test_advice_without_a_rig_file_is_on_the_cause(
    native: Native, run: Callable[[], Run], said: tuple[str, ...]
) -> None:
    _, advices = advised(run(), without_a_rig_file(run()), native)
    assert len(advices) == len(said)
    assert all(one.startswith(start) for one, start in zip(advices, said, strict=True))


def test_a_wrong_resolution_does_not_hide_the_cause(native: Native) -> None:
    rig = replace(RIG, sensor=replace(RIG.sensor, phi_lsb=LSB / 4))
    _, said = advised(run_of(release=3.0), rig, native)
    assert [one[:14] for one in said] == ["phi moves in s", "angles reach 0"]


def test_swapped_columns_are_reported(native: Native) -> None:
    run = run_of()
    for rig in (RIG, without_a_rig_file(replace(run, phi=run.y))):
        _, said = advised(replace(run, phi=run.y, y=run.phi), rig, native)
        assert len(said) == 1 and said[0].startswith("phi and y are exchanged") and "--columns phi=y,y=phi" in said[0]


def test_sensors_that_are_not_sampled_at_one_instant_are_told_by_how_much(native: Native) -> None:
    """y is recorded 4 ms late: moved back by y_delay it is that of the instants of phi."""
    late = replace(aligned(run_of(), -4e-3), notes=())
    result = answered(late, RIG, native)
    said = advice(late, RIG, result)
    assert len(said) == 1 and said[0].startswith("phi and y are not sampled at one instant")
    assert float(said[0].rpartition("=")[2]) == pytest.approx(4e-3, rel=0.05)


def test_wrapping_degrees_are_reported(native: Native) -> None:
    run = run_of()
    over = replace(run, phi=np.degrees(run.phi) % 360.0)
    _, said = advised(over, without_a_rig_file(over), native)
    assert len(said) == 1 and "--columns phi=phi:deg" in said[0]


def test_a_healthy_run_gets_no_advice(native: Native) -> None:
    result, said = advised(run_of(), RIG, native)
    assert result is not None and result.identified and said == ()


@pytest.mark.parametrize("core", ["f32", "q31", "f64"])
def test_a_healthy_run_of_small_angles_gets_none_in_any_core(native: Native, core: str) -> None:
    result, said = advised(run_of(truth="linear"), with_identifier(core=core), native)
    assert result is not None and result.identified and said == ()


def test_a_rest_at_half_a_turn_is_no_mistake(native: Native) -> None:
    """The weak form and the refinement count angles from rest."""
    result, said = advised(replace(run_of(), phi=run_of().phi + np.pi), RIG, native)
    assert result is not None and result.identified and said == ()
    assert result.value["g"] == pytest.approx(9.81, rel=0.03)


def test_two_mistakes_get_two_sentences(native: Native) -> None:
    run = run_of()
    _, said = advised(replace(run, phi=np.degrees(run.phi), y=-1e3 * run.y), RIG, native)
    assert [one.split(": use ")[1] for one in said] == [
        "--columns phi=phi:deg",
        "--columns y=y:mm",
        "--columns y=y:-m",
    ]


def test_fixed_point_is_advised_to_let_the_run_set_its_ranges(native: Native) -> None:
    rig = with_identifier(core="q31", form="strong")
    narrow = replace(rig, sensor=replace(rig.sensor, y_range=0.008))
    result, said = advised(run_of(truth="linear"), narrow, native)
    assert result is not None and not result.identified
    assert result.status == "saturated"
    assert said == (
        "22 % of the samples are beyond y_range = 0.008 m: raise y_range in the rig file, or omit the key to derive it "
        "from the run",
    )
    assert "saturated: 22 % of the samples are beyond y_range = 0.008 m" in result.verdict


# ---- what is weak


@pytest.mark.parametrize(
    ("drive", "said"),
    [
        (0.1, "the drive is weak: the pivot's acceleration (rms) is 2.1 % of gravity"),
        (0.001, "the pivot's acceleration is barely above its sensor's noise"),
    ],
)
def test_weak_drive_is_the_only_finding(native: Native, drive: float, said: str) -> None:
    result, advices = advised(run_of(drive=drive), RIG, native)
    assert result is not None and result.status in (Reason.HELD_NOT_EXCITED.text, Reason.HELD_UNCERTAIN.text)
    assert len(advices) == 1 and advices[0].startswith(said)


def test_driven_run_is_not_reported_as_unexcited(native: Native) -> None:
    for name, status in (("y in mm", "held uncertain"), ("y's sign turned", "held not explained")):
        result, _ = advised(*MISTAKES[name].spoilt(), native)
        assert result is not None and result.status == status
        assert "excited" not in result.verdict


def test_an_angle_that_hardly_moves_is_reported(native: Native) -> None:
    run = run_of()
    still = LSB * np.rint(0.01 * (run.phi - 0.01) / LSB)
    still[::3] += LSB
    _, advices = advised(replace(run, phi=still), RIG, native)
    assert len(advices) == 1 and advices[0].startswith("phi hardly moves: 0.")


@pytest.mark.parametrize("name", ["phi", "y"])
def test_a_constant_signal_is_refused_by_its_name(native: Native, name: str) -> None:
    with pytest.raises(PvidError, match=rf"^{name} has the same value in all 5000 samples: is the sensor connected\?$"):
        still = 0 * run_of().y
        identified(replace(run_of(), phi=still) if name == "phi" else replace(run_of(), y=still), RIG, native)


@pytest.mark.parametrize(
    "spoilt", [lambda: run_of(friction=2e-4), lambda: run_of(truth="linear")], ids=["friction", "linear equations"]
)
def test_what_the_refinement_or_the_verdict_covers_is_no_mistake(native: Native, spoilt: Callable[[], Run]) -> None:
    _, said = advised(spoilt(), RIG, native)
    assert said == ()


def test_swing_beyond_the_valid_range_is_reported(native: Native) -> None:
    _, said = advised(run_of(release=3.0), RIG, native)
    assert len(said) == 1
    assert said[0].startswith("angles reach 0.25 rad, too far for the equations of the weak form")


def test_decaying_swing_is_reported(native: Native) -> None:
    _, said = advised(run_of(friction=2e-3, duration=15.0), RIG, native)
    assert len(said) == 1 and said[0].startswith("the swing decays")


def test_the_strong_form_is_advised_to_be_the_weak_one(native: Native) -> None:
    _, said = advised(run_of(), with_identifier(form="strong"), native)
    assert said == ("the strong form needs an encoder of 20 bits and more: use --form weak, which explains this run",)


def test_misfit_of_another_mechanism_is_not_attributed_to_the_drive(native: Native) -> None:
    run = run_of()
    other = np.random.default_rng(1).permutation(run.phi.reshape(-1, 100)).ravel()  # the motion of no pendulum
    _, said = advised(replace(run, phi=other), RIG, native)
    assert len(said) == 1 and said[0].startswith("the run does not follow the equations of a pendulum")


def test_excitation_of_a_sine_in_closed_form() -> None:
    t = np.arange(20_000) / 1000.0
    run = Run(t=t, phi=0.1 * np.sin(5 * t), y=2e-3 * np.sin(2 * np.pi * 2.0 * t), sample_rate=1000.0)
    seen = excitation_of(run, RigFile.standard())
    # the window of the spectrum spreads a line over its neighbours, which count with f^4: 1 %
    assert seen.u == pytest.approx(2e-3 * (4 * np.pi) ** 2 / np.sqrt(2) / 0.3, rel=0.02)
    assert seen.w == pytest.approx(9.8 / 0.3)
    assert seen.angle == pytest.approx(0.1 / np.sqrt(2), rel=0.02)
    assert seen.weak is not None and seen.fading == pytest.approx(1, abs=0.05)


# ---- the command


def called(*arguments: str | Path) -> tuple[int, str, str]:
    done = CliRunner().invoke(commands, ["identify", *map(str, arguments)], standalone_mode=False)
    return done.return_value, done.stdout, done.stderr


def test_identify_prints_its_advice(tmp_path: Path) -> None:
    write_run(tmp_path / "run.csv", replace(run_of(), y=-run_of().y))
    RIG.write(tmp_path / "run.toml")
    code, out, err = called(tmp_path / "run.csv", "--rig", tmp_path / "run.toml")
    assert code == 3
    assert "estimate" not in out and "9.8" not in out  # the guess
    assert "pvid: nothing identified: held not explained" in err
    assert "pvid: advice: y is counted downwards" in err
    code, out, _ = called(tmp_path / "run.csv", "--rig", tmp_path / "run.toml", "--no-refine", "--json")
    answer = json.loads(out)
    assert answer["identified"] is False and "y=y:-m" in answer["advice"][0]
    assert answer["g"] == answer["parameters"]["g"]
    assert {one["value"] for one in answer["parameters"].values()} == {None}
    assert answer["chi2"] is None and answer["modes_hz"] is None and answer["first_publication_s"] is None
    assert sum(answer["reasons"].values()) == answer["ticks"] == 5000


def test_a_refusal_has_the_advice_in_front_of_it(tmp_path: Path) -> None:
    run = run_of()
    write_run(tmp_path / "run.csv", replace(run, t=1e3 * run.t, sample_rate=0.5))
    RIG.write(tmp_path / "run.toml")
    with pytest.raises(PvidError, match=r"^t looks like milliseconds .*use --columns t=t:ms \(as it is: .*\)$"):
        CliRunner().invoke(
            commands,
            ["identify", str(tmp_path / "run.csv"), "--rig", str(tmp_path / "run.toml")],
            standalone_mode=False,
            catch_exceptions=False,
        )


def test_the_json_of_an_answer(tmp_path: Path) -> None:
    write_run(tmp_path / "run.csv", run_of())
    RIG.write(tmp_path / "run.toml")
    answer = json.loads(called(tmp_path / "run.csv", "--rig", tmp_path / "run.toml", "--json")[1])
    assert answer["identified"] is True and answer["advice"] == [] and answer["warning"] is None
    assert answer["parameters"]["l2"] == answer["l2"]
    assert answer["l2"]["unit"] == "m" and answer["l2"]["value"] == pytest.approx(0.09, rel=0.05)
    assert 0.2 < answer["chi2"] < 5
    assert answer["largest_angle"] == pytest.approx(0.096, abs=0.003)
    assert answer["modes_hz"] == pytest.approx([0.83, 2.9], rel=0.05)
    assert 1 < answer["first_publication_s"] < answer["trusted_s"] <= 15
    assert answer["samples_beyond_range"] is None
    assert "misfit" not in answer


def test_the_readmes_simulate_and_identify_end_without_an_alarm(tmp_path: Path) -> None:
    simulated = CliRunner().invoke(commands, ["simulate", str(tmp_path / "run.csv")], standalone_mode=False)
    assert simulated.return_value == 0
    code, out, err = called(tmp_path / "run.csv", "--rig", tmp_path / "run.toml")
    assert (code, err) == (0, "")
    assert "status updated" in out
    answer = json.loads(called(tmp_path / "run.csv", "--json")[1])  # run.toml is beside it
    assert answer["warning"] is None and answer["advice"] == []
    for name, truth in (("g", 9.5), ("l2", 0.12), ("rho2", 0.08)):
        assert abs(answer[name]["value"] - truth) < 3 * answer[name]["se"] < 0.01 * truth


def test_missing_ticks_are_no_mistake(native: Native) -> None:
    run = run_of()
    phi, y = run.phi.copy(), run.y.copy()
    phi[1000:1003], y[1000:1003], phi[4000], y[4000] = np.nan, np.nan, np.nan, np.nan
    result, said = advised(replace(run, phi=phi, y=y), RIG, native)
    assert result is not None and result.identified and said == ()
    _, said = advised(replace(run, phi=phi, y=-y), RIG, native)
    assert len(said) == 1 and "y is counted downwards" in said[0]


@pytest.mark.parametrize(
    ("spoilt", "said"),
    [
        (lambda run: replace(run, t=1e3 * run.t, sample_rate=run.sample_rate / 1e3), "t looks like milliseconds"),
        (lambda run: replace(run, phi=np.degrees(run.phi)), "phi looks like degrees"),
        (lambda run: replace(run, phi=np.rint(run.phi / LSB)), "phi looks like counts"),
        (lambda run: replace(run, y=1e3 * run.y), "y looks like millimetres"),
        (lambda run: run, None),
    ],
    ids=["ms", "degrees", "counts", "mm", "right"],
)
def test_magnitudes_alone_show_a_wrong_unit(spoilt: Callable[[Run], Run], said: str | None) -> None:
    found = suspected_unit(spoilt(run_of()), RIG)
    assert found is None if said is None else found is not None and found.startswith(said)


def test_a_run_in_degrees_is_neither_refined_nor_answered(native: Native) -> None:
    result = answered(replace(run_of(), phi=np.degrees(run_of().phi)), without_a_rig_file(run_of()), native)
    assert result.refinement.text == "not refined: phi looks like degrees"
    assert not result.identified and result.status.startswith("held") and not result.parts
