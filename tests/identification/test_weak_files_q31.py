"""The files of a mechanism's fixed-point weak form for a rig: they compile in a project without pvid's own flags."""

import re
import subprocess
from pathlib import Path

import pytest

from pvid.codegen import files_weak_q31
from pvid.codegen.build import files_of
from pvid.codegen.generated import GeneratedModel, Options
from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.core.sources import PUBLIC_INCLUDES
from pvid.models.mechanisms import compiled_of

_USE = """
#include "rigid_body_design_q31.h"
pvid_reason step(const int32_t reading[]);
pvid_reason step(const int32_t reading[])
{
    static pvid_weak_q31 identifier;
    static pvid_status status = PVID_BAD_POINTER;
    if (status != PVID_OK) {
        status = pvid_weak_init_q31(&identifier, &rigid_body_config_q31);
    }
    return pvid_weak_step_q31(&identifier, reading);
}
"""


@pytest.fixture(scope="module")
def files() -> dict[str, str]:
    return files_weak_q31.files_of(weak_q31_for_simulated_rig(compiled_of("rigid_body")), "a test")


def test_they_compile_without_a_warning_and_contain_no_float(files: dict[str, str], tmp_path: Path) -> None:
    for name, text in {**files, "use.c": _USE}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    sizes = re.findall(r"-DPVID_MAX_\w+=\d+", files["rigid_body_design_q31.h"])
    warnings = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror")
    for source in ("rigid_body_weak_q31.c", "use.c"):
        command = ["gcc", "-std=c99", *warnings, *sizes, *PUBLIC_INCLUDES, f"-I{tmp_path}", "-c", source]
        subprocess.run([*command, "-o", f"{source}.o"], check=True, cwd=tmp_path)
    code = re.sub(r"/\*.*?\*/", "", files["rigid_body_weak_q31.c"] + files["rigid_body_design_q31.h"], flags=re.DOTALL)
    assert not re.search(r"\b(float|double)\b|\d\.\d", code)


def test_the_header_has_counts_and_formats_in_words(files: dict[str, str]) -> None:
    text = files["rigid_body_design_q31.h"]
    assert re.search(r"reading\[0\]  \w+ +\S+ \S+ a count, +within \+-\d+ of its offset", text)
    assert re.search(r"Ixx \[kg\*m\^2\] += integer 2\^-\d+, +start 0\.01", text)
    assert "The first estimate comes after at most" in text


def test_they_belong_to_the_folder_of_a_model(files: dict[str, str]) -> None:
    options = Options(weak_q31_for_run=weak_q31_for_simulated_rig(compiled_of("rigid_body")))
    whole = files_of(GeneratedModel(compiled_of("rigid_body"), "a test", options))
    assert set(files) < set(whole)
    target = re.search(r"add_library\(rigid_body STATIC (.*)\)", whole["CMakeLists.txt"])
    assert target is not None and "weak" not in target[1]  # an option: its library needs larger arrays
    assert "target_sources(rigid_body PRIVATE rigid_body_weak_q31.c)" in whole["CMakeLists.txt"]


def test_samples_have_a_least_deviation_in_counts() -> None:
    """Those of float32: more than the noise of the pendulum's measured drive, a step of its encoder."""
    config = weak_q31_for_simulated_rig(compiled_of("kapitza")).config
    assert config.drive_min is not None
    y, phi = config.drive_min
    assert y > 1 and phi == 1
