"""NAME_identifier.h and .c: one identifier, ready to be called from C and C++, whatever the arithmetic."""

from __future__ import annotations

import numpy as np

from pvid.codegen import describe
from pvid.deploy.deployment import Deployment, Files, Quantity
from pvid.design.c_tables import float_literal


def identifier_files(deployment: Deployment) -> Files:
    """Name -> text."""
    return {
        f"{deployment.name}_identifier.h": _header(deployment),
        f"{deployment.name}_identifier.c": _source(deployment),
    }


def _header(d: Deployment) -> str:
    counts = " in counts of the sensor" if d.arithmetic.is_integer else ""
    lines = [
        f"/* {d.name}_identifier.h - {d.title}: identifies the parameters of a rig.",
        " *",
        f" * Samples at {d.sample_rate:g} Hz in, parameters with standard errors out.",
        " *",
        f" * {d.banner}",
        " *",
        f" *   once:            if ({d.name}_begin() != PVID_OK) ...",
        f" *   each tick:       reason = {d.name}_step(sample);             all samples taken at the same time{counts}",
        f" *   in any context:  number = {d.name}_read(value, error);       number > 0: there is an estimate",
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
        '#include "pvid/status.h"',
        '#include "pvid/text.h"',
        "",
        f"#define {d.upper}_SAMPLES {len(d.samples)}",
        f"#define {d.upper}_PARAMETERS {len(d.parameters)}",
        f"#define {d.upper}_PERIOD_US {round(1e6 / d.sample_rate)}",
        "",
        "#ifdef __cplusplus",
        'extern "C" {',
        "#endif",
        "",
        f"extern const char *const {d.name}_parameter[{d.upper}_PARAMETERS];",
        f"extern const char *const {d.name}_unit[{d.upper}_PARAMETERS];",
        "",
        "/* Starts, or starts again from the guesses. PVID_OK, or the wrong field: pvid_status_text(status). */",
        f"pvid_status {d.name}_begin(void);",
        "",
        "/* One tick. PVID_UPDATED or PVID_MISFIT: there is a new estimate; pvid_reason_text(reason) for others. */",
        f"pvid_reason {d.name}_step(const {d.sample_type} sample[{d.upper}_SAMPLES]);",
        "",
        "/* Copies the published estimate with its standard errors, also while another context calls step. Returns",
        " * how many were published so far; 0: these are the guesses, or a step published during each attempt. */",
        f"uint32_t {d.name}_read(float value[{d.upper}_PARAMETERS], float standard_error[{d.upper}_PARAMETERS]);",
        "",
        "/* Call it where samples are missing. */",
        f"void {d.name}_gap(void);",
        "",
        "/* true: samples move no estimate, until false. */",
        f"void {d.name}_freeze(bool frozen);",
        "",
        "/* A snapshot of the state for a flash: its size [bytes]; save writes one, numbered by you, and returns",
        " * its length, 0 if there is no room; restore after begin returns true, or false and changes nothing:",
        " * damaged, or of another build or rig. */",
        f"size_t {d.name}_snapshot_size(void);",
        f"size_t {d.name}_save(uint32_t number, uint8_t image[], size_t room);",
        f"bool {d.name}_restore(const uint8_t image[], size_t length);",
        "",
        "#ifdef __cplusplus",
        "}",
        "#endif",
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
        f'#include "{d.arithmetic.snapshot_header}"',
        "",
        f"static pvid_weak_{core} identifier;",
        *scale,
        "",
        _names(d, "parameter", [one.name for one in d.parameters]),
        "",
        _names(d, "unit", [one.unit for one in d.parameters]),
        "",
        f"pvid_status {d.name}_begin(void)",
        "{",
        f"    return pvid_weak_init_{core}(&identifier, &{d.name}_config_{core});",
        "}",
        "",
        f"pvid_reason {d.name}_step(const {d.sample_type} sample[{upper}_SAMPLES])",
        "{",
        f"    return pvid_weak_step_{core}(&identifier, sample);",
        "}",
        "",
        f"uint32_t {d.name}_read(float value[{upper}_PARAMETERS], float standard_error[{upper}_PARAMETERS])",
        "{",
        f"    pvid_estimate_{core} estimate;",
        "    uint32_t number = 0u;",
        f"    if (!pvid_weak_read_{core}(&identifier, &estimate, &number)) {{",
        "        return 0u;",
        "    }",
        f"    for (int k = 0; k < {upper}_PARAMETERS; k++) {{",
        f"        value[k] = {values[0]};",
        f"        standard_error[k] = {values[1]};",
        "    }",
        "    return number;",
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
        f"size_t {d.name}_save(uint32_t number, uint8_t image[], size_t room)",
        "{",
        f"    return pvid_snapshot_save_weak_{core}(&identifier, &{d.name}_config_{core}, number, image, room);",
        "}",
        "",
        f"bool {d.name}_restore(const uint8_t image[], size_t length)",
        "{",
        f"    return pvid_snapshot_restore_weak_{core}(&identifier, &{d.name}_config_{core}, image, length) ==",
        "           PVID_SNAPSHOT_RESTORED;",
        "}",
        "",
    ]
    return "\n".join(lines)


def _names(d: Deployment, what: str, names: list[str]) -> str:
    texts = ", ".join(f'"{one}"' for one in names)
    return f"const char *const {d.name}_{what}[{d.upper}_PARAMETERS] = {{{texts}}};"
