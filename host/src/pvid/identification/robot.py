"""The answer of a robot's recording: base parameters, and how well they predict torques."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pvid.base.errors import PvidError
from pvid.base.rounding import with_error
from pvid.base.wording import listed, with_unit
from pvid.identification.answer import Answer, Factors, Float, Value
from pvid.identification.bodies import Bodies, bodies_of
from pvid.identification.sensor_prediction import SensorPrediction
from pvid.model.chain import INERTIAL, WRENCH, Chain
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.missing import student
from pvid.oracle.weak.robot import (
    DEAD,
    EVERY,
    GAIN,
    LATE,
    LOADED,
    RATIO,
    SOFT,
    ZERO,
    Lacking,
    RobotFit,
    RobotRun,
    identify_robot,
    terms_of,
)
from pvid.oracle.weak.verdict import Reason, Verdict
from pvid.rig.run import Recording

_CLASH = 4.5  # standard errors between the halves: one of 60 parameters is as far apart once in 2000 runs
_STILL = 0.14  # of the samples: 13 bits, 500 Hz, 0.8 rad/s; of 10 runs each 89 % of the values are within two standard
# errors there and 83 % with 12 bits
_CHANCE = 0.002  # of a clean recording: that one of all terms is taken for missing, by Student's t
_APART = 2 / 3  # degrees of freedom of a window that overlaps half of the next
_WORDS = {
    "q": "{size} * q{joint}: one of a spring, a cable and a wrong gear",
    "1": "{size} at all times: one of an offset of its sensor, a load, and a spring of which gravity's parameters take "
    "the rest",
    "abs(v)*v": "{size} * abs(v)*v of its rate v: one of drag and another gain of that torque",
    "slow": "{size} at low speed: friction that is not dry plus viscous; move faster",
    DEAD: "{size} less than it is on either side of 0: a dead band",
    "v": "{size} * its rate: drag",
}
_UNITS = {"q": "/{unit}", "1": "", "abs(v)*v": "*s^2/{unit}^2", "slow": "", DEAD: "", "v": "*s/{unit}"}
_SEEN = 1e-6  # relative size of a direction that the torques depend on
_CLEAR_MASS = 3.0  # standard errors: a payload of less has no centre
_PAYLOAD = ("m", "cx", "cy", "cz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
_OF_FILE = 0.1  # relative error of a file's values, which are taken as large as at least
_OF_WHOLE = 0.5  # of the body's vector or tensor
_FAR = 25.0  # of squared differences from the file, over their errors: what a spring explains at least
_ALIKE = 2.0  # of each value: what is left at most
_EXPLAINED = 0.9  # R^2 of a torque below which the equations do not explain it,
_NOISY = 1.5  # where the residual is larger than what the noise of the encoders makes of the torque


@dataclass(frozen=True, eq=False)
class RobotAnswer(Answer):
    """An identification of a robot in float64.

    Attributes
    ----------
    model, recording, values, advice : as of Answer
    fit : the estimate
    """

    model: CompiledModel
    fit: RobotFit
    values: Mapping[str, Value]
    recording: Recording
    advice: tuple[str, ...] = ()

    @property
    def identified(self) -> bool:
        """Whether at least one parameter is."""
        return self.verdict.identified

    @property
    def identifier(self) -> str:
        """Form and arithmetic."""
        return "base parameters, weak form, float64"

    @cached_property
    def prediction(self) -> tuple[SensorPrediction, ...]:
        """Of the torques in either half of the recording by the parameters of the other."""
        return torques_of(self.model, self.fit, self.fit.run, self.fit.halves[::-1])

    def predicts(self, other: Recording) -> tuple[SensorPrediction, ...]:
        """How well it predicts the torques of another recording."""
        run = RobotRun(self.model, other.run, other.sample_rate)
        return torques_of(self.model, self.fit, run, self.fit.p[np.newaxis])

    @cached_property
    def verdict(self) -> Verdict:
        """What the run does not determine, and what contradicts itself."""
        names, fit, chain = self.model.p_names, self.fit, self.fit.run.chain
        lost = [name for name, one in zip(names, fit.undetermined, strict=True) if one]
        if len(lost) == len(names):
            return Verdict((Reason("not_identified", "the motion determines no parameter: do the joints move?"),))
        reasons = []
        if lost:
            text = f"the motion does not determine {listed(lost)}: move more joints at the same time, and faster"
            reasons.append(Reason("undetermined", text, of=tuple(lost)))
        apart = [name for name, far in zip(names, fit.apart, strict=True) if far > _CLASH and name not in lost]
        if apart:
            text = f"the two halves of the recording disagree about {listed(apart)}: does friction change with heat?"
            reasons.append(Reason("halves", text, of=tuple(apart)))
        worst = int(np.argmax(fit.design.still))
        if fit.design.still[worst] > _STILL:
            text = (
                f"{chain.position(worst)} stays on one count in {fit.design.still[worst]:.0%} of the samples: its "
                "rounding is then no white noise, and standard errors, most of all of friction, may be too small; move "
                "faster, or record with more bits"
            )
            reasons.append(Reason("sensor", text))
        values = [self.values[name] for name in names]
        sd = np.array([math.hypot(it.se_noise or math.inf, it.se_scale or 0.0) for it in values])
        springs = self._springs
        for one in sure(fit):
            moved = [k for k in np.argsort(-np.abs(one.shift) / sd) if abs(one.shift[k]) > sd[k]]
            if one.law == GAIN and (springs or not moved):
                continue  # within what the gains' own errors are, or of a wrong gravity
            text = _told(chain, one)
            if moved:
                k = moved[0]
                text += f"; with that {names[k]} would be {fit.p[k] + one.shift[k]:.4g} in place of {fit.p[k]:.4g}"
            reasons.append(
                Reason(
                    "friction" if one.law == "slow" else "missing",
                    text,
                    alarm=bool(moved),
                    of=tuple(names[k] for k in moved),
                )
            )
        reasons += springs
        weak = [one.name for one in self.prediction if one.r2 < _EXPLAINED]
        if weak:  # the rates' noise may be all that is not explained
            pieces = zip(fit.predicted(fit.run, fit.p[np.newaxis]), fit.predicted(fit.run, fit.p[np.newaxis], 0),
                         strict=True)  # fmt: skip
            blurred = np.concatenate([(one - other)[:, 0] for (_, one), (_, other) in pieces], axis=1)
            noise = np.delete(np.sqrt(np.mean(blurred**2, axis=1)), fit.run.idle)
            weak = [one.name for one, sd in zip(self.prediction, noise, strict=True)
                    if one.r2 < _EXPLAINED and one.rms > _NOISY * sd]  # fmt: skip
        if weak:
            outside = ", or what touches the base: the ground, thrust (wrench=True)" if 0 in fit.run.idle else ""
            text = (
                f"less than {_EXPLAINED:.0%} of {listed(weak)} is explained on unseen motion: check signs, units, gear "
                f"ratios and the order of the joints, or a drive that bends{outside}"
            )
            reasons.append(Reason("unpredicted", text))
        return Verdict(tuple(reasons))

    @property
    def _springs(self) -> list[Reason]:
        """A joint whose spring alone would make the values differ from the file's as they do."""
        chain, names, fit = self.fit.run.chain, self.model.p_names, self.fit
        file = np.array([np.nan if one is None else one for one in map(chain.of_file, chain.base)])
        known = np.isfinite(file) & ~fit.undetermined
        known &= [chain.standard[one.standard].kind in INERTIAL for one in chain.base]
        # Of a centre on its axis the file has a 0: a part of the whole vector's length is known of each component.
        groups = [(chain.standard[one.standard].joint, chain.standard[one.standard].unit) for one in chain.base]
        whole = [np.sqrt(np.sum(file[[it and of == own for it, of in zip(known, groups, strict=True)]] ** 2))
                 for own in groups]  # fmt: skip
        length = np.maximum(np.abs(np.where(known, file, 1.0)), _OF_WHOLE * np.where(known, whole, 1.0))
        weight = known / (np.diag(fit.covariance) + (_OF_FILE * length) ** 2)
        off = np.where(known, fit.p - file, 0.0)
        found = []
        for joint, moved in enumerate(fit.springs):
            if not (size := np.sum(weight * moved**2)):
                continue
            stiffness = float(np.sum(weight * moved * off) / size)
            rest = np.sum(weight * (off - stiffness * moved) ** 2)
            if np.sum(weight * off**2) > _FAR + rest and rest < _ALIKE * np.sum(known):
                k = int(np.argmax(weight * (stiffness * moved) ** 2))
                unit = "N/m" if chain.joints[joint].prismatic else "N*m/rad"
                where = f"as of {with_unit(stiffness, unit, 3)} at joint {chain.number(joint)}"
                text = (
                    f"{names[k]} is {fit.p[k]:.4g}, and {file[k]:.4g} in the file: one of another body, a spring, a "
                    f"cable and a counterweight, {where}, which this motion does not distinguish: move that joint "
                    "farther"
                )
                found.append(Reason("missing", text, alarm=True, of=(names[k],)))
        return found

    @cached_property
    def possible(self) -> tuple[Float, tuple[int, ...], Bodies | None]:
        """Parameters [p] where none of friction and of rotors is below 0: the others are as the covariance has them
        with those 0; which these are, and possible bodies, nearest to the file's; None: the file has none."""
        chain, p, covariance = self.model.chain, self.fit.p.copy(), self.fit.covariance.copy()
        assert chain is not None
        hidden, low = self.fit.undetermined.copy(), list[int]()
        positive = [k for k, one in enumerate(chain.base) if chain.standard[one.standard].kind in ("Ia", "Fv", "Fc")]
        while (worst := min((k for k in positive if not hidden[k]), key=lambda k: p[k], default=None)) is not None:
            if p[worst] >= 0:
                break
            gain = covariance[:, worst] / covariance[worst, worst]
            p -= gain * p[worst]
            covariance -= np.outer(gain, covariance[worst])
            p[worst], hidden[worst] = 0.0, True
            low.append(worst)
        return p, tuple(low), bodies_of(chain, p, covariance, hidden)

    @property
    def bodies(self) -> Bodies | None:
        """Of `possible`."""
        return self.possible[2]

    @property
    def impossible(self) -> list[str]:
        """What no robot has of the values, in sentences."""
        low, bodies, names = *self.possible[1:], self.model.p_names
        told = (
            [f"no robot has {listed(names[k] for k in low)} below 0: its bodies are those with 0 there"] if low else []
        )
        if bodies is not None and bodies.impossible:
            worst = int(np.argmax(np.abs(bodies.off)))
            told.append(
                f"no possible bodies (mass and inertia positive) have all these values: the nearest ones differ by "
                f"{abs(bodies.off[worst]):.2g} standard errors of {names[bodies.base[worst]]}"
            )
        return told

    @property
    def method(self) -> list[str]:
        """Windows and rates."""
        design = self.fit.design
        return [f"{self.fit.windows} windows of {design.functions.length:.3g} s; rates over {design.taps} samples"]

    @property
    def lines(self) -> list[str]:
        """Combinations, and the prediction."""
        chain = self.model.chain
        assert chain is not None
        combined = [one for one in chain.base if len(one.parts) > 1]
        lines = [
            *(f"{chain.name_of(one)} = {chain.closed_form(one)}" for one in combined),
            *self.impossible,
        ]
        told = [f"predicts torques that were not fitted: {listed(self.prediction)}"] if self.prediction else []
        return [*lines, *told]

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (host/docs/index.md)."""
        chain = self.model.chain
        assert chain is not None
        out = super().as_json()
        for one in chain.base:
            entry = out["parameters"][chain.name_of(one)]
            entry |= {"combination": chain.closed_form(one), "file": chain.of_file(one)}
        joints = [one.name for one in chain.joints]
        bodies = None if self.bodies is None else {
            name: dict(zip(INERTIAL, map(float, one), strict=True))
            for name, one in list(zip(joints, self.bodies.inertial, strict=True))[max(chain.free - 1, 0) :]
        }  # fmt: skip
        return out | {
            "bodies": bodies,
            "prediction": {one.name: one.as_json() for one in self.prediction},
            "window_s": self.fit.design.functions.length,
            "windows": self.fit.windows,
            "core": "f64",
            "form": "weak",
        }


def _told(chain: Chain, one: Lacking) -> str:
    """What a robot has beyond its equations."""
    if one.law == LATE:
        which = "every torque is" if one.joint == EVERY else f"the {chain.force(one.joint)} is"
        late = "late" if one.size > 0 else "early"
        return f"{which} {with_unit(abs(one.size), 's', 3)} {late} against the positions: one of a filter and a clock"
    number, slides = chain.number(one.joint), chain.joints[one.joint].prismatic
    force, length = ("N", "m") if slides else ("N*m", "rad")
    if one.law == ZERO:
        size = with_unit(abs(one.size), length, 3)
        large = "large" if one.size > 0 else "small"
        return f"{chain.position(one.joint)} is {size} too {large}: its zero is not the file's"
    if one.law == RATIO:
        more = f"{abs(one.size):.2%} {'larger' if one.size > 0 else 'smaller'}"
        return (
            f"{chain.position(one.joint)} is {more} than in the equations: one of its gear ratio and its counts a turn"
        )
    if one.law == SOFT:
        size = with_unit(one.size, f"{length}/({force})", 3)
        return f"joint {number} gives way by {size} of its load behind its encoder"
    lacks = f"the {chain.force(one.joint)} has what the equations lack, "
    if one.law == GAIN:
        size = f"{abs(one.size):.0%} {'above' if one.size > 0 else 'below'}"
        return f"{lacks}a gain about {size} those of the others: one of its torque constant, its gear and its unit"
    if one.law == LOADED:
        return f"{lacks}{one.size:.1%} of the load as dry friction"
    size = with_unit(one.size, force + _UNITS[one.law].format(unit=length), 3)
    return lacks + _WORDS[one.law].format(size=size, joint=number)


def sure(fit: RobotFit) -> tuple[Lacking, ...]:
    """The terms that are missing, with the sizes that they have together."""
    terms = [law for law, _ in terms_of(fit.run.chain) if law != GAIN]  # a gain is to be twice as sure
    limit = student(_APART * fit.windows, _CHANCE / 2 / len(terms))
    found: tuple[Lacking, ...] = ()
    for together in fit.lacking:  # the first may hide among those that come after it
        if together[-1].t > limit:
            found = together
    return found


def answer_of_robot(recording: Recording, model: CompiledModel) -> RobotAnswer:
    """Base parameters of a robot from all segments of a recording. Raises PvidError when the recording is too short."""
    fit = identify_robot(model, recording.run, recording.sample_rate)
    return RobotAnswer(model, fit, values_of(model, fit), recording)


def values_of(model: CompiledModel, fit: RobotFit) -> dict[str, Value]:
    """Parameters of an estimate with their errors, of noise, gains and what is missing."""
    scale: Float = _gains(model)[:, np.newaxis] * fit.by_gain
    sizes, directions = np.linalg.eigh(fit.covariance)
    noise = directions * np.sqrt(np.maximum(sizes, 0.0))
    change = _moved(fit)
    values = {}
    for k, unknown in enumerate(model.unknowns):
        if fit.undetermined[k]:
            values[unknown.name] = Value(
                unknown.unit, None, None, None, "not_identified", "the motion does not determine it",
                word="not_identified",
            )  # fmt: skip
            continue
        parts = [float(np.linalg.norm(one)) for one in (noise[k], scale[:, k], change[:, k])]
        factors = Factors(noise[k], scale[:, k], change[:, k])
        values[unknown.name] = Value(
            unknown.unit, float(fit.p[k]), math.hypot(*parts), parts[0], se_scale=parts[1], se_model=parts[2],
            factors=factors,
        )  # fmt: skip
    return values


def _moved(fit: RobotFit) -> Float:
    """What each term that is missing moves the parameters by [terms, p]."""
    return np.array([one.shift for one in sure(fit)]).reshape(-1, len(fit.p))


def _gains(model: CompiledModel) -> Float:
    """Relative standard deviations of the torques [n]."""
    assert model.chain is not None
    signals = {one.name: one.gain_sd for one in model.signals if one.kind == "input"}
    constants = {one.name: one.sd / abs(one.value) for one in model.knowns if one.value}
    out = [signals.pop(one, 0.0) for one in WRENCH][: model.chain.free]
    return np.array(out + [math.hypot(sd, constants.get(f"kt{k}", 0.0)) for k, sd in enumerate(signals.values(), 1)])


def payload_of(loaded: RobotAnswer, empty: RobotAnswer) -> dict[str, Value]:
    """What the last body carries in one recording and not in the other: mass m, centre c in the frame of that body, and
    inertia about this centre; from the difference of the base parameters of the bodies.

    Raises
    ------
    PvidError
        Where the motions determine no base parameter of the bodies in common, or the mass is clearly below 0.
    """
    chain = loaded.model.chain
    assert chain is not None
    last = [k for k, one in enumerate(chain.standard) if one.joint == len(chain.joints) - 1 and one.kind in INERTIAL]
    last.sort(key=lambda k: INERTIAL.index(chain.standard[k].kind))
    lost = loaded.fit.undetermined | empty.fit.undetermined
    own = [k for k, one in enumerate(chain.base) if chain.standard[one.standard].kind in INERTIAL and not lost[k]]
    if not own:
        raise PvidError("no payload: the motions determine no common parameter of the bodies: move all joints in both")
    shares = np.array([[dict(chain.base[k].parts).get(one, 0.0) for one in last] for k in own])
    covariance = (loaded.fit.covariance + empty.fit.covariance)[np.ix_(own, own)]
    roots = np.linalg.inv(np.linalg.cholesky(covariance))
    sizes = np.linalg.norm(roots @ shares, axis=0)
    sizes = 1 / np.where(sizes > 0, sizes, 1.0)
    seen, values, directions = np.linalg.svd(roots @ shares * sizes, full_matrices=True)
    rank = int(np.sum(values > _SEEN * values[0]))
    inverse = sizes[:, np.newaxis] * (directions[:rank].T / values[:rank]) @ seen[:, :rank].T @ roots
    hidden = sizes[:, np.newaxis] * directions[rank:].T
    of = inverse @ (loaded.fit.p - empty.fit.p)[own]
    of[0] = of[0] or 1e-9  # of two recordings without a difference; it is faint
    tiny = 1e-30
    slopes = np.array([_about_centre(of + 1j * tiny * one).imag / tiny for one in np.eye(10)]).T
    noise = np.sqrt(np.einsum("ij,jk,ik->i", slopes @ inverse, covariance, slopes @ inverse))
    gains = _gains(loaded.model)[:, np.newaxis] * (loaded.fit.by_gain - empty.fit.by_gain)[:, own]
    scale = np.linalg.norm(slopes @ inverse @ gains.T, axis=1)
    missing = np.concatenate([_moved(one.fit) for one in (loaded, empty)])[:, own]
    missed = np.linalg.norm(slopes @ inverse @ missing.T, axis=1)
    dark = np.linalg.norm(slopes @ hidden, axis=1) > _SEEN * np.linalg.norm(slopes * sizes, axis=1)
    error = math.hypot(noise[0], scale[0], missed[0])
    faint = bool(abs(of[0]) < _CLEAR_MASS * error)
    if of[0] < -_CLEAR_MASS * error and not dark[0]:
        raise PvidError(
            f"the payload's mass would be {with_error(float(of[0]), error)[0]} kg: are the recordings with and without "
            "it swapped?"
        )
    dark[1:] |= dark[0]
    for k, name in enumerate(_PAYLOAD[4:], 4):  # Ixx about the centre contains cy and cz, Ixy cx and cy
        axes = set(name[1:]) if name[1] != name[2] else set("xyz") - {name[1]}
        dark[k] |= any(dark[1 + "xyz".index(one)] for one in axes)
    units, out = {"m": "kg", "c": "m", "I": "kg*m^2"}, {}
    for k, (name, value) in enumerate(zip(_PAYLOAD, _about_centre(of), strict=True)):
        unit = units[name[0]]
        if dark[k] or (faint and k):
            why = "no torque depends on it alone" if dark[k] else "there is no mass that is clear of its error"
            out[name] = Value(unit, None, None, None, "not_identified", why)
        else:
            parts = [float(one[k]) for one in (noise, scale, missed)]
            out[name] = Value(
                unit, float(value), math.hypot(*parts), parts[0], se_scale=parts[1], se_model=parts[2]
            )  # fmt: skip
    return out


def _about_centre(of: Any) -> Any:
    """m, c and I about c, from m, m c and I about the origin [10]."""
    c = of[1:4] / of[0]
    about = of[0] * (np.sum(c * c) * np.eye(3) - np.outer(c, c))
    return np.concatenate([of[:1], c, of[4:] - about[np.triu_indices(3)]])


def torques_of(
    model: CompiledModel, fit: RobotFit, run: RobotRun, p: Sequence[Float] | Float
) -> tuple[SensorPrediction, ...]:
    """Measured torques of a run less those of parameters [.., p]: of several, each has its part of the run."""
    left, moved, size = np.zeros(len(run.chain.joints)), np.zeros(len(run.chain.joints)), 0
    pieces = list(fit.predicted(run, np.asarray(p)))
    steps = sum(one.shape[1] for one, _ in pieces)
    if not steps:
        wanted = fit.fewest_samples(run) / run.sample_rate
        raise PvidError(f"a prediction needs a stretch of {wanted:.3g} s without a gap: record longer")
    for measured, predicted in pieces:
        place = (np.arange(measured.shape[1]) + size) * len(p) // steps
        own = predicted[:, place, np.arange(len(place))]
        left += np.sum((measured - own) ** 2, axis=1)
        moved += np.sum((measured - measured.mean(axis=1, keepdims=True)) ** 2, axis=1)
        size += len(place)
    out, chain = [], run.chain
    for k, joint in enumerate(chain.joints):
        if k in run.idle:
            continue
        part = float(np.sqrt(left[k] / max(moved[k], 1e-300)))
        rms = float(np.sqrt(left[k] / size))
        name = f"tau{chain.number(k)}" if k >= chain.free else chain.force(k)
        out.append(SensorPrediction(name, "N" if joint.prismatic else "N*m", rms, part, None))
    return tuple(out)
