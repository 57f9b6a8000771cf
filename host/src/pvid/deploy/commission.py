"""NAME_commission.h and .c: the commissioning of a rig, ready to be called."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pvid.codegen import describe
from pvid.codegen.c_text import for_cpp, initialised, table
from pvid.configuration.excitation import DesignedDrive, Excitation, Guard, Tone
from pvid.deploy.deployment import Deployment, Files
from pvid.design.c_tables import float_literal

CHECK_SCALE = 0.7  # of the second burst: another size shows what is not in the equations
AGREE = 5.0  # joint standard errors
MISFIT_MAX = 1.5
RESTRAINED_MAX = 0.25


def commission_files(d: Deployment) -> Files:
    """Name -> text; none without an excitation."""
    if d.excitation is None:
        return {}
    return {f"{d.name}_commission.h": _header(d, d.excitation), f"{d.name}_commission.c": _source(d, d.excitation)}


def _header(d: Deployment, e: Excitation) -> str:
    name, upper = d.name, d.upper
    seconds = 2 * (e.burst_s + 2 * e.ramp_s)
    rows = [(f"drive[{k}]", one.name, f"[{one.unit or '1'}]", f"up to {one.limit:g}") for k, one in enumerate(e.drives)]
    declared = [
        "/* PVID_OK, or the wrong field: pvid_status_text(status). */",
        f"pvid_status {name}_commission_init(void);",
        "",
        "/* Returns false while a commissioning runs. */",
        f"bool {name}_commission_start(void);",
        "",
        "/* One tick: the drives for these samples, of which those that are drives are ignored. Cost: some hundred",
        " * instructions, never a step of the identifier. */",
        f"pvid_commission_state {name}_commission_step(const {d.sample_type} sample[{upper}_SAMPLES], "
        f"float drive[{upper}_DRIVES]);",
        "",
        "/* Background: one sample of the identifier. Returns whether there may be more to do at once. */",
        f"bool {name}_commission_work(void);",
        "",
        "/* The drives fall to 0 at their slew rates. */",
        f"void {name}_commission_abort(void);",
        "",
        "/* Its verdict is PVID_COMMISSION_PENDING before the end. */",
        f"const pvid_commission_result_f32 *{name}_commission_result(void);",
        "",
    ]
    return "\n".join(
        [
            f"/* {name}_commission.h - {d.title}: excites the mechanism within its limits, identifies it, checks the",
            f" * values on fresh motion, stops. Two bursts, {seconds:.3g} s of motion in all.",
            " *",
            f" * {d.banner}",
            " *",
            f" *   once:        if ({name}_commission_init() != PVID_OK) ...",
            f" *   to begin:    {name}_commission_start();",
            f" *   each tick:   {name}_commission_step(sample, drive);        apply the drives until the next tick",
            f" *   main loop:   while ({name}_commission_work()) {{}}           never in the tick",
            f" *   behind it:   {name}_commission_result()->verdict == PVID_COMMISSION_DONE: use value[], error[]",
            " *",
            *([" * Drives:", *(f" *   {line}".rstrip() for line in describe.table(rows))] if rows else []),
            *_predicted(d, e),
            " */",
            f"#ifndef {upper}_COMMISSION_H",
            f"#define {upper}_COMMISSION_H",
            "",
            f'#include "{name}_identifier.h"',
            '#include "pvid/commission.h"',
            "",
            f"#define {upper}_DRIVES {max(len(e.drives), 1)}",
            f"#define {upper}_RING_TICKS {e.burst_ticks}u /* {4 * len(d.samples) * e.burst_ticks} bytes */",
            "",
            *_places(d),
            *for_cpp(declared),
            "",
            "#endif",
            "",
        ]
    )


def _places(d: Deployment) -> list[str]:
    """Names of the entries of value[] and error[]."""
    names = ", ".join(f"{d.upper}_{one.name.upper()} = {k}" for k, one in enumerate(d.parameters))
    upper = [one.name.upper() for one in d.parameters]
    return [f"enum {{ {names} }}; /* in value[], error[] */", ""] if len(set(upper)) == len(upper) else []


def _predicted(d: Deployment, e: Excitation) -> list[str]:
    if e.prediction is None:
        return []
    errors = ", ".join(
        f"{one.name} {100 * error:.2g} %" for one, error in zip(d.parameters, e.prediction.relative, strict=True)
    )
    return [" *", " * Standard errors that a burst gives at the model's guesses, of noise alone:", f" *   {errors}"]


def _source(d: Deployment, e: Excitation) -> str:
    name, upper = d.name, d.upper
    drives = len(e.drives)
    tables = [
        part
        for k, one in enumerate(e.drives)
        for part in (parts_table(f"part_{k}", one.tones), *_guard_table(k, one.guards))
    ]
    configs = ",\n".join(_drive(d, e, k, one) for k, one in enumerate(e.drives))
    if drives:
        tables += [
            f"static const pvid_excite_config_f32 excite[{drives}] = {{\n{configs},\n}};",
            f"static pvid_excite_f32 excitation[{drives}];",
            f"static const uint8_t input[{drives}] = {{{', '.join(str(one.place) for one in e.drives)}}};",
        ]
    fields: dict[str, object] = {
        "weak": f"&{name}_config_f32",
        "identifier": "&identifier",
        "excite": "excite" if drives else "NULL",
        "excitation": "excitation" if drives else "NULL",
        "input": "input" if drives else "NULL",
        "drives": f"{drives}u",
        "passes": f"{e.passes}u",
        "ring": "ring",
        "ring_ticks": f"{upper}_RING_TICKS",
        "burst_ticks": f"{e.burst_ticks}u",
        "check_scale": _number(CHECK_SCALE),
        "agree": _number(AGREE),
        "misfit_max": _number(MISFIT_MAX),
        "restrained_max": _number(RESTRAINED_MAX),
    }
    return "\n".join(
        [
            f"/* {d.banner} */",
            f'#include "{name}_commission.h"',
            "",
            f'#include "{name}_design_f32.h"',
            "",
            "\n\n".join(tables),
            "",
            f"static float ring[{upper}_RING_TICKS * {upper}_SAMPLES];",
            "static pvid_weak_f32 identifier;",
            "static pvid_commission_f32 commission;",
            "",
            initialised("static const pvid_commission_config_f32 config", fields),
            "",
            f"pvid_status {name}_commission_init(void)",
            "{",
            "    return pvid_commission_init_f32(&commission, &config);",
            "}",
            "",
            f"bool {name}_commission_start(void)",
            "{",
            "    return pvid_commission_start_f32(&commission);",
            "}",
            "",
            f"pvid_commission_state {name}_commission_step(const float sample[{upper}_SAMPLES], "
            f"float drive[{upper}_DRIVES])",
            "{",
            "    return pvid_commission_step_f32(&commission, sample, drive);",
            "}",
            "",
            f"bool {name}_commission_work(void)",
            "{",
            "    return pvid_commission_work_f32(&commission);",
            "}",
            "",
            f"void {name}_commission_abort(void)",
            "{",
            "    pvid_commission_abort_f32(&commission);",
            "}",
            "",
            f"const pvid_commission_result_f32 *{name}_commission_result(void)",
            "{",
            "    return pvid_commission_result_of_f32(&commission);",
            "}",
            "",
        ]
    )


def _number(value: float) -> str:
    return float_literal(np.float32(value))


def parts_table(name: str, tones: Sequence[Tone]) -> str:
    """Of an excitation."""
    rows = [
        f"{{PVID_EXCITE_TONE, {_number(one.amplitude)}, {_number(one.hz)}, {_number(one.turns)}, 0.0f, 0.0f, NULL, 0u}}"
        for one in tones
    ]
    return table("pvid_excite_part_f32", name, str(len(rows)), rows)


def _guard_table(number: int, guards: tuple[Guard, ...]) -> list[str]:
    if not guards:
        return []
    rows = []
    for one in guards:
        limits = (one.low, one.soft_low, one.soft_high, one.high, one.response, one.push, one.ahead_s, one.brake)
        numbers = ", ".join(_number(x) for x in (*limits, one.smoothing_s))
        rows.append(f"{{{one.signal}u, {str(one.of_rate).lower()}, {numbers}}}")
    return [table("pvid_excite_guard_f32", f"guard_{number}", str(len(rows)), rows)]


def _drive(d: Deployment, e: Excitation, number: int, one: DesignedDrive) -> str:
    guard = f"guard_{number}" if one.guards else "NULL"
    return excite_entry((e.sample_rate, e.ramp_s, e.burst_s), one, f"part_{number}", guard, len(d.samples))


def excite_entry(times: tuple[float, float, float], one: DesignedDrive, part: str, guard: str, measured: int) -> str:
    """A pvid_excite_config_f32 of a table; times: sample rate [Hz], ramp and burst [s]."""
    rate, ramp_s, burst_s = times
    fields = {
        "sample_rate_hz": _number(rate),
        "low": _number(-one.limit),
        "high": _number(one.limit),
        "slew": _number(one.slew),
        "ramp_s": _number(ramp_s),
        "burst_s": _number(burst_s),
        "part": part,
        "guard": guard,
        "parts": f"{len(one.tones)}u",
        "guards": f"{len(one.guards)}u",
        "measured": f"{measured}u",
    }
    return "    {" + ", ".join(f".{key} = {value}" for key, value in fields.items()) + "}"
