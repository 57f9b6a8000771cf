"""NAME_identifier.h and .c: one identifier, ready to be called from C and C++, whatever the arithmetic."""

from __future__ import annotations

import numpy as np

from pvid.codegen import describe
from pvid.codegen.c_text import for_cpp
from pvid.deploy.deployment import Deployment, Files, Quantity, SecondStage
from pvid.design.c_tables import float_literal

# A record is of one life.
_NO_PIECE = "    writer = (pvid_record_writer){0u, 0u, 0u};"


def identifier_files(deployment: Deployment) -> Files:
    """Name -> text."""
    name = deployment.name
    files = {f"{name}_identifier.h": _header(deployment), f"{name}_identifier.c": _source(deployment)}
    if deployment.second is not None:
        files |= {
            f"{name}_refined.h": _private(deployment),
            f"{name}_refined.c": _refined(deployment, deployment.second),
        }
    return files


def _header(d: Deployment) -> str:
    counts = " in counts of the sensor" if d.arithmetic.is_integer else ""
    declared = [
        f"extern const char *const {d.name}_parameter[{d.upper}_PARAMETERS];",
        f"extern const char *const {d.name}_unit[{d.upper}_PARAMETERS];",
        "",
        "/* Starts, or starts again from the guesses. PVID_OK, or the wrong field: pvid_status_text(status). */",
        f"pvid_status {d.name}_begin(void);",
        "",
        *_refined_declarations(d),
        "/* One tick. PVID_UPDATED or PVID_MISFIT: there is a new estimate; pvid_reason_text(reason) for others. */",
        f"pvid_reason {d.name}_step(const {d.sample_type} sample[{d.upper}_SAMPLES]);",
        "",
        f"/* The same of count ticks at once, samples[count][{d.upper}_SAMPLES] of a buffer: the same bits. The",
        " * reason is that of the last tick with a new estimate; without one, of the last with something to report. */",
        f"pvid_reason {d.name}_step_block(const {d.sample_type} samples[], uint32_t count);",
        "",
        *_turning_declarations(d),
        "typedef struct {",
        f"    float value[{d.upper}_PARAMETERS];",
        f"    float standard_error[{d.upper}_PARAMETERS];",
        "    uint32_t number;        /* of estimates published so far; 0: these are the guesses */",
        "    pvid_standing standing; /* whether it still holds, why not, its age: pvid/standing.h */",
        f"}} {d.name}_estimate;",
        "",
        "/* The published estimate and its standing, consistent, also while another context calls step. false: a step",
        " * published during each attempt, *result is undefined. */",
        f"bool {d.name}_result({d.name}_estimate *result);",
        "",
        "/* Its values and standard errors alone, without the standing. Returns",
        " * how many were published so far; 0: these are the guesses, or a step published during each attempt. */",
        f"uint32_t {d.name}_read(float value[{d.upper}_PARAMETERS], float standard_error[{d.upper}_PARAMETERS]);",
        "",
        "/* Call it where samples are missing. */",
        f"void {d.name}_gap(void);",
        "",
        "/* true: samples move no estimate, until false. */",
        f"void {d.name}_freeze(bool frozen);",
        "",
        "/* The published values and errors for the next life of the machine, of any release and settings. Save",
        " * writes a piece: call it, in any one context, until it no longer returns PVID_RECORD_MORE; the record is",
        " * complete with PVID_RECORD_DONE. Load, behind begin, makes it the start and returns PVID_RECORD_DONE, or",
        " * why not, and changes nothing: pvid/record.h. */",
        f"#define {d.upper}_RECORD {d.record_bytes} /* bytes */",
        f"pvid_record_status {d.name}_save(uint8_t record[{d.upper}_RECORD]);",
        f"pvid_record_status {d.name}_load(const uint8_t record[{d.upper}_RECORD]);",
        "",
        "/* A snapshot of the whole state for a flash: its size [bytes]; save writes one, numbered by you, and returns",
        " * its length, 0 if there is no room; restore after begin returns true, or false and changes nothing:",
        " * damaged, or of another build, rig or settings. */",
        f"size_t {d.name}_snapshot_size(void);",
        f"size_t {d.name}_snapshot_save(uint32_t number, uint8_t image[], size_t room);",
        f"bool {d.name}_snapshot_restore(const uint8_t image[], size_t length);",
        "",
    ]
    lines = [
        f"/* {d.name}_identifier.h - {d.title}: identifies the parameters of a rig.",
        " *",
        f" * Samples at {d.sample_rate:g} Hz in, parameters with standard errors out.",
        " *",
        f" * {d.banner}",
        " *",
        f" *   once:            if ({d.name}_begin() != PVID_OK) ...",
        f" *   each tick:       reason = {d.name}_step(sample);             all samples taken at the same time{counts}",
        f" *   or each block:   reason = {d.name}_step_block(samples, 24);",
        f" *   in any context:  {d.name}_result(&result);    result.standing.state == PVID_STANDING_VALID: use it",
        " *",
        " * Samples of a tick:",
        *(f" *   {line}".rstrip() for line in describe.table([_sample(k, one) for k, one in enumerate(d.samples)])),
        " *",
        " * Parameters:",
        *(f" *   {line}".rstrip() for line in describe.table([_parameter(k, x) for k, x in enumerate(d.parameters)])),
        " */",
        f"#ifndef {d.upper}_IDENTIFIER_H",
        f"#define {d.upper}_IDENTIFIER_H",
        "",
        "#include <stdbool.h>",
        "#include <stddef.h>",
        "#include <stdint.h>",
        "",
        '#include "pvid/record.h"',
        '#include "pvid/standing.h"',
        '#include "pvid/status.h"',
        '#include "pvid/text.h"',
        "",
        f"#define {d.upper}_SAMPLES {len(d.samples)}",
        f"#define {d.upper}_PARAMETERS {len(d.parameters)}",
        f"#define {d.upper}_PERIOD_US {round(1e6 / d.sample_rate)}",
        "",
        *for_cpp(declared),
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)


def _sample(place: int, one: Quantity) -> tuple[str, ...]:
    return (f"sample[{place}]", one.name, f"[{one.unit or '1'}]", one.note)


def _parameter(place: int, one: Quantity) -> tuple[str, ...]:
    return (f"value[{place}]", one.name, f"[{one.unit or '1'}]")


def _source(d: Deployment) -> str:
    core, upper = d.core, d.upper
    values = ("estimate.p[k]", "estimate.se[k]")
    scale: list[str] = []
    if d.arithmetic.is_integer:
        units = ", ".join(float_literal(np.float32(one.scale)) for one in d.parameters)
        table = f"static const float scale[{upper}_PARAMETERS] = {{{units}}};"
        scale = ["", "/* Value of one unit of each integer. */", table]
        values = ("(float)estimate.p[k] * scale[k]", "(float)estimate.se[k] * scale[k]")
    lines = [
        f"/* {d.banner} */",
        f'#include "{d.name}_identifier.h"',
        "",
        f'#include "{d.name}_design_{core}.h"',
        *([] if d.second is None else [f'#include "{d.name}_refined.h"']),
        *(['#include "pvid/counter.h"'] if d.turning else []),
        *(f'#include "pvid/{one}_{d.arithmetic.header.removeprefix("pvid/")}"' for one in ("record", "snapshot")),
        "",
        "/* Names and units of the parameters. */",
        f"#define MECHANISM 0x{d.mechanism:08X}u",
        "",
        f"static pvid_weak_{core} identifier;",
        "static pvid_record_writer writer;",
        *scale,
        "",
        _names(d, "parameter", [one.name for one in d.parameters]),
        "",
        _names(d, "unit", [one.unit for one in d.parameters]),
        "",
        *_begin(d),
        "",
        f"pvid_reason {d.name}_step(const {d.sample_type} sample[{upper}_SAMPLES])",
        "{",
        f"    return pvid_weak_step_{core}(&identifier, sample);",
        "}",
        "",
        f"pvid_reason {d.name}_step_block(const {d.sample_type} samples[], uint32_t count)",
        "{",
        f"    return pvid_weak_step_block_{core}(&identifier, samples, count);",
        "}",
        "",
        *_turning(d),
        f"bool {d.name}_result({d.name}_estimate *result)",
        "{",
        f"    pvid_estimate_{core} estimate;",
        f"    if ((result == NULL) || !pvid_weak_read_{core}(&identifier, &estimate, &result->number)) {{",
        "        return false;",
        "    }",
        f"    for (int k = 0; k < {upper}_PARAMETERS; k++) {{",
        f"        result->value[k] = {values[0]};",
        f"        result->standard_error[k] = {values[1]};",
        "    }",
        "    result->standing = estimate.standing;",
        "    return true;",
        "}",
        "",
        f"uint32_t {d.name}_read(float value[{upper}_PARAMETERS], float standard_error[{upper}_PARAMETERS])",
        "{",
        f"    {d.name}_estimate result;",
        f"    if (!{d.name}_result(&result)) {{",
        "        return 0u;",
        "    }",
        f"    for (int k = 0; k < {upper}_PARAMETERS; k++) {{",
        "        value[k] = result.value[k];",
        "        standard_error[k] = result.standard_error[k];",
        "    }",
        "    return result.number;",
        "}",
        "",
        f"void {d.name}_gap(void)",
        "{",
        f"    pvid_weak_gap_{core}(&identifier);",
        "}",
        "",
        f"void {d.name}_freeze(bool frozen)",
        "{",
        f"    pvid_weak_freeze_{core}(&identifier, frozen);",
        "}",
        "",
        f"size_t {d.name}_snapshot_size(void)",
        "{",
        f"    return PVID_SNAPSHOT_WEAK_{core.upper()};",
        "}",
        "",
        f"pvid_record_status {d.name}_save(uint8_t record[{upper}_RECORD])",
        "{",
        f"    return pvid_record_save_weak_{core}(&identifier, &writer, MECHANISM, record, {upper}_RECORD);",
        "}",
        "",
        f"pvid_record_status {d.name}_load(const uint8_t record[{upper}_RECORD])",
        "{",
        _NO_PIECE,
        f"    return pvid_record_load_weak_{core}(&identifier, &{d.name}_config_{core}, MECHANISM, record,",
        f"                                     {upper}_RECORD);",
        "}",
        "",
        f"size_t {d.name}_snapshot_save(uint32_t number, uint8_t image[], size_t room)",
        "{",
        f"    return pvid_snapshot_save_weak_{core}(&identifier, &{d.name}_config_{core}, number, image, room);",
        "}",
        "",
        f"bool {d.name}_snapshot_restore(const uint8_t image[], size_t length)",
        "{",
        _NO_PIECE,
        f"    return pvid_snapshot_restore_weak_{core}(&identifier, &{d.name}_config_{core}, image, length) ==",
        "           PVID_SNAPSHOT_RESTORED;",
        "}",
        "",
    ]
    return "\n".join(lines)


def _turning_declarations(d: Deployment) -> list[str]:
    return [
        line
        for one in d.turning
        for line in (
            f"/* sample[{one.place}] from the raw counter of its encoder [{one.lsb:.6g} a count], which starts over at",
            " * modulus: 65536, 4000, or 0 for 2^32. The angle may turn without end: it is given to step about a",
            " * reference that follows it. Call it once a tick, before step, and not for the ticks of a block, whose",
            " * reference must be one; with a second stage the angle grows: windows are held out of range. */",
            f"float {d.name}_counted_{one.name}(uint32_t counter, uint32_t modulus);",
            "",
        )
    ]


def _turning(d: Deployment) -> list[str]:
    """The samples of encoders that turn without end."""
    return [
        line
        for one in d.turning
        for line in (
            f"float {d.name}_counted_{one.name}(uint32_t counter, uint32_t modulus)",
            "{",
            "    static uint32_t before;",
            "    static uint32_t place; /* counts, modulo 2^32 */",
            "    static uint32_t reference;",
            "    place += (uint32_t)pvid_counter_difference(before, counter, modulus);",
            "    before = counter;",
            "    const int32_t count = pvid_counter_difference(reference, place, 0u);",
            f"    const float angle = {float_literal(np.float32(one.lsb))} * (float)count;",
            f"    if (((count <= {one.limit}) && (count >= -{one.limit})) ||",
            f"        !pvid_weak_rebase_f32(&identifier, {one.place}u, {one.channel}u, angle)) {{",
            "        return angle;",
            "    }",
            "    reference = place;",
            "    return 0.0f;",
            "}",
            "",
        )
    ]


def _begin(d: Deployment) -> list[str]:
    if d.second is None:
        return [
            f"pvid_status {d.name}_begin(void)",
            "{",
            _NO_PIECE,
            f"    return pvid_weak_init_{d.core}(&identifier, &{d.name}_config_{d.core});",
            "}",
        ]
    return [
        f"pvid_status {d.name}_begin_with(const pvid_weak_refine_f32 *stage)",
        "{",
        _NO_PIECE,
        f"    pvid_weak_config_f32 config = {d.name}_config_f32;",
        "    config.refine = stage;",
        "    return pvid_weak_init_f32(&identifier, &config);",
        "}",
        "",
        f"pvid_status {d.name}_begin(void)",
        "{",
        f"    return {d.name}_begin_with(NULL);",
        "}",
    ]


def _refined_declarations(d: Deployment) -> list[str]:
    if d.second is None:
        return []
    table = describe.table([_parameter(k, x) for k, x in enumerate(d.second.parameters)])
    return [
        f"/* The same with a second stage, in place of {d.name}_begin: it fits the full equations, to the statistical",
        " * limit, from the first stage's estimate on (pvid/refine.h). What it refines:",
        *(f" *   {line}".rstrip() for line in table),
        " */",
        f"#define {d.upper}_REFINED {len(d.second.parameters)}",
        f"extern const char *const {d.name}_refined_parameter[{d.upper}_REFINED];",
        f"extern const char *const {d.name}_refined_unit[{d.upper}_REFINED];",
        f"pvid_status {d.name}_begin_refined(void);",
        "",
        f"/* As {d.name}_read, of the refined estimate. 0: there is none yet, that of {d.name}_read stands. */",
        f"uint32_t {d.name}_read_refined(float value[{d.upper}_REFINED], float standard_error[{d.upper}_REFINED]);",
        "",
        "/* Outcome of the refinement's last block of samples; a snapshot does not contain the refinement. */",
        f"pvid_reason {d.name}_refined_reason(void);",
        "",
    ]


def _private(d: Deployment) -> str:
    return "\n".join(
        [
            f"/* {d.name}_refined.h - between {d.name}_identifier.c and {d.name}_refined.c.",
            " *",
            f" * {d.banner} */",
            f"#ifndef {d.upper}_REFINED_H",
            f"#define {d.upper}_REFINED_H",
            "",
            '#include "pvid/weak.h"',
            "",
            "/* With a second stage, or NULL. */",
            f"pvid_status {d.name}_begin_with(const pvid_weak_refine_f32 *stage);",
            "",
            "#endif",
            "",
        ]
    )


def _refined(d: Deployment, second: SecondStage) -> str:
    """Apart, so that a program without it does not link the refinement."""
    upper, size = d.upper, "REFINED"
    return "\n".join(
        [
            f"/* {d.banner} */",
            f'#include "{d.name}_identifier.h"',
            "",
            f'#include "{d.name}_refine_design_f32.h"',
            f'#include "{d.name}_refined.h"',
            "",
            "static pvid_refine_f32 refinement;",
            "static const pvid_weak_refine_f32 second = {&pvid_refiner_f32, &refinement,",
            f"                                            &{d.name}_refine_config_f32}};",
            "",
            _names(d, "refined_parameter", [one.name for one in second.parameters], size),
            "",
            _names(d, "refined_unit", [one.unit for one in second.parameters], size),
            "",
            f"pvid_status {d.name}_begin_refined(void)",
            "{",
            f"    return {d.name}_begin_with(&second);",
            "}",
            "",
            f"uint32_t {d.name}_read_refined(float value[{upper}_REFINED], float standard_error[{upper}_REFINED])",
            "{",
            "    pvid_refine_estimate_f32 estimate;",
            "    uint32_t number = 0u;",
            "    if (!pvid_refine_read_f32(&refinement, &estimate, &number)) {",
            "        return 0u;",
            "    }",
            f"    for (int k = 0; k < {upper}_REFINED; k++) {{",
            "        value[k] = estimate.r[k];",
            "        standard_error[k] = estimate.se[k];",
            "    }",
            "    return number;",
            "}",
            "",
            f"pvid_reason {d.name}_refined_reason(void)",
            "{",
            "    return pvid_refine_reason_f32(&refinement);",
            "}",
            "",
        ]
    )


def _names(d: Deployment, what: str, names: list[str], size: str = "PARAMETERS") -> str:
    texts = ", ".join(f'"{one}"' for one in names)
    return f"const char *const {d.name}_{what}[{d.upper}_{size}] = {{{texts}}};"
