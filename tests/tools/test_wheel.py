"""The wheel: the package with its C core, installed into environments that have nothing of this clone."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import ROOT

PYTHONS = ("3.11", "3.12", "3.13")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from the sources that git has, in a folder of its own."""
    place = tmp_path_factory.mktemp("wheel")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.split("\0"):
        if name.startswith(("CMakeLists.txt", "LICENSE", "firmware/", "host/native/", "host/src/", "host/pyproject")):
            (place / "source" / name).parent.mkdir(parents=True, exist_ok=True)
            if (ROOT / name).exists():
                shutil.copy(ROOT / name, place / "source" / name)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-index", "--no-build-isolation"]
    subprocess.run([*command, "-w", str(place), str(place / "source" / "host")], check=True, cwd=place)
    (found,) = place.glob("*.whl")
    return found


def test_the_wheel_has_the_core_its_sources_and_the_licences(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    for name in (
        "pvid/libpvid_native.so",
        "pvid/pvid.i",
        "pvid/sources/firmware/include/pvid/pvid.h",
        "pvid/sources/host/native/replay.c",
        "pvid/show/web/uplot.js",
    ):
        assert name in names
    assert any(name.endswith("LICENSE") for name in names) and any("uplot.LICENSE" in name for name in names)
    assert wheel.stat().st_size < 4_000_000 and "py3-none" in wheel.name


def _answers(python: str) -> bool:
    """Not so a version manager's stand-in for a version that is not chosen."""
    return subprocess.run([python, "--version"], capture_output=True, check=False).returncode == 0


def interpreters() -> Iterator[str]:
    """Of the versions that pvid is for, those that this machine has."""
    for version in PYTHONS:
        candidates = [shutil.which(f"python{version}"), *Path.home().glob(f".pyenv/versions/{version}.*/bin/python")]
        ready = [str(one) for one in candidates if one and _answers(str(one))]
        if ready:
            yield ready[0]


@pytest.fixture(scope="module")
def bare(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with the wheel, and this one's packages in place of a download."""
    place = tmp_path_factory.mktemp("bare") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place)], check=True)
    (packages,) = place.glob("lib/python*/site-packages")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(packages)
    (ours,) = (Path(sys.prefix) / "lib").glob("python*/site-packages")
    (packages / "others.pth").write_text(f"{ours}\n", encoding="utf-8")  # its own .pth files count for nothing
    return place / "bin" / "python"


def run(python: Path, code: str, folder: Path) -> str:
    done = subprocess.run([python, "-P", "-c", code], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_installed_package_identifies_by_its_own_core(bare: Path, tmp_path: Path) -> None:
    main = "import sys; from pvid.cli.main import main; sys.argv[1:] = {!r}; main()"
    run(bare, main.format(["simulate", "run.csv", "--duration", "20"]), tmp_path)
    told = run(bare, "import pvid; print(pvid.__file__); print(pvid.identify('run.csv'))", tmp_path)
    assert str(bare.parents[1]) in told and "g = 9." in told and "nothing" not in told
    assert "core" in run(bare, main.format(["compare", "run.csv"]), tmp_path)


def test_a_mechanism_is_compiled_with_the_sources_in_the_wheel(
    bare: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    main = "import sys; from pvid.cli.main import main; sys.argv[1:] = {!r}; main()"
    run(bare, main.format(["model", "simulate", "dc_motor", "motor.csv", "--duration", "10"]), tmp_path)
    told = run(bare, main.format(["identify", "motor.csv", "--core", "f32", "--json"]), tmp_path)
    assert '"identified": true' in told
    assert list((tmp_path / "cache" / "pvid").glob("cache/models/dc_motor*")) or (tmp_path / "cache").exists()


def test_without_termios_every_command_but_the_link_works(bare: Path, tmp_path: Path) -> None:
    """As on Windows."""
    block = "import sys; sys.modules['termios'] = None; sys.modules['fcntl'] = sys.modules['resource'] = None\n"
    main = "from pvid.cli.main import main; sys.argv[1:] = ['simulate', 'run.csv', '--duration', '20']; main()"
    run(bare, block + main, tmp_path)
    assert "g = 9." in run(bare, block + "import pvid; print(pvid.identify('run.csv'))", tmp_path)


def test_a_missing_extra_is_named(bare: Path, tmp_path: Path) -> None:
    block = "import sys; sys.modules['matplotlib'] = None\n"
    main = "from pvid.cli.main import main; sys.argv[1:] = ['plot', 'run.csv', '--set', 'l1=0.3']; main()"
    (tmp_path / "run.csv").write_text("t,phi,y\n", encoding="utf-8")
    done = subprocess.run([bare, "-P", "-c", block + main], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "pip install 'pvid[plot]'" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize("python", list(interpreters()))
def test_every_python_that_is_here_can_read_the_sources(python: str, wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    subprocess.run([python, "-m", "compileall", "-q", str(tmp_path / "pvid")], check=True)
