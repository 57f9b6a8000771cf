"""NAME_example.h and .c: a recorded motion in place of sensors, and an estimate as text without printf's %f."""

from __future__ import annotations

import numpy as np

from pvid.deploy.deployment import Deployment, Files
from pvid.design.c_tables import float_literal

_ROW = 16  # numbers a line

_NUMBER = """\
/* Five digits of x, as 0.0012346 or 1.2346e-05; returns the end. newlib-nano and the C library of AVRs print no %f. */
static char *number(char *text, float x)
{
    char digits[6];
    int exponent = 0;
    if (x < 0.0f) {
        *text++ = '-';
        x = -x;
    }
    while ((x >= 10.0f) && (exponent < 40)) {
        x /= 10.0f;
        exponent++;
    }
    while ((x > 0.0f) && (x < 1.0f) && (exponent > -46)) {
        x *= 10.0f;
        exponent--;
    }
    uint32_t whole = (uint32_t)((x * 10000.0f) + 0.5f);
    if (whole > 99999u) {
        whole = 10000u;
        exponent++;
    }
    for (int k = 5; k > 0; k--) {
        digits[k - 1] = (char)('0' + (int)(whole % 10u));
        whole /= 10u;
    }
    const bool plain = (exponent >= -3) && (exponent <= 4);
    int point = plain ? exponent : 0; /* digits before it, less one */
    if (plain && (exponent < 0)) {
        *text++ = '0';
        *text++ = '.';
        for (int k = exponent + 1; k < 0; k++) {
            *text++ = '0';
        }
        point = 5;
    }
    for (int k = 0; k < 5; k++) {
        *text++ = digits[k];
        if ((k == point) && (k < 4)) {
            *text++ = '.';
        }
    }
    if (!plain) {
        *text++ = 'e';
        *text++ = (exponent < 0) ? '-' : '+';
        exponent = (exponent < 0) ? -exponent : exponent;
        *text++ = (char)('0' + (exponent / 10));
        *text++ = (char)('0' + (exponent % 10));
    }
    return text;
}

static char *copied(char *text, const char *from)
{
    while (*from != '\\0') {
        *text++ = *from++;
    }
    return text;
}
"""


def example_files(deployment: Deployment) -> Files:
    """Name -> text."""
    return {
        f"{deployment.name}_example.h": _header(deployment),
        f"{deployment.name}_example.c": _source(deployment),
    }


def _header(d: Deployment) -> str:
    seconds = len(d.playback.counts) / d.sample_rate
    return "\n".join(
        [
            f"/* {d.name}_example.h - {seconds:.3g} s of a recorded motion, in place of your sensors.",
            " *",
            f" * {d.banner} */",
            f"#ifndef {d.upper}_EXAMPLE_H",
            f"#define {d.upper}_EXAMPLE_H",
            "",
            f'#include "{d.name}_identifier.h"',
            "",
            f"#define {d.upper}_EXAMPLE_TICKS {len(d.playback.counts)}u",
            f"#define {d.upper}_EXAMPLE_LINE {_longest_line(d)} /* characters, with the 0 at the end */",
            "",
            "#ifdef __cplusplus",
            'extern "C" {',
            "#endif",
            "",
            "/* The samples of a tick. Returns false behind the last one. */",
            f"bool {d.name}_example_sample(uint32_t tick, {d.sample_type} sample[{d.upper}_SAMPLES]);",
            "",
            "/* Parameter k as text, as in 'R = 1.2043 +- 0.00420 ohm'; k at most the number of parameters. */",
            f"const char *{d.name}_example_line(int k, char line[{d.upper}_EXAMPLE_LINE]);",
            "",
            "#ifdef __cplusplus",
            "}",
            "#endif",
            "",
            "#endif",
            "",
        ]
    )


def _longest_line(d: Deployment) -> int:
    number = len("-1.2346e-05")
    return max(len(f"{one.name} =  +-  {one.unit}") for one in d.parameters) + 2 * number + 1


def _source(d: Deployment) -> str:
    counts = d.playback.counts
    narrow = bool(np.abs(counts).max(initial=0) <= np.iinfo(np.int16).max)
    kind = "int16_t" if narrow else "int32_t"
    table = "PVID_EXAMPLE_TABLE "
    flat = counts.ravel().tolist()
    rows = ["    " + ", ".join(map(str, flat[k : k + _ROW])) + "," for k in range(0, len(flat), _ROW)]
    if not d.arithmetic.is_integer:
        lsb = ", ".join(float_literal(np.float32(one)) for one in d.playback.lsb)
        scale = ["", f"static const float count[{d.upper}_SAMPLES] = {{{lsb}}}; /* units */"]
        value = f"(float)counts[(tick * {len(d.samples)}u) + (uint32_t)k] * count[k]"
    else:
        scale = []
        value = f"counts[(tick * {len(d.samples)}u) + (uint32_t)k]"
    return "\n".join(
        [
            f"/* {d.banner} */",
            f'#include "{d.name}_example.h"',
            "",
            "#if defined(__AVR__)",
            "#define PVID_EXAMPLE_TABLE __flash",
            "#else",
            "#define PVID_EXAMPLE_TABLE",
            "#endif",
            *scale,
            "",
            "/* [tick][sample] counts */",
            f"static const {table}{kind} counts[{d.upper}_EXAMPLE_TICKS * {d.upper}_SAMPLES] = {{",
            *rows,
            "};",
            "",
            f"bool {d.name}_example_sample(uint32_t tick, {d.sample_type} sample[{d.upper}_SAMPLES])",
            "{",
            f"    if (tick >= {d.upper}_EXAMPLE_TICKS) {{",
            "        return false;",
            "    }",
            f"    for (int k = 0; k < {d.upper}_SAMPLES; k++) {{",
            f"        sample[k] = {value};",
            "    }",
            "    return true;",
            "}",
            "",
            _NUMBER,
            f"const char *{d.name}_example_line(int k, char line[{d.upper}_EXAMPLE_LINE])",
            "{",
            f"    float value[{d.upper}_PARAMETERS];",
            f"    float error[{d.upper}_PARAMETERS];",
            "    char *text = line;",
            f"    if ({d.name}_read(value, error) == 0u) {{",
            '        text = copied(text, "no estimate yet");',
            "    } else {",
            f"        text = copied(text, {d.name}_parameter[k]);",
            '        text = copied(text, " = ");',
            "        text = number(text, value[k]);",
            '        text = copied(text, " +- ");',
            "        text = number(text, error[k]);",
            f'        text = copied(text, ({d.name}_unit[k][0] == \'\\0\') ? "" : " ");',
            f"        text = copied(text, {d.name}_unit[k]);",
            "    }",
            "    *text = '\\0';",
            "    return line;",
            "}",
            "",
        ]
    )


def expected(d: Deployment) -> list[str]:
    """What the example prints at its end: the lines of a README."""
    playback = d.playback
    if playback.value is None or playback.error is None:
        return ["no estimate yet"]
    return [
        f"{one.name} = {_five(value)} +- {_five(error)} {one.unit}".rstrip()
        for one, value, error in zip(d.parameters, playback.value, playback.error, strict=True)
    ]


def _five(value: float) -> str:
    """As the C prints it, but for the rounding of the last digit."""
    plain = value == 0 or 1e-3 <= abs(value) < 1e5
    return f"{value:#.5g}".removesuffix(".") if plain else f"{value:.4e}"
