"""A Zephyr module: zephyr/module.yml, Kconfig, CMakeLists.txt, src/, and a sample."""

from __future__ import annotations

from pvid.codegen.cmake import COMPILE_OPTIONS
from pvid.deploy.deployment import Deployment, Files
from pvid.deploy.example import example_files
from pvid.deploy.library import indented, library_files, licence, sources, under
from pvid.deploy.readme import readme

_MODULE = """\
name: {library}
build:
  cmake: .
  kconfig: Kconfig
"""

_KCONFIG = """\
config {upper}
    bool "pvid: {title}"
    help
      Identifies {parameters} while the mechanism runs. Static memory, no heap.
"""

_CMAKE = """\
if(CONFIG_{upper})
  zephyr_library_named({library})
  zephyr_library_sources(
{sources}
  )
  zephyr_include_directories(src)
  zephyr_library_compile_options({options})
endif()
"""

_MAIN = """\
/* Identifies a recorded motion in a thread at the rate of a timer. Put your sensors in place of
 * {name}_example_sample. */
#include <zephyr/kernel.h>
#include <zephyr/sys/printk.h>

#include "{name}_example.h"

K_TIMER_DEFINE(period, NULL, NULL);

int main(void)
{{
    {type} sample[{upper}_SAMPLES];
    const pvid_status status = {begin}();
    if (status != PVID_OK) {{
        printk("the configuration is refused: %s\\n", pvid_status_text(status));
        return 1;
    }}
    k_timer_start(&period, K_USEC({upper}_PERIOD_US), K_USEC({upper}_PERIOD_US));
    for (uint32_t tick = 0; {name}_example_sample(tick, sample); tick++) {{
        (void)k_timer_status_sync(&period);
        (void){name}_step(sample);
    }}
    k_timer_stop(&period);
    for (int k = 0; k < {upper}_EXAMPLE_LINES; k++) {{
        char line[{upper}_EXAMPLE_LINE];
        printk("%s\\n", {name}_example_line(k, line));
    }}
    return 0;
}}
"""

_APPLICATION = """\
cmake_minimum_required(VERSION 3.20)
list(APPEND ZEPHYR_EXTRA_MODULES ${{CMAKE_CURRENT_SOURCE_DIR}}/../..)
find_package(Zephyr REQUIRED HINTS $ENV{{ZEPHYR_BASE}})
project({name}_example C)
target_sources(app PRIVATE src/main.c src/{name}_example.c)
"""

_SAMPLE = """\
sample:
  name: "{title}"
tests:
  sample.{library}:
    harness: console
    harness_config:
      type: one_line
      regex:
        - "{first} = "
"""


def package(d: Deployment) -> Files:
    """Name -> text."""
    library = library_files(d)
    symbol = d.library.upper()
    sample = f"samples/{d.name}"
    parameters = ", ".join(one.name for one in d.parameters)
    steps = [
        f"`west build -b BOARD {sample} -t run` (or `-t flash`); the sample adds this module itself.",
        f"In your own project: this folder in `ZEPHYR_EXTRA_MODULES` or west.yml, and `CONFIG_{symbol}=y` in prj.conf.",
    ]
    files = {
        "zephyr/module.yml": _MODULE.format(library=d.library),
        "Kconfig": _KCONFIG.format(upper=symbol, title=d.title, parameters=parameters),
        "CMakeLists.txt": _CMAKE.format(
            upper=symbol, library=d.library, sources=indented(sources(library), 4), options=COMPILE_OPTIONS
        ),
        f"{sample}/CMakeLists.txt": _APPLICATION.format(name=d.name),
        f"{sample}/prj.conf": f"CONFIG_{symbol}=y\n{d.arithmetic.zephyr}CONFIG_MAIN_STACK_SIZE=4096\n",
        f"{sample}/sample.yaml": _SAMPLE.format(title=d.title, library=d.library, first=d.parameters[0].name),
        "README.md": readme(
            d, "for Zephyr", steps, ["A processor without an FPU refuses CONFIG_FPU: delete the line."]
        ),
    }
    main = {"main.c": _MAIN.format(name=d.name, upper=d.upper, begin=d.begin, type=d.sample_type), **example_files(d)}
    return library | licence() | files | under(f"{sample}/src", main)
