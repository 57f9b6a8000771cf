"""The Arduino package on an emulated ATmega2560, and what an Uno lacks."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from packages import STUBS, run

from pvid.board.boards import BOARDS
from pvid.board.boards import run as run_on
from pvid.deploy import memory
from pvid.deploy.arduino import package
from pvid.deploy.deployment import Deployment
from pvid.deploy.example import expected
from pvid.deploy.of_rig import deployment_q31
from pvid.deploy.targets import write_package
from pvid.models.mechanisms import compiled_of
from pvid.run.engine_design import simulated_run_of
from pvid.run.engine_design_q31 import engine_for_simulated_rig

# As Arduino compiles: GNU standards, the library's src and the sketch's folder on the path, the sketch as C++.
C = ("avr-gcc", "-mmcu=atmega2560", "-Os", "-std=gnu11", "-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra")
CPP = ("avr-g++", "-mmcu=atmega2560", "-Os", "-std=gnu++11", "-fno-exceptions", "-Wall", "-Wextra", "-Werror")


@pytest.fixture(scope="module")
def pendulum() -> Deployment:
    compiled = compiled_of("kapitza")
    return deployment_q31(engine_for_simulated_rig(compiled), simulated_run_of(compiled)[0], "a test")


def test_a_mega_identifies_the_pendulum_in_fixed_point(pendulum: Deployment, tmp_path: Path) -> None:
    write_package(pendulum, "arduino", tmp_path)
    example, stub = tmp_path / "examples" / "kapitza", STUBS / "arduino"
    sources = [*(tmp_path / "src").rglob("*.c"), *example.glob("*.c")]
    (tmp_path / "o").mkdir()

    def compiled(source: Path) -> str:
        target = tmp_path / "o" / f"{source.stem}.o"
        run(*C, f"-I{tmp_path / 'src'}", f"-I{example}", "-c", source, "-o", target)
        return str(target)

    with ThreadPoolExecutor(2) as pool:
        objects = list(pool.map(compiled, sources))
    sketch = ("-include", "Arduino.h", "-x", "c++", example / "kapitza.ino")
    paths = (f"-I{stub}", f"-I{tmp_path / 'src'}", f"-I{example}")
    lines = f"-DLINES={len(pendulum.parameters)}"
    image = tmp_path / "sketch.elf"
    run(*CPP, *paths, lines, *sketch, stub / "core.cpp", "-x", "none", *objects, "-Wl,--gc-sections", "-o", image)
    done = run_on(BOARDS["atmega2560"], image, 120)
    assert done.text.splitlines() == expected(pendulum)


def test_the_readme_tells_that_an_uno_has_too_little_ram(pendulum: Deployment) -> None:
    size = memory.state_bytes(pendulum)
    assert size is not None and 4500 < size < 5500  # 5005 on an AVR
    sentence = f"An Uno has 2048 bytes of RAM, too few for the identifier's {size}; a Mega has 8192."
    assert sentence in package(pendulum)["README.md"]
