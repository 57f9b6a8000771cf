"""The programs of firmware/examples, built on a deployed package as C and as C++, and run."""

import re
import subprocess
from pathlib import Path

import pytest
from conftest import ROOT
from packages import STUBS, built, commissioning_of, run

from pvid.configuration.weak import config_for_simulated_rig, simulated_run_of
from pvid.deploy.of_rig import deployment_f32
from pvid.deploy.targets import write_package
from pvid.models.mechanisms import compiled_of
from pvid.rig.mechanism_file import MechanismRig

EXAMPLES = ROOT / "firmware" / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.c"))
SRC = ROOT / "firmware" / "src"
PAGE = ROOT / "host" / "docs" / "commissioning.md"
PUBLIC = (f"-I{ROOT / 'firmware' / 'include'}",)
ESTIMATOR = sorted(
    [*SRC.glob("solve/*_f32.c"), SRC / "solve" / "kinds.c", *SRC.glob("number/*_f32.c"), SRC / "number" / "fnv.c"]
)
SHIPPED = [
    f"-DRIG_{name}={value}f"
    for name, value in {
        **{"RATE": 1000.0, "R": 1.2, "L": 3e-3, "K": 0.05, "J": 2e-4, "B": 1e-4, "TC": 0.012, "I0": 0.03},
        **{"CURRENT": 10 / 2**12, "AMPLITUDE": 80.0},
    }.items()
]
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
PRINTED = {
    "minimal": r"(?s).*: updated\n.*\nR = 1\.(19|20)\d* \+- \S+ ohm\n.*",
    "timer_and_main_loop": r"estimate 1 at tick \d+: R = 1\.(19|20)\d*\n(?s:.*)",
    "dma_blocks": r"estimate 1 behind tick \d+: R = 1\.(19|20)\d*\n(?s:.*)",
    "own_mechanism": r"0\.0(199|200)\d .*\n0\.0(49|50)\d\d .*\n0\.(09|10)\d\d\d .*\n",
    "snapshot_in_flash": r"(\d+) estimates before the power cut, \1 after it; R = 1\.(19|20)\d*\n",
    "endless_rotation": r"2\d{3} turns, standing 1: R = 1\.(1999|2000|2001)\n",
    "parameters_in_flash": r"R = 1\.(19|20)\d* \+- \S+ at the start of the next life\n",
    "rtos_task": r"R = 1\.(19|20)\d* \+- \S+ ohm\n",
    "commission": r"verdict 1, .*\nR 1(19|20)\d{7} (?s:.*)\n"
    r"30 % off: .* [1-9]\d\.\d+ rad/s\ncommissioned: .* [0-2]\.\d+ rad/s\n",
}


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package in p and its build in b."""
    folder = tmp_path_factory.mktemp("examples")
    compiled = compiled_of("dc_motor")
    made = deployment_f32(compiled, config_for_simulated_rig(compiled), simulated_run_of(compiled)[0], "a test")
    write_package(made, "cmake", folder / "p")
    built(folder / "p", folder / "b")
    run("gcc", "-std=c99", "-Ip/src", "-c", "p/example/dc_motor_example.c", "-o", "example.o", cwd=folder)
    (folder / "core").mkdir()
    run("gcc", "-std=c99", "-ffp-contract=off", *PUBLIC, f"-I{SRC}", "-c", *ESTIMATOR, cwd=folder / "core")
    run("gcc", "-std=gnu99", "-c", STUBS / "freertos" / "tasks.c", "-o", "tasks.o", cwd=folder)
    return folder


@pytest.fixture(scope="module")
def commissioning(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same of a package with a commissioning, and the simulated motor."""
    folder = tmp_path_factory.mktemp("commissioning")
    compiled = compiled_of("dc_motor")
    rig = MechanismRig.parse(block_of(PAGE, "toml"))
    assert rig.sample_rate is not None
    write_package(commissioning_of(compiled, rig.excitation, rig.sample_rate)[0], "cmake", folder / "p")
    built(folder / "p", folder / "b")
    run("gcc", "-std=c99", "-O2", *SHIPPED, "-c", STUBS / "rig" / "rig.c", "-o", "rig.o", cwd=folder)
    return folder


def block_of(page: Path, kind: str) -> str:
    """The page's only block of this kind."""
    (found,) = re.findall(rf"^```{kind}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    return str(found)


def test_the_program_of_the_page_compiles(commissioning: Path, tmp_path: Path) -> None:
    (tmp_path / "page.c").write_text(block_of(PAGE, "c"), encoding="utf-8")
    command = ("gcc", "-std=c99", "-fsyntax-only", *WARNINGS, f"-I{commissioning}/p/src", tmp_path / "page.c")
    run(*command)
    assert len(re.findall(r"commission_\w+\(|_commission\.h", block_of(PAGE, "c"))) <= 30


def test_every_example_has_its_output() -> None:
    assert set(PRINTED) == set(NAMES)
    text = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(\w+)\.c` \|", text, re.MULTILINE)) == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("language", [("gcc", "-std=c99"), ("g++", "-std=c++14", "-x", "c++")], ids=["C", "C++"])
def test_example(name: str, language: tuple[str, ...], tmp_path: Path, request: pytest.FixtureRequest) -> None:
    package: Path = request.getfixturevalue("commissioning" if name == "commission" else "package")
    paths: tuple[str, ...] = (f"-I{package}/p/src", f"-I{package}/p/example", f"-I{STUBS / 'freertos'}")
    objects: tuple[str, ...] = ("example.o", "tasks.o", "b/libpvid_dc_motor.a")
    if name == "commission":
        paths, objects = (f"-I{package}/p/src", f"-I{STUBS / 'rig'}"), ("rig.o", "b/libpvid_dc_motor.a")
    if name == "own_mechanism":  # no package's
        paths, objects = PUBLIC, tuple(f"core/{one.stem}.o" for one in ESTIMATOR)
    flags = (*language[1:], *WARNINGS, *paths)
    run(language[0], *flags, "-c", EXAMPLES / f"{name}.c", "-o", tmp_path / "main.o", cwd=package)
    run(language[0], tmp_path / "main.o", *objects, "-lm", "-pthread", "-o", tmp_path / "it", cwd=package)
    assert re.fullmatch(PRINTED[name], run(tmp_path / "it"))


@pytest.mark.parametrize(("rate", "compiles"), [(1000, True), (2000, True), (1500, False), (100, False)])
def test_a_task_whose_period_is_no_whole_number_of_ticks_is_refused(rate: int, compiles: bool, package: Path) -> None:
    """At 100 Hz, a usual rate, a period of 1 ms was 0 ticks; at 1.5 kHz it would be a third too short."""
    paths = (f"-I{package}/p/src", f"-I{package}/p/example", f"-I{STUBS / 'freertos'}")
    tick = f"-DconfigTICK_RATE_HZ=((TickType_t){rate})"
    command = ["gcc", "-std=c99", "-fsyntax-only", *WARNINGS, *paths, tick, str(EXAMPLES / "rtos_task.c")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode == 0) == compiles
    assert compiles or "raise_configTICK_RATE_HZ" in done.stderr
