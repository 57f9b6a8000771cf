"""The wheel: the package with its C core, installed into environments that have nothing of this clone."""

import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest
from conftest import ROOT
from fetched import once

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
    command += ["--config-settings", "cmake.build-type=None"]  # no optimisation, which changes no bit
    subprocess.run([*command, "-w", str(place), str(place / "source" / "host")], check=True, cwd=place)
    (found,) = place.glob("*.whl")
    return found


def test_the_wheel_has_the_core_its_sources_and_the_licences(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    for name in (
        "pvid/py.typed",
        "pvid/libpvid_native.so",
        "pvid/pvid.i",
        "pvid/sources/firmware/include/pvid/pvid.h",
        "pvid/sources/host/native/replay.c",
        "pvid/show/web/uplot.js",
    ):
        assert name in names
    assert any(name.endswith("LICENSE") for name in names) and any("uplot.LICENSE" in name for name in names)
    assert wheel.stat().st_size < 4_000_000 and "py3-none" in wheel.name


@cache
def _version(python: str) -> str | None:
    """As in 3.12; None where it does not answer: a version manager's stand-in for a version that is not chosen."""
    asked = "import sys, venv, ensurepip; print('%d.%d' % sys.version_info[:2])"
    done = subprocess.run([python, "-c", asked], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else None


def interpreters() -> list[str]:
    """Of the versions that pvid is for, those that this machine seems to have."""
    found = []
    for version in PYTHONS:
        candidates = [*Path.home().glob(f".pyenv/versions/{version}.*/bin/python"), shutil.which(f"python{version}")]
        found += [str(one) for one in candidates if one][:1]
    return found


@contextmanager
def compiled_once(environment: Path, place: Path) -> Iterator[None]:
    """Bytecode of an environment's packages stays in it, where compiling 1700 modules for every process takes longer
    than what it does; that of a place goes with it."""
    with pytest.MonkeyPatch.context() as patched:
        patched.delenv("PYTHONDONTWRITEBYTECODE", raising=False)
        patched.setenv("PYTHONPYCACHEPREFIX", str(environment / "bytecode"))
        yield
    shutil.rmtree(environment / "bytecode" / place.relative_to("/"), ignore_errors=True)


@pytest.fixture(scope="module")
def bare(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """An environment with the wheel, and this one's packages in place of a download."""
    place = tmp_path_factory.mktemp("bare") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place)], check=True)
    (packages,) = place.glob("lib/python*/site-packages")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(packages)
    (ours,) = (Path(sys.prefix) / "lib").glob("python*/site-packages")
    (packages / "others.pth").write_text(f"{ours}\n", encoding="utf-8")  # its own .pth files count for nothing
    with compiled_once(Path(sys.prefix), place):
        yield place / "bin" / "python"


def run(python: Path, code: str, folder: Path) -> str:
    done = subprocess.run([python, "-P", "-c", code], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def commands(*lines: str) -> str:
    """Code that executes command lines of pvid, one after the other."""
    return f"""import sys
from pvid.cli.main import main
for words in {[line.split() for line in lines]}:
    sys.argv[1:] = words
    try:
        main()
    except SystemExit as end:
        assert not end.code
"""


def test_the_installed_package_compares_its_own_core_with_the_twin(bare: Path, tmp_path: Path) -> None:
    assert "equal" in run(bare, commands("simulate run.csv --duration 8", "compare run.csv"), tmp_path)


@pytest.mark.night
def test_a_mechanism_is_compiled_with_the_sources_in_the_wheel(
    bare: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made, asked = "model simulate dc_motor motor.csv --duration 10", "identify motor.csv --core f32 --json"
    told = run(bare, commands(made, asked), tmp_path)
    assert '"identified": true' in told
    assert list((tmp_path / "cache" / "pvid").glob("cache/models/dc_motor*")) or (tmp_path / "cache").exists()


@pytest.mark.night
def test_without_termios_every_command_but_the_link_works(bare: Path, tmp_path: Path) -> None:
    """As on Windows."""
    block = "import sys; sys.modules['termios'] = None; sys.modules['fcntl'] = sys.modules['resource'] = None\n"
    asked = "import pvid; print(pvid.identify('run.csv'))"
    assert "g = 9." in run(bare, block + commands("simulate run.csv --duration 8") + asked, tmp_path)


def test_a_missing_extra_is_named(bare: Path, tmp_path: Path) -> None:
    block = "import sys; sys.modules['matplotlib'] = None\n"
    main = "from pvid.cli.main import main; sys.argv[1:] = ['plot', 'run.csv', '--set', 'l1=0.3']; main()"
    (tmp_path / "run.csv").write_text("t,phi,y\n", encoding="utf-8")
    done = subprocess.run([bare, "-P", "-c", block + main], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "-m pip install matplotlib" in done.stderr and "Traceback" not in done.stderr


FOUND = interpreters()


@pytest.mark.night
@pytest.mark.parametrize(
    "python",  # the oldest and the newest; those between them in the long form
    [pytest.param(one, id=one, marks=pytest.mark.long if one in FOUND[1:-1] else ()) for one in FOUND],
)
def test_every_python_that_is_here_installs_it_and_identifies(python: str, wheel: Path, tmp_path: Path) -> None:
    """By pip, into an environment of its own that finds the dependencies in another one: for the version that the tests
    themselves run in, in theirs."""
    version = _version(python)
    if version is None:
        pytest.skip(f"{python} stands in for a version that is not here")

    def make(folder: Path) -> None:
        text = (ROOT / "host" / "pyproject.toml").read_text(encoding="utf-8")
        needed = tomllib.loads(text)["project"]["dependencies"]
        subprocess.run([python, "-m", "venv", folder], check=True)
        pip = [str(folder / "bin" / "python"), "-m", "pip", "install", "--quiet", "--no-compile"]
        subprocess.run([*pip, *needed], check=True)

    is_ours = version == f"{sys.version_info.major}.{sys.version_info.minor}"
    environment = Path(sys.prefix) if is_ours else once(f"python-{version}", make)
    place = tmp_path / "venv"
    subprocess.run([python, "-m", "venv", "--without-pip", place], check=True)
    (packages,) = place.glob("lib/python*/site-packages")
    (others,) = environment.glob("lib/python*/site-packages")
    (packages / "others.pth").write_text(f"{others}\n", encoding="utf-8")
    with compiled_once(environment, place):
        pip = [str(environment / "bin" / "python"), "-m", "pip", "--python", str(place / "bin" / "python")]
        subprocess.run([*pip, "install", "--quiet", "--no-deps", "--no-index", str(wheel)], check=True)
        program = place / "bin" / "pvid"
        subprocess.run([program, "simulate", "run.csv", "--duration", "8"], cwd=tmp_path, check=True)
        asked = "import pvid; print(pvid.__file__); print(pvid.identify('run.csv'))"
        told = run(place / "bin" / "python", asked, tmp_path)
    assert str(place) in told and "g = 9." in told and "nothing" not in told
