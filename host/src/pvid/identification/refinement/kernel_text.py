"""The C text of a model's kernel, and what there is to know of its functions.

Deriving and printing them takes tenths of a second; what was printed stays in the cache of builds, under all that it
was made from. It is data and a C text, which the compiler makes a library of as of one that was printed just now.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from dataclasses import fields, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import sympy as sp

import pvid.codegen
from pvid.codegen.files_refine import DOUBLE, function
from pvid.codegen.refine import (
    RefinedParameter,
    RefineFunction,
    RefineFunctions,
    is_driven_by_derivatives,
    refine_functions_of,
)
from pvid.core.sources import cache_folder, keep_text, kept_text
from pvid.model.compiled import CompiledModel
from pvid.model.operations import Program
from pvid.model.signals import Jet

_NO_PROGRAM = Program((), (), ())


def printed(model: CompiledModel) -> tuple[RefineFunctions, str]:
    """The functions of a model's kernel, without their programs, and the kernel's C text.

    Raises PvidError where the equations do not determine a motion.
    """
    place = cache_folder() / "kernels" / f"{_key(model)}.json"
    with suppress(ValueError, KeyError, TypeError):  # no such text, or none of ours
        kept = json.loads(kept_text(place))
        return _of_data(model, kept["made"]), str(kept["code"])
    made = refine_functions_of(model, None, is_driven_by_derivatives(model))
    code = _code(made, any(one.edge == "before" for one in model.signals))
    keep_text(place, json.dumps({"made": _data(made), "code": code}))
    made = replace(made, functions={name: replace(one, program=_NO_PROGRAM) for name, one in made.functions.items()})
    return made, code


def _key(model: CompiledModel) -> str:
    """Of all that the text is made from: the model but for its rows, and the sources of the printer."""
    plain = replace(model, rows=())
    own = model.refinement
    expressions = [*model.equations, *model.opaque.values(), *own.equations, *own.outputs.values(), *own.region]
    expressions += [*own.shapes.values(), *own.shapes]
    symbols = sorted(set[sp.Symbol]().union(*(one.free_symbols for one in expressions)), key=str)
    kinds = [(str(one), type(one).__name__, one.is_positive, one.is_real) for one in symbols]
    return hashlib.sha256(f"{_sources()}\n{sp.__version__}\n{kinds}\n{plain!r}".encode()).hexdigest()[:24]


@cache
def _sources() -> str:
    """A digest of the sources that print."""
    found = hashlib.sha256(_kernel().encode())
    for folder in (Path(pvid.codegen.__file__).parent, Path(__file__).parents[2] / "model"):
        for one in sorted(folder.glob("*.py")):
            found.update(one.name.encode() + b"\0" + one.read_bytes())
    found.update(Path(__file__).read_bytes())
    return found.hexdigest()


def _data(made: RefineFunctions) -> dict[str, Any]:
    """As JSON has it."""
    out = {one.name: getattr(made, one.name) for one in fields(made) if one.name != "model"}
    out["inputs"] = [(jet.of, jet.order) for jet in made.inputs]
    out["parameters"] = [[getattr(one, own.name) for own in fields(one)] for one in made.parameters]
    out["functions"] = {name: (one.given, one.written) for name, one in made.functions.items()}
    return out


def _of_data(model: CompiledModel, data: dict[str, Any]) -> RefineFunctions:
    """From what JSON has kept of it."""
    plain: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in data.items()}
    plain["inputs"] = tuple(Jet(of, order) for of, order in data["inputs"])
    plain["parameters"] = tuple(RefinedParameter(*one) for one in data["parameters"])
    plain["functions"] = {
        name: RefineFunction(name, tuple(map(tuple, given)), tuple(map(tuple, written)), _NO_PROGRAM)
        for name, (given, written) in data["functions"].items()
    }
    return RefineFunctions(model=model, **plain)


def _kernel() -> str:
    """The text around the functions."""
    return (files("pvid.identification.refinement") / "refinement.c").read_text(encoding="utf-8")


def _code(made: RefineFunctions, read_before: bool) -> str:
    counts = {
        "N": len(made.coordinates),
        "ORDER": made.order,
        "NU": len(made.inputs),
        "NZ": len(made.outputs),
        "NM": made.moving - made.skew,
        "NT": len(made.parameters) - made.moving,
        "SKEW": int(made.skew),
        "NS": dict(made.functions["signs"].written)["g"] if "signs" in made.functions else 0,
        "WIDTHS": len(made.parameters),
        "READ_BEFORE": int(read_before),
        "NUMBER_OF_CONSTANTS": len(made.constants),
    }
    jacobian = [key for key, _ in made.functions["jacobian"].written]
    arrays = ", ".join(f"double *{key}" for key in jacobian)
    export = [
        f"void refine_derivatives(const double *r, const double *q, const double *v, const double *u, {arrays}) "
        f"{{ double m[NUMBER_OF_CONSTANTS + 1]; pvid_refine_constants(r, m); "
        f"pvid_refine_jacobian(m, q, v, u, {', '.join(jacobian)}); }}"
    ]
    export += ["int refine_region(const double *r) { return pvid_refine_region(r); }"]
    if "chart" in made.functions:
        export.append("void refine_chart(const double *r, double *row) { pvid_refine_chart(r, row); }")
    return "\n".join(
        [
            "#include <math.h>\n#include <stdbool.h>",
            *(f"#define {name} {value}" for name, value in counts.items()),
            *(function(one, DOUBLE) for one in made.functions.values()),
            _kernel(),
            *export,
        ]
    )
