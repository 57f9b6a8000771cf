"""A folder with the generated files of a model: C, its twin, a CMake target and a test."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pvid.base.atomic_write import write_files
from pvid.base.errors import PvidError
from pvid.codegen import (
    files_design,
    files_f32,
    files_q31,
    files_refine,
    files_refine_design,
    files_strong,
    files_strong_design,
    files_weak,
    refine_twin,
    self_test,
    twin_file,
)
from pvid.codegen.banner import banner
from pvid.codegen.fitted_sizes import config_header, fitted_sizes
from pvid.codegen.fixed_model import fixed_model
from pvid.codegen.functions import ModelFunctions, functions_of
from pvid.codegen.reaches import Reaches, reaches_of
from pvid.codegen.refine import RefineFunctions, has_skew, refine_functions_of, without_optional
from pvid.codegen.strong import renamed, strong_functions_of
from pvid.codegen.strong_twin import StrongModelConfig
from pvid.codegen.weak import weak_functions_of
from pvid.codegen.weak_twin import weak_model_of
from pvid.model.compiled import CompiledModel
from pvid.model.signals import sgn
from pvid.model.strong import strong_form
from pvid.settings.refine import RefineConfig
from pvid.settings.weak import WeakConfig
from pvid.setup.weak import with_soft_signs
from pvid.setup.weak_sizes import sizes_of_design, sizes_of_model

COMPILE_OPTIONS = "-ffp-contract=off -fno-fast-math -fno-delete-null-pointer-checks"  # as PvidCompile.cmake
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
  target_compile_options({name} PRIVATE {options})
endif()

# {name}_strong.h, an identifier from derivatives of the signals: needs a pvid of larger sizes, which its header names.
option({upper}_STRONG "Build the strong form of {name}" OFF)
if({upper}_STRONG AND EXISTS ${{CMAKE_CURRENT_SOURCE_DIR}}/{name}_strong_f32.c)
  target_sources({name} PRIVATE {name}_strong_f32.c)
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


@dataclass(frozen=True)
class Options:
    """What is generated besides the functions in float32.

    Attributes
    ----------
    reaches : of the inputs, for the fixed-point formats
    soft_signs : argument of a sgn, as in phi_1 -> width of the soft sign v / (|v| + width) in its place
    strong : the strong form as well, an identifier from derivatives of the signals
    design : of the weak form for a rig; None: no NAME_design_f32.h
    fixed_weak : files of the fixed-point weak form for a rig, name -> text (pvid.configuration.weak_files_q31)
    strong_design : settings of the strong form for a rig; None: no NAME_strong_design_f32.h
    refine_design : settings of the refinement for a rig; None: no NAME_refine_design_f32.h
    """

    reaches: Reaches = field(default_factory=Reaches)
    soft_signs: Mapping[str, float] = field(default_factory=dict)
    strong: bool = False
    design: WeakConfig | None = None
    fixed_weak: Mapping[str, str] = field(default_factory=dict)
    strong_design: StrongModelConfig | None = None
    refine_design: RefineConfig | None = None


def files_of(compiled: CompiledModel, command: str, options: Options | None = None) -> dict[str, str]:
    """Name -> text of each file; the fixed-point ones only where fixed point can compute all functions.

    Raises
    ------
    PvidError
        Where a function cannot be generated; for a soft sign that is in no channel.
    """
    chosen = options or Options()
    functions = _functions(compiled, chosen)
    name = functions.name
    files = {
        f"{name}_sizes.h": files_f32.sizes(functions, command),
        f"{name}.h": files_f32.header(functions, command),
        f"{name}_f32.c": files_f32.source(functions, command),
    }
    fixed = None
    if refusal(functions, chosen.reaches) is None:
        fixed = fixed_model(functions, chosen.reaches)
        files[f"{name}_q31.h"] = files_q31.header(fixed, command)
        files[f"{name}_q31.c"] = files_q31.source(fixed, command)
    apart = [f"{name}_test.c", f"{name}_weak_f32.c", f"{name}_weak_q31.c"]
    files |= chosen.fixed_weak
    if weak_refusal(compiled) is None:
        files |= _weak_files(compiled, command, chosen)
    if chosen.strong:
        named = renamed(strong_functions_of(strong_form(compiled)))
        files[f"{name}_strong.h"] = files_strong.header(named, command)
        files[f"{name}_strong_f32.c"] = files_strong.source(named, command)
        apart.append(f"{name}_strong_f32.c")
        if chosen.strong_design is not None:
            files[f"{name}_strong_design_f32.h"] = files_strong_design.header(named, chosen.strong_design, command)
    if refine_refusal(compiled) is None:
        refined = refine_functions(compiled, chosen)
        files["pvid/refine_shape.h"] = files_refine.shape(refined, command)
        files["refine_model_f32.h"] = files_refine.header(refined, command)
        files[f"{name}_refine_twin.py"] = refine_twin.text(refined, command)
        if chosen.refine_design is not None:
            files[f"{name}_refine_design_f32.h"] = files_refine_design.header(refined, chosen.refine_design, command)
    files[f"{name}_twin.py"] = twin_file.text(functions, command, fixed)
    files[f"{name}_test.c"] = self_test.source(functions, command, fixed)
    sources = " ".join(one for one in files if one.endswith(".c") and one not in apart)
    fixed_weak = _CMAKE_Q31.format(name=name, upper=name.upper()) if chosen.fixed_weak else ""
    files["CMakeLists.txt"] = _CMAKE.format(
        options=COMPILE_OPTIONS,
        banner="\n# ".join(banner(functions, command)),
        name=name,
        upper=name.upper(),
        sources=sources,
        fixed_weak=fixed_weak,
    )
    return files


def _weak_files(compiled: CompiledModel, command: str, options: Options) -> dict[str, str]:
    made, model = weak_functions_of(compiled), weak_model_of(compiled)
    files = {
        f"{made.name}_weak.h": files_weak.header(made, model, sizes_of_model(model), command),
        f"{made.name}_weak_f32.c": files_weak.source(made, model, command),
    }
    if options.design is not None:
        design = with_soft_signs(options.design, options.soft_signs)
        names = [f"{one.name} [{one.unit or '1'}]" for one in compiled.unknowns]
        needed = sizes_of_design(design.design)
        files[f"{made.name}_design_f32.h"] = files_design.header(design, needed, command, compiled.title, names)
        files[f"{made.name}_config.h"] = config_header(f"{made.name}_config", fitted_sizes(design), command)
    return files


def refine_functions(compiled: CompiledModel, options: Options | None = None) -> RefineFunctions:
    """Of the refinement in float32; widths of signs that are not chosen are refined."""
    model = without_optional(compiled)
    return refine_functions_of(model, (options or Options()).soft_signs, has_skew(model))


def refine_refusal(compiled: CompiledModel) -> str | None:
    """Why a model gets no files for the refinement; None where it gets them."""
    try:
        files_refine.header(refine_functions(compiled), "")
    except PvidError as error:
        return str(error)
    return None


def weak_refusal(compiled: CompiledModel) -> str | None:
    """Why a model gets no files for the weak engine; None where it gets them."""
    try:
        weak_model_of(compiled)
    except PvidError as error:
        return str(error)
    return None


def _functions(compiled: CompiledModel, options: Options) -> ModelFunctions:
    functions = functions_of(compiled, options.soft_signs)
    signs = {str(one.args[0]) for label in functions.channels.expressions for one in label.atoms(sgn)}
    for name, width in options.soft_signs.items():
        if name not in signs:
            known = f"its signs are of {', '.join(sorted(signs))}" if signs else "it has none"
            raise PvidError(f"{compiled.name} has no sign of {name}: {known}")
        if not 0 < width < math.inf:
            raise PvidError(f"the width of the sign of {name} must be positive, not {width}")
    return functions


def refusal(functions: ModelFunctions, reaches: Reaches | None = None) -> str | None:
    """Why the functions have no fixed-point form; None where they have one.

    Raises
    ------
    PvidError
        For a reach that is given for no input.
    """
    reaches_of(functions, reaches or Reaches())
    try:
        fixed_model(functions, reaches)
    except PvidError as error:
        return str(error)
    return None


def fixed_point_refusal(compiled: CompiledModel, options: Options | None = None) -> str | None:
    """Why a model gets no fixed-point files; None where it gets them."""
    chosen = options or Options()
    return refusal(_functions(compiled, chosen), chosen.reaches)


def build(
    compiled: CompiledModel, directory: Path, command: str | None = None, options: Options | None = None
) -> list[Path]:
    """Writes the files of a model.

    Parameters
    ----------
    compiled
        The model.
    directory
        Where; it is made if there is none.
    command
        For the banner; `pvid model build NAME` by default.
    options
        What is generated besides the functions in float32.

    Returns
    -------
    The files.
    """
    files = files_of(compiled, command or _command(compiled), options)
    directory.mkdir(parents=True, exist_ok=True)
    return write_files(directory, files)


def check(compiled: CompiledModel, directory: Path, command: str | None = None, options: Options | None = None) -> None:
    """Whether the files in a folder are those of the model; see `build`.

    Raises
    ------
    PvidError
        For the first file that is missing or differs.
    """
    for name, text in files_of(compiled, command or _command(compiled), options).items():
        path = directory / name
        if not path.is_file():
            raise PvidError(f"{path} is missing: build the model again")
        if path.read_text(encoding="utf-8") != text:
            raise PvidError(f"{path} is not what {compiled.name} generates now: build the model again")


def _command(compiled: CompiledModel) -> str:
    return f"pvid model build {compiled.name}"
