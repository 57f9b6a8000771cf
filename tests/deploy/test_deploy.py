"""What `pvid deploy` writes is built by the ecosystems' own files, and its example identifies the motor."""

import json
import os
import re
import tarfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]
from conftest import ROOT
from ecosystems import newlib, packer
from own_mechanisms import OWN, own_recording
from packages import STUBS, built, run
from program import pvid

from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.board.boards import run as run_on
from pvid.cli.deploy import _within
from pvid.configuration.refine import full_motion_of, refine_for_simulated_rig
from pvid.configuration.weak import config_for_recording, config_for_simulated_rig, simulated_run_of
from pvid.configuration.weak_q31 import weak_q31_for_recording, weak_q31_for_simulated_rig
from pvid.deploy.deployment import Deployment, Most
from pvid.deploy.example import expected
from pvid.deploy.of_rig import deployment_f32, deployment_q31
from pvid.deploy.targets import TARGETS, write_package
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig

WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")


@pytest.fixture(scope="module")
def motor() -> Deployment:
    compiled = compiled_of("dc_motor")
    return deployment_f32(compiled, config_for_simulated_rig(compiled), simulated_run_of(compiled)[0], "a test")


@pytest.fixture(scope="module")
def fixed_motor() -> Deployment:
    compiled = compiled_of("dc_motor")
    return deployment_q31(weak_q31_for_simulated_rig(compiled), simulated_run_of(compiled)[0], "a test")


@pytest.fixture(scope="module")
def pendulum() -> Deployment:
    """With its second stage; the example's motion has the full equations, those of the weak form are linear."""
    compiled = compiled_of("kapitza")
    config = config_for_simulated_rig(compiled)
    refine = refine_for_simulated_rig(compiled, config)
    return deployment_f32(compiled, config, full_motion_of(compiled), "a test", refine)


def written(deployment: Deployment, target: str, folder: Path) -> Path:
    write_package(deployment, target, folder)
    return folder


@pytest.fixture(scope="module")
def deployments(motor: Deployment, fixed_motor: Deployment) -> dict[str, Deployment]:
    """Of a shipped mechanism in either arithmetic, of one without an input and of one of the user's own."""
    free, plate = OWN["free_pendulum"].compiled, OWN["heated_plate"].compiled
    swing, steps = own_recording("free_pendulum"), own_recording("heated_plate")
    return {
        "dc_motor": motor,
        "dc_motor in integers": fixed_motor,
        "free_pendulum": deployment_f32(free, config_for_recording(free, swing), swing.signals, "a test"),
        "heated_plate in integers": deployment_q31(weak_q31_for_recording(plate, steps), steps.signals, "a test"),
    }


DEPLOYED = ("dc_motor", "dc_motor in integers", "free_pendulum", "heated_plate in integers")


@pytest.mark.parametrize("name", DEPLOYED)
def test_the_example_comes_near_the_truth(name: str, deployments: dict[str, Deployment]) -> None:
    one = deployments[name]
    own = OWN.get(one.name)
    truth = simulated_rig(one.name).truth if own is None else {x.name: x.guess for x in own.compiled.unknowns}
    assert one.playback.value is not None and one.playback.error is not None
    for parameter, value, error in zip(one.parameters, one.playback.value, one.playback.error, strict=True):
        assert abs(value - truth[parameter.name]) < 4 * error  # one seed, seven parameters: 3 would be met by 98 %
        assert error < 0.05 * (abs(truth[parameter.name]) or 1.0)  # se_max of the publication


@pytest.mark.parametrize("name", DEPLOYED[::2] + DEPLOYED[3:])
def test_cmake(name: str, deployments: dict[str, Deployment], tmp_path: Path) -> None:
    one = deployments[name]
    tree = built(written(one, "cmake", tmp_path / "p"), tmp_path / "b")
    assert run(tree / f"{one.name}_example").splitlines() == expected(one)


BLOCKS = """\
    for (uint32_t tick = 0, count = 1; tick < @_EXAMPLE_TICKS; tick += count) {
        static TYPE samples[25][@_SAMPLES];
        static const uint32_t length[] = {24, 7, 1, 25};
        count = 0;
        while ((count < length[tick % 4]) && NAME_example_sample(tick + count, samples[count])) {
            count++;
        }
        (void)NAME_step_block(samples[0], count);
    }
"""


@pytest.mark.parametrize("name", ["dc_motor", "dc_motor in integers", "heated_plate in integers", "kapitza"])
def test_its_blocks_have_the_estimate_of_its_steps(
    name: str, deployments: dict[str, Deployment], pendulum: Deployment, tmp_path: Path
) -> None:
    """Of ragged lengths, in either arithmetic and with the second stage."""
    one = pendulum if name == "kapitza" else deployments[name]
    folder = written(one, "cmake", tmp_path / "p")
    main = folder / "example" / "main.c"
    blocks = BLOCKS.replace("TYPE", one.sample_type).replace("NAME", one.name).replace("@", one.upper)
    text, changed = re.subn(
        r"    for \(uint32_t tick = 0;.*?\n    \}\n", blocks, main.read_text("utf-8"), flags=re.DOTALL
    )
    assert changed == 1 and "_step(" not in text
    main.write_text(text.replace(f"    {one.sample_type} sample[{one.upper}_SAMPLES];\n", ""), encoding="utf-8")
    tree = built(folder, tmp_path / "b", "-DCMAKE_C_FLAGS=-Wall -Wextra -Werror")
    assert run(tree / f"{one.name}_example").splitlines() == expected(one)


LIVES = """\
#include <stdio.h>
#include <string.h>
#include "../src/NAME_identifier.c"

static uint8_t image[65536], loaded[UPPER_RECORD], whole[UPPER_RECORD], record[UPPER_RECORD];

static void publish(void)
{
    identifier.trust.estimate.standing.state = PVID_STANDING_VALID;
    identifier.trust.mark.number[0] = 1u;
}

static void save(uint8_t to[])
{
    while (NAME_save(to) == PVID_RECORD_MORE) {
    }
}

int main(void)
{
    printf("%d", (int)NAME_begin());
    const size_t length = NAME_snapshot_save(1, image, sizeof image);
    publish();
    save(loaded);
    for (int life = 0; life < 3; life++) {
        publish();
        printf(" %d", (int)NAME_save(record));
        printf(" %d", (life == 0)   ? (NAME_begin() == PVID_OK)
                      : (life == 1) ? (NAME_load(loaded) == PVID_RECORD_DONE)
                                    : NAME_snapshot_restore(image, length));
        publish();
        identifier.trust.estimate.p[0] /= life + 2;
        save(record);
        save(whole);
        printf(" %d", (memcmp(whole, record, sizeof whole) == 0) && (memcmp(whole, loaded, 20) != 0));
    }
    return 0;
}
"""


@pytest.mark.parametrize("name", ["dc_motor", "dc_motor in integers", "kapitza"])
def test_a_record_is_of_one_life(
    name: str, deployments: dict[str, Deployment], pendulum: Deployment, tmp_path: Path
) -> None:
    """A piece is saved, then another life publishes an estimate of the same number."""
    one = pendulum if name == "kapitza" else deployments[name]
    folder = written(one, "cmake", tmp_path / "p")
    text = LIVES.replace("NAME", one.name).replace("UPPER", one.upper)
    (folder / "example" / "main.c").write_text(text, encoding="utf-8")
    tree = built(folder, tmp_path / "b")
    assert run(tree / f"{one.name}_example").split() == ["0", *("1 1 1".split() * 3)]


def test_the_example_of_a_refined_mechanism_prints_the_refined_estimate(pendulum: Deployment, tmp_path: Path) -> None:
    """It is right where the weak form, whose equations are linear in the angle, is several standard errors off."""
    tree = built(written(pendulum, "cmake", tmp_path / "p"), tmp_path / "b", "-DCMAKE_C_FLAGS=-Wall -Wextra -Werror")
    lines = run(tree / "kapitza_example").splitlines()
    assert lines == expected(pendulum)
    found = {
        name: (float(value), float(error))
        for name, value, error in re.findall(r"^(\w+(?: \w+)?) = (\S+) \+- (\S+)", "\n".join(lines), re.MULTILINE)
    }
    truth = simulated_rig("kapitza").truth
    for name in ("w", "d1", "d2"):
        value, error = found[f"refined {name}"]
        assert abs(value - truth[name]) < 3 * error < 0.005 * truth[name]
        assert abs(found[name][0] - truth[name]) > 2 * abs(value - truth[name])
    for name in ("k1", "k2", "tau"):  # there is neither friction nor skew
        value, error = found[f"refined {name}"]
        assert abs(value) < 3 * error


def test_without_its_call_the_second_stage_is_not_linked(pendulum: Deployment, tmp_path: Path) -> None:
    folder = written(pendulum, "cmake", tmp_path / "p")
    main = folder / "example" / "main.c"
    text = main.read_text(encoding="utf-8")
    assert text.count("kapitza_begin_refined()") == 1
    lines = text.replace("kapitza_begin_refined()", "kapitza_begin()").replace("_EXAMPLE_LINES", "_PARAMETERS")
    main.write_text(lines, encoding="utf-8")
    example = folder / "example" / "kapitza_example.c"
    own = example.read_text(encoding="utf-8")
    first, last = own.index("    if (k >= KAPITZA_PARAMETERS)"), own.index("    float value[KAPITZA_PARAMETERS]")
    example.write_text(own[:first] + own[last:], encoding="utf-8")
    tree = built(folder, tmp_path / "b")
    assert run(tree / "kapitza_example").splitlines() == expected(pendulum)[: len(pendulum.parameters)]
    symbols = run("nm", tree / "kapitza_example")
    assert "pvid_weak_step_f32" in symbols and "pvid_refine" not in symbols


def test_a_refined_mechanism_in_two_files_has_no_public_name_of_the_core(pendulum: Deployment, tmp_path: Path) -> None:
    written(pendulum, "amalgamation", tmp_path)
    c = (*WARNINGS, "-Wno-maybe-uninitialized", "-std=c99", "-O1", "-I.", "-Iexample")
    run("gcc", *c, "-c", "pvid_kapitza.c", cwd=tmp_path)
    run("gcc", *c, "pvid_kapitza.o", "example/main.c", "example/kapitza_example.c", "-lm", "-o", "it", cwd=tmp_path)
    assert run(tmp_path / "it").splitlines() == expected(pendulum)
    symbols = re.findall(r"^\w+ ([A-Z]) (\w+)$", run("nm", "--defined-only", tmp_path / "pvid_kapitza.o"), re.MULTILINE)
    assert not [name for kind, name in symbols if kind != "W" and not name.startswith("kapitza_")]


@pytest.mark.parametrize("target", TARGETS)
def test_every_ecosystems_example_switches_the_second_stage_on(target: str, pendulum: Deployment) -> None:
    files = TARGETS[target](pendulum)
    assert sum(text.count("= kapitza_begin_refined()") for text in files.values()) == 1
    assert "kapitza_begin_refined()" in files["README.md"]


def test_a_folder_of_something_else_is_refused(motor: Deployment, tmp_path: Path) -> None:
    written(motor, "amalgamation", tmp_path)
    written(motor, "amalgamation", tmp_path)  # again: the same files
    with pytest.raises(PvidError, match="files that are not of this package"):
        write_package(motor, "cmake", tmp_path)


@pytest.mark.parametrize("core", ["f32", "q31"])
def test_two_files_are_c99_and_cpp_includes_them(
    core: str, motor: Deployment, fixed_motor: Deployment, tmp_path: Path
) -> None:
    made = motor if core == "f32" else fixed_motor
    written(made, "amalgamation", tmp_path)
    c = [*WARNINGS, "-Wno-maybe-uninitialized", "-std=c99", "-O1", "-I.", "-c"]
    run("gcc", *c, "pvid_dc_motor.c", "example/dc_motor_example.c", cwd=tmp_path)
    (tmp_path / "main.cpp").write_text((tmp_path / "example" / "main.c").read_text(encoding="utf-8"), encoding="utf-8")
    objects = ("pvid_dc_motor.o", "dc_motor_example.o")
    run("g++", *WARNINGS, "-std=c++14", "-I.", "-Iexample", "main.cpp", *objects, "-lm", "-o", "it", cwd=tmp_path)
    assert run(tmp_path / "it").splitlines() == expected(made)
    symbols = re.findall(r"^\w+ ([A-Z]) (\w+)$", run("nm", "--defined-only", tmp_path / objects[0]), re.MULTILINE)
    strange = [name for kind, name in symbols if kind != "W" and not name.startswith("dc_motor_")]
    assert not strange, "two mechanisms in one program would clash"


def test_two_files_have_the_bits_of_the_core_under_gnu17(motor: Deployment, tmp_path: Path) -> None:
    """gcc's default standard fuses a * b + c unless the file forbids it."""
    written(motor, "amalgamation", tmp_path)
    cpu = ["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-mthumb", "-ffreestanding", "-fbuiltin"]
    headers = f"-I{ROOT}/firmware/ports/freestanding/include"
    run("arm-none-eabi-gcc", *cpu, headers, "-std=gnu17", "-O2", "-I.", "-c", "pvid_dc_motor.c", cwd=tmp_path)
    assert "vfma" not in run("arm-none-eabi-objdump", "-d", tmp_path / "pvid_dc_motor.o")


@pytest.mark.night
def test_esp_idf(motor: Deployment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IDF_PATH", str(STUBS / "esp_idf"))
    folder = written(motor, "esp-idf", tmp_path / "p")
    tree = built(folder / "examples" / "dc_motor", tmp_path / "b")
    assert run(tree / "dc_motor_example").splitlines() == [f"I pvid: {line}" for line in expected(motor)]
    manifest = yaml.safe_load((folder / "idf_component.yml").read_text(encoding="utf-8"))
    assert set(manifest) == {"version", "description", "license", "dependencies"}
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"])
    example = folder / "examples" / "dc_motor" / "main"
    (path,) = yaml.safe_load((example / "idf_component.yml").read_text(encoding="utf-8"))["dependencies"].values()
    assert (example / path["override_path"]).resolve() == folder.resolve()


@pytest.mark.night
def test_zephyr(motor: Deployment, tmp_path: Path) -> None:
    folder = written(motor, "zephyr", tmp_path / "p")
    tree = built(folder / "samples" / "dc_motor", tmp_path / "b", f"-DZephyr_DIR={STUBS / 'zephyr'}")
    assert run(tree / "app").splitlines() == expected(motor)
    module = yaml.safe_load((folder / "zephyr" / "module.yml").read_text(encoding="utf-8"))
    assert module == {"name": "pvid_dc_motor", "build": {"cmake": ".", "kconfig": "Kconfig"}}
    sample = yaml.safe_load((folder / "samples" / "dc_motor" / "sample.yaml").read_text(encoding="utf-8"))
    (pattern,) = sample["tests"]["sample.pvid_dc_motor"]["harness_config"]["regex"]
    assert re.search(pattern, expected(motor)[0])


@pytest.mark.night
def test_cubemx_on_an_emulated_stm32_with_newlib_nano(motor: Deployment, tmp_path: Path) -> None:
    folder = written(motor, "cubemx", tmp_path / "p")
    headers, libraries = newlib("thumb/v7e-m+fp/hard")
    toolchain = ROOT / "firmware" / "cmake" / "cortex-m.cmake"
    options = (
        f"-DCMAKE_TOOLCHAIN_FILE={toolchain}",
        f"-DPVID_PACKAGE={folder}",
        f"-DPVID_FIRMWARE={ROOT / 'firmware'}",
    )
    library = (f"-DNEWLIB_HEADERS={headers}", f"-DNEWLIB_LIBRARIES={libraries}", "-DCMAKE_BUILD_TYPE=Release")
    tree = built(STUBS / "stm32", tmp_path / "b", *options, *library)
    linked = set(re.findall(r"libc_nano\.a\((\S+)\.o\)", (tree / "cube.map").read_text(encoding="utf-8")))
    assert {"lib_a-puts", "lib_a-memset"} <= linked
    done = run_on(BOARDS["netduinoplus2"], tree / "cube.elf", 60)
    lines = done.text.splitlines()
    assert done.exit_code == 0
    assert lines[-len(motor.parameters) :] == expected(motor)
    assert len(lines) > len(motor.parameters)  # estimates before the last one


@pytest.mark.night
@pytest.mark.parametrize("target", ["platformio", "arduino"])
def test_platformio_packs_it(target: str, motor: Deployment, tmp_path: Path) -> None:
    """With PlatformIO's own command, for which the list of licences, which it downloads, has one entry here."""
    folder = written(motor, target, tmp_path / "pvid_dc_motor")
    python, _, program = packer("platformio")
    licences = '{"licenses": [{"licenseId": "MIT"}]}'
    offline = (
        "from platformio.package.manifest.schema import ManifestSchema\n"
        f"ManifestSchema.load_spdx_licenses = staticmethod(lambda: {licences})\n"
        f"from {program}.__main__ import main\nmain()"
    )
    settings = {
        **os.environ,
        "PLATFORMIO_CORE_DIR": str(tmp_path / "core"),
        "PLATFORMIO_SETTING_ENABLE_TELEMETRY": "no",
    }
    run(python, "-c", offline, "pkg", "pack", "-o", tmp_path, folder, env=settings)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as packed:
        names = set(packed.getnames())
    manifest = "library.json" if target == "platformio" else "library.properties"
    assert {manifest, "src/dc_motor_identifier.h", "examples/dc_motor/dc_motor.ino"} <= names


@pytest.mark.night
def test_esp_idf_packs_it(motor: Deployment, tmp_path: Path) -> None:
    folder = written(motor, "esp-idf", tmp_path / "p")
    run(*packer("idf_component_manager"), "component", "pack", "--name", "pvid_dc_motor", cwd=folder)
    (archive,) = (folder / "dist").glob("pvid_dc_motor_*.tgz")
    with tarfile.open(archive) as packed:
        names = {name.removeprefix("./") for name in packed.getnames()}
    assert {"idf_component.yml", "CMakeLists.txt", "examples/dc_motor/main/idf_component.yml"} <= names


def test_platformios_manifest_names_what_is_there(motor: Deployment, tmp_path: Path) -> None:
    folder = written(motor, "platformio", tmp_path)
    manifest = json.loads((folder / "library.json").read_text(encoding="utf-8"))
    assert re.fullmatch(r"[\w. -]+", manifest["name"]) and re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"])
    assert (folder / manifest["build"]["srcDir"] / manifest["headers"]).is_file()
    assert "-ffp-contract=off" in manifest["build"]["flags"]
    for example in manifest["examples"]:
        assert all((folder / example["base"] / one).is_file() for one in example["files"])


def test_arduinos_properties_are_those_of_its_specification(motor: Deployment, tmp_path: Path) -> None:
    folder = written(motor, "arduino", tmp_path)
    lines = (folder / "library.properties").read_text(encoding="utf-8").splitlines()
    found = dict(line.split("=", 1) for line in lines)
    needed = {"name", "version", "author", "maintainer", "sentence", "paragraph", "category", "url", "architectures"}
    assert set(found) == needed | {"includes"}
    assert (folder / "src" / found["includes"]).is_file()
    assert (folder / "examples" / "dc_motor" / "dc_motor.ino").is_file()


@pytest.mark.parametrize("target", TARGETS)
def test_a_readme_is_one_screen(target: str, motor: Deployment) -> None:
    lines = TARGETS[target](motor)["README.md"].splitlines()
    assert len(lines) <= 48
    assert all(f"    {line}" in lines for line in expected(motor))


def test_the_command_takes_a_design_that_fits_into_the_ram(tmp_path: Path) -> None:
    """The largest one: with a byte less there is another. Where the smallest does not fit its bytes are named."""
    command = ("deploy", "dc_motor", "--for", "cmake", "--core", "q31", "-o", "out", "--force", "--ram")
    taken, notes = [10**6], []
    for _ in range(3):
        done = pvid(tmp_path, *command, str(taken[-1] - 1))
        assert done.returncode == 0, done.stderr
        notes.append("test functions in place of" in done.stderr)
        readme = (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
        taken.append(int(re.findall(r"takes about (\d+) bytes of RAM", readme)[0]))
    assert notes == [False, True, True] and all(b < a for a, b in pairwise(taken))
    refused = pvid(tmp_path, *command, "1000")
    assert refused.returncode == 2 and "with the fewest test functions the first stage takes" in refused.stderr


@pytest.mark.parametrize(("ticks", "number"), [(500, None), (449, 8), (260, 5), (100, 0)])
def test_the_command_takes_the_largest_design_within_the_instructions_of_a_tick(
    ticks: int, number: int | None, capsys: pytest.CaptureFixture[str]
) -> None:
    """50 instructions for each of 10 test functions; with fewer than 7 the second stage has no estimate. The smallest
    design has 4."""

    def made(functions: int | None) -> Any:
        n = functions or 10
        return SimpleNamespace(sizes={"PVID_MAX_FUNCTIONS": n}, most=Most(50 * n, 20 * n, 0), is_refined=n > 6)

    if number == 0:
        with pytest.raises(PvidError, match="a tick takes up to 200 instructions by its code, and 80 in a search"):
            _within(None, ticks, None, made)
        return
    fits = _within(None, ticks, None, made)
    notes = capsys.readouterr().err
    assert fits.sizes["PVID_MAX_FUNCTIONS"] == (number or 10)
    assert ("test functions in place of 10, for " in notes) == (number is not None)
    assert ("the second stage has no estimate" in notes) == (number == 5)


def test_a_readme_names_the_bounds_of_time_and_stack(motor: Deployment) -> None:
    def notes(one: Deployment) -> str:
        return TARGETS["cmake"](one)["README.md"]

    assert "`pvid deploy --ticks N` bounds the instructions of a tick" in notes(motor)
    known = notes(replace(motor, most=Most(1234, 567, 448)))
    assert "at most 1234 instructions" in known and "took 567 in a search" in known and "at most 448 bytes" in known


@pytest.mark.slow
def test_the_command_takes_a_recording(tmp_path: Path) -> None:
    """A mechanism of one's own: its model file, a recording of it, and from there to a program that identifies it."""
    shipped = ROOT / "host" / "src" / "pvid" / "models" / "dc_motor" / "mechanism.py"
    (tmp_path / "my_motor.py").write_text(shipped.read_text(encoding="utf-8"), encoding="utf-8")
    done = pvid(tmp_path, "model", "simulate", "dc_motor", "run.csv", "--duration", "2")
    assert done.returncode == 0, done.stderr
    (tmp_path / "run.toml").unlink()  # it names the shipped model
    command = ("deploy", "my_motor.py", "--for", "amalgamation", "-o", "out")
    refused = pvid(tmp_path, *command)
    assert refused.returncode == 2 and "give a recording of yours with --run" in refused.stderr
    done = pvid(tmp_path, *command, "--run", "run.csv")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    assert "--run run.csv" in text and "    R = 1.2" in text
