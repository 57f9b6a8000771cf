"""NAME_example.h and .c: a recorded motion in place of sensors, and an estimate as text without printf's %f."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pvid.codegen.c_text import for_cpp
from pvid.deploy.deployment import Deployment, Files, Quantity
from pvid.design.c_tables import float_literal
from pvid.settings.enums import Reason

Float = npt.NDArray[np.float64]

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


_ESTIMATE = """\
static void estimate(char *text, const char *name, float value, float error, const char *unit)
{
    text = copied(text, name);
    text = copied(text, " = ");
    text = number(text, value);
    text = copied(text, " +- ");
    text = number(text, error);
    text = copied(text, (unit[0] == '\\0') ? "" : " ");
    *copied(text, unit) = '\\0';
}
"""
_REFINED = "refined "


def _refined_line(d: Deployment) -> list[str]:
    if d.second is None:
        return []
    name, upper = d.name, d.upper
    texts = [f"{name}_refined_{one}[r]" for one in ("parameter", "unit")]
    return [
        f"    if (k >= {upper}_PARAMETERS) {{",
        f"        float refined[{upper}_REFINED];",
        f"        float refined_error[{upper}_REFINED];",
        f"        const int r = k - {upper}_PARAMETERS;",
        f'        char *text = copied(line, "{_REFINED}");',
        f"        if ({name}_read_refined(refined, refined_error) == 0u) {{",
        f"            *copied(text, pvid_reason_text({name}_refined_reason())) = '\\0';",
        "        } else {",
        f"            estimate(text, {texts[0]}, refined[r], refined_error[r], {texts[1]});",
        "        }",
        "        return line;",
        "    }",
    ]


def example_files(deployment: Deployment) -> Files:
    """Name -> text."""
    return {f"{deployment.name}_example.h": _header(deployment), f"{deployment.name}_example.c": _source(deployment)}


def _header(d: Deployment) -> str:
    seconds = len(d.playback.counts) / d.sample_rate
    declared = [
        "/* The samples of a tick. Returns false behind the last one. */",
        f"bool {d.name}_example_sample(uint32_t tick, {d.sample_type} sample[{d.upper}_SAMPLES]);",
        "",
        "/* Line k as text, as in 'R = 1.2043 +- 0.00420 ohm'; k less than the number of lines. */",
        f"const char *{d.name}_example_line(int k, char line[{d.upper}_EXAMPLE_LINE]);",
        "",
    ]
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
            f"#define {d.upper}_EXAMPLE_LINES {_lines(d)} /* {_all_lines(d)} */",
            f"#define {d.upper}_EXAMPLE_LINE {_longest_line(d)} /* characters, with the 0 at the end */",
            "",
            *for_cpp(declared),
            "",
            "#endif",
            "",
        ]
    )


def _lines(d: Deployment) -> str:
    return f"{d.upper}_PARAMETERS" if d.second is None else f"({d.upper}_PARAMETERS + {d.upper}_REFINED)"


def _all_lines(d: Deployment) -> str:
    return "one for each parameter" if d.second is None else "one for each parameter, and for each refined one"


def _longest_line(d: Deployment) -> int:
    number = len("-1.2346e-05")
    refined = () if d.second is None else d.second.parameters
    texts = [f"{_REFINED}{one.name} =  +-  {one.unit}" for one in (*d.parameters, *refined)]
    held = max(len(f"{_REFINED}{one.text}") for one in Reason) if refined else 0
    return max(max(map(len, texts)) + 2 * number, held) + 1


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
            _ESTIMATE,
            f"const char *{d.name}_example_line(int k, char line[{d.upper}_EXAMPLE_LINE])",
            "{",
            *_refined_line(d),
            f"    float value[{d.upper}_PARAMETERS];",
            f"    float error[{d.upper}_PARAMETERS];",
            f"    if ({d.name}_read(value, error) == 0u) {{",
            "        *copied(line, \"no estimate yet\") = '\\0';",
            "    } else {",
            f"        estimate(line, {d.name}_parameter[k], value[k], error[k], {d.name}_unit[k]);",
            "    }",
            "    return line;",
            "}",
            "",
        ]
    )


def expected(d: Deployment) -> list[str]:
    """What the example prints at its end: the lines of a README."""
    playback, second = d.playback, d.second
    lines = _estimates(d.parameters, playback.value, playback.error) or ["no estimate yet"] * len(d.parameters)
    if second is not None:
        refined = _estimates(second.parameters, second.value, second.error)
        lines += [f"{_REFINED}{one}" for one in refined or [second.held.text] * len(second.parameters)]
    return lines


def _estimates(parameters: Sequence[Quantity], value: Float | None, error: Float | None) -> list[str]:
    """A line for each; none where there is no estimate."""
    if value is None or error is None:
        return []
    return [
        f"{one.name} = {_five(x)} +- {_five(se)} {one.unit}".rstrip()
        for one, x, se in zip(parameters, value, error, strict=True)
    ]


def _five(value: float) -> str:
    """As the C prints it, but for the rounding of the last digit."""
    plain = value == 0 or 1e-3 <= abs(value) < 1e5
    return f"{value:#.5g}".removesuffix(".") if plain else f"{value:.4e}"
