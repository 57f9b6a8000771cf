"""An application whose sizes are not the library's does not link: every PVID_MAX_, C and C++, static and shared."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from conftest import ROOT

from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, core_sources, public_headers, source

FREESTANDING = f"-I{ROOT / 'firmware' / 'ports' / 'freestanding' / 'include'}"
SOURCES = core_sources()

# Every size of config.h, and another value than its default that is allowed.
OTHER = {
    "PVID_MAX_WINDOW": 81,
    "PVID_MAX_THETA": 12,
    "PVID_MAX_P": 6,
    "PVID_MAX_MOMENTS": 55,
    "PVID_MAX_DECIMATION": 64,
    "PVID_MAX_FUNCTIONS": 12,
    "PVID_MAX_ITERATIONS": 20,
    "PVID_MAX_THETA_Q31": 12,
    "PVID_MAX_MOMENTS_Q31": 78,
    "PVID_MAX_C_Q31": 24,
    "PVID_MAX_SAMPLES": 3,
    "PVID_MAX_RING": 500,
    "PVID_MAX_INPUTS": 15,
    "PVID_MAX_CHANNELS": 9,
    "PVID_MAX_INTEGRANDS": 2,
    "PVID_MAX_HARMONICS": 17,
    "PVID_MAX_KINDS": 1,
    "PVID_MAX_COLUMNS": 14,
    "PVID_MAX_POWER": 6,
    "PVID_MAX_BLOCKS": 1,
    "PVID_MAX_WINDOWS": 0,
    "PVID_FEEDBACK": 0,
}

# Of a build for one design, whose structs have no more than it needs.
EXACT = ("", *(f"_{one}" for one in "SIGNALS JETS RUNS SIGNS GAINS INTEGRANDS CHANNELS PLAIN".split()))

LANGUAGES = {"c": ("gcc", "-std=c99"), "cpp": ("g++", "-std=c++11")}

# The first call of each kind of application; the last one represents files without an init.
FUNCTIONS = (
    "pvid_weak_init_f32",
    "pvid_strong_init_f32",
    "pvid_weak_init_q31",
    "pvid_strong_init_q31",
    "pvid_estimator_init_f32",
    "pvid_estimator_init_q31",
    "pvid_weak_estimate_f32",
)
USER = """#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
static pvid_weak_f32 weak; static pvid_weak_config_f32 weak_config;
static pvid_strong_f32 strong; static pvid_strong_config_f32 strong_config;
static pvid_weak_q31 weak_q31; static pvid_weak_config_q31 weak_config_q31;
static pvid_strong_q31 strong_q31; static pvid_strong_config_q31 strong_config_q31;
static pvid_estimator_f32 estimator; static pvid_estimator_config_f32 estimator_config;
static pvid_estimator_q31 estimator_q31; static pvid_estimator_config_q31 estimator_config_q31;
int main(void)
{
    (void)pvid_weak_init_f32(&weak, &weak_config);
    (void)pvid_strong_init_f32(&strong, &strong_config);
    (void)pvid_weak_init_q31(&weak_q31, &weak_config_q31);
    (void)pvid_strong_init_q31(&strong_q31, &strong_config_q31);
    (void)pvid_estimator_init_f32(&estimator, &estimator_config);
    (void)pvid_estimator_init_q31(&estimator_q31, &estimator_config_q31);
    return (pvid_weak_estimate_f32(&weak) != 0) ? 0 : 1;
}
"""


def run(*command: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, cwd=cwd, check=False)


@pytest.fixture(scope="module")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The library with the default sizes, static and shared, as who copies include and src makes it."""
    folder = tmp_path_factory.mktemp("library")
    done = run("gcc", "-std=c99", "-O0", "-fPIC", *INCLUDES, "-c", *SOURCES, cwd=folder)
    assert done.returncode == 0, done.stderr
    objects = sorted(folder.glob("*.o"))
    made = {"static": folder / "libpvid.a", "shared": folder / "libpvid.so"}
    assert run("ar", "rcs", made["static"], *objects).returncode == 0
    assert run("gcc", "-shared", "-o", made["shared"], *objects, "-lm").returncode == 0
    return made


def user(folder: Path, language: str, *sizes: str) -> Path:
    """The object of an application that was compiled with those sizes."""
    source = folder / f"user.{language}"
    source.write_text(USER, encoding="utf-8")
    compiled = folder / "user.o"
    done = run(*LANGUAGES[language], *sizes, *PUBLIC_INCLUDES, "-c", source, "-o", compiled)
    assert done.returncode == 0, done.stderr
    return compiled


def link(folder: Path, language: str, compiled: Path, library: Path) -> subprocess.CompletedProcess[str]:
    return run(LANGUAGES[language][0], compiled, library, "-lm", "-o", folder / "user")


def test_every_size_of_the_headers_is_tried() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in public_headers())
    assert set(re.findall(r"#ifndef (PVID_MAX_\w+|PVID_FEEDBACK)", text)) == set(OTHER)


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_same_sizes_link(language: str, libraries: dict[str, Path], tmp_path: Path) -> None:
    compiled = user(tmp_path, language)
    for library in libraries.values():
        done = link(tmp_path, language, compiled, library)
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", OTHER)
@pytest.mark.parametrize("language", LANGUAGES)
def test_another_size_is_refused(language: str, name: str, libraries: dict[str, Path], tmp_path: Path) -> None:
    """Each function by itself, with its name and the size in the message."""
    compiled = user(tmp_path, language, f"-D{name}={OTHER[name]}")
    for library in libraries.values():
        done = link(tmp_path, language, compiled, library)
        assert done.returncode != 0
        refused = set(
            re.findall(rf"undefined reference to `(pvid_\w+[fq]3[12])_window(?:\w*[a-z])?{OTHER[name]}_", done.stderr)
        )
        assert refused == set(FUNCTIONS), done.stderr


def test_a_build_for_one_design_is_refused(libraries: dict[str, Path], tmp_path: Path) -> None:
    """Its counts of the model have places of their own in the names."""
    compiled = user(tmp_path, "c", *(f"-DPVID_EXACT{name}={place}" for place, name in enumerate(EXACT, 1)))
    done = link(tmp_path, "c", compiled, libraries["static"])
    names = re.findall(
        r"`(pvid_\w+[fq]3[12])_window\w+_exact1_plain9_runs4_signs5_gains6_integrals7_enum\d", done.stderr
    )
    assert set(names) == set(FUNCTIONS), done.stderr


def test_every_function_that_takes_a_struct_has_its_sizes_in_its_name() -> None:
    all_text = "".join(
        re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL) for path in public_headers()
    )
    structs = set(re.findall(r"^\} (pvid_\w+);", all_text, re.MULTILINE)) | set(
        re.findall(r"struct (pvid_\w+)", all_text)
    )
    pointer = re.compile(rf"\b({'|'.join(sorted(structs))}) \*")
    prototypes = re.findall(r"^(?!static|typedef|extern)([a-z][\w *]*?(pvid_\w+)\([^;{]*\));", all_text, re.MULTILINE)
    given = {name for prototype, name in prototypes if pointer.search(prototype)}
    listed = re.findall(r"^#define (pvid_\w+) PVID_(SIZED|REFINED)\((pvid_\w+)\)$", all_text, re.MULTILINE)
    assert all(one == other and ("_refine_" in one) == (how == "REFINED") for one, how, other in listed)
    assert given and given | {"pvid_estimator_defaults_f32", "pvid_refine_stage_f32"} == {one for one, _, _ in listed}


def test_a_size_costs_nothing_on_a_board(tmp_path: Path) -> None:
    """With the check and without: the same code and data."""
    sections = {}
    for names in ("", "-DPVID_PLAIN_NAMES"):
        compiled = tmp_path / "strong.o"
        options = ("-std=c99", "-mcpu=cortex-m4", "-mthumb", "-O2", *INCLUDES, FREESTANDING, *names.split())
        done = run("arm-none-eabi-gcc", *options, "-c", source("strong_f32.c"), "-o", compiled)
        assert done.returncode == 0, done.stderr
        sections[names] = run("arm-none-eabi-size", compiled).stdout.split()[6:10]
    assert sections[""] == sections["-DPVID_PLAIN_NAMES"]
