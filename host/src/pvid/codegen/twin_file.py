"""NAME_twin.py: the numpy twins of a model's generated C, and how to load them without a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.codegen import numpy_f32, numpy_q31
from pvid.codegen.c_text import banner
from pvid.codegen.fixed_model import FixedModel
from pvid.codegen.functions import ModelFunctions
from pvid.twin.f32.pattern import PatternModel
from pvid.twin.q31.integer import Int
from pvid.twin.q31.model import ModelQ31, ScaledModelQ31
from pvid.twin.q31.scaled import Scaled

Float32 = npt.NDArray[np.float32]

_SUMMARIES = {
    "integrands": "What is integrated [integrands, ...] from the inputs [inputs, ...].",
    "channels": "Channels [channels, ...] from the inputs [inputs, ...].",
    "theta": "theta [n_theta, ...] from p [n_p, ...].",
    "jacobian": "Non-zeros of d theta / d p [n_c, ...] from p [n_p, ...].",
}


def text(functions: ModelFunctions, command: str, fixed: FixedModel | None = None) -> str:
    """The module, with the fixed-point functions where they are given."""
    model = functions.model
    imports = ["from pvid.twin.f32 import elementary"]
    if fixed:
        imports += [
            "from pvid.twin.q31 import elementary as elementary_q31",
            "from pvid.twin.q31.integer import Int",
            "from pvid.twin.q31.scaled import Scaled",
        ]
    parts = [
        f'"""Twin of {functions.name}_f32.c: {model.title}.\n\n' + "\n".join(banner(functions, command)) + '\n"""',
        "from __future__ import annotations",
        "import numpy as np\nimport numpy.typing as npt\n\n" + "\n".join(imports),
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
    if fixed:
        parts.append(
            "\n".join(
                [
                    f"IN_BITS = {fixed.input_bits!r}",
                    *(f"{one.function.name.upper()}_BITS = {one.made.result_bits!r}" for one in fixed.of_inputs),
                ]
            )
        )
        definitions += [
            numpy_q31.fixed_function(
                f"{one.function.name}_q31", one.made, fixed.limits, f"{_SUMMARIES[one.function.name]} In integers."
            )
            for one in fixed.of_inputs
        ]
        definitions += [
            numpy_q31.scaled_function(f"{one.name}_q31", one.program, f"{_SUMMARIES[one.name]} Of any size.")
            for one in fixed.of_parameters
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


def pattern_of(functions: ModelFunctions, space: dict[str, Any]) -> PatternModel:
    """The estimator's model, with theta_f32 and jacobian_f32 of a module that is run."""
    return PatternModel(
        n_theta=len(functions.theta.labels),
        n_p=len(functions.model.unknowns),
        positive=tuple(one.positive for one in functions.model.unknowns),
        c_row=functions.c_row,
        c_column=functions.c_column,
        theta=space["theta_f32"],
        jacobian=space["jacobian_f32"],
        kind_end=functions.kind_end if len(functions.kinds) > 1 else (),
    )


def loaded(functions: ModelFunctions) -> TwinF32:
    """The text of the module, run."""
    space = namespace(text(functions, "loaded"), functions.name)
    pattern = pattern_of(functions, space)
    return TwinF32(
        channels=space["channels_f32"],
        theta=space["theta_f32"],
        jacobian=space["jacobian_f32"],
        pattern=pattern,
        integrands=space.get("integrands_f32"),
    )


@dataclass(frozen=True)
class TwinQ31:
    """The fixed-point functions.

    channels and integrands of int64 [inputs, ...] return results and whether the inputs are within their limits; theta
    and jacobian take and return Scaled [n_p, ...].
    """

    channels: Callable[[Int], tuple[Int, npt.NDArray[np.bool_]]]
    theta: Callable[[Scaled], Scaled]
    jacobian: Callable[[Scaled], Scaled]
    model: ModelQ31
    integrands: Callable[[Int], tuple[Int, npt.NDArray[np.bool_]]] | None = None


def _no_integers(_: Int) -> Int:
    raise AssertionError("the model has numbers of any size")


def _no_formats(_: Sequence[int]) -> tuple[list[int], list[int]]:
    raise AssertionError("the model has numbers of any size")


def loaded_q31(fixed: FixedModel) -> TwinQ31:
    """The fixed-point part of the module, run."""
    space = namespace(text(fixed.functions, "loaded", fixed), fixed.functions.name)
    functions = fixed.functions
    model = ModelQ31(
        n_theta=len(functions.theta.labels),
        n_p=len(functions.model.unknowns),
        positive=tuple(one.positive for one in functions.model.unknowns),
        c_row=functions.c_row,
        c_column=functions.c_column,
        theta=_no_integers,
        jacobian=_no_integers,
        formats=_no_formats,
        kind_end=functions.kind_end if len(functions.kinds) > 1 else (),
        scaled=ScaledModelQ31(space["theta_q31"], space["jacobian_q31"]),
    )
    return TwinQ31(
        channels=space["channels_q31"],
        theta=space["theta_q31"],
        jacobian=space["jacobian_q31"],
        model=model,
        integrands=space.get("integrands_q31"),
    )


def namespace(module: str, name: str) -> dict[str, Any]:
    """What a module's text defines; `name` is that of the model, for messages."""
    space: dict[str, Any] = {}
    exec(compile(module, f"<twin of {name}>", "exec"), space)
    return space
