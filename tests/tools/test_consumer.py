"""Projects outside pvid build against it in every way that it offers, with the sizes it was built with."""

from __future__ import annotations

import re
import shutil
import subprocess
import tarfile
from dataclasses import dataclass
from pathlib import Path

import pytest
from conftest import ROOT

from pvid.base.version import __version__
from pvid.core.sources import public_headers

CONSUMER = ROOT / "tests" / "consumer"
SOURCES = ("CMakeLists.txt", "LICENSE", "firmware")  # all that a user's build needs
QUICK = "-DCMAKE_BUILD_TYPE=None"  # no optimisation: how it is linked is not changed by that, nor a bit
LINKED = "-DPVID_LEAVE_OUT=refine|snapshot|persist/fingerprint"  # what no consumer links; `prefix` has all of the core
HARMONICS = 17  # not the default: the definition must reach whoever links the library


def call(*command: str | Path, cwd: Path | None = None) -> str:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, cwd=cwd, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def configured(build: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = ["cmake", "-S", str(CONSUMER), "-B", str(build), "-G", "Ninja", *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def built(build: Path, *options: str) -> list[str]:
    """Configures and builds the consumer; what its two programs print."""
    done = configured(build, *options)
    assert done.returncode == 0, done.stdout + done.stderr
    call("ninja", "-C", build)
    return [call(build / "consumer_c").strip(), call(build / "consumer_cpp").strip()]


def install(prefix: Path, build: Path, *options: str) -> None:
    call(
        *("cmake", "-S", ROOT, "-B", build, "-G", "Ninja", QUICK, f"-DCMAKE_INSTALL_PREFIX={prefix}"),
        *("-DPVID_BUILD_TESTS=OFF", "-DPVID_BUILD_NATIVE=OFF", *options),
    )
    call("ninja", "-C", build, "install")


@dataclass(frozen=True)
class Printed:
    """What the C program says."""

    version: str
    harmonics: int
    hash: str

    @classmethod
    def of(cls, text: str) -> Printed:
        found = re.fullmatch(r"version (\S+) harmonics (\d+) hash ([0-9a-f]{8})", text)
        assert found is not None, text
        return cls(found[1], int(found[2]), found[3])


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tree that pvid was installed into, and that was moved since."""
    folder = tmp_path_factory.mktemp("installed")
    install(folder / "first", folder / "build", f"-DPVID_MAX_HARMONICS={HARMONICS}")
    shutil.rmtree(folder / "build")
    return (folder / "first").rename(folder / "moved here")


@pytest.fixture(scope="module")
def version() -> str:
    text = (ROOT / "firmware" / "include" / "pvid" / "version.h").read_text(encoding="utf-8")
    return ".".join(re.findall(r"#define PVID_VERSION_\w+ (\d+)", text))


@pytest.fixture(scope="module")
def by_package(prefix: Path, version: str, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    build = tmp_path_factory.mktemp("find_package")
    wanted = f"-DPVID_VERSION_WANTED={version.rpartition('.')[0]}"
    return built(build, "-DPVID_BY=find_package", f"-DCMAKE_PREFIX_PATH={prefix}", wanted)


def test_the_python_package_has_the_same_version(version: str) -> None:
    assert __version__ == version


def test_find_package(by_package: list[str], version: str) -> None:
    printed = Printed.of(by_package[0])
    assert (printed.version, printed.harmonics) == (version, HARMONICS)
    assert by_package[1] == f"version {version} harmonics {HARMONICS}"


def test_find_package_refuses_another_version(prefix: Path, tmp_path: Path) -> None:
    options = ("-DPVID_BY=find_package", f"-DCMAKE_PREFIX_PATH={prefix}", "-DPVID_VERSION_WANTED=0.9")
    done = configured(tmp_path, *options)
    assert done.returncode != 0
    assert "0.9" in done.stderr


@pytest.mark.night
def test_fetch_content(by_package: list[str], tmp_path: Path) -> None:
    archive = tmp_path / "pvid.tar.gz"
    with tarfile.open(archive, "w:gz") as file:
        for name in SOURCES:
            file.add(ROOT / name, f"pvid-1/{name}")
    url = archive.as_uri()
    printed = built(
        *(tmp_path / "build", QUICK, LINKED, "-DPVID_BY=FetchContent", f"-DPVID_ARCHIVE={url}"),
        f"-DPVID_MAX_HARMONICS={HARMONICS}",
    )
    assert printed == by_package


@pytest.mark.night
def test_add_subdirectory(by_package: list[str], tmp_path: Path) -> None:
    for name in SOURCES:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tmp_path / name)
    options = (QUICK, LINKED, "-DPVID_BY=add_subdirectory", f"-DPVID_SOURCES={tmp_path}")
    printed = Printed.of(built(tmp_path / "build", *options)[0])
    assert printed.harmonics == 13  # the default
    assert printed.hash == Printed.of(by_package[0]).hash  # sizes change no bit


def flags(prefix: Path, *what: str) -> list[str]:
    """What pkg-config says, as a shell would split it."""
    folder = next(prefix.rglob("pvid.pc")).parent
    command = f'PKG_CONFIG_PATH="$1" pkg-config {" ".join(what)} pvid | xargs printf "%s\\n"'
    return call("sh", "-c", command, "sh", folder).splitlines()


def test_pkg_config(prefix: Path, by_package: list[str], version: str, tmp_path: Path) -> None:
    assert flags(prefix, "--modversion") == [version]
    compiled = tmp_path / "consumer"
    source = CONSUMER / "consumer.c"
    both = flags(prefix, "--cflags", "--libs")
    call("gcc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", source, *both, "-o", compiled)
    assert call(compiled).strip() == by_package[0]
    call(
        "g++",
        "-std=c++11",
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Wold-style-cast",
        "-Werror",
        CONSUMER / "consumer.cpp",
        *both,
        "-o",
        compiled,
    )
    assert call(compiled).strip() == by_package[1]


def test_init_refuses_sizes_that_disagree(prefix: Path, tmp_path: Path) -> None:
    """Here the header's default meets a library of 17."""
    without = [flag for flag in flags(prefix, "--cflags", "--libs") if not flag.startswith("-DPVID_MAX_HARMONICS")]
    call("gcc", "-std=c99", CONSUMER / "consumer.c", *without, "-o", tmp_path / "consumer")
    done = subprocess.run([tmp_path / "consumer"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "init: bad layout" in done.stderr
    assert "library: window=321 " in done.stderr and " harmonics=17 " in done.stderr and " harmonics=13 " in done.stderr


@pytest.mark.night
def test_a_header_of_sizes_travels_too(tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "my_sizes.h").write_text("#define PVID_MAX_HARMONICS 19\n", encoding="utf-8")
    options = (LINKED, "-DPVID_CONFIG_HEADER=my_sizes.h", f"-DCMAKE_C_FLAGS=-I{mine}")
    install(tmp_path / "prefix", tmp_path / "build", *options)
    compiled = tmp_path / "consumer"
    both = flags(tmp_path / "prefix", "--cflags", "--libs")
    call("gcc", "-std=c99", f"-I{mine}", CONSUMER / "consumer.c", *both, "-o", compiled)
    assert Printed.of(call(compiled).strip()).harmonics == 19
    printed = built(
        *(tmp_path / "find", "-DPVID_BY=find_package", f"-DCMAKE_PREFIX_PATH={tmp_path / 'prefix'}"),
        *(f"-DCMAKE_C_FLAGS=-I{mine}", f"-DCMAKE_CXX_FLAGS=-I{mine}"),
    )
    assert Printed.of(printed[0]).harmonics == 19


def test_installed_files(prefix: Path) -> None:
    files = {path.relative_to(prefix).as_posix() for path in prefix.rglob("*") if path.is_file()}
    headers = {f"include/{path.as_posix()[path.as_posix().rindex('/pvid/') + 1 :]}" for path in public_headers()}
    assert headers == {name for name in files if name.endswith(".h")}  # public headers only, all of them
    assert {"lib/libpvid.a", "lib/pkgconfig/pvid.pc"} <= files
    assert {f"lib/cmake/pvid/pvid-config{part}.cmake" for part in ("", "-version")} <= files
    assert any(name.endswith("pvid/LICENSE") for name in files)
    texts = [prefix / name for name in files if name.endswith((".cmake", ".pc", ".h"))]
    for path in texts:  # nothing may point back to where it was built
        assert str(ROOT) not in path.read_text(encoding="utf-8"), path
        assert "first" not in path.read_text(encoding="utf-8").split("/"), path
