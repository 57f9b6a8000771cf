"""NAME_twin.py: the numpy twins of a model's generated C, and how to load them without a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.codegen import numpy_f32
from pvid.codegen.banner import banner
from pvid.codegen.functions import ModelFunctions
from pvid.twin.f32.pattern import PatternModel

Float32 = npt.NDArray[np.float32]

_SUMMARIES = {
    "integrands": "What is integrated [integrands, ...] from the inputs [inputs, ...].",
    "channels": "Channels [channels, ...] from the inputs [inputs, ...].",
    "theta": "theta [n_theta, ...] from p [n_p, ...].",
    "jacobian": "Non-zeros of d theta / d p [n_c, ...] from p [n_p, ...].",
}


def text(functions: ModelFunctions, command: str) -> str:
    """The module."""
    model = functions.model
    parts = [
        f'"""Twin of {functions.name}_f32.c: {model.title}.\n\n' + "\n".join(banner(functions, command)) + '\n"""',
        "from __future__ import annotations",
        "import numpy as np\nimport numpy.typing as npt\n\nfrom pvid.twin.f32 import elementary",
        "Float32 = npt.NDArray[np.float32]\n_F = np.float32",
        "\n".join(
            [
                f"P = {tuple(model.p_names)!r}",
                f"POSITIVE = {tuple(one.positive for one in model.unknowns)!r}",
                f"INPUTS = {tuple(one.name for one in functions.inputs)!r}",
                f"C_ROW = {functions.c_row!r}",
                f"C_COLUMN = {functions.c_column!r}",
            ]
        ),
    ]
    definitions = [
        numpy_f32.function(f"{one.name}_f32", one.program, _SUMMARIES[one.name]) for one in functions.functions
    ]
    return "\n\n".join(parts) + "\n\n\n" + "\n\n\n".join(definitions) + "\n"


@dataclass(frozen=True)
class TwinF32:
    """The float32 functions; each takes [inputs or n_p, ...] and returns [results, ...]."""

    channels: Callable[[Float32], Float32]
    theta: Callable[[Float32], Float32]
    jacobian: Callable[[Float32], Float32]
    pattern: PatternModel
    integrands: Callable[[Float32], Float32] | None = None


def loaded(functions: ModelFunctions) -> TwinF32:
    """The text of the module, run."""
    space: dict[str, Any] = {}
    exec(compile(text(functions, "loaded"), f"<twin of {functions.name}>", "exec"), space)
    pattern = PatternModel(
        n_theta=len(functions.theta.labels),
        n_p=len(functions.model.unknowns),
        positive=tuple(one.positive for one in functions.model.unknowns),
        c_row=functions.c_row,
        c_column=functions.c_column,
        theta=space["theta_f32"],
        jacobian=space["jacobian_f32"],
    )
    return TwinF32(
        channels=space["channels_f32"],
        theta=space["theta_f32"],
        jacobian=space["jacobian_f32"],
        pattern=pattern,
        integrands=space.get("integrands_f32"),
    )
