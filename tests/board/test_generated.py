"""The generated functions of all mechanisms on emulated boards: the bits of their twins, also in soft float."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import ROOT

from bench.kinds import KINDS
from pvid.board.boards import BOARDS, BUILD, build, run
from pvid.codegen.build import build as generate
from pvid.codegen.generated import GeneratedModel
from pvid.models import mechanisms

TIMEOUT_S = 120.0
NEEDLESS = "/src/(judge|persist|refine|solve|strong|weak)/|/models/"  # of the core: they call its arithmetic alone
LISTS = """
cmake_minimum_required(VERSION 3.20)
project(generated LANGUAGES C)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE RelWithDebInfo CACHE STRING "Build type" FORCE)
endif()
option(PVID_DEVELOPER "Many warnings, all of them errors" OFF)
add_subdirectory({root}/firmware firmware)
set(tests "")
foreach(name IN ITEMS {names})
  add_subdirectory(${{name}})
  list(APPEND tests ${{name}}/${{name}}_test.c)
endforeach()
pvid_add_image(generated main.c ${{tests}} {root}/firmware/apps/replay/report.c)
target_include_directories(generated PRIVATE {root}/firmware/apps/replay)
target_compile_definitions(generated PRIVATE PVID_GENERATED_WITHOUT_MAIN)
target_link_libraries(generated PRIVATE {names_spaced})
"""
MAIN = """
#include "port.h"
#include "report.h"
{includes}
{declarations}

/* Instructions of a call, less those of counting. */
#define REPORT_COST(name, call)                                         \\
    do {{                                                               \\
        const uint32_t first = pvid_port_instructions();                \\
        const uint32_t second = pvid_port_instructions();               \\
        call;                                                           \\
        const uint32_t third = pvid_port_instructions();                \\
        report_number(name, (third - second) - (second - first));       \\
    }} while (0)

int main(void)
{{
    static float in[16];
    static float out[16];
    static int32_t counts[16];
    static int32_t channels[16];
    pvid_port_init();
    report_number("counts_per_1024", pvid_port_counts_per_1024());
{calls}
    return 0;
}}
"""


@pytest.fixture(scope="module")
def sources() -> Path:
    """A project with the generated folders of all mechanisms; in one place, because the boards' trees keep it."""
    folder = BUILD / "runs" / "generated"
    folder.mkdir(parents=True, exist_ok=True)
    names = KINDS
    for name in names:
        generate(GeneratedModel(mechanisms.compiled_of(name), "test"), folder / name)
    lists = LISTS.format(root=ROOT, names=" ".join(names), names_spaced=" ".join(names))
    (folder / "CMakeLists.txt").write_text(lists, encoding="utf-8")
    calls = []
    for name in names:
        calls.append(f'    report_number("{name}_faults", {name}_faults());')
        calls.append(f'    REPORT_COST("{name}_f32", {name}_channels_f32(in, out));')
        calls.append(f'    REPORT_COST("{name}_q31", (void){name}_channels_q31(counts, channels));')
    text = MAIN.format(
        includes="\n".join(f'#include "{name}.h"\n#include "{name}_q31.h"' for name in names),
        declarations="\n".join(f"unsigned {name}_faults(void);" for name in names),
        calls="\n".join(calls),
    )
    (folder / "main.c").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    "name",
    [
        "microbit",
        pytest.param("mps2-an386", marks=pytest.mark.long),
        pytest.param("mps3-an547", marks=pytest.mark.long),
        pytest.param("virt-rv32imac", marks=pytest.mark.long),
    ],
)
def test_all_results_have_the_bits_of_the_twins(
    name: str, sources: Path, record_property: Callable[[str, object], None]
) -> None:
    board = BOARDS[name]
    tree = BUILD / f"{board.name}-generated"
    build(board, tree, {"PVID_LEAVE_OUT": NEEDLESS}, source=sources)
    outcome = run(board, tree / "generated.elf", TIMEOUT_S)
    found = {word: int(number) for word, number in re.findall(r"^([a-z_0-9]+) ([0-9]+)$", outcome.text, re.MULTILINE)}
    assert [found[f"{one}_faults"] for one in KINDS] == [0] * len(KINDS), outcome.text
    for one in KINDS:
        for core in ("f32", "q31"):
            count = found[f"{one}_{core}"] * 1024 / found["counts_per_1024"]
            record_property(f"{one}_{core}_instructions", round(count))
            print(one, core, round(count))
