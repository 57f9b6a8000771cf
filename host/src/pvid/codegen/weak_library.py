"""The weak form of a mechanism in C, on this computer: generated, compiled, loaded."""

from __future__ import annotations

from pvid.codegen import files_refine, files_weak
from pvid.codegen.refine import RefineFunctions
from pvid.codegen.weak import weak_functions_of
from pvid.codegen.weak_twin import weak_model_of
from pvid.core.model_library import model_library
from pvid.core.sizes import roomy
from pvid.core.weak_native import WeakNative
from pvid.model.compiled import CompiledModel
from pvid.settings.weak import WeakDesign32
from pvid.setup.weak_sizes import sizes_of_design, sizes_of_model


def weak_native(
    compiled: CompiledModel, design: WeakDesign32 | None = None, refine: RefineFunctions | None = None
) -> WeakNative:
    """The library of a model, with arrays that hold a design; `refine`: with the second stage.

    Raises
    ------
    PvidError
        When there is no compiler, or the engine does not have what the model needs.
    """
    made, model = weak_functions_of(compiled), weak_model_of(compiled)
    needed = sizes_of_model(model) if design is None else sizes_of_design(design)
    texts = {
        f"{made.name}_weak.h": files_weak.header(made, model, sizes_of_model(model), "identification"),
        f"{made.name}_weak_f32.c": files_weak.source(made, model, "identification"),
    }
    if refine is not None:
        texts["pvid/refine_shape.h"] = files_refine.shape(refine, "identification")
        texts["refine_model_f32.h"] = files_refine.header(refine, "identification")
    return WeakNative(made.name, model_library(made.name, texts, roomy(needed)))
