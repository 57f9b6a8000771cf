"""Random rigs the whole road: model file, check, a recording by an integrator that is not pvid's, identification in
float64 and in C, both stages, generated files, the compiler's words, the deployed example, equal bits.

A failure is an exception, a C compiler's word, a road that does not end, bits that differ from the twin's, a wrong
answer that is called good, or a run that determines every parameter well and is not identified.
"""

from __future__ import annotations

import json
import math
import os
import signal
import statistics
import subprocess
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from sympy.core.cache import clear_cache

from bench import senseless_models
from bench.case import Advance, Report, Table, columns
from bench.random_motion import RandomRun, random_run
from bench.random_rigs import random_rig
from pvid.base.errors import PvidError
from pvid.cli.identify_run import recording_of
from pvid.codegen.build import build
from pvid.codegen.generated import GeneratedModel, Options
from pvid.codegen.weak_q31 import WeakQ31
from pvid.codegen.weak_sizes import refuse_too_many_unknowns
from pvid.compare.bits import Comparison
from pvid.compare.weak import compare_recording
from pvid.configuration.refine import refine_design
from pvid.configuration.weak import config_for_recording, config_to_identify
from pvid.configuration.weak_q31 import weak_q31_for_recording
from pvid.core.host_compiler import compiled_once, host_compiler
from pvid.core.sources import INCLUDES, build_folder, core_sources
from pvid.deploy.deployment import Deployment
from pvid.deploy.example import expected
from pvid.deploy.of_rig import deployment_f32, deployment_q31
from pvid.deploy.targets import write_package
from pvid.identification.advice import advised
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis, Value
from pvid.identification.core import identify_in_c
from pvid.identification.core_refined import BothStages, compare_refined, refined_in_c
from pvid.identification.refinement.adoption import refined_answer
from pvid.model.compiled import CompiledModel
from pvid.model.identifiability import identifiable
from pvid.model.report import check_report
from pvid.models import mechanisms
from pvid.oracle.weak.choice import Scored
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.settings.enums import Core
from pvid.settings.refine import RefineConfig
from pvid.settings.weak import WeakConfig

HEADER = columns(
    "kind | rigs | failures | good | warning | not identified | refused | median error [s.e.] | largest of good |"
    " second stage in C | fixed point"
)
COMPILE_HEADER = ("mechanism", "theta", "unknowns", "compiled in [s]", "judged in [s]")

_LIMIT_S = 240.0  # processor time of a rig: a road that takes longer has no end
_WRONG_SE, _WRONG = 5.0, 0.02  # a good answer is wrong beyond so many standard errors and this part of the value
_DETERMINED = 3e-3  # a relative standard error that no estimate need exceed is a parameter that the run determines
_LAST_DIGIT = 2e-4  # of the five that the example prints
_WARNINGS = (
    *("-Werror", "-Wall", "-Wextra", "-Wpedantic", "-Wcast-align", "-Wcast-qual", "-Wconversion", "-Wvla", "-Wundef"),
    *("-Wdouble-promotion", "-Wfloat-equal", "-Wmissing-prototypes", "-Wshadow", "-Wstrict-prototypes"),
)
_STRICT = ("-std=c99", "-O0", "-ffp-contract=off", *_WARNINGS)
_USUAL = ("-std=c99", "-O0", "-Werror", "-Wall", "-Wextra")  # of a user, for a package
_NUMBERS = ("elementary_f32", "elementary_q31", "scaled_q31", "scaled_model_q31", "integer_q31")


@dataclass
class Road:
    """What became of a rig.

    Attributes
    ----------
    outcome : of the identification in float64: good, warning, not identified, refused
    errors : by unknown: error over standard error
    failures : what must not happen, each with its stage
    refusals : by stage: the sentence
    reached : stages that did what they are for
    seconds : processor time, that of compilers included
    """

    seed: int
    kind: str
    features: list[str]
    outcome: str = "refused"
    errors: dict[str, float] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    refusals: dict[str, str] = field(default_factory=dict)
    reached: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """A part of the road: a refusal is kept with its sentence, an exception is a failure."""
        try:
            yield
        except PvidError as error:
            sentence = str(error)
            if "\n" in sentence or len(sentence) < 20 or _is_of_machinery(sentence):
                self.failures.append(f"{name}: no sentence: {sentence!r}")
            self.refusals[name] = sentence
        except _TooLongError:
            raise
        except Exception as error:  # what is looked for
            frames = traceback.extract_tb(error.__traceback__)
            where = next((one for one in reversed(frames) if "/pvid/" in one.filename), frames[-1])
            place = f"{Path(where.filename).name}:{where.name}"
            self.failures.append(f"{name}: {type(error).__name__} in {place}: {error}")
        else:
            self.reached.append(name)


class _TooLongError(Exception):
    """The limit of time of a rig."""


def _is_of_machinery(sentence: str) -> bool:
    """Whether a refusal is that of a compiler or of the core for what the generator or the design got wrong."""
    return "C compiler refused" in sentence or "core refused" in sentence


def road_of(seed: int, kind: str | None = None, *, in_c: bool = True) -> Road:
    """Takes the rig of a seed the whole road; in_c=False: as far as the float64 analysis and refinement go."""
    rig = random_rig(seed, kind)
    road = Road(seed, rig.kind, sorted(rig.features))
    began = _processor_s()

    def stop(*_: object) -> None:
        raise _TooLongError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, _LIMIT_S)
    try:
        with tempfile.TemporaryDirectory() as folder:
            run = random_run(rig, seed, Path(folder))
            answer = _analysed(road, run, Path(folder))
            if answer is not None and in_c:
                with road.stage("size"):
                    refuse_too_many_unknowns(answer.model)
                if "size" in road.reached:
                    _in_c(road, run, answer)
                _built(road, answer, Path(folder))
    except _TooLongError as error:
        last = next(one for one in reversed(traceback.extract_tb(error.__traceback__)) if "/pvid/" in one.filename)
        road.failures.append(f"no end within {_LIMIT_S:g} s, in {Path(last.filename).name}:{last.name}")
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    road.seconds = round(_processor_s() - began, 1)
    return road


def _processor_s() -> float:
    own = os.times()
    return own.user + own.system + own.children_user + own.children_system


def _analysed(road: Road, run: RandomRun, folder: Path) -> Analysis | None:
    """Check, identification and refinement in float64; None: it is refused."""
    path, recorded = folder / "rig.py", folder / "run.csv"
    path.write_text(run.rig.text, encoding="utf-8")
    table = np.stack(list(run.signals.values()), 1)
    np.savetxt(recorded, table, fmt="%.10g", delimiter=",", header=",".join(run.signals), comments="")
    possible = False
    with road.stage("check"):
        compiled = mechanisms.compiled_of(path)
        possible = identifiable(compiled).identifiable
        assert "sum of theta * N = Y" in check_report(compiled)
    if "check" not in road.reached:
        return None
    with road.stage("identify"):
        recording, model = recording_of(recorded, MechanismRig(path), None)
        answer = advised(analysed(recording, model))
        json.dumps(answer.as_json(), allow_nan=False)
    determined = max(one / _size(run, name) for name, one in run.bound.items())
    if "identify" not in road.reached:
        if determined < _DETERMINED and "identify" in road.refusals:
            road.failures.append(f"identify: refused, of a run that determines all: {road.refusals['identify']}")
        return None
    verdict = answer.found.verdict
    road.outcome = verdict.status.replace("_", " ")
    _judge(road, run, answer.values, good=verdict.status == "good")
    if possible and not answer.identified and run.stuck < 0.5:
        if determined < _DETERMINED:
            told = "; ".join(one.text for one in verdict.reasons if one.alarm) or "no reason"
            road.failures.append(
                f"identify: withheld, of a run that determines all to {100 * determined:.2g} %: {told}"
            )
    with road.stage("refine"):
        refined, _, _ = refined_answer(answer)
        json.dumps(refined.as_json(), allow_nan=False)
        if refined is not answer:
            _judge(road, run, refined.values, good=verdict.status == "good", stage="refine")
    return answer


def _size(run: RandomRun, name: str) -> float:
    """What the error of an unknown is relative to."""
    return max(abs(run.rig.truth[name]), run.rig.small.get(name, 0.0))


def _judge(road: Road, run: RandomRun, values: dict[str, Value] | Any, *, good: bool, stage: str = "identify") -> None:
    """Errors of an answer; one that is called good and is wrong is a failure."""
    wrong = []
    for name, truth in run.rig.truth.items():
        one = values.get(name)
        if one is None or one.value is None or not one.se:
            continue
        error = one.value - truth
        if stage == "identify":
            road.errors[name] = error / one.se
        if abs(error) > _WRONG_SE * one.se and abs(error) > _WRONG * _size(run, name):
            wrong.append(f"{name} {100 * error / _size(run, name):+.2g} % ({error / one.se:+.2g} s.e.)")
    if wrong and good:
        road.failures.append(f"{stage}: good and wrong: {', '.join(wrong)}")


def _in_c(road: Road, run: RandomRun, answer: Analysis) -> None:
    """Both cores and the second stage, and their bits beside those of the twins."""
    model, recording, ranking = answer.model, answer.recording, answer.ranking
    core: Core
    for core in ("f32", "q31"):
        with road.stage(core):
            found = identify_in_c(answer, core)
            json.dumps(found.as_json(), allow_nan=False)
            if found.identified:
                _judge(road, run, found.values, good=found.verdict.status == "good", stage=core)
            if core == "f32":
                _equal_in_f32(road, model, recording, ranking)
                with road.stage("second stage"):
                    both = refined_in_c(found)
                    json.dumps(both.as_json(), allow_nan=False)
                    if both.adopted and both.identified:
                        _judge(road, run, both.values, good=found.verdict.status == "good", stage="second stage")
            else:
                _equal(road, core, compare_recording(model, recording, core, ranking=ranking))


def _equal_in_f32(road: Road, model: CompiledModel, recording: Recording, ranking: Sequence[Scored]) -> None:
    """Both stages after every tick, whose hash contains the first one; that alone where there is no second one."""
    try:
        stages = BothStages.of(model, recording, config_to_identify(model, recording, ranking))
    except PvidError:
        _equal(road, "f32", compare_recording(model, recording, "f32", ranking=ranking))
    else:
        _equal(road, "both stages", compare_refined(stages))


def _equal(road: Road, stage: str, found: Comparison) -> None:
    if not found.equal:
        road.failures.append(f"{stage}: bits differ: {found.difference}")


def _built(road: Road, answer: Analysis, folder: Path) -> None:
    """Generated files and packages, compiled with the project's warnings as errors, and what they print."""
    compiled, recording, ranking = answer.model, answer.recording, answer.ranking
    design: WeakConfig | None = None
    weak: WeakQ31 | None = None
    refine: RefineConfig | None = None
    with road.stage("design"):
        design = config_for_recording(compiled, recording, ranking=ranking)
    with road.stage("fixed design"):
        weak = weak_q31_for_recording(compiled, recording, ranking=ranking)
    if design is not None and GeneratedModel(compiled, "bench").refinement.made is not None:
        with road.stage("second design"):
            refine = refine_design(compiled, design, recording.signals)
    files = folder / "generated"
    with road.stage("build"):
        options = Options(design=design, weak_q31_for_run=weak, refine_design=refine)
        build(GeneratedModel(compiled, "bench", options), files)
    if "build" in road.reached:
        with road.stage("compile"):
            _compile(road, files, compiled.name, design is not None, weak is not None, refine is not None)
    deployed: list[tuple[str, Callable[[], Deployment]]] = []
    if design is not None:
        deployed.append(("deploy", lambda: deployment_f32(compiled, design, recording.signals, "bench", refine)))
    if weak is not None:
        deployed.append(("fixed deploy", lambda: deployment_q31(weak, recording.signals, "bench")))
    for name, made in deployed:
        with road.stage(name):
            _play(road, name, made(), folder / name.replace(" ", "_"))


def _compile(road: Road, files: Path, name: str, designed: bool, fixed: bool, second: bool) -> None:
    """Every file of a folder; its test runs."""
    own = [f"-I{files}", *INCLUDES]
    plain = [files / f"{name}_{one}.c" for one in ("f32", "q31", "test")]
    core = [one for one in core_sources() if one.stem in _NUMBERS]
    program = str(files / "it")
    sources = [str(one) for one in [*plain, *core] if one.exists()]
    done = _cc(road, [*_STRICT, *own, *sources, "-o", program, "-lm"])
    if done:
        ran = subprocess.run([program], capture_output=True, text=True, check=False)
        if ran.returncode != 0:
            road.failures.append(f"compile: {name}_test fails: {(ran.stdout + ran.stderr).strip()[-200:]}")
    units = []
    if designed:
        units.append((f"{name}_weak_f32.c", f"{name}_config.h", f"{name}_design_f32.h"))
    if second:
        units.append(("", f"{name}_config.h", f"{name}_refine_design_f32.h"))
    if fixed:
        units.append((f"{name}_weak_q31.c", f"{name}_config_q31.h", f"{name}_design_q31.h"))
    for source, sizes, header in units:
        user = files / f"user_of_{header}.c"
        user.write_text(f'#include "{header}"\nint used(void);\nint used(void) {{ return 0; }}\n', encoding="utf-8")
        inputs = [str(user), *([str(files / source)] if source else [])]
        flags = [*_STRICT, "-Wno-unused", f'-DPVID_CONFIG_HEADER="{sizes}"', "-fsyntax-only"]
        _cc(road, [*flags, *(["-DPVID_REFINEMENT=1"] if "refine" in header else []), *own, *inputs])


def _cc(road: Road, options: Sequence[str]) -> bool:
    """Whether the compiler is silent; its first word is a failure."""
    command = [host_compiler("the bench"), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=compiled_once())
    if done.returncode or done.stderr:
        lines = [one for one in done.stderr.splitlines() if "error" in one or "undefined" in one]
        road.failures.append(f"compile: {(lines or [done.stderr])[0].rpartition('/')[2][:300]}")
        return False
    return True


def _play(road: Road, name: str, made: Deployment, folder: Path) -> None:
    """Compiles the two files of a package and its example, and compares what that prints."""
    write_package(made, "amalgamation", folder)
    program = str(folder / "it")
    sources = [str(one) for one in sorted(folder.rglob("*.c"))]
    if not _cc(road, [*_USUAL, f"-I{folder}", f"-I{folder / 'example'}", *sources, "-o", program, "-lm"]):
        return
    done = subprocess.run([program], capture_output=True, text=True, check=False, timeout=60)
    if done.returncode or not _alike(done.stdout.splitlines(), expected(made)):
        road.failures.append(f"{name}: the example prints {done.stdout!r}, not {expected(made)!r}"[:400])


def _alike(printed: Sequence[str], wanted: Sequence[str]) -> bool:
    """The same words, the same numbers but for the rounding of the last digit."""

    def same(one: str, other: str) -> bool:
        try:
            return math.isclose(float(one), float(other), rel_tol=_LAST_DIGIT)
        except ValueError:
            return one == other

    if len(printed) != len(wanted):
        return False
    pairs = [(a.split(), b.split()) for a, b in zip(printed, wanted, strict=True)]
    return all(len(a) == len(b) and all(map(same, a, b)) for a, b in pairs)


# ---- many


def roads(seeds: range, kept: Path | None = None, advance: Callable[[int], None] = lambda done: None) -> list[Road]:
    """The rigs of seeds, one after the other.

    Parameters
    ----------
    kept : JSON lines of what is done; those that it has are not travelled again
    """
    done: dict[int, Road] = {}
    if kept is not None and kept.exists():
        lines = (json.loads(line) for line in kept.read_text(encoding="utf-8").splitlines())
        done = {one["seed"]: Road(**one) for one in lines}
    found = []
    for own in seeds:
        road = done.get(own)
        if road is None:
            road = road_of(own)
            clear_cache()
            if kept is not None:
                with kept.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(road)) + "\n")
        found.append(road)
        advance(len(found))
    return found


def table_of(found: Sequence[Road]) -> list[tuple[str, ...]]:
    """A row for each kind, then one of all."""
    kinds = sorted({one.kind for one in found})
    return [*(_row(kind, [one for one in found if one.kind == kind]) for kind in kinds), _row("all", found)]


def _row(name: str, found: Sequence[Road]) -> tuple[str, ...]:
    count = Counter(one.outcome for one in found)
    errors = [abs(z) for one in found if one.outcome in ("good", "warning") for z in one.errors.values()]
    good = [abs(z) for one in found if one.outcome == "good" for z in one.errors.values()]
    reached = [sum(stage in one.reached for one in found) for stage in ("second stage", "q31")]
    return (
        name,
        str(len(found)),
        str(sum(bool(one.failures) for one in found)),
        *(str(count[one]) for one in ("good", "warning", "not identified", "refused")),
        f"{statistics.median(errors):.2f}" if errors else "-",
        f"{max(good):.1f}" if good else "-",
        *map(str, reached),
    )


def compile_times() -> list[tuple[str, ...]]:
    """Processor time of each shipped mechanism, in a process that has compiled none yet."""
    out: list[tuple[str, ...]] = []
    for name in mechanisms.names():
        clear_cache()
        began = time.process_time()
        compiled = mechanisms.described(name).compiled(name)
        done = time.process_time()
        identifiable(compiled)
        thetas = " + ".join(str(len(row.theta)) for row in compiled.rows)
        times = (f"{done - began:.2f}", f"{time.process_time() - done:.2f}")
        out.append((name, thetas, str(len(compiled.p)), *times))
    return out


def report(count: int, seed: int, resume: bool, advance: Advance) -> Report:
    """See bench.case."""
    kept = build_folder() / f"random-models-{seed}.jsonl"
    if not resume:
        kept.unlink(missing_ok=True)
    found = roads(range(seed, seed + count), kept, lambda _: advance())
    senseless = senseless_models.run(range(seed, seed + 2 * count))
    faults = [f"rig {one.seed} ({one.kind}): {failure}" for one in found for failure in one.failures]
    faults += [f"description {number}: {error}" for number, error in senseless.tracebacks]
    tables: list[Table] = [
        ("random-models", HEADER, table_of(found)),
        ("compile-times", COMPILE_HEADER, compile_times()),
        ("senseless-models", senseless_models.HEADER, [senseless.row()]),
    ]
    return Report(tables, faults)
