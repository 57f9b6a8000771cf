"""What the ecosystems themselves bring, fetched once into build/fetched: packages of Debian unpacked without being
installed (arduino-mk would drag in a Java environment, newlib 370 MB), and the packers of PlatformIO and ESP-IDF in
an environment of their own."""

import subprocess
import sys
from pathlib import Path

from fetched import once
from packages import run

PACKERS = Path(__file__).with_name("packers.txt")


def _unpacked(package: str, *patterns: str) -> Path:
    """Files of a Debian package that match a pattern of tar, all without one."""

    def make(folder: Path) -> None:
        fetch = ("apt-get", "-o", "APT::Sandbox::User=root", "download", package)  # _apt may not write here
        if subprocess.run(fetch, cwd=folder, capture_output=True, check=False).returncode:
            run("apt-get", "update")  # there may be no lists of packages yet
            run(*fetch, cwd=folder)
        unpack = 'dpkg-deb --fsys-tarfile ./*.deb | tar -x --wildcards "$@"'
        run("bash", "-o", "pipefail", "-c", unpack, "bash", *patterns, cwd=folder)

    return once(package, make) / "usr"


def newlib(multilib: str) -> tuple[Path, Path]:
    """Newlib's headers, and the folder of its libraries for one kind of core, like thumb/v7e-m+fp/hard."""
    headers = _unpacked("libnewlib-dev", "./usr/include/*") / "include" / "newlib"
    folder = _unpacked("libnewlib-arm-none-eabi", f"./usr/lib/arm-none-eabi/newlib/{multilib}/*.a")
    return headers, folder / "lib" / "arm-none-eabi" / "newlib" / multilib


def arduino() -> tuple[Path, Path]:
    """Folders of Arduino's core for AVRs, and of arduino-mk."""
    place = Path("share") / "arduino"
    return _unpacked("arduino-core-avr", "./usr/share/*") / place, _unpacked("arduino-mk", "./usr/share/*") / place


def packer(module: str) -> tuple[str | Path, ...]:
    """The command of PlatformIO (`platformio`) or of ESP-IDF's component manager (`idf_component_manager`)."""

    def make(folder: Path) -> None:
        run(sys.executable, "-m", "venv", folder)
        pip = (folder / "bin" / "python", "-m", "pip", "--disable-pip-version-check", "install", "--quiet")
        run(*pip, "--requirement", PACKERS)

    return once("packers", make) / "bin" / "python", "-m", module
