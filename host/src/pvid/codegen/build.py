"""A folder with the generated files of a model: the line of printers, each of which reads the generated model."""

from __future__ import annotations

from pathlib import Path

from pvid.base.atomic_write import write_files
from pvid.base.errors import PvidError
from pvid.codegen import (
    cmake,
    files_functions,
    files_refine,
    files_strong,
    files_strong_design,
    files_strong_q31,
    files_weak,
    files_weak_q31,
    self_test,
    twin_file,
)
from pvid.codegen.files_robot import RobotFiles
from pvid.codegen.generated import GeneratedModel

# Each takes the generated model and returns name -> text of its files, none where the model or the order has no such
# part.
PRINTERS = (
    files_functions.printed_f32,
    files_functions.printed_q31,
    files_weak.printed,
    files_weak.printed_design,
    files_weak_q31.printed,
    files_strong.printed,
    files_strong_design.printed,
    files_strong_q31.printed,
    files_refine.printed,
    files_refine.printed_design,
    twin_file.printed,
    self_test.printed,
    cmake.printed,
)


def files_of(model: GeneratedModel | RobotFiles) -> dict[str, str]:
    """Name -> text of each file.

    Raises PvidError where a function cannot be generated; for a soft sign that is in no channel, a reach that is of no
    input.
    """
    if isinstance(model, RobotFiles):
        return model.files()
    return {name: text for printed in PRINTERS for name, text in printed(model).items()}


def build(model: GeneratedModel | RobotFiles, directory: Path) -> list[Path]:
    """Writes the files of a model into a folder, which is made if there is none; their paths. Raises as `files_of`."""
    files = files_of(model)
    directory.mkdir(parents=True, exist_ok=True)
    return write_files(directory, files)


def check(model: GeneratedModel | RobotFiles, directory: Path) -> None:
    """Whether the files in a folder are those of the model.

    Raises PvidError for the first file that is missing or differs.
    """
    for name, text in files_of(model).items():
        path = directory / name
        if not path.is_file():
            raise PvidError(f"{path} is missing: build the model again")
        if path.read_text(encoding="utf-8") != text:
            raise PvidError(f"{path} is not what {model.compiled.name} generates now: build the model again")
