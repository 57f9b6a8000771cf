"""CMakeLists.txt of a generated model: a target, with an option for each of its forms."""

from __future__ import annotations

from collections.abc import Sequence

from pvid.codegen.c_text import banner
from pvid.codegen.generated import GeneratedModel

COMPILE_OPTIONS = "-ffp-contract=off -fno-fast-math -fno-delete-null-pointer-checks"  # as PvidCompile.cmake
_TARGET = """\
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
  target_compile_options({name} PRIVATE {options})
endif()
"""

_CMAKE = """
# {name}_strong.h, an identifier from derivatives of the signals: includes strong/strong_f32.h of pvid's sources; and
# {name}_strong_q31.h, the same with integers only, with the formats of a rig.
option({upper}_STRONG "Build the strong form of {name}" OFF)
option({upper}_STRONG_Q31 "Build the fixed-point strong form of {name}" OFF)
if(({upper}_STRONG AND EXISTS ${{CMAKE_CURRENT_SOURCE_DIR}}/{name}_strong_f32.c)
   OR ({upper}_STRONG_Q31 AND EXISTS ${{CMAKE_CURRENT_SOURCE_DIR}}/{name}_strong_q31.c))
  get_target_property({name}_pvid pvid::pvid ALIASED_TARGET)
  if(NOT {name}_pvid)
    message(FATAL_ERROR "{upper}_STRONG needs the sources of pvid: add_subdirectory or FetchContent, not find_package")
  endif()
  get_target_property({name}_pvid_sources ${{{name}_pvid}} SOURCE_DIR)
  target_include_directories({name} PRIVATE ${{{name}_pvid_sources}}/src)
  target_sources({name} PRIVATE $<$<BOOL:${{{upper}_STRONG}}>:{name}_strong_f32.c>
                                $<$<BOOL:${{{upper}_STRONG_Q31}}>:{name}_strong_q31.c>)
endif()

# {name}_weak.h, the model for pvid/weak.h: needs a pvid of the sizes that its header names.
option({upper}_WEAK "Build the weak form of {name}" OFF)
if({upper}_WEAK AND EXISTS ${{CMAKE_CURRENT_SOURCE_DIR}}/{name}_weak_f32.c)
  target_sources({name} PRIVATE {name}_weak_f32.c)
endif()

# {name}_refine_design_f32.h, the second stage (pvid/refine.h): compiles pvid itself with the equations of {name}.
option({upper}_REFINE "Compile pvid with the refinement of {name}" OFF)
if({upper}_REFINE AND EXISTS ${{CMAKE_CURRENT_SOURCE_DIR}}/refine_model_f32.h)
  get_target_property({name}_pvid pvid::pvid ALIASED_TARGET)
  if(NOT {name}_pvid)
    message(FATAL_ERROR "{upper}_REFINE needs the sources of pvid: add_subdirectory or FetchContent, not find_package")
  endif()
  target_include_directories(${{{name}_pvid}} BEFORE PUBLIC $<BUILD_INTERFACE:${{CMAKE_CURRENT_SOURCE_DIR}}>)
  target_compile_definitions(${{{name}_pvid}} PUBLIC PVID_REFINEMENT=1)
endif()

{fixed_weak}# The generated functions against the bits of their twin: ctest.
option({upper}_TEST "Build the test of {name}" ${{PROJECT_IS_TOP_LEVEL}})
if({upper}_TEST)
  enable_testing()
  add_executable({name}_test {name}_test.c)
  target_link_libraries({name}_test PRIVATE {name})
  set_target_properties({name}_test PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF)
  add_test(NAME {name} COMMAND {name}_test)
endif()
"""

_CMAKE_Q31 = """\
# {name}_weak_q31.h, the same for pvid/weak_q31.h, integers only, with the formats of a rig.
option({upper}_WEAK_Q31 "Build the fixed-point weak form of {name}" OFF)
if({upper}_WEAK_Q31 AND EXISTS ${{CMAKE_CURRENT_SOURCE_DIR}}/{name}_weak_q31.c)
  target_sources({name} PRIVATE {name}_weak_q31.c)
endif()

"""


def target(name: str, banner: Sequence[str], sources: Sequence[str]) -> str:
    """The head of CMakeLists.txt, and the target of these files; it can be a project of its own."""
    return _TARGET.format(
        name=name, banner="\n# ".join(banner), sources=" ".join(sources), options=COMPILE_OPTIONS
    )  # fmt: skip


def printed(model: GeneratedModel) -> dict[str, str]:
    """CMakeLists.txt."""
    words = {"name": model.name, "upper": model.name.upper()}
    cores = ["f32", *(["q31"] if model.fixed.made is not None else [])]
    sources = [f"{model.name}_{core}.c" for core in cores]
    fixed_weak = _CMAKE_Q31.format(**words) if model.options.weak_q31_for_run is not None else ""
    head = target(model.name, banner(model.functions, model.command), sources)
    return {"CMakeLists.txt": head + _CMAKE.format(fixed_weak=fixed_weak, **words)}
