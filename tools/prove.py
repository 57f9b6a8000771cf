#!/usr/bin/env python3
"""Proofs of the fixed-point core and the frame codec by Frama-C, over the programs of tests/proofs.

    tools/prove.py            all of them; exits 1 when one leaves an alarm that is not explained
    tools/prove.py link       one of them
    tools/prove.py --update   writes the table of host/docs/proofs.md as well

A program feeds the functions of one module every input that their header allows. That Eva raises no alarm proves, for
all of these inputs: no overflow of signed arithmetic, no value lost in a conversion to a smaller signed type, no access
out of bounds, no division by zero, no bad shift, no uninitialised read, and the assertions of the program. Functions
of `taken` are replaced by their contracts in tests/proofs/contracts.h, and their conditions are shown to be met; the
proof of their own module shows that they keep the contract.

A proof is not done again while nothing that it reads has changed (tools/kept.py).

Where the bound is a relation between several numbers, which intervals do not see, the functions of `deduced` carry
contracts and loop invariants in their source, and Frama-C's WP proves these, the same absence of faults and that every
loop ends, goal by goal, with z3.
"""

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from kept import kept, preprocessed, version

from pvid.cli.page_table import put_table

ROOT = Path(__file__).resolve().parents[1]
INCLUDES = " ".join(
    f"-I'{ROOT / name}'"
    for name in (
        *("firmware/include", "firmware/src", "firmware/examples/refine_model"),
        *("firmware/link", "firmware/ports", "tests/proofs", "tests/unit"),
    )
)
PAGE = ROOT / "host" / "docs" / "proofs.md"
GENERATED = ROOT / "build" / "proofs"  # of this run: the design of the weak identifier
PREPROCESSOR = f"{INCLUDES} -I'{GENERATED}'"
LONGEST = 3600  # seconds: many times what the slowest needs on a machine that is busy


@dataclass(frozen=True)
class Proof:
    """A program of tests/proofs, what it is linked with, and how far Eva unrolls loops or keeps paths apart."""

    name: str
    covers: str  # what is proved, in words
    sources: tuple[str, ...]
    options: tuple[str, ...] = ()
    taken: tuple[str, ...] = ()  # functions by their contracts
    left: tuple[str, ...] = ()  # regular expressions, each of one alarm that Eva cannot exclude
    why: str = ""  # and why it cannot happen, or what covers it
    deduced: tuple[str, ...] = ()  # functions that WP proves from their contracts, in place of Eva


ESTIMATOR = (
    *("src/solve/estimator_q31.c", "src/solve/row_q31.c", "src/solve/staged_q31.c", "src/solve/system_q31.c"),
    *(
        "src/solve/assess_q31.c",
        "src/solve/information_q31.c",
        "src/solve/kinds.c",
        "src/solve/scaled_model_q31.c",
        "src/solve/settings_q31.c",
    ),
    *("src/solve/cholesky_q31.c", "src/number/scaled_q31.c", "src/number/integer_q31.c"),
)


def in_stages(program: str) -> tuple[str, ...]:
    """Options for stages: paths are kept apart where the factor is positive and where it is not."""
    return (
        *("-eva-min-loop-unroll", "80", "-eva-split-return", "full", "-eva-subdivide-non-linear", "4"),
        "-eva-slevel-function",
        "main:200,checks_noise:5,pvid_system_eliminate_q31:30,above_noise_stage:30,factor_stage:60,advance_shared:60,solve_stage:30,"
        "pvid_estimator_advance_q31:100,pvid_estimator_assess_advance_q31:100,kappa_stage:60,widen_stage:60,"
        f"pvid_assess_invert_q31:20,pvid_cholesky_eliminate_q31:20,{program}:5000",
    )


SCALED = ("pvid_scaled_of_q31", "pvid_scaled_plus_q31", "pvid_scaled_times_q31", "pvid_scaled_over_q31")
TAKEN_IN_STAGES = (
    *("pvid_scale_q31", "pvid_bit_length_q31", "pvid_root_of_q31", "pvid_half_exponent_q31", "pvid_to_block_q31"),
    *SCALED,
    *("pvid_cholesky_eliminate_q31", "pvid_cholesky_least_pivot_q31", "pvid_cholesky_lower_q31"),
    "pvid_cholesky_solve_q31",
)

PROOFS = (
    Proof(
        "integer_q31",
        "every function, every argument",
        ("src/number/integer_q31.c",),
        ("-eva-auto-loop-unroll", "200", "-eva-min-loop-unroll", "33"),
    ),
    Proof(
        "scaled_of_q31",
        "`pvid_scaled_of_q31`, every number, an octave at a time",
        ("src/number/scaled_q31.c", "src/number/integer_q31.c"),
        ("-eva-auto-loop-unroll", "200", "-eva-min-loop-unroll", "66"),
    ),
    Proof(
        "scaled_q31",
        "sums at every distance of the exponents, products, quotients of any two numbers",
        ("src/number/scaled_q31.c", "src/number/integer_q31.c"),
        ("-eva-auto-loop-unroll", "200", "-eva-min-loop-unroll", "66"),
        taken=("pvid_scaled_of_q31",),
    ),
    Proof(
        "elementary_q31",
        "sine and cosine of any integer in every format, signs, limits; the same of numbers of any size",
        ("src/number/elementary_q31.c", "src/number/scaled_q31.c", "src/number/integer_q31.c"),
        ("-eva-auto-loop-unroll", "200", "-eva-min-loop-unroll", "142"),
        taken=("pvid_scaled_of_q31",),
    ),
    Proof(
        "block_q31",
        "`pvid_to_block_q31`, any entries, the longest of each length, first or last",
        ("src/solve/cholesky_q31.c", "src/number/integer_q31.c"),
        (
            *("-eva-min-loop-unroll", "66", "-eva-slevel-function"),
            "pvid_bit_length_q31:20,pvid_scale_q31:20,pvid_magnitude_q31:5,pvid_to_block_q31:20",
        ),
    ),
    Proof(
        "cholesky_q31",
        "factor, its pivots and solutions, n = 1..4, any matrix within 30 bits, any right-hand side",
        ("src/solve/cholesky_q31.c", "src/number/scaled_q31.c", "src/number/integer_q31.c"),
        (
            *("-eva-auto-loop-unroll", "200", "-eva-slevel", "100", "-eva-subdivide-non-linear", "4"),
            *("-inline-calls", "pvid_pivot_is_significant_q31", "-eva-domains", "equality,symbolic-locations"),
            *("-eva-split-return", "full"),
        ),
        taken=(
            *("pvid_scale_q31", "pvid_bit_length_q31", "pvid_scaled_of_q31", "pvid_inverse_root_q31"),
            "pvid_to_block_q31",
        ),
    ),
    Proof(
        "estimator_q31",
        "start and rows of models with any theta and C, of one kind and of three: any configuration, any row",
        ESTIMATOR,
        (
            *("-eva-min-loop-unroll", "80", "-eva-split-return", "full", "-eva-subdivide-non-linear", "4"),
            "-eva-slevel-function",
            "main:50,any_configuration:50,any_row:50,any_compensation:50,config_is_valid:100,model_is_valid:50,"
            "pvid_settings_are_valid_q31:200,parameters_are_valid:200,prepare:200,pvid_estimator_init_q31:200,pvid_estimator_init_layout_q31:200,pvid_estimator_add_kind_q31:20,pvid_estimator_add_to_b_q31:20,pvid_estimator_innovation_q31:200,"
            "pvid_estimator_terms_q31:200",
        ),
        taken=(
            *("pvid_scale_q31", "pvid_bit_length_q31", "pvid_scaled_of_q31", "pvid_scaled_times_q31"),
            "pvid_information_init_q31",
        ),
    ),
    Proof(
        "estimator_solve_q31",
        "every stage of a solve from any state of these models, which leaves such a state",
        ESTIMATOR,
        in_stages("any_solve"),
        taken=TAKEN_IN_STAGES,
    ),
    Proof(
        "estimator_assess_q31",
        "every stage of an assessment of any such state",
        ESTIMATOR,
        in_stages("any_assessment"),
        taken=TAKEN_IN_STAGES,
    ),
    Proof(
        "gate_q31",
        "any configuration and floor; any residual on top of any scale that a residual leaves",
        ("src/judge/gate_q31.c", "src/number/scaled_q31.c", "src/number/integer_q31.c"),
        ("-eva-slevel", "100", "-eva-split-return", "full"),
        taken=SCALED,
    ),
    Proof(
        "misfit_q31",
        "any configuration; any row and verdict on top of sums within 2^1000 (those of a block lie within 2^78)",
        ("src/judge/misfit_q31.c", "src/number/scaled_q31.c", "src/number/integer_q31.c"),
        (
            *("-eva-slevel", "200", "-eva-auto-loop-unroll", "100", "-eva-split-return", "full"),
            *("-eva-subdivide-non-linear", "4"),
        ),
        taken=SCALED,
    ),
    Proof(
        "trust_q31",
        "any configuration, four parameters and three; any group on top of any state that a group leaves",
        (*("src/judge/trust_q31.c", "src/judge/standing.c", "src/judge/publication.c"), "src/number/integer_q31.c"),
        ("-eva-slevel", "10", "-eva-auto-loop-unroll", "20", "-eva-split-return", "full"),
        taken=("pvid_square_root_q31",),
    ),
    Proof(
        "fingerprint_q31",
        "any settings of the gate and the estimator; `pvid_fnv_estimator_q31`, any state",
        (
            *("src/number/fingerprint_numbers_q31.c", "src/judge/gate_q31.c", "src/solve/settings_q31.c"),
            *("src/persist/fnv_q31.c", "src/number/fnv.c"),
        ),
        ("-eva-auto-loop-unroll", "20"),
    ),
    Proof(
        "information_q31",
        "a group of rows within their limit on top of any sums within 2^60",
        ("src/solve/information_q31.c", "src/solve/kinds.c", "src/number/integer_q31.c"),
        ("-eva-auto-loop-unroll", "1100", "-eva-min-loop-unroll", "13"),
    ),
    Proof(
        "weak_scores_q31",
        "any score on top of any scores and their means; standard errors by any such means and any inverse",
        ("src/weak/scores_q31.c", "src/solve/assess_q31.c", "src/number/integer_q31.c"),
        ("-eva-min-loop-unroll", "80"),
        taken=("pvid_scale_q31", "pvid_bit_length_q31", "pvid_root_of_q31"),
    ),
    Proof(
        "weak_error_q31",
        "any mean square of residuals on top of any mean of them; any share of any variance of an equation's own error",
        ("src/weak/error_q31.c", "src/number/integer_q31.c"),
        ("-eva-slevel", "100"),
        taken=("pvid_scale_q31", *SCALED),
    ),
    Proof(
        "weak_front_q31",
        "the weak form's front end, the pendulum's design: any counts within full scale, three times round the line",
        ("src/number/integer_q31.c",),
        ("-eva-min-loop-unroll", "60"),
        taken=("pvid_weak_count_q31",),
    ),
    Proof(
        "weak_sums_q31",
        "the same design: any jets within their reach through a half, its channels, any sums of them, a joined window",
        (
            *("src/weak/values_q31.c", "src/weak/sums_q31.c", "src/number/integer_q31.c"),
            *("src/number/scaled_q31.c", "src/number/elementary_q31.c"),
        ),
        ("-eva-min-loop-unroll", "100"),
    ),
    Proof(
        "record",
        "any bytes of any length read as a record of any number of parameters; any parameter written into any room",
        ("src/persist/record.c", "src/persist/crc32.c"),
        ("-eva-min-loop-unroll", "8", "-eva-auto-loop-unroll", "10"),
    ),
    Proof(
        "record_q31",
        "any estimate in any format saved, any record loaded",
        ("src/persist/record_weak_q31.c", "src/persist/record.c", "src/number/integer_q31.c"),
        (
            *("-eva-min-loop-unroll", "8", "-eva-split-return", "full"),
            *("-eva-slevel-function", "pvid_clamp_q31:10,fixed_of:20,take_start:100,take_errors:100"),
        ),
        taken=(
            *("pvid_record_get", "pvid_record_inspect", "pvid_record_put", "pvid_weak_read_q31"),
            *("pvid_weak_init_layout_q31", "pvid_scale_q31", "pvid_bit_length_q31"),
        ),
    ),
    Proof(
        "snapshot",
        "two slots with any bytes in them, any lengths and identities; sealing one",
        ("src/persist/snapshot.c", "src/persist/crc32.c", "src/number/fnv.c"),
        ("-eva-auto-loop-unroll", "10"),
    ),
    Proof(
        "snapshot_q31",
        "any state of the weak form saved into any room, any bytes of any length restored; its pointers stay",
        ("src/persist/snapshot_weak_q31.c", "src/persist/snapshot.c", "src/persist/crc32.c", "src/number/fnv.c"),
        ("-eva-min-loop-unroll", "6", "-eva-auto-loop-unroll", "50"),
        taken=(*("pvid_fingerprint_weak_q31", "pvid_fingerprint_weak_model_q31", "pvid_fingerprint_weak_design_q31"),),
    ),
    Proof(
        "receiver",
        "the ring behind the UART's interrupt, whatever the interrupt does between any two reads of its counters",
        ("ports/uart/receiver.c",),
        ("-eva-auto-loop-unroll", "10"),
    ),
    Proof(
        "link",
        "the decoder, any number of any bytes",
        ("link/link.c", "src/persist/crc32.c"),
        (*("-eva-split-return", "full"), *("-eva-slevel-function", "one_byte:20,pvid_link_decode:40,accept:40")),
    ),
    Proof(
        "encoder",
        "the encoder, any frame, any room; that it ends",
        ("link/link.c",),
        deduced=("pvid_link_encode", "stuff", "pvid_put_u16", "pvid_put_u32"),
    ),
    Proof(
        "excite",
        "two parts of any kind, any limits and times that init accepts, any phases, stops and aborts at any tick",
        ("src/excite/excite_f32.c", "src/number/elementary_f32.c", "src/number/finite_f32.c"),
        ("-eva-min-loop-unroll", "16", "-eva-domains", "equality,symbolic-locations", "-eva-slevel", "20"),
    ),
)


@dataclass(frozen=True)
class Result:
    """What came of a proof: nothing but alarms that are explained, or what Frama-C says."""

    proved: bool
    text: str
    statements: int = 0  # that Eva reached, or goals that WP proved


def unexplained(proof: Proof, said: str) -> list[str]:
    """The alarms, and the contracts and assertions that are not shown to hold, but for those that are explained; and
    explanations of what is no alarm any more."""
    found = re.findall(r"^\[eva:alarm\][^\n]*(?:\n  [^\n]*)*", said, re.MULTILINE)
    fresh = [alarm for alarm in found if not any(re.search(known, alarm) for known in proof.left)]
    stale = [known for known in proof.left if not any(re.search(known, alarm) for alarm in found)]
    return fresh + [f"explained, but not found: {known}" for known in stale]


def weak_design(folder: Path) -> None:
    """Writes weak_design_q31.h: functions and tables of the pendulum's shipped rig, the reach of its jets."""
    from pvid.codegen import files_weak_q31
    from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
    from pvid.models.mechanisms import compiled_of

    weak = weak_q31_for_simulated_rig(compiled_of("kapitza"))
    name, made_by = weak.name, "tools/prove.py"
    text = files_weak_q31.source(weak.made, weak.parameters, made_by)
    reach = re.search(r"limits\[\d+\] = (\{[^}]*\})", text)
    assert reach is not None, "the generated function refuses no input"
    sizes = {"PVID_MAX_P": 3}  # those of the proofs are the defaults
    own = [f"#define weak_design_q31 {name}_design_q31", f"static const int32_t weak_reach[] = {reach[1]};"]
    files = {
        f"{name}_weak_q31.h": files_weak_q31.header(weak.made, sizes, made_by),
        f"{name}_design_q31.h": files_weak_q31.design_header(weak.config, name, sizes, made_by, []),
        "weak_design_q31.h": "\n".join([text, f'#include "{name}_design_q31.h"', *own, ""]),
    }
    for file, content in files.items():
        (folder / file).write_text(content, encoding="utf-8")


def program_of(proof: Proof) -> Path:
    return ROOT / "tests" / "proofs" / f"prove_{proof.name}.c"


def command_of(proof: Proof) -> list[str]:
    files = [str(program_of(proof)), *(str(ROOT / "firmware" / source) for source in proof.sources)]
    cpp = f"-cpp-extra-args={PREPROCESSOR}"
    return ["frama-c", "-machdep", "gcc_x86_64", cpp, "-warn-signed-downcast", *files]


def deduce(proof: Proof) -> Result:
    """WP. A goal has twenty seconds, many times what the slowest needs."""
    started = time.monotonic()
    goals = ["-wp", "-wp-rte", "-wp-prover", "z3", "-wp-timeout", "20", "-wp-par", "1"]
    with tempfile.TemporaryDirectory() as folder:  # why3 keeps in a file which provers there are
        known = {**os.environ, "WHY3CONFIG": str(Path(folder) / "why3.conf")}
        subprocess.run(["why3", "config", "detect"], env=known, capture_output=True, check=True, timeout=LONGEST)
        command = [*command_of(proof), *goals, "-wp-fct", ",".join(proof.deduced)]
        done = subprocess.run(command, env=known, capture_output=True, text=True, check=False, timeout=LONGEST)
    counted = re.search(r"Proved goals:\s+(\d+) / (\d+)", done.stdout)
    if done.returncode != 0 or counted is None or counted[1] != counted[2] or counted[1] == "0":
        proved = re.compile(r"^\[wp\] \[[^]]*\] Goal \S+ : Valid.*\n", re.MULTILINE)
        return Result(False, proved.sub("", done.stdout) + done.stderr)
    text = f"{counted[1]} goals, {time.monotonic() - started:.0f} s"
    return Result(True, text, int(counted[1]))


def prove(proof: Proof) -> Result:
    """Anew where something that the proof reads has changed since it was proved."""
    versions = [version(*one) for one in (("frama-c", "-version"), ("why3", "--version"), ("z3", "--version"))]
    # As Frama-C preprocesses, with its own headers of the C library.
    library = f"{version('frama-c', '-print-share-path').strip()}/libc"
    compiler = shlex.split(f"gcc -D__FRAMAC__ -D__FC_MACHDEP_GCC_X86_64 -nostdinc -isystem {library} {PREPROCESSOR}")
    command = command_of(proof)
    sources = [preprocessed(compiler, Path(one)) for one in command if one.endswith(".c")]

    def made() -> str | None:
        result = deduce(proof) if proof.deduced else evaluate(proof)
        found.append(result)
        return json.dumps(asdict(result)) if result.proved else None

    found: list[Result] = []
    text = kept([*versions, Path(__file__).read_text(encoding="utf-8"), proof.name, *command, *sources], made)
    if found or text is None:
        return found[0]
    before = Result(**json.loads(text))
    return replace(before, text=f"{before.text}; since then nothing has changed that it reads")


def evaluate(proof: Proof) -> Result:
    """Eva."""
    started = time.monotonic()
    quiet = ["-eva", "-eva-no-show-progress", "-eva-msg-key=-initial-state,-final-states"]
    taken = ["-eva-use-spec", ",".join(proof.taken)] if proof.taken else []
    command = [*command_of(proof), *quiet, *proof.options, *taken]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST)
    reached = re.search(r"(\d+) statements reached \(out of (\d+)\)", done.stdout)
    if done.returncode != 0 or reached is None or "ANALYSIS SUMMARY" not in done.stdout:
        return Result(False, done.stdout + done.stderr)
    found = unexplained(proof, done.stdout)
    if found:
        return Result(False, "\n".join(found))
    alarms = f"{len(proof.left)} kinds of alarm explained" if proof.left else "no alarm"
    took = f"{time.monotonic() - started:.0f} s"
    return Result(True, f"{alarms} in {reached[1]} of {reached[2]} statements, {took}", int(reached[1]))


def table(results: list[tuple[Proof, Result]]) -> str:
    """The table of host/docs/proofs.md."""
    rows = [
        f"| `{proof.name}` | {proof.covers} | {result.statements}{' goals' if proof.deduced else ''} | "
        f"{f'{len(proof.left)}: {proof.why}' if proof.left else 'none'} |"
        for proof, result in results
    ]
    return "\n".join(["| program | proved for | statements | alarms left |", "|---|---|---:|---|", *rows])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(proof.name for proof in PROOFS))
    parser.add_argument("--update", action="store_true", help="write the table of host/docs/proofs.md")
    given = parser.parse_args()
    if given.update and given.names:
        parser.error("--update is for all of them")
    names = given.names or [proof.name for proof in PROOFS]
    chosen = [proof for proof in PROOFS if proof.name in names]
    unknown = set(names) - {proof.name for proof in chosen}
    if unknown:
        parser.error(f"no entry of PROOFS (tools/prove.py) is called {', '.join(sorted(unknown))}")
    packages = {"frama-c": "frama-c-base", "why3": "why3", "z3": "z3"}
    missing = [package for tool, package in packages.items() if shutil.which(tool) is None]
    if missing:
        raise SystemExit(f"missing: {' '.join(missing)} (Debian's names); ./tools/test installs them")
    if any("weak_design_q31.h" in program_of(proof).read_text(encoding="utf-8") for proof in chosen):
        GENERATED.mkdir(parents=True, exist_ok=True)
        weak_design(GENERATED)
    with ThreadPoolExecutor(2) as pool:
        results = list(zip(chosen, pool.map(prove, chosen), strict=True))
    for proof, result in results:
        print(f"{proof.name}: {result.text}" if result.proved else f"{proof.name}: NOT PROVED\n{result.text}")
    failed = sum(not result.proved for _, result in results)
    if given.update and not failed:
        put_table(PAGE, "proofs", table(results))
    print(f"Found {failed} modules not proved" if failed else f"All checks passed! {len(chosen)} modules proved")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
