"""The ecosystems that a deployment is written for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from pvid.base.atomic_write import write_files
from pvid.base.errors import PvidError
from pvid.deploy import amalgamation, arduino, cmake, cubemx, esp_idf, platformio, zephyr
from pvid.deploy.deployment import Deployment, Files

TARGETS: Mapping[str, Callable[[Deployment], Files]] = {
    "arduino": arduino.package,
    "platformio": platformio.package,
    "esp-idf": esp_idf.package,
    "zephyr": zephyr.package,
    "cmake": cmake.package,
    "cubemx": cubemx.package,
    "amalgamation": amalgamation.package,
}


def write_package(deployment: Deployment, target: str, folder: Path) -> list[Path]:
    """Writes the files of a package.

    Raises PvidError where the folder has other files: two packages in one would be compiled together.

    Returns
    -------
    Their paths.
    """
    files = TARGETS[target](deployment)
    if folder.is_dir():
        strange = sorted(
            name
            for path in folder.rglob("*")
            if path.is_file() and (name := path.relative_to(folder).as_posix()) not in files
        )
        if strange:
            raise PvidError(
                f"{folder} has files that are not of this package, {strange[0]} for one: name an empty folder"
            )
    return write_files(folder, files)
