"""A folder for a project of STM32CubeMX or CubeIDE: the library, and an application of three calls."""

from __future__ import annotations

from pvid.deploy.cmake import target
from pvid.deploy.deployment import Deployment, Files
from pvid.deploy.example import example_files
from pvid.deploy.library import library_files, licence, under
from pvid.deploy.readme import readme

_HEADER = """\
/* {name}_app.h - three calls for the USER CODE of main.c. */
#ifndef {upper}_APP_H
#define {upper}_APP_H

#ifdef __cplusplus
extern "C" {{
#endif

/* USER CODE BEGIN 2, before HAL_TIM_Base_Start_IT. Returns 0, or the number of the wrong field. */
int {name}_app_start(void);

/* In HAL_TIM_PeriodElapsedCallback of a timer with a period of {upper}_PERIOD_US. */
void {name}_app_tick(void);

/* USER CODE BEGIN 3, in the endless loop. Prints when there is something new; returns whether the example has ended. */
int {name}_app_poll(void);

#ifdef __cplusplus
}}
#endif

#endif
"""

_SOURCE = """\
/* {name}_app.h. Put your sensors in place of {name}_example_sample. Prints texts alone: newlib-nano has no %f. */
#include "{name}_app.h"

#include <stdio.h>

#include "{name}_example.h"

static volatile uint32_t tick;

int {name}_app_start(void)
{{
    const pvid_status status = {begin}();
    if (status != PVID_OK) {{
        (void)puts(pvid_status_text(status));
    }}
    return (int)status;
}}

void {name}_app_tick(void)
{{
    {type} sample[{upper}_SAMPLES];
    if ({name}_example_sample(tick, sample)) {{
        (void){name}_step(sample);
        tick++;
    }}
}}

int {name}_app_poll(void)
{{
    static uint32_t shown;
    float value[{upper}_PARAMETERS];
    float error[{upper}_PARAMETERS];
    const int ended = (tick >= {upper}_EXAMPLE_TICKS) ? 1 : 0;
    const uint32_t number = {name}_read(value, error);
    if (number != shown) {{
        shown = number;
        for (int k = 0; k < {upper}_EXAMPLE_LINES; k++) {{
            char line[{upper}_EXAMPLE_LINE];
            (void)puts({name}_example_line(k, line));
        }}
    }}
    return ended;
}}
"""


def package(d: Deployment) -> Files:
    """Name -> text."""
    library = library_files(d)
    app = {
        f"{d.name}_app.h": _HEADER.format(name=d.name, upper=d.upper),
        f"{d.name}_app.c": _SOURCE.format(name=d.name, upper=d.upper, begin=d.begin, type=d.sample_type),
    }
    steps = [
        f"Toolchain CMake: in CMakeLists.txt `add_subdirectory({d.library})` and "
        f"`target_link_libraries(${{CMAKE_PROJECT_NAME}} {d.library}_app)`. CubeIDE: copy `src` and `app` into the "
        "project and add both as include paths.",
        f"A timer of {1e6 / d.sample_rate:g} us with its interrupt; in main.c `{d.name}_app_start()`, then "
        f"`HAL_TIM_Base_Start_IT`, `{d.name}_app_tick()` in `HAL_TIM_PeriodElapsedCallback`, `{d.name}_app_poll()` in "
        "the loop.",
        "`puts` goes where your `_write` or `__io_putchar` sends it, a UART for instance.",
    ]
    cmake = target(d, library) + "\n".join(
        [
            "",
            f"add_library({d.library}_app STATIC app/{d.name}_app.c app/{d.name}_example.c)",
            f"target_include_directories({d.library}_app PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}}/app)",
            f"target_link_libraries({d.library}_app PUBLIC {d.library})",
            f"set_target_properties({d.library}_app PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON)",
            "",
        ]
    )
    return (
        library
        | licence()
        | under("app", app | example_files(d))
        | {
            "CMakeLists.txt": cmake,
            "README.md": readme(
                d,
                "for STM32CubeMX",
                steps,
                ["The timer's priority must leave time for a step; `read` may be interrupted by it."],
            ),
        }
    )
