"""Twin of refine_f32.c: samples and estimates of a weak form in, refined estimates and the running hash out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.refine import BIG_STEP, RefineConfig
from pvid.twin.f32.refine_front import Entry, Front
from pvid.twin.f32.refine_model import Float32, RefineModel
from pvid.twin.f32.refine_pass import Job, PartSignals, Pass, Signals, turned
from pvid.twin.f32.refine_solve import Solution, Solve, Steps, inverse_column
from pvid.twin.fnv import START, fold_bytes

_F = np.float32
_WHITENESS = _F(0.89)
_ABSURD = _F(1e3)
_MAY_GROW = _F(3)
_HOPELESS = _F(30)
_ASTRAY = _F(3)
_ROUGH = _F(2)
_LOST_MOST = 6
_RECENT = 200
_LEVEL_GAIN = _F(0.2)
_CLASH_GAIN = _F(0.3)
_FIRST_CLASH = _F(2)
_KEPT = _F(1 / 16)
_CONSISTENT = _F(2)
_APART = 4
_SHORT = _F(0.25)
_SHARPEST, _REVERSALS = _F(0.25), _F(4)
_PRIOR_ERRORS, _LEAST_PRIOR = _F(10), _F(1e-6)
_SETTLED = _F(0.25)
_ROUGHLY = _F(0.25)
_JOBS = 9
_FIRST_JOBS = 16
_SOLVE_TICKS = 45
_SPARE = 16
_ERRORS = _F(5)


class Phase(Enum):
    """What the next tick does."""

    WAIT = auto()
    PASS = auto()
    SOLVE = auto()
    MOVE = auto()
    END = auto()
    FOLLOW = auto()
    ASSESS = auto()
    JUDGE = auto()
    PUBLISH = auto()
    NEXT = auto()
    START = auto()


@dataclass(frozen=True)
class RefineEstimate:
    """pvid_refine_estimate_f32."""

    r: Float32
    se: Float32
    covariance: Float32
    level: np.float32
    clash: np.float32


@dataclass(frozen=True)
class TwinRefineRecord:
    """One entry a tick; see pvid.core.refine_native.RefineRecord."""

    reason: npt.NDArray[np.uint8]
    hash: npt.NDArray[np.uint32]
    r: Float32
    se: Float32


def _at_least_one(level: np.float32) -> np.float32:
    return level if level > 1 else _F(1)


class RefineTwin:
    """pvid_refine_f32 of a model; its state persists between calls of `run`."""

    def __init__(self, model: RefineModel, config: RefineConfig) -> None:
        shape = self.shape = model.shape
        self.model, self.config = model, config
        self.steps = Steps(model)
        self.parts = config.parts or 1
        self.sd = np.asarray(config.sd, _F)
        self.prior_sd = np.asarray(config.prior_sd, _F)
        self.gain_sd = np.asarray(config.gain_sd, _F)
        given = config.observer
        self.observer = None if given is None else np.asarray(given, _F).reshape(shape.outputs, shape.states)
        self.state_limit = np.asarray(config.state_limit, _F)
        self.variance = self.sd[0] * self.sd[0]
        self.weight = self.sd[0] / self.sd
        self.h = _F(config.ratio) / _F(config.sample_rate)
        self.fade = _F(1)
        if config.forgetting_s > 0:
            seconds = _F(config.block) * (_F(BIG_STEP) * self.h)
            share = seconds / (_F(2) * _F(config.forgetting_s))
            self.fade = _F(1) - share if share < _F(0.9) else _F(0.1)
        self.front = Front(config, shape)
        self.work, self.solve = Pass(model), Solve(model)
        n = shape.parameters
        self.phase = Phase.WAIT
        self.renewed = self.frozen = self.waiting = self.restarted = self.solved = self.sane = False
        self.again = self.same_start = False
        self.rested = self.passed = self.taken = self.refused = self.lost = self.length = self.begin = self.origin = 0
        self.level = self.clash = self.scatter = _F(0)
        self.r, self.next, self.linear, self.weak = (np.zeros(n, _F) for _ in range(4))
        self.weak_se = np.zeros(len(shape.place_of_p), _F)
        self.triangle = np.zeros((n, n), _F)
        self.start, self.expected = np.zeros(shape.states, _F), np.zeros(shape.states, _F)
        self.diagonal = np.zeros(n, _F)
        self.covariance = np.zeros((n, n), _F)
        self.verdict = Reason.UPDATED
        self.told = Reason.WARMING_UP  # of the last block
        self.estimate: RefineEstimate | None = None  # published, not withdrawn
        self.published = 0  # estimates so far
        self.hash = START

    # ---- blocks ----

    def _forget_state(self) -> None:
        self.expected = np.zeros_like(self.expected)
        self.restarted = True

    def _begin_pass(self) -> None:
        if self.passed < 2:
            self.solve.dropped[:] = False
        gate = _ABSURD
        late = any(self.shape.measured) or bool(self.shape.signs) or self.passed >= 2
        predicted = self.taken > 1 or (self.taken == 1 and late)
        if predicted and self.config.gate > 0 and not self.restarted:
            gate = (_F(self.config.gate) * self.sd[0]) * np.sqrt(_at_least_one(self.level))
        parts = self.parts, self.config.fine_parts or 1
        self.work.begin(self.linear, self.start, self.h, parts, gate, self.front.turn, self.observer)
        self.phase = Phase.PASS
        self.waiting = False

    def _is_there(self) -> bool:
        return self.front.end - self.begin <= self.front.room - 8

    def _begin_block(self) -> None:
        if not self._is_there():
            self.begin = self.front.end
            self._forget_state()
        self.linear, self.start = self.next.copy(), self.expected.copy()
        self.passed = 0
        self._begin_pass()
        if any(self.shape.measured) and self.restarted:
            self.phase = Phase.START

    def _start_job(self) -> None:
        behind = self.begin + 2 * _APART + 1
        if self.front.end < behind:
            self.waiting, self.due = True, behind
            return
        at = [self.front.read(self.begin + k * _APART)[1] for k in range(3)]
        scale = _F(1) / ((_F(2) * _F(_APART)) * self.h)
        for i, code in enumerate(self.shape.measured):
            if code > 0:
                output = (code - 1) // 2
                first, middle, last = (one[output] for one in at)
                rate = (((_F(4) * middle) - last) - (_F(3) * first)) * scale
                if any(self.shape.turning):
                    middle, last = (turned(one - at[0], self.front.turn)[output] for one in at[1:])
                    rate = ((_F(4) * middle) - last) * scale
                x = first if code % 2 else rate
                self.start[i] = x if abs(x) < self.state_limit[i] else _F(0)
        self._begin_pass()

    def _is_off(self) -> bool:
        few = self.work.used * 10 < self.length * 6 * self.shape.outputs
        return any(self.shape.measured) and not self.restarted and self.taken > 0 and self.passed == 0 and few

    def _begin_from_prior(self) -> None:
        sd = self.prior_sd.copy()
        if self.shape.signs:
            for i, place in enumerate(self.shape.place_of_p):
                size = self.weak[place] if self.steps.logarithmic[place] else _F(1)
                scaled = (_PRIOR_ERRORS * self.weak_se[i]) / size
                prior = scaled if scaled > _LEAST_PRIOR else _LEAST_PRIOR
                sd[place] = prior if prior < sd[place] else sd[place]
        self.triangle = np.diag(self.sd[0] / sd)

    def _begin_search(self) -> None:
        if self.shape.signs:
            self.r = self.weak.copy()
        self._begin_from_prior()
        self.taken = self.refused = 0
        self.level = _F(0)
        self.kept = _F(1)

    def _take_weak(self, p: Float32, se: Float32) -> None:
        r = self.model.from_p(p)
        if self.config.width is not None:
            r[self.steps.is_width] = self.config.width
        if self.model.region(r):
            self.weak, self.weak_se = r, se.copy()
            self.renewed = True

    def _begin_anew(self) -> None:
        self._begin_from_prior()
        self.r, self.next = self.weak.copy(), self.weak.copy()
        self._forget_state()
        self.renewed = False
        self.lost = 0
        self.length = self.config.first_block

    @property
    def _solve_jobs(self) -> int:
        """In a tick."""
        return 1 + self.config.jobs // 8 if self.shape.runge_kutta else 1

    def _ticks(self, length: int) -> int:
        """Of a pass with its solution."""
        of_big_step, solve = _JOBS, _SOLVE_TICKS
        if self.shape.runge_kutta:
            of_big_step, solve = 15 + 10 * self.parts, 5 + _SOLVE_TICKS // self._solve_jobs
        return (of_big_step * length + _FIRST_JOBS) // self.config.jobs + solve

    def _lasts(self, length: int) -> bool:
        """Whether the ring still has the beginning of the block for another pass of this length; where a pass takes as
        long as the block, at its end."""
        if not self.shape.runge_kutta:
            return self._is_there()
        taken = self._ticks(length) // max(self.config.ratio - 1, 1)
        return self.front.end + taken - self.begin <= self.front.room - 8

    def _oldest(self, ticks: int) -> int:
        """How far back a block may begin that the ring must have for so many ticks."""
        taken = ticks // max(self.config.ratio - 1, 1) + _SPARE
        back = max(self.front.room - taken, 0)
        return max(self.front.end - back, self.origin)

    def _begin_anew_in_the_past(self) -> None:
        self._begin_anew()
        config = self.config
        if self.shape.runge_kutta:
            self.begin = self._oldest(config.most_passes * self._ticks(config.block // 2))
        else:
            self.begin = self._oldest(config.passes * self._ticks(self.length))

    # ---- the end of a block ----

    def _is_sane(self) -> bool:
        enough = self.work.used * 10 >= self.length * 6 * self.shape.outputs
        return bool(self.solved and enough and np.all(np.abs(self.start) < self.state_limit))

    def _lengthen(self, began: int) -> None:
        self.length = min(2 * self.length, self.config.block)
        first = self._oldest(self.config.passes * self._ticks(self.length))
        if self.begin > first and not self.shape.hidden:
            self.again, self.same_start = True, first == began
            self.begin = first

    def _share_of_block(self) -> np.float32:
        past = _F(0)
        for part in np.diag(self.triangle) / np.diag(self.solve.triangle):
            past = past + part * part
        return _F(1) - past / _F(self.shape.parameters)

    def _is_consistent(self) -> bool:
        ratio = _F(1)
        for part in np.diag(self.solve.triangle) / self.diagonal:
            ratio = ratio * part
        return bool(_F(1) / _CONSISTENT < ratio < _CONSISTENT)

    def _take(self, square: np.float32, clash: np.float32, again: bool, began: int) -> None:
        config = self.config
        self.refused = self.lost = 0
        if self.taken > 0:
            mean = self.clash + _CLASH_GAIN * (clash - self.clash)
            first = _FIRST_CLASH * clash if self.taken == 1 else _F(0)
            self.clash = first if first > mean else mean
            larger = clash if clash > first else first
            self.scatter = self.scatter + self._share_of_block() * (larger - self.scatter)
        consistent = bool(self.shape.signs) or self.taken == 0 or again or self._is_consistent()
        self.taken = 1 if self.taken == 0 or not consistent else 2
        self.level = square if self.taken == 1 or again else self.level + _LEVEL_GAIN * (square - self.level)
        self.r, self.next = self.linear.copy(), self.linear.copy()
        fade = _F(1) - (_F(1) - self.fade) * (_F(self.length) / _F(config.block))
        if self.length < config.block:
            self._lengthen(began)
        anew = self.again or not consistent
        fade = _KEPT if anew else fade
        counts = _F(1) if not self.shape.signs or self._is_fine() else _ROUGHLY
        self.kept = _KEPT * counts if anew else counts
        fade = fade * counts
        self.triangle = self.solve.triangle * fade
        for i in range(self.shape.widths):
            self.triangle[i] = 0
            self.triangle[i, i] = (self.sd[0] * fade) / self.prior_sd[i]

    def _refuse(self) -> None:
        if self.taken > 0:
            limit = _F(self.config.clash_max) * _at_least_one(self.level)
            self.clash = self.clash + _CLASH_GAIN * (limit - self.clash)
            self.refused += 1
            self.origin = self.begin
            if self.refused >= 2:
                self._begin_search()
                if self.sane:
                    self.next = self.linear.copy()
        else:
            self.lost += 1 if self.sane else 2
            if self.sane:
                self.next = self.linear.copy()

    def _resize(self, square: np.float32) -> None:
        config = self.config
        if self.sane and square < _MAY_GROW * _F(config.chi_max):
            self.length = 2 * self.length if 2 * self.length < config.block else self.length
        elif not self.sane or not square <= _HOPELESS * _F(config.chi_max):
            self.length = config.first_block

    def _turn_back(self) -> None:
        """Takes whole turns off the start of the next block."""
        for output, turn in enumerate(self.front.turn):
            angles = np.array(self.shape.measured) == 1 + 2 * output
            if turn > 0 and np.any(angles):
                x = self.expected[angles][0]
                self.expected[angles] -= x - turned(np.atleast_1d(x), np.atleast_1d(turn))[0]

    def _follow(self) -> None:
        within = self.sane
        if self.again:
            within = within and self.same_start
            self.expected = self.start.copy()
        elif within:
            self.expected = self.solve.end_state(self.work, self.linear)
            self._turn_back()
            within = bool(np.all(np.abs(self.expected) < self.state_limit))
        self.restarted = False
        if not within:
            self._forget_state()

    def _mean_square(self) -> np.float32:
        used, unknowns = self.work.used, self.shape.unknowns
        freedom = _F(used - unknowns) if used > unknowns + 1 else _F(1)
        return _F(self.solve.residual / (freedom * (_WHITENESS * self.variance)))

    def _is_fine(self) -> bool:
        short = self.solve.size < _F(self.config.step_fine)
        return bool(short or self.solve.reduction < _SETTLED * self.variance)

    def _is_settled(self) -> bool:
        small = bool(self.solve.size < _F(self.config.step_max))
        if self.shape.signs:
            return (small and self.taken < 2) or self._is_fine()
        return small

    def _end_block(self) -> None:
        config, square = self.config, self._mean_square()
        past = self.kept * self.kept
        clash = self.solve.clash / ((_F(self.shape.parameters) * self.variance) * past)
        self.sane = self._is_sane()
        room, again = _at_least_one(self.level), self.again
        limit = _MAY_GROW * _F(config.chi_max) if again else _F(config.chi_max)
        taken = (
            self.sane
            and square < limit * room
            and (self.taken == 0 or again or clash < _F(config.clash_max) * room)
            and self._is_settled()
        )
        began = self.begin
        self.begin += self.work.step * BIG_STEP
        self.again = False
        if taken:
            self._take(square, clash, again, began)
            self.verdict = Reason.UPDATED if self.taken > 1 else Reason.HELD_UNCERTAIN
        else:
            self.verdict = Reason.HELD_BLOCK if self.taken > 0 else Reason.HELD_SEARCHING
            self._refuse()
            if self.taken == 0:
                self._resize(square)

    # ---- the estimate ----

    def _larger_clash(self) -> np.float32:
        return self.clash if self.clash > self.scatter else self.scatter

    def _assess(self) -> None:
        if self.passed == 0:
            self.covariance = np.multiply.outer(self.gain_sd, self.gain_sd)
        x = inverse_column(self.solve.triangle, self.passed)
        level, clash = _at_least_one(self.level), self._larger_clash()
        larger = clash if clash > level else level
        if self.shape.signs:
            larger = larger if larger > _REVERSALS else _REVERSALS
        variance = self.variance * larger
        upto = self.passed + 1
        self.covariance[:upto, :upto] = self.covariance[:upto, :upto] + np.multiply.outer(variance * x[:upto], x[:upto])
        self.passed += 1
        self.phase = Phase.ASSESS if self.passed < self.shape.parameters else Phase.JUDGE

    def _judge(self) -> None:
        sd = np.sqrt(np.diag(self.covariance))
        logarithmic = self.steps.logarithmic
        se = np.where(logarithmic, sd * self.r, sd)
        self.candidate = RefineEstimate(self.r.copy(), se, self.covariance.copy(), self.level, self._larger_clash())
        uncertain = logarithmic & ~self.steps.is_width & ~(se <= _F(self.config.se_max) * self.r)
        certain = np.all(np.isfinite(self.r)) and np.all(np.isfinite(se)) and not np.any(uncertain)
        self.verdict = Reason.UPDATED
        if not certain:
            self.verdict = Reason.HELD_UNCERTAIN
            return
        ratio, distance = _F(1), _F(self.config.distance)
        for i, place in enumerate(self.shape.place_of_p):
            x, error, weak_se = self.r[place], se[place], self.weak_se[i]
            errors = np.sqrt(error * error + weak_se * weak_se)
            allowed = _ERRORS * errors + (distance * x if logarithmic[place] else distance)
            if not -allowed <= x - self.weak[place] <= allowed:
                self.verdict = Reason.HELD_DISAGREES
            ratio = ratio * (error / weak_se)
        if not (distance > 0 or ratio <= 1) and self.verdict is Reason.UPDATED:
            self.verdict = Reason.HELD_UNCERTAIN

    # ---- jobs ----

    def _pass_jobs(self) -> None:
        for _ in range(self.config.jobs):
            step = self.work.awaited()
            signals: Signals | PartSignals | None = None
            if step is not None:
                entry = self.begin + step
                if self.shape.runge_kutta and self.front.end - entry > self.front.room - 4:
                    self.solved, self.phase = False, Phase.END
                    return
                if self.front.end <= entry:
                    self.waiting, self.due = True, entry + 1
                    return
                if not self.shape.runge_kutta or self.work.job == Job.START:
                    signals = self.front.read(entry)
                else:
                    part, of_a_step = self.work.part, _F(1) / _F(self.work.parts)
                    since, to = (_F(k) * of_a_step for k in (part, part + 1))
                    signals = self.front.read_part(entry - 2, since, to)
            self.work.do(self.linear, self.weight, signals)
            if self.work.ends(self.length):
                self.solve.begin()
                self.phase = Phase.SOLVE
                return

    def _solve_job(self) -> None:
        solution = self.solve.do(
            self.work.sum, self.triangle, self.r, self.linear, self.prior_sd, _F(self.config.step_limit)
        )
        if solution is not Solution.SOLVING:
            self.solved = solution is Solution.SOLVED
            self.phase = Phase.MOVE if self.solved else Phase.END

    def _is_enough(self) -> bool:
        config = self.config
        tracks = self.taken > 0 and self.solve.bend < _SHORT * _F(config.step_max)
        small = (tracks or self.passed >= config.passes) and self._is_settled()
        return bool(small) or self.passed >= config.most_passes or not self._lasts(self.length)

    def _grows(self) -> bool:
        config = self.config
        twice = 2 * self.length
        short = (
            self.taken == 0
            and self.passed >= 2
            and twice < config.block
            and (not self.shape.runge_kutta or self._lasts(twice))
        )
        return bool(short and self.solve.size < _ROUGH and self._mean_square() < _MAY_GROW * _F(config.chi_max))

    def _move(self) -> None:
        if self._is_off():
            self._forget_state()
            self._begin_block()
            return
        self.linear = self.steps.moved(self.linear, self.solve.step)
        if self.config.width is not None:
            widths = self.linear[self.steps.is_width]
            self.linear[self.steps.is_width] = np.maximum(widths, _SHARPEST * self.config.width)
        self.start = self.start + self.solve.shift
        if self.passed == 0:
            self.diagonal = np.diag(self.solve.triangle).copy()
        self.passed += 1
        if self._grows():
            self.length, self.passed = 2 * self.length, 0
            self._begin_pass()
        elif self._is_enough():
            self.phase = Phase.END
        elif self.taken == 0 and self.renewed and not self.solve.size < _ASTRAY:
            self.lost, self.length = 1, self.config.first_block
            self.verdict, self.phase = Reason.HELD_SEARCHING, Phase.NEXT
        else:
            self._begin_pass()

    def _next_block(self) -> None:
        if self.taken == 0 and self.lost > 0:
            if self.renewed and self.length == self.config.first_block:
                self._begin_anew_in_the_past()
            elif self.lost >= _LOST_MOST:
                self._begin_anew()
        self._begin_block()

    def _wait(self) -> None:
        if self.renewed:
            self.begin = max(self.front.end - _RECENT, self.front.first)
            self.origin = self.front.first
            self._begin_search()
            self._begin_anew()
            self._begin_block()

    def _withdraw(self) -> None:
        """The published estimate, if the last block refutes it."""
        if self.verdict != Reason.UPDATED and not (self.verdict == Reason.HELD_BLOCK and self.taken > 0):
            self.estimate = None

    def _do(self) -> Reason:
        match self.phase:
            case Phase.WAIT:
                self._wait()
                return Reason.WARMING_UP
            case Phase.START:
                self._start_job()
            case Phase.PASS:
                self._pass_jobs()
            case Phase.SOLVE:
                for _ in range(self._solve_jobs):
                    if self.phase is Phase.SOLVE:
                        self._solve_job()
            case Phase.MOVE:
                self._move()
            case Phase.END:
                self._end_block()
                self.phase = Phase.FOLLOW
            case Phase.FOLLOW:
                self._follow()
                self.passed = 0
                self.phase = Phase.ASSESS if self.verdict == Reason.UPDATED else Phase.NEXT
            case Phase.ASSESS:
                self._assess()
            case Phase.JUDGE:
                self._judge()
                self.phase = Phase.PUBLISH
            case Phase.PUBLISH:
                if self.verdict == Reason.UPDATED:
                    self.estimate = self.candidate
                    self.published += 1
                self.phase = Phase.NEXT
            case Phase.NEXT:
                reason = self.told = self.verdict
                self._withdraw()
                self._next_block()
                return reason
        return Reason.ACCUMULATED

    # ---- API ----

    def gap(self) -> None:
        """pvid_refine_gap_f32."""
        self.front.reset()
        self.begin = self.origin = self.front.first
        self.again = False
        self._forget_state()
        if self.phase is not Phase.WAIT:
            self._begin_block()

    def freeze(self, frozen: bool) -> None:
        """pvid_refine_freeze_f32."""
        self.frozen = frozen

    def step(self, sample: Float32, p: Float32, se: Float32, busy: bool) -> Reason:
        """A tick; p and se [p] of the weak form if they are new, else NaN; whether it is busy."""
        if np.isfinite(p[0]):
            self._take_weak(p, se)
        entry = self.front.step(sample)
        if entry is Entry.BROKEN:
            self.gap()
            return Reason.REJECTED_NOT_FINITE
        if self.frozen:
            return Reason.HELD_FROZEN
        if entry is Entry.ENTERED:
            self.waiting = self.waiting and self.front.end < self.due
        if self.front.wait == self.config.ratio > 1 or self.waiting:
            return self._idle()
        if busy and self.rested < self.config.rests:
            self.rested += 1
            return self._idle()
        self.rested = 0
        return self._do()

    def _idle(self) -> Reason:
        return Reason.WARMING_UP if self.phase is Phase.WAIT else Reason.ACCUMULATED

    def _state(self, reason: Reason) -> bytes:
        """The bytes that a hash covers, as in fnv_refine.h."""
        values = np.concatenate([self.linear, self.work.state, [self.level]]).astype(_F)
        words = np.where(np.isfinite(values), values.view(np.uint32), np.uint32(0x7FC00000))
        return words.astype("<u4").tobytes() + int(reason).to_bytes(4, "little")

    @property
    def hashed(self) -> bytes:
        """What the running hash of both stages covers of the refinement after a tick."""
        return self._state(self.told)

    def run(
        self, samples: npt.ArrayLike, weak_p: npt.ArrayLike, weak_se: npt.ArrayLike, busy: npt.ArrayLike | None = None
    ) -> TwinRefineRecord:
        """Steps through samples [ticks, samples] with the weak form's new estimates, else NaN [ticks, p]; by default it
        is never busy."""
        given, p, se = (np.asarray(x, _F) for x in (samples, weak_p, weak_se))
        ticks, n = len(given), self.shape.parameters
        long = np.zeros(ticks, bool) if busy is None else np.asarray(busy, bool)
        record = TwinRefineRecord(
            np.zeros(ticks, np.uint8),
            np.zeros(ticks, np.uint32),
            np.zeros((ticks, n), _F),
            np.zeros((ticks, n), _F),
        )
        with np.errstate(all="ignore"):
            for tick in range(ticks):
                reason = self.step(given[tick], p[tick], se[tick], bool(long[tick]))
                self.hash = fold_bytes(self.hash, self._state(reason))
                record.reason[tick], record.hash[tick] = reason, self.hash
                if self.estimate is not None:
                    record.r[tick], record.se[tick] = self.estimate.r, self.estimate.se
        return record
