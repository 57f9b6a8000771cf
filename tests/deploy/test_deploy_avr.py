"""The Arduino package, built by arduino-mk on Arduino's own core and run on an emulated Mega; and what an Uno holds."""

import re
import shutil
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from ecosystems import arduino
from own_mechanisms import OWN
from packages import STUBS, run
from program import pvid
from test_examples import ESTIMATOR, PRINTED

from pvid.base.subprocesses import start
from pvid.board.boards import BOARDS, prepare_emulator
from pvid.configuration.weak import simulated_run_of
from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.deploy import memory
from pvid.deploy.arduino import package
from pvid.deploy.deployment import Deployment
from pvid.deploy.example import expected
from pvid.deploy.of_rig import deployment_q31
from pvid.deploy.targets import write_package
from pvid.models.mechanisms import compiled_of

_SECONDS = 120  # of the emulator


@pytest.fixture(scope="module")
def pendulum() -> Deployment:
    compiled = compiled_of("kapitza")
    return deployment_q31(weak_q31_for_simulated_rig(compiled), simulated_run_of(compiled)[0], "a test")


def uploaded(sketch: Path, board: str, libraries: Path, library: str, *more: str) -> Path:
    """The image of a sketch."""
    core, makefiles = arduino()
    places = (f"ARDUINO_DIR={core}", f"ARDMK_DIR={makefiles}", f"USER_LIB_PATH={libraries}")
    makefile = STUBS / "arduino" / "Makefile"
    run("make", "-j2", "-C", sketch, "-f", makefile, *places, f"ARDUINO_LIBS={library}", f"BOARD={board}", *more)
    (image,) = (sketch / "build").glob("*.elf")
    return image


def printed(board: str, image: Path, count: int) -> list[str]:
    """The first lines that an image sends. A sketch never ends."""
    target = BOARDS[board]
    prepare_emulator(target)
    process = start(target.command(image), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    assert process.stdout is not None
    end = threading.Timer(_SECONDS, process.kill)
    end.start()
    try:
        return [process.stdout.readline().decode("ascii").rstrip() for _ in range(count)]
    finally:
        end.cancel()
        process.kill()
        process.communicate()


@pytest.mark.night
def test_a_mega_identifies_the_pendulum_in_fixed_point(pendulum: Deployment, tmp_path: Path) -> None:
    library = tmp_path / "pvid_kapitza"
    write_package(pendulum, "arduino", library)
    image = uploaded(library / "examples" / "kapitza", "mega", tmp_path, library.name)
    wanted = expected(pendulum)
    assert printed("atmega2560", image, len(wanted)) == wanted


@pytest.mark.night
def test_an_uno_runs_the_estimator_on_rows_of_ones_own(tmp_path: Path) -> None:
    sketch, library = tmp_path / "uno", tmp_path / "libraries" / "pvid"
    source = library / "src"
    shutil.copytree(STUBS / "arduino" / "uno", sketch)
    shutil.copytree(ROOT / "firmware" / "include", source)
    (library / "library.properties").write_text("name=pvid\n", encoding="utf-8")
    for room in ("number", "solve"):
        (source / room).mkdir()
        for header in (ROOT / "firmware" / "src" / room).glob("*.h"):
            shutil.copy(header, source / room)
    for one in ESTIMATOR:
        shutil.copy(one, source / one.parent.name)
    sizes = f'MORE_FLAGS=-I{ROOT}/firmware/examples -I{sketch} -DPVID_CONFIG_HEADER=\\"sizes.h\\"'
    floats = "MORE_LINKED=-Wl,-u,vfprintf -lprintf_flt"
    image = uploaded(sketch, "uno", tmp_path / "libraries", "pvid", sizes, floats)
    size = {name: int(number) for name, number in re.findall(r"^(\.\w+) +(\d+)", run("avr-size", "-A", image), re.M)}
    assert size[".data"] + size[".bss"] < 2048 - 512  # of RAM, without the stack
    assert re.fullmatch(PRINTED["own_mechanism"], "\n".join(printed("atmega328p", image, 3)) + "\n")


def test_the_readme_tells_that_an_uno_has_too_little_ram(pendulum: Deployment) -> None:
    size = memory.state_bytes(pendulum)
    assert size is not None and 3500 < size < 4500  # 4105 on an AVR
    sentence = f"An Uno has 2048 bytes of RAM, too few for the identifier's {size}; a Mega has 8192."
    assert sentence in package(pendulum)["README.md"]


def test_the_least_mechanism_is_too_large_for_an_uno_and_a_poor_recording_is_named(tmp_path: Path) -> None:
    """One input, one sensor, two unknowns; the run is a tenth of the plate's time constant."""
    shutil.copy(OWN["heated_plate"].path, tmp_path / "heater.py")
    assert pvid(tmp_path, "model", "simulate", "heater.py", "run.csv", "--drive", "steps").returncode == 0
    done = pvid(tmp_path, *"deploy heater.py --for arduino --core q31 --run run.csv -o out".split())
    assert done.returncode == 0, done.stderr
    assert "the first 15 s of the recording and prints no estimate: held uncertain" in done.stderr
    size = re.search(r"about (\d+) bytes of RAM", (tmp_path / "out" / "README.md").read_text(encoding="utf-8"))
    assert size is not None and 2048 < int(size[1]) < 8192


@pytest.mark.night
def test_the_sketch_that_records_sends_a_run(tmp_path: Path) -> None:
    """On an emulated Uno, whose inputs are open: the clock, the drive and the format of its lines."""
    sketch = tmp_path / "record"
    shutil.copytree(ROOT / "firmware" / "examples" / "record", sketch)
    header, *lines = printed("atmega328p", uploaded(sketch, "uno", tmp_path, ""), 202)
    assert header == "t,duty,current,counts"
    t, duty, current, counts = np.array([line.split(",") for line in lines], float).T
    assert np.array_equal(t, 5.0 * np.arange(201))  # no line was late
    assert len(set(duty)) == 6 and np.array_equal(np.flatnonzero(np.diff(duty)) + 1, [40, 80, 120, 160, 200])
    assert duty.min() >= 0 and duty.max() <= 255 and np.all((0 <= current) & (current < 1024)) and not counts.any()
