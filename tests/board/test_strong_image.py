"""The strong form of a described mechanism by the command line: identified, compared with its twin and on a board."""

import json
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from in_process import pvid
from motor_run import motor_equations
from motor_run import recording as motor_recording

from bench.kinds import KINDS
from pvid.base.console import DONE, NOTHING_IDENTIFIED
from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.board.boards import BOARDS
from pvid.board.replay_image import play
from pvid.board.strong_image import build_image, compare_on_board, hashes_of, standard_run
from pvid.compare.strong import StrongComparison
from pvid.configuration.strong import StrongDesign, five_point_design, strong_design
from pvid.core.sources import ROOT
from pvid.design.fir import finite_difference
from pvid.identification import strong
from pvid.model import Model
from pvid.models.kapitza import paper_pendulum
from pvid.models.mechanisms import compiled_of
from pvid.rig.run import Recording
from pvid.settings.enums import Law
from pvid.settings.parts import GateConfig
from pvid.sim.simulated_run import simulation_of

TICKS = 1200


def recording(name: str, ticks: int = TICKS) -> Recording:
    """The first samples of a mechanism's shipped rig."""
    simulation = simulation_of(name)
    run = simulation.run(seed=1)
    signals = {one.name: run[one.name][:ticks] for one in simulation.model.signals}
    return Recording(run["t"][:ticks], signals, simulation.rig.sample_rate)


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("body") / "body.csv"
    assert pvid("model", "simulate", "rigid_body", path, "--duration", "1.5", "--seed", "2").return_value == DONE
    return path


def test_inertias_of_a_rigid_body_by_either_core(body: Path) -> None:
    truth = simulation_of("rigid_body").rig.truth
    for core in ("f32", "q31", "f64"):
        shown = json.loads(pvid("identify", body, "--form", "strong", "--core", core, "--json").stdout)
        assert (shown["identified"], shown["form"], shown["core"]) == (True, "strong", core)
        assert "noise biases its regressors" in shown["warning"]
        for name, value in truth.items():
            one = shown["parameters"][name]
            assert abs(one["value"] - value) < 5 * one["se"], name


def test_a_distance_from_the_weak_form_is_claimed_where_that_determines_a_value(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(strong, "reference_of", lambda found: np.concatenate([[np.nan], found.p[1:]]))
    answer = strong.identify_strong_mechanism(recording("rigid_body"), compiled_of("rigid_body"), "f64")
    (noise,) = (one.text for one in answer.doubts if one.name == "noise")
    _, *others = answer.model.p_names
    assert f"distance of {listed(others)} from the weak form, and of the others what" in noise


@pytest.mark.parametrize(
    "target", ["mps2-an386", *(pytest.param(one, marks=pytest.mark.night) for one in ("microbit", "virt-rv32imac"))]
)
def test_the_board_has_the_hash_of_the_twin(body: Path, target: str) -> None:
    """With a floating-point unit and without: every operation of the generic path."""
    done = pvid("compare", body, "--form", "strong", "--core", "all", "--on", target)
    lines = [line.split("│") for line in done.stdout.splitlines() if "rigid" not in line and "equal" in line]
    assert done.return_value == DONE
    for core, host, board in zip(("f32", "q31"), lines[::2], lines[1::2], strict=True):
        assert host[2].strip() == core and host[6] == board[6] and len(host[6].strip()) == 8


def test_constraints_have_the_hash_of_the_twin_on_a_board() -> None:
    model = Model("motor with two constants")
    unknowns = "R:ohm:1 L:H:1e-3 ke:V*s/rad:0.05 kt:N*m/A:0.05 J:kg*m^2:1e-4 b:N*m*s/rad:1e-4"
    own = motor_equations(model, "ke", "kt", unknowns)
    model.constraint(own["ke"] - own["kt"])
    whole = motor_recording()
    part = Recording(whole.t[:TICKS], {name: x[:TICKS] for name, x in whole.signals.items()}, whole.sample_rate)
    run = StrongComparison.of(model.compiled("motor_two_constants"), part)
    assert run.found.equal and compare_on_board("mps2-an386", run, "").equal


@pytest.mark.parametrize("name", [pytest.param(one, marks=pytest.mark.long) for one in KINDS])
def test_every_mechanism_has_the_bits_of_its_twin(name: str) -> None:
    run = StrongComparison.of(simulation_of(name).model, recording(name))
    assert run.found.equal and run.found.ticks == TICKS


@cache
def of_paper() -> StrongDesign:
    """The paper's pendulum on the standard run, whose pivot is differentiated twice; gate and alarm on."""
    samples, rate, bank = standard_run("kapitza").samples[:TICKS].astype(float), 50.0, finite_difference()
    rig = simulation_of("kapitza").rig
    u = bank.apply(samples[:, 0], rate)[2] / rig.knowns.get("l1", 0.3)
    phi = samples[bank.delay : -bank.delay, 1] - rig.truth["c"]
    run = Recording(np.arange(len(u)) / rate, {"u": u, "phi": phi}, rate)
    design = five_point_design(paper_pendulum.model.compiled("paper_pendulum"), run)
    return replace(design, config=replace(design.config, gate=GateConfig(10.0, 1.0)))


@pytest.mark.parametrize(("schedule", "divider", "every"), [("exact", 1, 1), ("eighth", 1, 8), ("staged", 8, 0)])
def test_a_tick_of_the_papers_pendulum_has_its_budget(schedule: str, divider: int, every: int) -> None:
    config = of_paper().config
    config = replace(config, exact_every=every, estimator=replace(config.estimator, divider=divider))
    design = replace(of_paper(), config=config)
    report = play(BOARDS["mps2-an386"], build_image(BOARDS["mps2-an386"], design)[0], 100.0)
    budget = tomllib.loads((ROOT / "tests" / "budget.toml").read_text(encoding="utf-8"))["paper"][schedule]
    assert report.differs_at(hashes_of(design)) is None
    assert report.instructions_mean <= 1.02 * budget["mean"]
    assert report.instructions_longest <= 1.02 * budget["longest"]


def test_the_papers_law_solves_at_every_row() -> None:
    model = simulation_of("rigid_body").model
    design = strong_design(model, recording("rigid_body"), Law.PSEUDOVELOCITY)
    assert (design.config.estimator.law, design.config.estimator.divider) == (Law.PSEUDOVELOCITY, 1)


def test_noise_that_decides_the_answer_is_no_answer(tmp_path: Path) -> None:
    """Of the furuta pendulum with a coarse encoder: each window gives another estimate."""
    path = tmp_path / "furuta.csv"
    pvid("model", "simulate", "furuta", path, "--duration", "4")
    done = pvid("identify", path, "--form", "strong")
    assert done.return_value == NOTHING_IDENTIFIED and "does not determine" in done.stderr


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--refine",), "--figure, --refine, --weights and --add are for the weak form"),
        (("--on", "mps2-an386"), "is for `compare`"),
    ],
)
def test_what_the_strong_form_does_not_have_is_refused(body: Path, options: tuple[str, ...], sentence: str) -> None:
    with pytest.raises(PvidError) as caught:
        pvid("identify", body, "--form", "strong", *options)
    assert sentence in str(caught.value)
