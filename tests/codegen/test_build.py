"""The folder of a generated model: two lines of CMake build it, its test runs, --check finds changes."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from described import CHAIN, MOTOR

from pvid.base.errors import PvidError
from pvid.codegen import generated
from pvid.codegen.build import build, check, files_of
from pvid.codegen.files_weak_q31 import fitted_of
from pvid.codegen.fixed_model import Reaches
from pvid.codegen.generated import GeneratedModel, Options
from pvid.codegen.refine import refine_functions
from pvid.codegen.weak_library import weak_native
from pvid.codegen.weak_sizes import sizes_of_design
from pvid.configuration.refine import refine_design, refine_settings
from pvid.configuration.strong import strong_design
from pvid.configuration.strong_q31 import fixed_design
from pvid.configuration.weak import config_for_simulated_rig, samples_of, simulated_run_of
from pvid.configuration.weak_q31 import weak_q31_for_rig_like_the_shipped
from pvid.core.host_compiler import host_compiler
from pvid.core.sizes import default_sizes, raised
from pvid.core.sources import INCLUDES, source
from pvid.model import Integral, Model
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.rig.run import Recording
from pvid.sim.simulated_run import simulation_of

USER = """
cmake_minimum_required(VERSION 3.20)
project(user LANGUAGES C CXX)
enable_testing()
set(MOTOR_TEST ON)
set(CHAIN_TEST ON)
add_subdirectory({root} pvid)
include({root}/firmware/cmake/PvidCompile.cmake)

add_subdirectory({folder}/motor motor)
add_subdirectory({folder}/chain chain)
foreach(name IN ITEMS motor chain)
  target_compile_options(${{name}} PRIVATE ${{PVID_DEVELOPER_WARNINGS}})
  target_compile_options(${{name}}_test PRIVATE ${{PVID_DEVELOPER_WARNINGS}})
endforeach()
add_executable(user_cpp user.cpp)
target_link_libraries(user_cpp PRIVATE motor chain)
target_compile_options(user_cpp PRIVATE -Werror -Wall -Wextra -Wpedantic)
add_test(NAME user_cpp COMMAND user_cpp)
"""
STRONG = """
cmake_minimum_required(VERSION 3.20)
project(user LANGUAGES C)
add_subdirectory({root} pvid EXCLUDE_FROM_ALL)
add_subdirectory(rigid_body)
"""
WEAK = """
cmake_minimum_required(VERSION 3.20)
project(user LANGUAGES C)
add_subdirectory({root} pvid EXCLUDE_FROM_ALL)
add_subdirectory(rigid_body)
add_executable(user main.c)
target_link_libraries(user PRIVATE rigid_body)
"""
WEAK_PROGRAM = """
#include <stdio.h>
#include "rigid_body_design_f32.h"
#include "rigid_body_refine_design_f32.h"
static pvid_weak_f32 identifier;
static pvid_refine_f32 refinement;
static const pvid_weak_refine_f32 second = {&pvid_refiner_f32, &refinement, &rigid_body_refine_config_f32};
int main(int count, char **names)
{
    float sample[RIGID_BODY_WEAK_SAMPLES];
    FILE *file = fopen(names[count - 1], "rb");
    pvid_weak_config_f32 config = rigid_body_config_f32;
    config.refine = &second;
    if (pvid_weak_init_f32(&identifier, &config) != PVID_OK) {
        return 1;
    }
    while (fread(sample, sizeof sample, 1, file) == 1) {
        (void)pvid_weak_step_f32(&identifier, sample);
    }
    for (int k = 0; k < RIGID_BODY_WEAK_P; k++) {
        printf("%.9g ", (double)pvid_weak_estimate_f32(&identifier)->p[k]);
    }
    for (int k = 0; k < PVID_REFINE_PARAMETERS; k++) {
        printf("%.9g ", (double)pvid_refine_latest_f32(&refinement)->r[k]);
    }
    return 0;
}
"""
PROGRAM = """
#include "chain.h"
#include "motor.h"
int main() { return (motor_model_f32.n_theta == MOTOR_THETA && chain_model_f32.n_p == CHAIN_P) ? 0 : 1; }
"""


def generated_model(model: CompiledModel, **options: Any) -> GeneratedModel:
    return GeneratedModel(model, "test", Options(**options))


def run(*command: str | Path) -> str:
    done = subprocess.run([str(one) for one in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_two_lines_of_cmake_make_a_library_whose_test_passes(tmp_path: Path) -> None:
    for model in (MOTOR, CHAIN):
        build(generated_model(model), tmp_path / model.name)
    (tmp_path / "CMakeLists.txt").write_text(USER.format(root=ROOT, folder=tmp_path), encoding="utf-8")
    (tmp_path / "user.cpp").write_text(PROGRAM, encoding="utf-8")
    run("cmake", "-S", tmp_path, "-B", tmp_path / "b", "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Debug")
    run("ninja", "-C", tmp_path / "b")
    assert "100% tests passed, 0 tests failed out of 3" in run("ctest", "--test-dir", tmp_path / "b")


def test_the_twins_file_is_a_module_that_needs_nothing_but_pvid(tmp_path: Path) -> None:
    build(generated_model(MOTOR), tmp_path)
    program = "import motor_twin as one; x = [one.f32(0)] * 9; one.motor_theta_f32([one.f32(1)] * 5, x); print(x[2])"
    assert run(sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r}); {program}") == "1.0\n"


def test_the_strong_form_is_an_option_of_the_folder(tmp_path: Path) -> None:
    """With the sizes that its header names."""
    build(generated_model(compiled_of("rigid_body"), strong=True), tmp_path / "rigid_body")
    check(generated_model(compiled_of("rigid_body"), strong=True), tmp_path / "rigid_body")
    (tmp_path / "CMakeLists.txt").write_text(STRONG.format(root=ROOT), encoding="utf-8")
    command = ("cmake", "-S", tmp_path, "-B", tmp_path / "b", "-G", "Ninja", "-DRIGID_BODY_STRONG=ON")
    run(*command, "-DPVID_MAX_P=6", "-DPVID_MAX_THETA=15", "-DPVID_MAX_MOMENTS=45")
    compiled = ("ninja", "-C", str(tmp_path / "b"), "rigid_body/CMakeFiles/rigid_body.dir/rigid_body_strong_f32.c.o")
    run(*compiled)
    run(*command, "-DPVID_MAX_P=5")
    done = subprocess.run(compiled, capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "compile pvid and this file with -DPVID_MAX_P=6" in done.stdout


def test_the_fixed_point_strong_form_is_an_option_of_the_folder(tmp_path: Path) -> None:
    """With the sizes that its header names."""
    simulation = simulation_of("rigid_body")
    found = simulation.run(seed=1)
    recording = Recording(found.pop("t"), found, simulation.rig.sample_rate)
    fixed = fixed_design(simulation.model, recording, strong_design(simulation.model, recording)).strong_q31
    whole = generated_model(simulation.model, strong=True, strong_q31=fixed)
    build(whole, tmp_path / "rigid_body")
    check(whole, tmp_path / "rigid_body")
    (tmp_path / "CMakeLists.txt").write_text(STRONG.format(root=ROOT), encoding="utf-8")
    command = ("cmake", "-S", tmp_path, "-B", tmp_path / "b", "-G", "Ninja", "-DRIGID_BODY_STRONG_Q31=ON")
    run(*command, *(f"-D{macro}={size}" for macro, size in fixed.sizes.items()))
    compiled = ("ninja", "-C", str(tmp_path / "b"), "rigid_body/CMakeFiles/rigid_body.dir/rigid_body_strong_q31.c.o")
    run(*compiled)
    run(*command, "-DPVID_MAX_THETA_Q31=14")
    done = subprocess.run(compiled, capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "compile pvid and this file with -DPVID_MAX" in done.stdout


def test_the_weak_form_and_its_refinement_are_options_of_the_folder(tmp_path: Path) -> None:
    """With the sizes that the design names, and a program that takes both stages from init to an estimate."""
    compiled = compiled_of("rigid_body")
    design, (run_of_rig, _, p_of_rig) = config_for_simulated_rig(compiled), simulated_run_of(compiled)
    refined = refine_design(compiled, design, run_of_rig, p_of_rig)
    whole = generated_model(compiled, design=design, refine_design=refined)
    build(whole, tmp_path / "rigid_body")
    check(whole, tmp_path / "rigid_body")
    (tmp_path / "CMakeLists.txt").write_text(WEAK.format(root=ROOT), encoding="utf-8")
    (tmp_path / "main.c").write_text(WEAK_PROGRAM, encoding="utf-8")
    debug = ["-DCMAKE_BUILD_TYPE=Debug"]
    sizes = [f"-D{macro}={size}" for macro, size in raised(sizes_of_design(design.design)).items()]
    run("cmake", "-S", tmp_path, "-B", tmp_path / "b", "-G", "Ninja", "-DRIGID_BODY_WEAK=ON", *debug, *sizes)
    done = subprocess.run(["ninja", "-C", str(tmp_path / "b"), "user"], capture_output=True, text=True, check=False)
    assert done.returncode != 0 and re.search(r"reference to `pvid_refiner_f32_model0x\w{8}u", done.stdout)
    run("cmake", "-DRIGID_BODY_REFINE=ON", tmp_path / "b")
    run("ninja", "-C", tmp_path / "b", "user")
    table = samples_of(design, run_of_rig)
    (tmp_path / "samples").write_bytes(table.tobytes())
    printed = np.array(run(tmp_path / "b" / "user", tmp_path / "samples").split(), np.float32)
    host = weak_native(compiled, design.design, refine_functions(compiled)).refined_of(design, refined)
    host.run_both(table)
    assert host.refined is not None
    assert printed.tolist() == [*host.estimator.p, *host.refined["r"].tolist()]
    assert np.allclose(printed[-6:-3], p_of_rig[:3], rtol=2e-4) and np.allclose(printed[-6:], p_of_rig, atol=2e-6)


@pytest.mark.parametrize("names", [("dc_motor",), ("dc_motor", "cart_pendulum")])
def test_both_arithmetics_of_mechanisms_are_in_one_c_file(names: tuple[str, ...], tmp_path: Path) -> None:
    """As in a firmware that carries both for a comparison, or that identifies two axes."""
    sizes: dict[str, int] = {}
    lines, begun = ["static pvid_weak_f32 one;", "static pvid_weak_q31 other;"], []
    for name in names:
        compiled = compiled_of(name)
        weak, config = weak_q31_for_rig_like_the_shipped(compiled), config_for_simulated_rig(compiled)
        build(generated_model(compiled, design=config, weak_q31_for_run=weak), tmp_path / name)
        for needed in (sizes_of_design(config.design), fitted_of(weak)):
            sizes |= {macro: max(size, sizes.get(macro, 0)) for macro, size in needed.items()}
        headers = sorted(one.name for one in (tmp_path / name).glob(f"{name}*.h"))
        assert {f"{name}_design_f32.h", f"{name}_design_q31.h"} < set(headers)
        lines = [*(f'#include "{header}"' for header in headers), *lines]
        begun += [
            f"pvid_weak_init_{core}(&{it}, &{name}_config_{core})" for core, it in (("f32", "one"), ("q31", "other"))
        ]
    lines += ["int main(void)", "{", f"    return {' || '.join(f'({one} != PVID_OK)' for one in begun)};", "}", ""]
    (tmp_path / "all.c").write_text("\n".join(lines), encoding="utf-8")
    usual = [
        f"-D{macro}={size}" for macro, size in raised({m: sizes[m] for m in {*sizes} & {*default_sizes()}}).items()
    ]
    folders = [f"-I{tmp_path / name}" for name in names]
    run(
        host_compiler("a test"), "-std=c99", "-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *usual,
        *folders, *INCLUDES, tmp_path / "all.c",
    )  # fmt: skip


def test_what_the_refinement_in_c_lacks_is_a_sentence() -> None:
    motor = compiled_of("dc_motor")
    run_of_rig, _, p = simulated_run_of(motor)
    with pytest.raises(PvidError, match=r"needs \d+ samples a second for the fastest motion or relaxation, .* not 40"):
        refine_settings(refine_functions(motor), run_of_rig, 40.0, p, 2.0)
    model = Model("heat")
    i, v = model.sensor("i", "A", noise=1e-3, driven=True), model.sensor("v", "V", noise=1e-3)
    z, s = model.define("z", "A^2*s", Integral(i**2, 1)), model.unknown("s", "V/(A^2*s)", 1.0)
    R, T, h = model.unknown("R", "ohm", 1.0), model.unknown("T", "s", 1.0), model.unmeasured("h", "V")
    model.equation(v + s * z + h)
    model.equation(T * h.d() + h - R * i)
    signals = {name: np.sin(np.arange(2000.0)) for name in ("i", "v")}
    with pytest.raises(
        PvidError, match=r"has the input Integral\(i\*\*2, 1\); those of the refinement in C are samples"
    ):
        refine_settings(refine_functions(model.compiled("heat")), signals, 100.0, (1.0, 1.0, 1.0), 2.0)


def test_a_soft_sign_is_one_of_the_design_too() -> None:
    compiled = compiled_of("two_link_arm")
    whole = generated_model(compiled, design=config_for_simulated_rig(compiled), soft_signs={"q2_1": 0.25})
    text = files_of(whole)["two_link_arm_design_f32.h"]
    widths = text.split("two_link_arm_sign_width[2] = {")[1].split("};")[0]
    assert widths.split() == ["0.0f,", "0.25f,"]


def test_a_model_is_analysed_once_however_many_printers_read_it(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def counted(name: str) -> Callable[..., Any]:
        own = getattr(generated, name)

        def make(*given: Any) -> Any:
            made.append(name)
            return own(*given)

        return make

    parts = ("functions_of", "fixed_model", "weak_functions_of", "strong_functions_of", "refine_functions")
    for name in parts:
        monkeypatch.setattr(generated, name, counted(name))
    assert len(files_of(generated_model(compiled_of("rigid_body"), strong=True))) > 10
    assert sorted(made) == sorted(parts)


def test_a_wrong_bit_fails_the_test_of_the_folder(tmp_path: Path) -> None:
    files = files_of(generated_model(MOTOR))
    wrong = files["motor_f32.c"].replace("pvid_sign_f32", "pvid_magnitude_f32")
    for name, text in {**files, "motor_f32.c": wrong}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    written = [tmp_path / f"motor_{one}.c" for one in ("f32", "q31", "test")]
    core = [
        source(f"{one}.c")
        for one in ("elementary_f32", "elementary_q31", "scaled_q31", "scaled_model_q31", "integer_q31")
    ]
    sources = [*written, *core]
    includes = [f"-I{ROOT / 'firmware' / one}" for one in ("include", "src")]
    run("gcc", "-std=c99", "-O1", *includes, *sources, "-o", tmp_path / "test")
    done = subprocess.run([tmp_path / "test"], capture_output=True, text=True, check=False)
    assert done.returncode == 1


def test_check_finds_a_changed_and_a_missing_file(tmp_path: Path) -> None:
    build(generated_model(MOTOR), tmp_path)
    check(generated_model(MOTOR), tmp_path)
    header = tmp_path / "motor.h"
    text = header.read_text(encoding="utf-8")
    header.write_text(text.replace("rad", "deg"), encoding="utf-8")
    with pytest.raises(PvidError, match=r"motor\.h is not what motor generates now"):
        check(generated_model(MOTOR), tmp_path)
    header.unlink()
    with pytest.raises(PvidError, match=r"motor\.h is missing"):
        check(generated_model(MOTOR), tmp_path)


def test_files_name_their_command_and_input_and_no_date(tmp_path: Path) -> None:
    first, again = build(generated_model(MOTOR), tmp_path / "a"), build(generated_model(MOTOR), tmp_path / "b")
    for one, other in zip(first, again, strict=True):
        text = one.read_text(encoding="utf-8")
        assert text == other.read_text(encoding="utf-8")
        assert "Generated by `test`: do not edit." in text
    hashes = {line for path in first for line in path.read_text(encoding="utf-8").splitlines() if "Input " in line}
    assert len({line.split()[-1] for line in hashes}) == 1


def test_the_header_names_every_parameter_theta_regressor_and_unit() -> None:
    header = " ".join(files_of(generated_model(MOTOR))["motor.h"].split())
    for line in (
        "p[0] R [1] 0.1..10",
        "in[1] i [A]",
        "theta[2] k [1] N[2] [1/s] D(phi)",
        "Y [V] (V)",
        "phi, derivative 1 [rad/s]",
    ):
        assert line in header, line


def test_options_change_formats_and_signs_and_the_hash() -> None:
    plain = files_of(generated_model(MOTOR))
    soft = files_of(generated_model(MOTOR, soft_signs={"phi_1": 0.5}))
    assert "pvid_soft_sign_f32(phi_1, 0.5f)" in soft["motor_f32.c"] and "pvid_soft_sign" not in plain["motor_f32.c"]
    near = files_of(generated_model(MOTOR, reaches=Reaches(of={"phi_1": 40.0})))
    assert "|in[3]| <= 40 rad/s" in near["motor_q31.h"] and plain["motor_q31.c"] != near["motor_q31.c"]
    with pytest.raises(PvidError, match="motor has no sign of speed: its signs are of phi_1"):
        files_of(generated_model(MOTOR, soft_signs={"speed": 1.0}))
    with pytest.raises(PvidError, match="motor has no input speed"):
        files_of(generated_model(MOTOR, reaches=Reaches(of={"speed": 1.0})))


def test_a_model_that_fixed_point_cannot_compute_gets_the_float_files_alone() -> None:
    reaches = Reaches(of={"phi": 1000.0})  # tan(phi / 200) then has a divisor that may be 0
    wide = generated_model(MOTOR, reaches=reaches)
    reason = wide.fixed.refusal
    assert reason is not None and "motor, channels: a divisor lies in -1..1 and may be 0" in reason
    assert generated_model(MOTOR).fixed.refusal is None
    files = files_of(wide)
    assert "motor_f32.c" in files and not [name for name in files if "q31" in name]
    assert "q31" not in files["motor_test.c"] and "motor_q31" not in files["CMakeLists.txt"]
