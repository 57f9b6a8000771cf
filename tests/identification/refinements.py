"""Mechanisms to refine, their recordings, and answers of the weak form: two whose drive is differentiated, a shipped
one with an input, and two in files of one's own, one of them without an input."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from math import pi

import numpy as np
import numpy.typing as npt
from own_mechanisms import OWN, own_recording
from pendulum_plant import STANDARD_DRIVE, STANDARD_PENDULUM, Pendulum, simulate, standard_sensors
from test_own_mechanisms import read, recorded

from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.identification.refinement.problem import RefinedMechanism
from pvid.identification.refinement.search import refine
from pvid.model import Model
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.verdict import Judged
from pvid.rig.run import Recording
from pvid.sim.simulated_run import simulation_of

Float = npt.NDArray[np.float64]

DAMPED = replace(STANDARD_PENDULUM, damping1=2e-3, damping2=5e-4)  # [m^2/s]
PENDULUM = dict(zip(("w", "d1", "d2", "c"), (*STANDARD_PENDULUM.linear, 0.02), strict=True))
ISOLATED = {"c": 3.0, "k": 400.0, "x0": 1e-3}


@dataclass(frozen=True, eq=False)
class Subject:
    """A mechanism: compiled, its true parameters, and a recording of it."""

    model: CompiledModel
    truth: Mapping[str, float]
    recording: Recording

    @property
    def p(self) -> Float:
        """Truth in the order of the model."""
        return np.array([self.truth[name] for name in self.model.p_names])

    @property
    def positive(self) -> npt.NDArray[np.bool_]:
        """Which of the parameters are."""
        return np.array([one.positive for one in self.model.unknowns])


def pendulum_model(bits: int = 16) -> CompiledModel:
    compiled = compiled_of("kapitza")
    lsb = 2 * pi / 2**bits
    signals = tuple(replace(one, resolution=lsb if one.name == "phi" else one.resolution) for one in compiled.signals)
    return replace(compiled, signals=signals)


@cache
def isolator_model() -> CompiledModel:
    """A mass on a spring in a moving frame, whose place in the frame is measured."""
    model = Model("isolator")
    b = model.sensor("b", "m", resolution=1e-6, noise=0.4, reach=0.02, driven=True)
    x = model.sensor("x", "m", resolution=1e-5, reach=0.05)
    a = model.define("a", "m/s^2", b.d(2))
    c, k = model.unknown("c", "1/s", 2.5), model.unknown("k", "1/s^2", 450.0)
    x0 = model.unknown("x0", "m", 0.0, positive=False, sd=0.01)
    model.equation(x.d(2) + c * x.d() + k * (x - x0) + a)
    return model.compiled("isolator")


def pendulum_run(
    skew: float = 0.0, bits: int = 16, release: tuple[float, float] = (0.17, 0.4), of: Pendulum = DAMPED, seed: int = 1
) -> Recording:
    """20 s of the standard rig, by default released at 0.3 rad, with friction; full equations."""
    sensors = replace(standard_sensors(bits), phi_zero=PENDULUM["c"], skew_s=skew)
    return simulate(of, STANDARD_DRIVE, sensors, 1000.0, 20.0, release, "full", seed).run.recording


def isolator_run(skew: float = 0.0, of: Mapping[str, float] = ISOLATED) -> Recording:
    """16 s at 500 Hz; the frame's sensor is read `skew` [s] early."""
    dt, n = 1 / 500, 8000
    t = np.arange(n) * dt
    frame, moved = np.zeros(n), np.zeros(n)
    for hz, size, phase in ((1.3, 5e-3, 0.3), (2.9, 3e-3, 1.0), (5.2, 2e-3, 2.0)):
        s = 2j * pi * hz
        wave = size * np.exp(1j * phase)
        frame += (wave * np.exp(s * (t - skew))).real
        moved += (-(s**2) * wave * np.exp(s * t) / (s**2 + of["c"] * s + of["k"])).real
    return recorded(dt, b=read(frame, 1e-6, 1), x=read(moved + of["x0"], 1e-5, 2))


@cache
def subject(name: str, skew: float = 0.0) -> Subject:
    """Of a driven sensor that is read `skew` [s] early."""
    if name == "kapitza":
        return Subject(pendulum_model(), PENDULUM, pendulum_run(skew))
    if name == "isolator":
        return Subject(isolator_model(), ISOLATED, isolator_run(skew))
    if name in OWN:
        model = OWN[name].compiled
        return Subject(model, {one.name: one.guess for one in model.unknowns}, own_recording(name))
    simulation = simulation_of(name)
    run = {one: values[:6000] for one, values in simulation.run(1).items()}
    recording = Recording(run.pop("t"), run, simulation.rig.sample_rate)
    return Subject(simulation.model, simulation.rig.truth, recording)


def run_of(name: str, skew: float = 0.0) -> Recording:
    return subject(name, skew).recording


@cache
def _weak(name: str) -> Analysis:
    return analysed(run_of(name), subject(name).model)


def answer_of(
    name: str, recording: Recording | None = None, factor: float = 1.05, lacking: tuple[str, ...] = ()
) -> Analysis:
    """An answer of the weak form with parameters off by a factor or its inverse in turn; it determines all but those
    of `lacking`."""
    weak, of = _weak(name), subject(name)
    factors = [factor ** (-1) ** k if positive else 1.0 for k, positive in enumerate(of.positive)]
    judged = tuple(Judged("not_identified", "for a test") if one in lacking else Judged() for one in of.model.p_names)
    found = replace(weak.found, p=of.p * factors, judged=judged)
    return replace(weak, found=found, recording=weak.recording if recording is None else recording)


@cache
def refined_small() -> RefinedMechanism:
    """Of the pendulum at small angles, where its linearised equations hold."""
    return refine(answer_of("kapitza", pendulum_run(release=(0.01, 0.02))))


@cache
def refined_of(name: str, skew: float = 0.0) -> RefinedMechanism:
    return refine(answer_of(name, run_of(name, skew)))


def errors_of(refined: RefinedMechanism, truth: Mapping[str, float]) -> tuple[Float, Float]:
    """Relative errors and standard errors of the main parameters."""
    names = [refined.names[k] for k in refined.main]
    values = np.array([refined.values[name] / truth[name] - 1 for name in names])
    return values, np.sqrt(np.diag(refined.found.covariance))[list(refined.main)]


def errors_over_se(refined: RefinedMechanism, of: Subject) -> Float:
    """Of the parameters in the order of the model."""
    return np.array([(refined.values[name] - of.truth[name]) / refined.errors[name] for name in of.model.p_names])


def changed(recording: Recording, **signals: Float) -> Recording:
    """The recording with other samples of some signals."""
    return replace(recording, signals={**recording.signals, **signals})


def shaken(recording: Recording, sensor: str, amplitude: float, hz: float) -> Recording:
    """With a vibration of a sensor that no equation has."""
    return changed(recording, **{sensor: recording.signals[sensor] + amplitude * np.sin(2 * pi * hz * recording.t)})


def played(x: Float, half: float) -> Float:
    """Through a sensor that follows only when a play of +-half is taken up."""
    out = x.copy()
    for k in range(1, len(x)):
        out[k] = min(max(out[k - 1], x[k] - half), x[k] + half)
    return out
