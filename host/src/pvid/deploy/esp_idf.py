"""An ESP-IDF component: idf_component.yml, CMakeLists.txt, src/, and an example as a project."""

from __future__ import annotations

from pvid.base.version import __version__
from pvid.codegen.cmake import COMPILE_OPTIONS
from pvid.deploy.deployment import Deployment, Files
from pvid.deploy.example import example_files
from pvid.deploy.library import indented, library_files, licence, sources, under
from pvid.deploy.readme import readme

_COMPONENT = """\
idf_component_register(
  SRCS
{sources}
  INCLUDE_DIRS src
)
target_compile_options(${{COMPONENT_LIB}} PRIVATE {options})
"""

_MANIFEST = """\
version: "{version}"
description: "Identifies {parameters} of a mechanism while it runs: {title}"
license: MIT
dependencies:
  idf: ">=4.4"
"""

_MAIN = """\
/* Identifies a recorded motion: a timer steps, the main task reads. Put your sensors in place of
 * {name}_example_sample. */
#include "esp_err.h"
#include "esp_log.h"
#include "esp_timer.h"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"

#include "{name}_example.h"

static const char *TAG = "pvid";
static volatile uint32_t tick;

/* Every {upper}_PERIOD_US, in the task of esp_timer. */
static void step(void *unused)
{{
    {type} sample[{upper}_SAMPLES];
    (void)unused;
    if ({name}_example_sample(tick, sample)) {{
        (void){name}_step(sample);
        tick++;
    }}
}}

void app_main(void)
{{
    const pvid_status status = {begin}();
    if (status != PVID_OK) {{
        ESP_LOGE(TAG, "the configuration is refused: %s", pvid_status_text(status));
        return;
    }}
    const esp_timer_create_args_t arguments = {{.callback = step, .name = "pvid"}};
    esp_timer_handle_t timer;
    ESP_ERROR_CHECK(esp_timer_create(&arguments, &timer));
    ESP_ERROR_CHECK(esp_timer_start_periodic(timer, {upper}_PERIOD_US));
    while (tick < {upper}_EXAMPLE_TICKS) {{
        vTaskDelay(pdMS_TO_TICKS(100));
    }}
    ESP_ERROR_CHECK(esp_timer_stop(timer));
    for (int k = 0; k < {upper}_EXAMPLE_LINES; k++) {{
        char line[{upper}_EXAMPLE_LINE];
        ESP_LOGI(TAG, "%s", {name}_example_line(k, line));
    }}
}}
"""

_PROJECT = """\
cmake_minimum_required(VERSION 3.16)
include($ENV{{IDF_PATH}}/tools/cmake/project.cmake)
project({name}_example)
"""


def package(d: Deployment) -> Files:
    """Name -> text."""
    library = library_files(d)
    example = f"examples/{d.name}"
    main = {
        "main.c": _MAIN.format(name=d.name, upper=d.upper, begin=d.begin, type=d.sample_type),
        **example_files(d),
        "CMakeLists.txt": f"idf_component_register(SRCS main.c {d.name}_example.c INCLUDE_DIRS .)\n",
        "idf_component.yml": f'dependencies:\n  {d.library}:\n    version: "*"\n    override_path: "../../.."\n',
    }
    steps = [
        f"`cd {example} && idf.py set-target esp32 && idf.py flash monitor`.",
        f"In your own project: copy this folder to `components/{d.library}`.",
    ]
    return (
        library
        | licence()
        | under(f"{example}/main", main)
        | {
            "CMakeLists.txt": _COMPONENT.format(sources=indented(sources(library), 4), options=COMPILE_OPTIONS),
            "idf_component.yml": _MANIFEST.format(
                version=__version__, title=d.title, parameters=", ".join(one.name for one in d.parameters)
            ),
            f"{example}/CMakeLists.txt": _PROJECT.format(name=d.name),
            "README.md": readme(
                d,
                "for ESP-IDF",
                steps,
                ["A step runs in the task of esp_timer; its stack (menuconfig) needs 1 kB more."],
            ),
        }
    )
