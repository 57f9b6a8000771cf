"""Runs of a simulated rig: sensors, imperfections, drives by name, seeds, files."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Signal, Unknown
from pvid.model.evaluation import numpy_function
from pvid.model.signals import Jet, jets, sgn
from pvid.models.drive import Chirp, RandomSteps, Sines, Steps, Sum
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import Servo, SimulatedRig, simulated_rig
from pvid.rig.columns import Channel, Columns
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import read_recording
from pvid.sim.bound import bound
from pvid.sim.drives import DRIVES, drive_named
from pvid.sim.imperfections import Imperfections, sizes_of, with_play
from pvid.sim.sensing import sensed
from pvid.sim.simulated_run import SOFT, RigSimulation, write_simulated_run

LSB = 2 * math.pi / 2**12


def shaft() -> CompiledModel:
    """J phi'' + b phi' + Tc sgn(phi') = M with an encoder; a second encoder psi shows the same."""
    phi, psi, M = Jet("phi"), Jet("psi"), Jet("M")
    J, b, Tc = sp.symbols("J b Tc", real=True)
    return CompiledModel(
        name="shaft",
        title="",
        signals=(
            Signal(M, "N*m", "input", hold="zoh", driven=True),
            Signal(phi, "rad", "sensor", resolution=LSB),
            Signal(psi, "rad", "sensor", resolution=LSB),
        ),
        unknowns=tuple(Unknown(one, "", 1.0, True, 0.0, 1e9, 2.0) for one in (J, b, Tc)),
        knowns=(),
        outputs=(),
        rows=(),
        equations=(J * phi.d(2) + b * phi.d() + Tc * sgn(phi.d()) - M, psi - phi),
    )


RIG = SimulatedRig(
    model="shaft",
    truth={"J": 2e-3, "b": 1e-3, "Tc": 0.05},
    drive={"M": Sines(((0.3, 0.7, 0.0), (0.2, 1.9, 1.0)))},
    duration=3.0,
    friction_width=0.5,
    window_s=0.5,
)


@pytest.fixture(scope="module")
def simulation() -> RigSimulation:
    return RigSimulation.of(shaft(), RIG)


def test_one_seed_gives_the_same_bits_and_another_seed_other_noise(simulation: RigSimulation) -> None:
    first, again, other = (simulation.run(seed) for seed in (3, 3, 4))
    fresh = RigSimulation.of(shaft(), RIG).run(3)
    for name in ("t", "M", "phi", "psi"):
        np.testing.assert_array_equal(first[name], again[name])
        np.testing.assert_array_equal(first[name], fresh[name])
    assert np.any(first["phi"] != other["phi"])
    np.testing.assert_array_equal(first["M"], other["M"])
    assert len(first["t"]) == 3000
    # two sensors of one angle have noise of their own
    assert np.std(first["phi"] - first["psi"]) == pytest.approx(math.sqrt(2) * LSB * math.sqrt(1 / 12 + 0.25), rel=0.1)


def test_sensor_rounds_to_its_resolution_with_the_noise_of_its_signal(simulation: RigSimulation) -> None:
    signal = simulation.model.signal("phi")
    values = np.linspace(0.0, 3.0, 40_000)
    read = sensed(signal, values, np.random.default_rng(1))
    np.testing.assert_allclose(read / LSB, np.round(read / LSB), atol=1e-9)
    assert np.std(read - values) == pytest.approx(signal.sd, rel=0.02)  # 40 000 samples: 0.4 % s.e.
    exact = replace(signal, resolution=0.0, noise=0.1)
    assert np.std(sensed(exact, values, np.random.default_rng(1)) - values) == pytest.approx(0.1, rel=0.02)
    np.testing.assert_array_equal(sensed(simulation.model.signal("M"), values, np.random.default_rng(1)), values)


def test_sharp_friction_and_stiction_change_the_motion() -> None:
    weak = Sines(((0.08, 0.7, 0.0), (0.03, 1.9, 1.0)))
    simulation = RigSimulation.of(shaft(), replace(RIG, drive={"M": weak}))
    soft = simulation.motion(SOFT)["phi"]
    sharp = simulation.motion()["phi"]
    stuck = simulation.motion(Imperfections(breakaway=1.4))["phi"]
    assert np.ptp(sharp - soft) > 10 * LSB
    assert np.ptp(stuck - sharp) > 10 * LSB


def test_play_holds_the_sensor_between_its_flanks(simulation: RigSimulation) -> None:
    values = np.array([0.0, 1.0, 3.0, 2.5, 1.5, 0.9, 2.0, 4.0])
    np.testing.assert_allclose(with_play(values, 2.0), [0.0, 0.0, 2.0, 2.0, 2.0, 1.9, 1.9, 3.0])
    plain, loose = simulation.run(0), simulation.run(0, Imperfections(backlash={"phi": 4.0}))
    assert np.ptp(loose["phi"] - plain["phi"]) == pytest.approx(4 * LSB, abs=1.01 * LSB)
    np.testing.assert_array_equal(loose["psi"], plain["psi"])


def test_eccentric_encoder_errs_once_a_turn(simulation: RigSimulation) -> None:
    plain, bent = simulation.run(0), simulation.run(0, Imperfections(eccentricity={"phi": 5.0}))
    error = (bent["phi"] - plain["phi"]) / LSB
    angle = simulation.motion()["phi"]
    shape = np.stack([np.sin(angle), np.cos(angle), np.ones(len(angle))], 1)
    fitted, rest = np.linalg.lstsq(shape, error, rcond=None)[:2]
    assert np.hypot(*fitted[:2]) == pytest.approx(5.0, rel=0.05)
    assert rest[0] / len(angle) < 0.5  # what two roundings leave: 1/6


def test_skewed_sensor_shows_the_angle_of_a_moment_before(simulation: RigSimulation) -> None:
    plain, late = simulation.run(0), simulation.run(0, Imperfections(skew={"phi": 1e-3}))
    np.testing.assert_array_equal(late["psi"], plain["psi"])
    rate = simulation.motion()["phi_1"]
    lag = float(rate @ (plain["phi"] - late["phi"]) / (rate @ rate))
    assert lag == pytest.approx(1e-3, rel=0.05)
    with pytest.raises(PvidError, match="skew of phi must be a multiple"):
        simulation.run(0, Imperfections(skew={"phi": 0.77e-4}))


def test_gain_of_an_input_acts_on_the_motion_and_that_of_a_sensor_on_the_record(simulation: RigSimulation) -> None:
    plain = simulation.run(0)
    strong = simulation.run(0, Imperfections(gain={"M": 1.01}))
    np.testing.assert_array_equal(strong["M"], plain["M"])
    assert np.ptp(strong["phi"] - plain["phi"]) > 10 * LSB
    long = simulation.run(0, Imperfections(gain={"phi": 1.01}))
    np.testing.assert_allclose(long["phi"], 1.01 * plain["phi"], atol=1.1 * LSB)


def test_process_noise_differs_by_seed(simulation: RigSimulation) -> None:
    rough = Imperfections(process={0: 1e-3})
    first, again, other = (simulation.motion(rough, seed=seed)["phi"] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.ptp(first - other) > LSB
    with pytest.raises(PvidError, match="no equation 5"):
        simulation.motion(Imperfections(process={5: 1.0}))


def test_servo_follows_its_reference() -> None:
    servo = Servo("phi", Sines(((0.5, 0.7, 0.0),)), kp=20.0, kd=0.4)
    simulation = RigSimulation.of(shaft(), replace(RIG, drive={"M": servo}))
    run = simulation.run(0)
    reference = servo.reference.values(run["t"])
    assert np.abs(run["phi"] - reference)[1000:].max() < 0.1
    motion = simulation.motion()
    law = 20.0 * (reference - motion["phi"]) - 0.4 * motion["phi_1"]
    np.testing.assert_allclose(run["M"], law, atol=1e-12)


def test_wrong_requests_are_one_sentence(simulation: RigSimulation) -> None:
    with pytest.raises(PvidError, match="x is no signal of shaft; signals are M, phi, psi"):
        simulation.run(0, Imperfections(backlash={"x": 1.0}))
    with pytest.raises(PvidError, match="gives no value of Tc"):
        RigSimulation.of(shaft(), replace(RIG, truth={"J": 1.0, "b": 1.0}))
    with pytest.raises(PvidError, match="needs a sharp friction"):
        Imperfections("soft", breakaway=1.5)
    with pytest.raises(PvidError, match="friction is soft or sharp"):
        Imperfections(friction="wet")  # type: ignore[arg-type]
    with pytest.raises(PvidError, match="nothing has no simulated rig"):
        simulated_rig("nothing")


def test_imperfections_are_read_from_settings() -> None:
    sizes = sizes_of(["skew.phi=1e-3", "gain.M=1.01", "skew.psi = 2e-3"])
    assert sizes == {"skew": {"phi": 1e-3, "psi": 2e-3}, "gain": {"M": 1.01}}
    for setting, sentence in (
        ("phi=3", "'phi=3' is not KIND.SIGNAL=SIZE with a KIND of backlash, eccentricity, skew and gain"),
        ("skew.phi=late", "'late' is no number"),
    ):
        with pytest.raises(PvidError, match=sentence):
            sizes_of([setting])


def test_run_is_written_with_its_rig_file(simulation: RigSimulation, tmp_path: Path) -> None:
    run = simulation.run(0)
    settings = write_simulated_run(tmp_path / "shaft.csv", run, simulation)
    assert settings == tmp_path / "shaft.toml"
    rig = MechanismRig.parse(settings.read_text(encoding="utf-8"))
    assert (rig.model, rig.sample_rate) == ("shaft", 1000.0)
    channels = tuple(Channel(one.name, one.unit) for one in simulation.model.signals)
    again = read_recording(tmp_path / "shaft.csv", rig.sample_rate, Columns(channels))
    assert list(again.signals) == ["M", "phi", "psi"] and again.notes == ()
    for name, values in again.signals.items():
        np.testing.assert_array_equal(values, run[name])


# ---- drives


def test_derivative_of_sines_is_that_of_differences() -> None:
    drive = Sum((Sines(((2.0, 1.3, 0.4), (0.5, 4.0, 1.0)), offset=3.0), Sines(((1.0, 0.2, 0.0),))))
    t, h = np.linspace(0.0, 2.0, 50), 1e-4
    for order in (1, 2):
        slope = (drive.values(t + h, order - 1) - drive.values(t - h, order - 1)) / (2 * h)
        np.testing.assert_allclose(drive.values(t, order), slope, atol=h**2 * 0.5 * (8 * math.pi) ** (order + 2))


def test_steps_and_random_steps_change_at_their_edges_alone() -> None:
    t = np.arange(1000) * 1e-3
    prbs = RandomSteps(1.5, 0.01, seed=1).values(t)
    assert set(np.unique(prbs)) == {-1.5, 1.5}
    assert np.all(np.flatnonzero(np.diff(prbs)) % 10 == 9)
    np.testing.assert_array_equal(RandomSteps(1.5, 0.01, seed=1).values(t[500:]), prbs[500:])
    np.testing.assert_array_equal(Steps((1.0, 0.0), 0.1).values(t)[[0, 99, 100, 199, 200]], [1, 1, 0, 0, 1])
    with pytest.raises(PvidError, match="a sequence of steps has none") as refused:
        RandomSteps(1.0, 0.1, seed=1).values(t, 1)
    named = re.findall(r'take the drive "(.*)"', str(refused.value))
    assert named and {*named} <= {*DRIVES}


def test_chirp_goes_up_and_down_without_a_jump() -> None:
    t = np.arange(60_000) * 1e-3
    values = Chirp(2.0, 0.5, 8.0, 15.0).values(t)
    assert np.abs(np.diff(values)).max() <= 2.0 * 2 * math.pi * 8.0 * 1e-3
    crossings = np.flatnonzero(np.diff(np.sign(values))) * 1e-3
    near = [np.count_nonzero((crossings > at) & (crossings <= at + 1.0)) for at in (0.0, 14.0, 29.0)]
    assert near[0] <= 2 and near[1] >= 14 and near[2] <= 2


@pytest.mark.parametrize("name", DRIVES)
def test_drive_by_name_stays_within_its_amplitude(name: str) -> None:
    t = np.arange(20_000) * 1e-3
    first, second = (drive_named(name, 3.0, 0.5, 10.0, number).values(t) for number in (0, 1))
    assert 0.5 * 3.0 < np.abs(first).max() <= 3.0 + 1e-12
    assert name == "constant" or np.any(first != second)


def test_drive_of_no_name_or_band_is_refused() -> None:
    with pytest.raises(PvidError, match="square is no drive; known are constant, steps"):
        drive_named("square", 1.0, 1.0, 2.0)
    with pytest.raises(PvidError, match="a drive's band"):
        drive_named("chirp", 1.0, 2.0, 1.0)


# ---- the equations of the refinement


def test_whole_equations_hold_in_the_motion_and_its_angle_is_that_of_the_encoder() -> None:
    """Friction and slant of the refinement are truths of the rig; 0.5 % of g, which small angles neglect, is seen."""
    model, rig = compiled_of("kapitza"), simulated_rig("kapitza")
    true = {**rig.truth, "c": 0.02, "k1": 0.05, "k2": 0.01, "slant": 0.03}
    whole = RigSimulation.of(model, replace(rig, truth=true, duration=4.0), whole=True)
    motion = whole.motion()
    names = [jet for one in model.refinement.equations for jet in jets(one) if jet.of != "u"]
    u = motion["y_2"] / 0.3
    values = {str(one): motion[str(one)] for one in names} | {"u": u}
    fixed = {sp.Symbol(one, real=True): value for one, value in true.items()}
    for equation in model.refinement.equations:
        plain = equation.xreplace(dict(model.refinement.shapes))
        plain = plain.xreplace({one: fixed.get(sp.Symbol(str(one), real=True), one) for one in plain.free_symbols})
        plain = plain.xreplace({one: sp.Integer(0) for one in plain.free_symbols if str(one) in ("f1", "f2")})
        left = sorted(plain.free_symbols, key=str)
        off = numpy_function(left, plain)(*(values[str(one)] for one in left))
        assert np.abs(off).max() < 1e-10 * np.abs(motion["a1_2"]).max()
    phi = whole.run()["phi"]
    assert np.abs(phi - (motion["a2"] - motion["a1"] + 0.02)).max() < 4 * model.signal("phi").resolution
    rows = RigSimulation.of(model, replace(rig, duration=4.0)).run()["phi"]
    assert (
        1e-4 < np.abs(rows - RigSimulation.of(model, replace(rig, duration=4.0), whole=True).run()["phi"]).max() < 0.02
    )


def test_a_model_without_equations_of_its_own_is_simulated_by_those_of_its_rows() -> None:
    rows, own = (RigSimulation.of(shaft(), RIG, whole=whole).run(2)["phi"] for whole in (False, True))
    np.testing.assert_array_equal(rows, own)


# ---- bound


def test_bound_of_a_constant_rate_is_that_of_a_straight_line() -> None:
    """x' = v from an unknown start in every window: sd/sqrt(sum (t - mean)^2) over the root of the windows."""
    x, v, w = Jet("x"), sp.Symbol("v", real=True), sp.Symbol("w", real=True)
    model = CompiledModel(
        name="line",
        title="",
        signals=(Signal(x, "m", "sensor", resolution=1e-3),),
        unknowns=tuple(Unknown(one, "", 1.0, True, 0.0, 9.0, 2.0) for one in (v, w)),
        knowns=(),
        outputs=(),
        rows=(),
        equations=(x.d() - v,),
    )
    rig = SimulatedRig("line", {"v": 0.7, "w": 1.0}, {}, sample_rate=100.0, duration=4.0, window_s=0.5)
    se = bound(RigSimulation.of(model, rig))
    t = np.arange(50) / 100.0
    line = model.signals[0].sd / math.sqrt(8 * float(np.sum((t - t.mean()) ** 2)))
    assert se[0] == pytest.approx(line, rel=1e-6)
    assert se[1] == math.inf  # no equation contains w


def test_bound_falls_with_longer_windows(simulation: RigSimulation) -> None:
    short, long = bound(simulation, 0.25), bound(simulation, 1.0)
    assert np.all(long < short)
