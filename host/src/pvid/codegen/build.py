"""A folder with the generated files of a model: C, its twin, a CMake target and a test."""

from __future__ import annotations

from pathlib import Path

from pvid.base.atomic_write import appearing
from pvid.base.errors import PvidError
from pvid.codegen import files_f32, self_test, twin_file
from pvid.codegen.banner import banner
from pvid.codegen.functions import ModelFunctions, functions_of
from pvid.model.compiled import CompiledModel

_CMAKE = """\
# {banner}
#
# In your own CMakeLists.txt, behind what provides pvid::pvid (add_subdirectory, FetchContent or find_package):
#
#     add_subdirectory({name})
#     target_link_libraries(my_firmware PRIVATE {name})
cmake_minimum_required(VERSION 3.20)
if(CMAKE_SOURCE_DIR STREQUAL CMAKE_CURRENT_SOURCE_DIR)
  project({name} LANGUAGES C)
endif()
if(NOT TARGET pvid::pvid)
  find_package(pvid REQUIRED CONFIG)
endif()

add_library({name} STATIC {sources})
target_include_directories({name} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
target_link_libraries({name} PUBLIC pvid::pvid)
set_target_properties({name} PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF)
if(CMAKE_C_COMPILER_ID MATCHES "GNU|Clang")
  target_compile_options({name} PRIVATE -ffp-contract=off -fno-fast-math)
endif()

# The generated functions against the bits of their twin: ctest.
option({upper}_TEST "Build the test of {name}" ${{PROJECT_IS_TOP_LEVEL}})
if({upper}_TEST)
  enable_testing()
  add_executable({name}_test {name}_test.c)
  target_link_libraries({name}_test PRIVATE {name})
  set_target_properties({name}_test PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF)
  add_test(NAME {name} COMMAND {name}_test)
endif()
"""


def files_of(functions: ModelFunctions, command: str) -> dict[str, str]:
    """Name -> text of each file."""
    name = functions.name
    files = {
        f"{name}.h": files_f32.header(functions, command),
        f"{name}_f32.c": files_f32.source(functions, command),
        f"{name}_twin.py": twin_file.text(functions, command),
        f"{name}_test.c": self_test.source(functions, command),
    }
    sources = " ".join(one for one in files if one.endswith(".c") and not one.endswith("_test.c"))
    files["CMakeLists.txt"] = _CMAKE.format(
        banner="\n# ".join(banner(functions, command)), name=name, upper=name.upper(), sources=sources
    )
    return files


def build(compiled: CompiledModel, directory: Path, command: str | None = None) -> list[Path]:
    """Writes the files of a model.

    Parameters
    ----------
    compiled
        The model.
    directory
        Where; it is made if there is none.
    command
        For the banner; `pvid model build NAME` by default.

    Returns
    -------
    The files.
    """
    files = files_of(functions_of(compiled), command or f"pvid model build {compiled.name}")
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, text in files.items():
        with appearing(directory / name) as path:
            path.write_text(text, encoding="utf-8")
        paths.append(directory / name)
    return paths


def check(compiled: CompiledModel, directory: Path, command: str | None = None) -> None:
    """Whether the files in a folder are those of the model.

    Raises
    ------
    PvidError
        For the first file that is missing or differs.
    """
    files = files_of(functions_of(compiled), command or f"pvid model build {compiled.name}")
    for name, text in files.items():
        path = directory / name
        if not path.is_file():
            raise PvidError(f"{path} is missing: build the model again")
        if path.read_text(encoding="utf-8") != text:
            raise PvidError(f"{path} is not what {compiled.name} generates now: build the model again")
