"""A folder for add_subdirectory, with an example for this computer or a board."""

from __future__ import annotations

from pvid.codegen.cmake import COMPILE_OPTIONS
from pvid.deploy.deployment import Deployment, Files
from pvid.deploy.example import example_files
from pvid.deploy.library import indented, library_files, licence, sources, under
from pvid.deploy.readme import readme

_CMAKE = """\
# In your own CMakeLists.txt:
#
#     add_subdirectory({library})
#     target_link_libraries(my_firmware PRIVATE {library})
cmake_minimum_required(VERSION 3.16)
if(CMAKE_SOURCE_DIR STREQUAL CMAKE_CURRENT_SOURCE_DIR)
  project({library} LANGUAGES C)
  if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
    set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
  endif()
endif()

set(PVID_MATH_LIBRARY m CACHE STRING "The library that has sqrtf")
add_library({library} STATIC
{sources}
)
target_include_directories({library} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}}/src)
set_target_properties({library} PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF)
if(CMAKE_C_COMPILER_ID MATCHES "GNU|Clang")
  target_compile_options({library} PRIVATE {options})
endif()
target_link_libraries({library} PUBLIC ${{PVID_MATH_LIBRARY}})
"""

_EXAMPLE_TARGET = """
if(CMAKE_SOURCE_DIR STREQUAL CMAKE_CURRENT_SOURCE_DIR)
  add_executable({name}_example example/main.c example/{name}_example.c)
  target_link_libraries({name}_example PRIVATE {library})
  set_target_properties({name}_example PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON)
endif()
"""

MAIN = """\
/* Identifies a recorded motion and prints the parameters. Put your sensors in place of {name}_example_sample. */
#include <stdio.h>

#include "{name}_example.h"

int main(void)
{{
    {type} sample[{upper}_SAMPLES];
    const pvid_status status = {begin}();
    if (status != PVID_OK) {{
        (void)puts(pvid_status_text(status));
        return 1;
    }}
    for (uint32_t tick = 0; {name}_example_sample(tick, sample); tick++) {{
        (void){name}_step(sample);
    }}
    for (int k = 0; k < {upper}_EXAMPLE_LINES; k++) {{
        char line[{upper}_EXAMPLE_LINE];
        (void)puts({name}_example_line(k, line));
    }}
    return 0;
}}
"""


def target(d: Deployment, library: Files) -> str:
    """The CMake target of the library."""
    return _CMAKE.format(library=d.library, sources=indented(sources(library), 2), options=COMPILE_OPTIONS)


def main_of(d: Deployment) -> str:
    """A program with standard output."""
    return MAIN.format(name=d.name, upper=d.upper, begin=d.begin, type=d.sample_type)


def package(d: Deployment) -> Files:
    """Name -> text."""
    library = library_files(d)
    steps = [
        f"`cmake -B build && cmake --build build && build/{d.name}_example`.",
        f"In your own project: `add_subdirectory({d.library})` and "
        f"`target_link_libraries(my_firmware PRIVATE {d.library})`.",
    ]
    return (
        library
        | licence()
        | under("example", {"main.c": main_of(d), **example_files(d)})
        | {
            "CMakeLists.txt": target(d, library) + _EXAMPLE_TARGET.format(name=d.name, library=d.library),
            "README.md": readme(
                d, "for CMake", steps, ["A toolchain without a libm that has sqrtf: `-DPVID_MATH_LIBRARY=`."]
            ),
        }
    )
