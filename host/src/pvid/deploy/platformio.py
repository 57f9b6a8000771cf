"""A PlatformIO library: library.json, src/, and the example as a project."""

from __future__ import annotations

import json

from pvid.base.version import __version__
from pvid.codegen.cmake import COMPILE_OPTIONS
from pvid.deploy.arduino import sketch
from pvid.deploy.deployment import Deployment, Files
from pvid.deploy.library import library_files, licence
from pvid.deploy.memory import avr_note
from pvid.deploy.readme import readme

_PROJECT = """\
; pio run -e mega -t upload && pio device monitor
[platformio]
src_dir = .

[env]
framework = arduino
monitor_speed = 115200
lib_deps = symlink://../..

[env:mega]
platform = atmelavr
board = megaatmega2560

[env:nucleo]
platform = ststm32
board = nucleo_f446re

[env:esp32]
platform = espressif32
board = esp32dev
"""


def manifest(d: Deployment) -> str:
    """library.json."""
    names = ", ".join(one.name for one in d.parameters)
    return (
        json.dumps(
            {
                "name": d.library,
                "version": __version__,
                "description": f"Identifies {names} of a mechanism while it runs: {d.title}.",
                "keywords": ["identification", "estimation", "control", "parameters"],
                "license": "MIT",
                "frameworks": "*",
                "platforms": "*",
                "headers": f"{d.name}_identifier.h",
                "build": {"flags": COMPILE_OPTIONS.split(), "srcDir": "src", "includeDir": "src"},
                "examples": [
                    {
                        "name": d.name,
                        "base": f"examples/{d.name}",
                        "files": [f"{d.name}.ino", f"{d.name}_example.c", f"{d.name}_example.h"],
                    }
                ],
            },
            indent=2,
        )
        + "\n"
    )


def package(d: Deployment) -> Files:
    """Name -> text."""
    steps = [
        f"`cd examples/{d.name}` and `pio run -e mega -t upload` (others: platformio.ini), `pio device monitor`.",
        f"In your own project: `lib_deps = symlink://PATH/{d.library}`, or `pio pkg pack` here and the archive's path.",
    ]
    files = library_files(d) | sketch(d) | licence()
    return files | {
        "library.json": manifest(d),
        f"examples/{d.name}/platformio.ini": _PROJECT,
        "README.md": readme(d, "for PlatformIO", steps, [avr_note(d)]),
    }
