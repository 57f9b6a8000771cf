"""Text files of Octave (`save run.txt`): matrices, one after the other, each under its name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import shown
from pvid.rig.columns import Columns
from pvid.rig.table import Table
from pvid.rig.text_lines import blocks
from pvid.rig.tree_table import table_of_arrays

_BEGIN = (b"# Created by Octave", b"# name: ")


def is_octave(path: Path) -> bool:
    """Whether a file begins as one of Octave's text format."""
    with path.open("rb") as file:
        return file.read(19).startswith(_BEGIN)


def read_octave(path: Path, columns: Columns) -> Table:
    """Reads the matrices of a file, a column of each named as in a .mat file.

    Raises PvidError for a matrix with another number of numbers than it states, two of one name, and as `table_of`.
    """
    arrays: dict[str, npt.NDArray[np.float64]] = {}
    name, shape, rows = "", {"rows": 0, "columns": 0}, list[str]()

    def end() -> None:
        if rows and shape["rows"]:
            try:
                matrix = np.array(" ".join(rows).split(), np.float64).reshape(shape["rows"], shape["columns"])
            except ValueError:
                size = f"{shape['rows']} by {shape['columns']}"
                raise PvidError(f"{path}: matrix {shown(name)} is not {size} numbers, as its head states.") from None
            if name in arrays:
                raise PvidError(f"{path} has several matrices {shown(name)}, of structs: save one of these alone.")
            arrays[name] = matrix

    for block in blocks(path):
        for line in block.decode(errors="replace").split("\n"):
            if not line.startswith("#"):
                if line.strip():
                    rows.append(line.replace("NA", "NaN"))
                continue
            key, _, value = line.lstrip("# ").partition(":")
            if key == "name":
                end()
                name, shape, rows = value.strip(), {"rows": 0, "columns": 0}, []
            elif key in shape and value.strip().isdecimal():
                shape[key] = int(value)
    end()
    return table_of_arrays(path, arrays, columns)
